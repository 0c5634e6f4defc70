//! The timeline as a report holds it: rows and columns of at most 600 entries.

use std::collections::BTreeMap;

use recorder::{SweepTimeline, TimelineSnapshot};
use serde::{Deserialize, Serialize};

use crate::report::timeline::{PROCESSES, Timeline, Used};

/// How a run went over time. All times count from its start [s]; the first bucket of sweeps may begin before it.
///
/// Buckets without a sample are left out.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct TimelineReport {
    /// The sweeps; its fields stand among these.
    #[serde(flatten)]
    pub sweeps: SweepTimeline,
    /// Length of a bucket of samples [s]: 1, doubled as often as the run needs.
    pub sample_s: f64,
    /// Begin of each bucket of samples.
    pub sample_t_s: Vec<f64>,
    /// By process: one entry for each of `sample_t_s`.
    pub processes: BTreeMap<String, ProcessTimeline>,
    /// The machine: one entry for each of `sample_t_s`.
    pub machine: MachineTimeline,
    /// Restarts and moves on the ladder of overload, the first 200.
    pub events: Vec<Event>,
    /// All events.
    pub event_count: u64,
}

/// One process.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct ProcessTimeline {
    /// CPU time over time; 100 = one core.
    pub cpu_pct: Vec<f64>,
    /// Most memory resident at a look.
    pub rss_kib: Vec<u64>,
}

/// The machine; 100 = one core. Null where it was not looked at.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct MachineTimeline {
    /// Used by this chain.
    pub own_cpu_pct: Vec<Option<f64>>,
    /// Used by other programs and by interrupts.
    pub foreign_cpu_pct: Vec<Option<f64>>,
    /// Taken by the hypervisor.
    pub steal_pct: Vec<Option<f64>>,
    /// Latest wake of a thread that waits for the time [ms].
    pub wake_late_max_ms: Vec<f64>,
}

/// Something that happened.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Event {
    /// When [s].
    pub t_s: f64,
    /// `restart` or `step`.
    pub kind: String,
    /// The stage and how it ended, or the steps before and after.
    pub what: String,
}

fn rounded(value: f64, digits: i32) -> f64 {
    let scale = 10_f64.powi(digits);
    (value * scale).round() / scale
}

impl TimelineReport {
    /// All that is known of a run; `processes` are the names in the order of the looks.
    pub(crate) fn of(timeline: &Timeline, sweeps: &TimelineSnapshot, stages: &[&str], processes: &[&str]) -> Self {
        let mut report = Self { sweeps: SweepTimeline::of(sweeps, stages, timeline.started_ns), ..Self::default() };
        let from_start_s = |at_ns: u64| rounded((at_ns as f64 - timeline.started_ns as f64) / 1e9, 3);
        report.sample_s = timeline.used.width_ns() as f64 / 1e9;
        for (begin_ns, used) in timeline.used.iter().filter(|(_, used)| used.passed_s > 0.0) {
            report.sample_t_s.push(from_start_s(begin_ns));
            report.add_sample(used, processes);
        }
        let event = |event: &crate::report::timeline::Happened| Event {
            t_s: from_start_s(event.at_ns),
            kind: event.kind.to_owned(),
            what: event.what.clone(),
        };
        report.events = timeline.happened.iter().map(event).collect();
        report.event_count = timeline.events;
        report
    }

    fn add_sample(&mut self, used: &Used, processes: &[&str]) {
        for (place, &process) in processes.iter().enumerate().take(PROCESSES) {
            let row = self.processes.entry(process.to_owned()).or_default();
            row.cpu_pct.push(rounded(100.0 * used.cpu_s[place] / used.passed_s, 1));
            row.rss_kib.push(used.rss_kib[place]);
        }
        let share = |sum: f64| (used.machine_s > 0.0).then(|| rounded(sum / used.machine_s, 1));
        self.machine.own_cpu_pct.push(share(used.machine.own));
        self.machine.foreign_cpu_pct.push(share(used.machine.foreign));
        self.machine.steal_pct.push(share(used.machine.steal));
        self.machine.wake_late_max_ms.push(rounded(used.late_ns as f64 / 1e6, 3));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_shares_of_the_time_between_looks() {
        let mut timeline = Timeline::new(5_000_000_000);
        let mut used = Used { passed_s: 2.0, machine_s: 2.0, late_ns: 1_500_000, ..Used::default() };
        (used.cpu_s[1], used.rss_kib[1], used.machine.foreign) = (0.5, 100, 60.0);
        *timeline.used.at(7_000_000_000) = used;
        let report = TimelineReport::of(&timeline, &TimelineSnapshot::default(), &[], &["source", "supervisor"]);
        assert_eq!(report.sample_t_s, [2.0]);
        assert_eq!((report.processes["supervisor"].cpu_pct[0], report.processes["supervisor"].rss_kib[0]), (25.0, 100));
        assert_eq!((report.machine.foreign_cpu_pct[0], report.machine.wake_late_max_ms[0]), (Some(30.0), 1.5));
    }
}
