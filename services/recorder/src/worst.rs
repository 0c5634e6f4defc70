use messages::Trace;
use serde::{Deserialize, Serialize};

use crate::cause::Cause;
use crate::segments::Segments;

/// Sweeps that are kept by name.
const KEPT: usize = 10;

/// A sweep that took long, and the way of its last part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorstSweep {
    /// Its number.
    pub sweep: u64,
    /// From its last return to its last detection sent [ms].
    pub end_to_end_ms: f64,
    /// The largest share of that: a stage and `late` (the source), `wake-up`, `queueing`, `compute`, `cpu taken` or
    /// `restart`.
    pub cause: String,
    /// Degradation at which it was processed.
    pub step: String,
    /// Its last part's hops, the source first.
    pub hops: Vec<WorstHop>,
}

/// One hop. The four times of a stage that reads add up to the time since the hop before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorstHop {
    /// The stage.
    pub stage: String,
    /// Sent, and the stage busy with parts before [ms]; 0 for the source.
    pub queued_ms: f64,
    /// Sent, and the stage free, until `process` began, less what was taken [ms]; 0 for the source.
    pub wake_ms: f64,
    /// Ready to run, and other processes had the cores [ms].
    pub taken_ms: f64,
    /// In `process`, less what was taken [ms].
    pub busy_ms: f64,
    /// When `process` began, from when the last return was due [ms].
    pub started_after_due_ms: f64,
    /// When `process` had ended, from when the last return was due [ms].
    pub finished_after_due_ms: f64,
}

/// The sweeps that took longest so far, longest first; of equals the earlier.
#[derive(Default)]
pub(crate) struct Worst {
    kept: [Option<(u64, Cause, Trace)>; KEPT],
}

impl Worst {
    /// Adds a sweep by the trace of its last part.
    pub(crate) fn add(&mut self, end_to_end_ns: u64, cause: Cause, trace: &Trace) {
        let longer = |kept: &Option<(u64, Cause, Trace)>| kept.as_ref().is_none_or(|(ns, ..)| end_to_end_ns > *ns);
        let Some(place) = self.kept.iter().position(longer) else { return };
        self.kept[place..].rotate_right(1);
        self.kept[place] = Some((end_to_end_ns, cause, *trace));
    }

    /// `stages` are the names by position.
    pub(crate) fn snapshot(&self, stages: &[impl AsRef<str>]) -> Vec<WorstSweep> {
        let sweep = |(end_to_end_ns, cause, trace): &(u64, Cause, Trace)| WorstSweep {
            sweep: trace.part.sweep,
            end_to_end_ms: *end_to_end_ns as f64 / 1e6,
            cause: cause.name(stages),
            step: trace.part.step().name().to_owned(),
            hops: hops(trace, stages),
        };
        self.kept.iter().flatten().map(sweep).collect()
    }
}

fn hops(trace: &Trace, stages: &[impl AsRef<str>]) -> Vec<WorstHop> {
    let segments = Segments::of(trace);
    let ms = |ns: u64| ns as f64 / 1e6;
    let after_due_ms = |host_ns: u64| (i128::from(host_ns) - i128::from(trace.due_ns)) as f64 / 1e6;
    let hop = |((hop, segments), stage): ((&messages::Hop, &crate::segments::HopSegments), &_)| WorstHop {
        stage: AsRef::<str>::as_ref(stage).to_owned(),
        queued_ms: ms(segments.queued_ns),
        wake_ms: ms(segments.wake_ns()),
        taken_ms: ms(segments.taken_ns()),
        busy_ms: ms(segments.compute_ns()),
        started_after_due_ms: after_due_ms(hop.started_ns),
        finished_after_due_ms: after_due_ms(hop.finished_ns),
    };
    trace.hops().iter().zip(&segments.hops).zip(stages).map(hop).collect()
}

/// The longest of both.
pub(crate) fn merge(worst: &mut Vec<WorstSweep>, later: &[WorstSweep]) {
    worst.extend_from_slice(later);
    worst.sort_by(|a, b| b.end_to_end_ms.total_cmp(&a.end_to_end_ms).then(a.sweep.cmp(&b.sweep)));
    worst.truncate(KEPT);
}

#[cfg(test)]
mod tests {
    use messages::{Hop, Part};

    use super::*;
    use crate::cause::Kind;

    fn add(sut: &mut Worst, sweep: u64, ms: u64) {
        let trace = Trace { part: Part { sweep, ..Part::default() }, ..Trace::default() };
        sut.add(ms * 1_000_000, Cause { stage: 0, kind: Kind::Late }, &trace);
    }

    #[test]
    fn the_ten_longest_are_kept_longest_first() {
        let mut sut = Worst::default();
        for sweep in 0..100_u64 {
            add(&mut sut, sweep, sweep * 37 % 100);
        }
        let worst = sut.snapshot(&["source"]);
        let times: Vec<f64> = worst.iter().map(|worst| worst.end_to_end_ms).collect();
        assert_eq!(times, [99.0, 98.0, 97.0, 96.0, 95.0, 94.0, 93.0, 92.0, 91.0, 90.0]);
        assert!(worst.iter().all(|worst| worst.sweep * 37 % 100 == worst.end_to_end_ms as u64));
    }

    #[test]
    fn two_lives_keep_the_longest_of_both() {
        let of = |times: &[u64]| {
            let mut sut = Worst::default();
            times.iter().for_each(|&ms| add(&mut sut, ms, ms));
            sut.snapshot(&["source"])
        };
        let mut one = of(&[1, 3, 5, 7, 9, 11, 13, 15]);
        merge(&mut one, &of(&[2, 4, 6, 8, 10, 12]));
        assert_eq!(one, of(&[15, 13, 12, 11, 10, 9, 8, 7, 6, 5]));
    }

    #[test]
    fn a_kept_sweep_shows_when_each_hop_had_it() {
        let ms = 1_000_000_u64;
        let mut trace = Trace { due_ns: 100 * ms, part: Part { step: 1, ..Part::default() }, ..Trace::default() };
        trace.push(Hop { started_ns: 40 * ms, finished_ns: 101 * ms, ..Hop::default() });
        let (free_ns, received_ns) = (103 * ms, 104 * ms);
        let taken = (500_000, 2_000_000);
        trace.push(Hop {
            free_ns,
            received_ns,
            started_ns: 105 * ms,
            finished_ns: 115 * ms,
            taken_before_ns: taken.0,
            taken_busy_ns: taken.1,
            ..Hop::default()
        });
        let mut sut = Worst::default();
        sut.add(15 * ms, Cause { stage: 1, kind: Kind::Compute }, &trace);
        let found = sut.snapshot(&["source", "clusterer"]).remove(0);
        assert_eq!((found.cause.as_str(), found.step.as_str()), ("clusterer compute", "fewer-starts"));
        let source = &found.hops[0];
        assert_eq!((source.stage.as_str(), source.busy_ms, source.started_after_due_ms), ("source", 61.0, -60.0));
        let hop = &found.hops[1];
        assert_eq!((hop.queued_ms, hop.wake_ms, hop.taken_ms, hop.busy_ms), (2.0, 1.5, 2.5, 8.0));
        assert_eq!((hop.started_after_due_ms, hop.finished_after_due_ms), (5.0, 15.0));
    }
}
