use runtime::page::Counts;

use crate::statistics::Answer;

/// Turns looks at the pages into answered sweeps.
///
/// The sink's page tells the last sweep that came to its end. Where more than one did between two looks, the others were due whole
/// periods before, and count as answered when the last one was: by then they were.
pub(crate) struct Answers {
    sectors: u64,
    period_ns: u64,
    seen: Option<Seen>,
}

#[derive(Clone, Copy)]
struct Seen {
    answered_ns: u64,
    due_ns: u64,
    accepted: u64,
    trouble: u64,
}

impl Answers {
    /// Of sweeps of so many parts, so far apart.
    pub(crate) fn new(sectors: u32, period_ns: u64) -> Self {
        Self { sectors: u64::from(sectors.max(1)), period_ns: period_ns.max(1), seen: None }
    }

    /// The sweeps that ended since the last look. `trouble` counts the parts of all hops that were lost, dropped or rejected:
    /// where it rose, what ended since is not whole.
    pub(crate) fn look(&mut self, sink: &Counts, trouble: u64) -> Vec<Answer> {
        let seen = Seen {
            answered_ns: sink.answered_ns,
            due_ns: sink.answered_ns.saturating_sub(sink.latency_ns),
            accepted: sink.published,
            trouble,
        };
        if sink.answered_ns == 0 || self.seen.is_some_and(|before| before.answered_ns == sink.answered_ns) {
            return Vec::new();
        }
        let before = self.seen.replace(seen);
        let whole = before.is_none_or(|before| trouble == before.trouble);
        let count = before.map_or(1, |before| {
            let sweeps = (seen.accepted.saturating_sub(before.accepted) + self.sectors / 2) / self.sectors;
            let places = (seen.due_ns.saturating_sub(before.due_ns) + self.period_ns / 2) / self.period_ns;
            sweeps.min(places).max(1)
        });
        let earlier = |place: u64| {
            let latency_ns = sink.latency_ns + (count - 1 - place) * self.period_ns;
            let due_ns = seen.due_ns.saturating_sub((count - 1 - place) * self.period_ns);
            Answer { due_ns, answered_ns: seen.answered_ns, latency_ns, whole }
        };
        (0..count).map(earlier).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn sink(answered_ms: u64, latency_ms: u64, sweeps: u64) -> Counts {
        Counts {
            answered_ns: answered_ms * MS,
            latency_ns: latency_ms * MS,
            published: sweeps * 4,
            ..Counts::default()
        }
    }

    #[test]
    fn each_sweep_is_seen_once() {
        let mut sut = Answers::new(4, 100 * MS);
        assert!(sut.look(&sink(0, 0, 0), 0).is_empty());
        assert_eq!(sut.look(&sink(1005, 5, 1), 0)[0].due_ns, 1000 * MS);
        assert!(sut.look(&sink(1005, 5, 1), 0).is_empty());
        let next = sut.look(&sink(1106, 6, 2), 0);
        assert_eq!((next.len(), next[0].latency_ns, next[0].whole), (1, 6 * MS, true));
    }

    #[test]
    fn sweeps_that_ended_together_are_told_apart_by_the_parts_that_came() {
        let mut sut = Answers::new(4, 100 * MS);
        sut.look(&sink(1005, 5, 1), 0);
        let burst = sut.look(&sink(1520, 20, 4), 0);
        let dues: Vec<u64> = burst.iter().map(|answer| answer.due_ns / MS).collect();
        assert_eq!(dues, [1300, 1400, 1500]);
        assert_eq!(burst[0].latency_ns, 220 * MS);
        // What was lost in between makes the next one broken, and no other.
        assert!(!sut.look(&sink(1605, 5, 5), 3)[0].whole);
        assert!(sut.look(&sink(1705, 5, 6), 3)[0].whole);
    }
}
