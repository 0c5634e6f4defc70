use std::io;
use std::time::Duration;

use ratatui::crossterm::event::{self, Event};

use super::draw::draw;
use super::ui::{Asked, Ui};
use super::watch::Watch;
use crate::MonitorError;

/// Shows the chain until somebody asks to leave. The terminal is as before afterwards, after a panic, too.
pub(super) fn show(watch: &mut Watch, runs: &impl Fn() -> bool) -> Result<(), MonitorError> {
    let mut terminal = ratatui::try_init().map_err(MonitorError::Terminal)?;
    let shown = turn_and_draw(&mut terminal, watch, runs);
    ratatui::restore();
    shown
}

fn turn_and_draw(
    terminal: &mut ratatui::DefaultTerminal,
    watch: &mut Watch,
    runs: &impl Fn() -> bool,
) -> Result<(), MonitorError> {
    let mut ui = Ui::default();
    let mut view = watch.view();
    let mut stale = true;
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
        match next_event(Duration::from_nanos(watch.patience_ns()))? {
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

/// A key or a new size within this time; none also where a signal came.
fn next_event(patience: Duration) -> Result<Option<Event>, MonitorError> {
    let read = || if event::poll(patience)? { event::read().map(Some) } else { Ok(None) };
    match read() {
        Err(cause) if cause.kind() == io::ErrorKind::Interrupted => Ok(None),
        read => read.map_err(MonitorError::Terminal),
    }
}
