use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use supervisor::LedgerReport;

use crate::Injection;
use crate::campaign::{Cycle, Step};
use crate::look::{Growth, ProcessRecord, Steady};
use crate::matrix::{Matrix, Row};
use crate::statistics::{Drift, Tally, WindowReport};

/// What a soak has shown, as `verdict.json` holds it.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Verdict {
    /// Version of the program.
    pub encke: String,
    /// Whether no bar was failed.
    pub passed: bool,
    /// Whether all bars could be judged.
    pub judged: bool,
    /// `no faults`, `faults`, `kills`, `kill-all`, `cycles`, `mode-changes`, `day`.
    pub kind: String,
    /// Where sweeps came from.
    pub source: String,
    /// The machine: cores and kernel.
    pub machine: String,
    /// Time of day at the begin [s since 1970].
    pub began_utc_s: u64,
    /// Time looked at [s].
    pub duration_s: f64,
    /// Of all that is random.
    pub seed: u64,
    /// Why it ended before its time, where it did.
    pub ended_early: Option<String>,
    /// What had to be reached.
    pub bars: Vec<Bar>,
    /// Every sweep due.
    pub availability: Option<Available>,
    /// Change of latency.
    pub drift: Option<Drift>,
    /// The processes: memory, file descriptors, threads.
    pub processes: Vec<ProcessRecord>,
    /// The chain's objects in shared memory.
    pub shared_memory: SharedMemoryRecord,
    /// Processes started in place of others.
    pub restarts: u64,
    /// Supervisors that followed one that died.
    pub adoptions: u32,
    /// Events by name.
    pub events: BTreeMap<String, u64>,
    /// Numbers of the log that were never seen.
    pub events_skipped: u64,
    /// The grave ones: when [s], name, stage, text.
    pub grave: Vec<Grave>,
    /// Deadline misses by cause, as the runs' reports have them.
    pub misses: BTreeMap<String, u64>,
    /// The ledgers, one of each supervisor that ended in order.
    pub ledgers: Vec<LedgerReport>,
    /// Used by others on average [% of a core]: programs, interrupts, the hypervisor.
    pub foreign_pct: Option<f64>,
    /// The survival matrix.
    pub matrix: Matrix,
    /// Every fault.
    pub faults: Vec<Row>,
    /// What was to be injected.
    pub planned: Vec<Injection>,
    /// Every start and stop, where that is what it is about: times and failures.
    pub cycles: Vec<Cycle>,
    /// Every step of a day or change of mode.
    pub steps: Vec<Step>,
    /// The observer itself.
    pub observer: ObserverCost,
    /// How it went over time.
    pub timeline: Timeline,
}

/// Every sweep due, and what became of it.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Available {
    /// All.
    pub overall: Tally,
    /// Share answered whole and in time [%].
    pub overall_pct: Option<f64>,
    /// Those outside a fixed time after each injection.
    pub after_injections: Tally,
    /// Share of these [%].
    pub after_injections_pct: Option<f64>,
    /// Those outside faults, their length and that time after it.
    pub outside_faults: Tally,
    /// Share of these [%].
    pub outside_faults_pct: Option<f64>,
    /// Longest row of sweeps that were late, broken or not answered.
    pub longest_run: u64,
    /// Whole answers that were older than allowed.
    pub stale: u64,
}

/// The chain's objects in shared memory; null where the run was too short.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct SharedMemoryRecord {
    /// How many.
    pub objects: Option<Steady>,
    /// Their length: memory that they may take [KiB].
    pub length_kib: Option<Steady>,
    /// Memory that they take, from five minutes on.
    pub touched_kib: Option<Growth>,
}

/// Something that had to be reached.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Bar {
    /// What.
    pub name: String,
    /// What it came to; null where it could not be judged.
    pub value: Option<f64>,
    /// `at most` or `at least`.
    pub rule: String,
    /// The bound.
    pub bound: f64,
    /// Of both.
    pub unit: String,
    /// Whether it was reached; null where it could not be judged.
    pub passed: Option<bool>,
    /// More, or why it could not.
    pub note: String,
}

impl Bar {
    fn new(name: &str, value: Option<f64>, rule: &str, bound: f64, unit: &str, passed: Option<bool>) -> Self {
        // A value that is no number reaches nothing.
        let value = value.map(|value| (value * 1e4).round() / 1e4);
        let (name, rule, unit) = (name.to_owned(), rule.to_owned(), unit.to_owned());
        Self { name, value, rule, bound, unit, passed, note: String::new() }
    }

