//! A chain that runs and is looked at: one turn after the other.

use std::ffi::OsString;
use std::io::{IsTerminal, Write};
use std::process::ExitStatus;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use runtime::page::PageView;
use runtime::{Plan, SOURCE, clock, stop_signals};
use transport::Instance;

use crate::SoakError;
use crate::look::{Looked, Observer};
use crate::run::{Run, Setup};

/// Between two looks at the pages [ns]: a sweep ends every few tens of milliseconds at most.
const LOOK_NS: u64 = 4_000_000;
/// Between two looks at `/proc` [ns].
const SAMPLE_NS: u64 = 1_000_000_000;
/// Between two lines of progress [ns], on a terminal and elsewhere.
const PROGRESS_NS: [u64; 2] = [1_000_000_000, 30_000_000_000];
/// How long the first sweep may take [ns].
const FIRST_SWEEP_NS: u64 = 10_000_000_000;

/// Set by Ctrl-C, SIGTERM and a terminal that closes.
pub(crate) fn interrupts() -> Result<Arc<AtomicBool>, SoakError> {
    let asked = Arc::new(AtomicBool::new(false));
    for signal in stop_signals() {
        signal_hook::flag::register(signal, Arc::clone(&asked)).map_err(SoakError::chain)?;
    }
    Ok(asked)
}

/// A chain that runs and is looked at.
pub(crate) struct Session<'a> {
    pub(crate) run: Run<'a>,
    pub(crate) observer: Observer<'a>,
    more: Vec<OsString>,
    interrupted: Arc<AtomicBool>,
    next_sample_ns: u64,
    next_progress_ns: u64,
    /// The supervisor ended and nothing had been done to it: how.
    pub(crate) ended: Option<ExitStatus>,
}

impl<'a> Session<'a> {
    /// Starts the chain and waits for its first sweep; it will be looked at for about `length_s`. `more` are further options of
    /// `encke run`.
    pub(crate) fn begin(
        setup: &'a Setup,
        more: Vec<OsString>,
        length_s: f64,
        interrupted: Arc<AtomicBool>,
    ) -> Result<Self, SoakError> {
        let mut run = Run::start(setup, &more)?;
        run.await_up()?;
        await_first_sweep(&setup.instance)?;
        let now_ns = clock::now_ns();
        Ok(Self {
            run,
            observer: Observer::new(&setup.instance, &setup.out, now_ns, length_s)?,
            more,
            interrupted,
            next_sample_ns: now_ns,
            next_progress_ns: now_ns,
            ended: None,
        })
    }

    /// Whether there is reason to go on.
    pub(crate) fn goes_on(&self) -> bool {
        self.ended.is_none() && !self.interrupted.load(Ordering::Relaxed)
    }

    /// Waits a little and looks. `may_be_dead`: something was done to the supervisor, so that its end calls for a successor.
    pub(crate) fn turn(&mut self, may_be_dead: bool) -> Result<(Looked, u64), SoakError> {
        clock::sleep_ns(LOOK_NS);
        let now_ns = clock::now_ns();
        let looked = self.observer.look(now_ns);
        if now_ns >= self.next_sample_ns {
            self.next_sample_ns += SAMPLE_NS * (1 + now_ns.saturating_sub(self.next_sample_ns) / SAMPLE_NS);
            self.observer.sample(now_ns, self.run.pid());
        }
        if let Some(status) = self.run.ended() {
            if may_be_dead {
                self.run.adopt(&self.more)?;
            } else {
                self.ended = Some(status);
            }
        }
        self.progress(now_ns);
        Ok((looked, now_ns))
    }

    /// Ends the chain in order and looks a last time. Gives how it ended.
    pub(crate) fn stop(&mut self) -> Option<ExitStatus> {
        let now_ns = clock::now_ns();
        self.observer.end(now_ns);
        let ended = self.ended.or_else(|| self.run.stop());
        self.observer.look(clock::now_ns());
        if std::io::stderr().is_terminal() {
            let _ = writeln!(std::io::stderr());
        }
        ended
    }

    fn progress(&mut self, now_ns: u64) {
        if now_ns < self.next_progress_ns {
            return;
        }
        let on_terminal = std::io::stderr().is_terminal();
        self.next_progress_ns = now_ns + PROGRESS_NS[usize::from(!on_terminal)];
        let tally = self.observer.availability.overall;
        let line = format!(
            "{:7.0} s  sweeps due {}  answered in time {}  restarts {}",
            self.observer.t_s(now_ns),
            tally.due,
            tally.in_time,
            self.observer.restarts
        );
        let mut stderr = std::io::stderr();
        let _ = if on_terminal { write!(stderr, "\r{line}  ") } else { writeln!(stderr, "{line}") };
    }
}

fn await_first_sweep(instance: &Instance) -> Result<(), SoakError> {
    let plan = Plan::read(instance).map_err(SoakError::chain)?;
    let sink = plan.stages().last().unwrap_or(SOURCE);
    let page = |stage: &str| PageView::open(&Plan::page_path(instance, stage)).map_err(SoakError::chain);
    let (source, sink) = (page(SOURCE)?, page(sink)?);
    // The second sweep's page knows how far they are apart.
    clock::wait_for(FIRST_SWEEP_NS, || source.counts().period_ns > 0 && sink.counts().answered_ns > 0);
    Ok(())
}
