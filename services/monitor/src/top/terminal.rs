use std::fs::File;
use std::io::{self, IsTerminal};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use ratatui::crossterm::event::{self, Event};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::draw::draw;
use super::ui::{Asked, Ui};
use super::watch::Watch;
use crate::MonitorError;

/// Shows the chain until somebody asks to leave, or the terminal closes. It is as before afterwards, after a panic, too.
pub(super) fn show(watch: &mut Watch, runs: &impl Fn() -> bool) -> Result<(), MonitorError> {
    let mut terminal = ratatui::try_init().map_err(MonitorError::Terminal)?;
    let shown = turn_and_draw(&mut terminal, watch, runs);
    if ratatui::try_restore().is_err() {
        // It is gone, and what would be said of that on stderr could not be said either: that is a panic.
        std::mem::forget(terminal);
    }
    // Who was asked to leave because the terminal closed could not draw any more.
    if watch.asked() { Ok(()) } else { shown }
}

fn turn_and_draw(
    terminal: &mut ratatui::DefaultTerminal,
    watch: &mut Watch,
    runs: &impl Fn() -> bool,
) -> Result<(), MonitorError> {
    let keyboard = Keyboard::new()?;
    let mut ui = Ui::default();
    let mut view = watch.view();
    let (mut stale, mut more) = (true, false);
    while !watch.asked() {
        // Paused, the chain is watched on: nothing is missed, it is only not shown.
        if watch.turn(runs)? && !ui.paused {
            view = watch.view();
            stale = true;
        }
        if stale {
            terminal.draw(|frame| draw(frame, &view, &ui)).map_err(MonitorError::Terminal)?;
            stale = false;
        }
        // Of keys that came at once each has a turn of its own.
        let patience_ns = if more { 0 } else { watch.patience_ns() };
        if !keyboard.wait(patience_ns) {
            return Ok(());
        }
        let event = next_event()?;
        more = event.is_some();
        match event {
            Some(Event::Key(key)) => match ui.key(key) {
                Asked::Leave => return Ok(()),
                Asked::Redraw => {
                    if !ui.paused {
                        view = watch.view();
                    }
                    stale = true;
                }
                Asked::Nothing => {}
            },
            Some(Event::Resize(..)) => stale = true,
            _ => {}
        }
    }
    Ok(())
}

/// Where keys come from.
struct Keyboard(Option<File>);

impl Keyboard {
    /// Standard input, or where that is something else, the terminal of this process.
    fn new() -> Result<Self, MonitorError> {
        let own = (!io::stdin().is_terminal()).then(|| File::open("/dev/tty"));
        own.transpose().map(Self).map_err(MonitorError::Terminal)
    }

    /// Waits for a key, a signal or the end of this time; false once the terminal has closed. To be asked before each read:
    /// crossterm reads from a closed terminal for ever.
    fn wait(&self, patience_ns: u64) -> bool {
        let stdin = io::stdin();
        let keyboard: BorrowedFd<'_> = self.0.as_ref().map_or(stdin.as_fd(), AsFd::as_fd);
        let mut ready = [PollFd::new(&keyboard, PollFlags::IN)];
        let patience = Timespec { tv_sec: 0, tv_nsec: patience_ns.min(999_999_999) as _ };
        // An error is a signal: a new size, or that this process is to leave.
        let _ = poll(&mut ready, Some(&patience));
        !ready[0].revents().intersects(PollFlags::HUP | PollFlags::ERR)
    }
}

/// A key or a new size, where there is one.
fn next_event() -> Result<Option<Event>, MonitorError> {
    let read = || if event::poll(Duration::ZERO)? { event::read().map(Some) } else { Ok(None) };
    match read() {
        Err(cause) if cause.kind() == io::ErrorKind::Interrupted => Ok(None),
        read => read.map_err(MonitorError::Terminal),
    }
}
