//! A live line on a terminal, a line every few seconds elsewhere.

use std::io::{IsTerminal, Write};

use runtime::Plan;
use runtime::logging::Stderr;

use crate::processes::child::Watched;

const TERMINAL_PERIOD_NS: u64 = 200_000_000;
const LOG_PERIOD_NS: u64 = 5_000_000_000;

/// Where the run is, on stderr.
pub(crate) struct Progress {
    on_terminal: bool,
    next_ns: u64,
    started_ns: u64,
    goal: Option<u64>,
    sectors: u64,
    shown: bool,
}

impl Progress {
    pub(crate) fn new(now_ns: u64, plan: &Plan) -> Self {
        let on_terminal = std::io::stderr().is_terminal();
        let first = if on_terminal { TERMINAL_PERIOD_NS } else { LOG_PERIOD_NS };
        Self {
            on_terminal,
            next_ns: now_ns + first,
            started_ns: now_ns,
            goal: plan.sweeps,
            sectors: u64::from(plan.chain.sectors.max(1)),
            shown: false,
        }
    }

    /// Shows the line when it is time for it.
    pub(crate) fn show(&mut self, now_ns: u64, stages: &[Watched]) {
        if now_ns < self.next_ns {
            return;
        }
        self.next_ns = now_ns + if self.on_terminal { TERMINAL_PERIOD_NS } else { LOG_PERIOD_NS };
        let (Some(source), Some(sink)) = (stages.first(), stages.last()) else { return };
        let goal = self.goal.map_or(String::new(), |goal| format!(" of {goal}"));
        let missing: u64 = stages.iter().map(|stage| stage.page.dropped.get() + stage.page.lost.get()).sum();
        let restarts: u64 = stages.iter().map(|stage| stage.restarts.total).sum();
        let line = format!(
            "{:7.1} s  sweep {}{goal}  answered {}  parts missing {missing}  restarts {restarts}",
            (now_ns - self.started_ns) as f64 / 1e9,
            source.page.next_ordinal_out.get() / self.sectors,
            sink.page.processed.get().min(sink.page.next_ordinal_out.get()) / self.sectors,
        );
        let text = if self.on_terminal { format!("\r{line}\x1b[K") } else { format!("{line}\n") };
        // A closed stderr is no reason to stop a chain.
        let _ = Stderr.write(text.as_bytes());
        self.shown = true;
    }

    /// Clears the live line.
    pub(crate) fn end(&self) {
        if self.on_terminal && self.shown {
            let _ = Stderr.write(b"\r\x1b[K");
        }
    }
}
