//! What processes and machine did over the time of a run, and what happened when. Bounded, whatever the run's length.

use recorder::{Buckets, Merge};

use crate::processes::child::Ended;
use crate::processes::machine::Shares;
use crate::processes::usage::Usage;

/// Most buckets of samples.
const MOST: usize = 600;
/// Length of a bucket at first [ns]: one sample.
const WIDTH_NS: u64 = 1_000_000_000;
/// Most processes that are told apart: a chain's stages, its sink and the supervisor.
pub(crate) const PROCESSES: usize = messages::MAX_HOPS + 2;
/// Most events that are kept; later ones are only counted.
const MAX_EVENTS: usize = 200;

/// What was used in a bucket of time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Used {
    /// Time between the looks that it is the sum of [s].
    pub(crate) passed_s: f64,
    /// CPU time of each process [s].
    pub(crate) cpu_s: [f64; PROCESSES],
    /// Most memory resident at a look.
    pub(crate) rss_kib: [u64; PROCESSES],
    /// Shares of the machine, times the time between the looks [% of a core · s].
    pub(crate) machine: Shares,
    /// Time between the looks at the machine [s].
    pub(crate) machine_s: f64,
    /// Latest wake of a thread that waited for the time [ns].
    pub(crate) late_ns: u64,
}

impl Merge for Used {
    fn merge(&mut self, later: &Self) {
        self.passed_s += later.passed_s;
        self.cpu_s.iter_mut().zip(later.cpu_s).for_each(|(sum, more)| *sum += more);
        self.rss_kib.iter_mut().zip(later.rss_kib).for_each(|(most, other)| *most = (*most).max(other));
        self.machine = self.machine.plus(later.machine);
        self.machine_s += later.machine_s;
        self.late_ns = self.late_ns.max(later.late_ns);
    }
}

impl Ended {
    /// How it ended, in two words.
    pub(crate) fn in_words(self) -> String {
        match self {
            Self::Code(code) => format!("exit code {code}"),
            Self::Signal(signal) => format!("signal {signal}"),
            Self::Gone => "gone".to_owned(),
        }
    }
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Happened {
    pub(crate) at_ns: u64,
    pub(crate) kind: &'static str,
    pub(crate) what: String,
}

/// The run so far.
pub(crate) struct Timeline {
    pub(crate) started_ns: u64,
    pub(crate) used: Buckets<Used>,
    pub(crate) happened: Vec<Happened>,
    pub(crate) events: u64,
    /// The last look: when, and the CPU time of each process by then [s].
    last: (u64, [f64; PROCESSES]),
}

impl Timeline {
    pub(crate) fn new(started_ns: u64) -> Self {
        Self {
            started_ns,
            used: Buckets::new(WIDTH_NS, MOST),
            happened: Vec::with_capacity(MAX_EVENTS),
            events: 0,
            last: (started_ns, [0.0; PROCESSES]),
        }
    }

    /// Notes a look at all processes, the supervisor last, at the machine (none where the looks are too near), and the
    /// latest wake since the look before.
    pub(crate) fn look<'a>(
        &mut self,
        at_ns: u64,
        usages: impl Iterator<Item = &'a Usage>,
        machine: Option<(f64, Shares)>,
        late_ns: u64,
    ) {
        let (last_ns, last_cpu_s) = &mut self.last;
        let passed_s = at_ns.saturating_sub(*last_ns) as f64 / 1e9;
        let mut used = Used { passed_s, late_ns, ..Used::default() };
        for (place, usage) in usages.take(PROCESSES).enumerate() {
            used.cpu_s[place] = (usage.cpu_s() - last_cpu_s[place]).max(0.0);
            used.rss_kib[place] = usage.rss_kib();
            last_cpu_s[place] = usage.cpu_s();
        }
        *last_ns = at_ns;
        if let Some((passed_s, shares)) = machine {
            (used.machine, used.machine_s) = (shares.times(passed_s), passed_s);
        }
        self.used.at(at_ns).merge(&used);
    }

    /// Notes that a stage is started anew, and why.
    pub(crate) fn restarted(&mut self, at_ns: u64, stage: &str, ended: Ended) {
        self.happen(at_ns, "restart", format!("{stage} ({})", ended.in_words()));
    }

    /// Notes a move on the ladder of overload.
    pub(crate) fn stepped(&mut self, at_ns: u64, step: &crate::Move) {
        self.happen(at_ns, "step", format!("{} to {}", step.from, step.to));
    }

    fn happen(&mut self, at_ns: u64, kind: &'static str, what: String) {
        self.events += 1;
        if self.happened.len() < MAX_EVENTS {
            self.happened.push(Happened { at_ns, kind, what });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_add_up_time_and_keep_the_most_memory_and_the_latest_wake() {
        let used = |cpu_s: f64, rss: u64, late_ns: u64| {
            let mut used = Used { passed_s: 1.0, machine_s: 1.0, late_ns, ..Used::default() };
            (used.cpu_s[1], used.rss_kib[1]) = (cpu_s, rss);
            used
        };
        let mut sut = used(0.25, 30, 7);
        sut.merge(&used(0.5, 20, 9));
        assert_eq!((sut.cpu_s[1], sut.rss_kib[1], sut.late_ns, sut.passed_s), (0.75, 30, 9, 2.0));
    }

    #[test]
    fn events_beyond_the_most_that_are_kept_are_counted() {
        let mut sut = Timeline::new(0);
        for at_ns in 0..300 {
            sut.restarted(at_ns, "clusterer", Ended::Signal(9));
        }
        assert_eq!((sut.happened.len(), sut.events), (MAX_EVENTS, 300));
        assert_eq!(sut.happened[1].what, "clusterer (signal 9)");
    }
}