    /// Not more than.
    pub(crate) fn at_most(name: &str, value: Option<f64>, bound: f64, unit: &str) -> Self {
        Self::new(name, value, "at most", bound, unit, value.map(|value| value <= bound))
    }

    /// Not less than.
    pub(crate) fn at_least(name: &str, value: Option<f64>, bound: f64, unit: &str) -> Self {
        Self::new(name, value, "at least", bound, unit, value.map(|value| value >= bound))
    }

    /// Something of which there must be none.
    pub(crate) fn none(name: &str, count: usize) -> Self {
        Self::at_most(name, Some(count as f64), 0.0, "")
    }

    /// The same with more to say.
    pub(crate) fn noting(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// The same, not judged where there is a reason.
    pub(crate) fn unless(mut self, reason: Option<&str>) -> Self {
        if let Some(reason) = reason {
            self.passed = None;
            self.note = format!("not judged: {reason}");
        }
        self
    }
}

/// Something grave that was said.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Grave {
    /// When [s].
    pub t_s: f64,
    /// The event.
    pub name: String,
    /// About whom.
    pub stage: String,
    /// What.
    pub text: String,
}

/// What the looking itself took.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct ObserverCost {
    /// [% of a core].
    pub cpu_pct: f64,
    /// Looks at the pages.
    pub looks: u64,
    /// Between two of them, on average [ms].
    pub every_ms: f64,
}

/// How it went over time.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Timeline {
    /// Latencies.
    pub windows: Vec<WindowReport>,
    /// Length of a window [s].
    pub window_s: f64,
    /// Begins of the samples [s].
    pub sample_t_s: Vec<f64>,
    /// By process, one entry for each sample: mean of memory [KiB]; null where it was not there.
    pub rss_kib: BTreeMap<String, Vec<Option<f64>>>,
    /// By process: most file descriptors.
    pub files: BTreeMap<String, Vec<u64>>,
    /// By process: most threads.
    pub threads: BTreeMap<String, Vec<u64>>,
    /// Shared memory [KiB].
    pub shared_kib: Vec<u64>,
}

impl Verdict {
    /// Sets `passed` and `judged` by the bars.
    pub(crate) fn judge(mut self) -> Self {
        self.passed = self.bars.iter().all(|bar| bar.passed != Some(false));
        self.judged = self.bars.iter().all(|bar| bar.passed.is_some());
        self
    }

    /// Why the command is to fail, if it is; `strict` calls a bar that could not be judged a failure.
    pub fn failure(&self, strict: bool) -> Option<String> {
        let failed = |bar: &&Bar| bar.passed == Some(false) || (strict && bar.passed.is_none());
        let names: Vec<_> = self.bars.iter().filter(failed).map(|bar| bar.name.as_str()).collect();
        (!names.is_empty()).then(|| format!("bars not reached: {}", names.join(", ")))
    }

    /// A few lines for people.
    pub fn summary(&self) -> String {
        let word = |bar: &Bar| match bar.passed {
            Some(true) => "ok",
            Some(false) => "FAILED",
            None => "-",
        };
        let mut text = format!("soak, {}: {:.0} s\n", self.kind, self.duration_s);
        for bar in &self.bars {
            let value = bar.value.map_or("–".to_owned(), |value| format!("{value}"));
            let note = if bar.note.is_empty() { String::new() } else { format!("   {}", bar.note) };
            text += &format!(
                "{:<7} {:<46} {value:>10} {} {} {}{note}\n",
                word(bar),
                bar.name,
                bar.rule,
                bar.bound,
                bar.unit
            );
        }
        let verdict = match (self.passed, self.judged) {
            (true, true) => "passed",
            (true, false) => "passed, as far as it could be judged",
            (false, _) => "FAILED",
        };
        text + verdict + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_that_cannot_be_judged_fails_only_where_that_is_asked_for() {
        let bars = vec![
            Bar::at_most("misses", Some(3.0), 0.0, "").unless(Some("others had the cores")),
            Bar::at_least("availability", Some(99.5), 99.0, "%"),
            Bar::at_most("memory growth", None, 1.0, "%"),
        ];
        let sut = Verdict { bars, ..Verdict::default() }.judge();
        assert!(sut.passed && !sut.judged && sut.failure(false).is_none());
        assert_eq!(sut.failure(true).unwrap(), "bars not reached: misses, memory growth");
        let failed = Verdict { bars: vec![Bar::none("leftovers", 2)], ..Verdict::default() }.judge();
        assert!(!failed.passed && failed.summary().contains("FAILED  leftovers"));
    }
}
