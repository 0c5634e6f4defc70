//! Who had the cores: the chain, somebody else, or the hypervisor. From `/proc/stat`.

use std::fs;

use rustix::param::clock_ticks_per_second;
use serde::{Deserialize, Serialize};

/// Load of the machine during a run. 100 = one core.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct MachineLoad {
    /// Taken by the hypervisor while a thread was ready to run [% of a core]; null where nothing was measured.
    pub steal_pct: Option<f64>,
    /// Used by programs that are not of this chain, and by interrupts [% of a core].
    pub foreign_cpu_pct: Option<f64>,
    /// Used by the processes of this chain [% of a core].
    pub own_cpu_pct: Option<f64>,
    /// The worst second's steal [% of a core].
    pub steal_worst_pct: Option<f64>,
    /// The worst second's foreign programs [% of a core].
    pub foreign_cpu_worst_pct: Option<f64>,
}

/// CPU time of all cores since the machine started.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CpuTimes {
    /// Of all programs and of interrupts [s].
    pub busy_s: f64,
    /// Taken by the hypervisor [s].
    pub steal_s: f64,
}

impl CpuTimes {
    /// Reads them; none where there is no `/proc/stat`.
    pub fn now() -> Option<Self> {
        parse(&fs::read_to_string("/proc/stat").ok()?, clock_ticks_per_second() as f64)
    }
}

/// `cpu user nice system idle iowait irq softirq steal guest guest_nice` (proc(5)); guests are in user already.
fn parse(stat: &str, ticks_per_s: f64) -> Option<CpuTimes> {
    let line = stat.lines().find_map(|line| line.strip_prefix("cpu "))?;
    let ticks: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let [user, nice, system, _idle, _iowait, irq, softirq, steal, ..] = ticks[..] else { return None };
    Some(CpuTimes { busy_s: (user + nice + system + irq + softirq) / ticks_per_s, steal_s: steal / ticks_per_s })
}

/// A look at the machine.
#[derive(Clone, Copy)]
struct Look {
    at_ns: u64,
    times: CpuTimes,
    own_cpu_s: f64,
}

/// Shares between two looks [% of a core].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shares {
    pub(crate) steal: f64,
    pub(crate) foreign: f64,
    pub(crate) own: f64,
}

impl Shares {
    pub(crate) fn plus(self, other: Self) -> Self {
        Self { steal: self.steal + other.steal, foreign: self.foreign + other.foreign, own: self.own + other.own }
    }

    pub(crate) fn times(self, factor: f64) -> Self {
        Self { steal: self.steal * factor, foreign: self.foreign * factor, own: self.own * factor }
    }
}

impl Look {
    fn shares_since(&self, earlier: &Self) -> Shares {
        let passed_s = (self.at_ns - earlier.at_ns) as f64 / 1e9;
        let pct = |part_s: f64| (part_s / passed_s * 1e4).round().max(0.0) / 100.0;
        let own_s = self.own_cpu_s - earlier.own_cpu_s;
        Shares {
            steal: pct(self.times.steal_s - earlier.times.steal_s),
            foreign: pct(self.times.busy_s - earlier.times.busy_s - own_s),
            own: pct(own_s),
        }
    }
}

/// The machine during a run, looked at now and then.
#[derive(Default)]
pub(crate) struct Machine {
    first: Option<Look>,
    last: Option<Look>,
    worst: Shares,
}

/// Nearer looks tell nothing: the kernel counts in ticks of 10 ms [ns].
const NEAREST_LOOKS_NS: u64 = 500_000_000;

impl Machine {
    /// One look, with the CPU time that this chain has used by now; the time since the last one [s] and the shares in it.
    pub(crate) fn look(&mut self, at_ns: u64, own_cpu_s: f64) -> Option<(f64, Shares)> {
        let times = CpuTimes::now()?;
        self.add(Look { at_ns, times, own_cpu_s })
    }

    fn add(&mut self, look: Look) -> Option<(f64, Shares)> {
        let Some(last) = self.last else {
            (self.first, self.last) = (Some(look), Some(look));
            return None;
        };
        if look.at_ns < last.at_ns + NEAREST_LOOKS_NS {
            return None;
        }
        let shares = look.shares_since(&last);
        self.worst.steal = self.worst.steal.max(shares.steal);
        self.worst.foreign = self.worst.foreign.max(shares.foreign);
        self.last = Some(look);
        Some(((look.at_ns - last.at_ns) as f64 / 1e9, shares))
    }

    /// What the report says: nothing when the run was over before a second look.
    pub(crate) fn load(&self) -> MachineLoad {
        let (Some(first), Some(last)) = (self.first, self.last) else { return MachineLoad::default() };
        if last.at_ns == first.at_ns {
            return MachineLoad::default();
        }
        let shares = last.shares_since(&first);
        MachineLoad {
            steal_pct: Some(shares.steal),
            foreign_cpu_pct: Some(shares.foreign),
            own_cpu_pct: Some(shares.own),
            steal_worst_pct: Some(self.worst.steal),
            foreign_cpu_worst_pct: Some(self.worst.foreign),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn busy_is_everything_but_idle_and_steal_and_guests_count_once() {
        let stat = "cpu  100 20 30 999 5 6 4 50 100 7\ncpu0 1 1 1 1 1 1 1 1 1 1\n";
        assert_eq!(parse(stat, 100.0), Some(CpuTimes { busy_s: 1.6, steal_s: 0.5 }));
        assert_eq!(parse("cpu 1 2 3", 100.0), None);
        assert_eq!(parse("", 100.0), None);
    }

    #[test]
    fn what_is_not_ours_is_foreign_and_the_worst_second_is_kept() {
        let look = |s: u64, busy_s, steal_s, own_cpu_s| Look {
            at_ns: s * 1_000_000_000,
            times: CpuTimes { busy_s, steal_s },
            own_cpu_s,
        };
        let mut sut = Machine::default();
        assert_eq!(sut.load(), MachineLoad::default());
        for look in [look(1, 10.0, 1.0, 0.0), look(2, 11.0, 1.0, 0.9), look(3, 12.5, 1.5, 1.4)] {
            sut.add(look);
        }
        let load = sut.load();
        assert_eq!(load.own_cpu_pct, Some(70.0));
        assert_eq!(load.foreign_cpu_pct, Some(55.0));
        assert_eq!(load.steal_pct, Some(25.0));
        assert_eq!(load.foreign_cpu_worst_pct, Some(100.0));
        assert_eq!(load.steal_worst_pct, Some(50.0));
    }

    #[test]
    fn ticks_that_were_counted_a_moment_apart_never_make_a_negative_share() {
        let times = CpuTimes { busy_s: 1.0, steal_s: 0.0 };
        let mut sut = Machine::default();
        sut.add(Look { at_ns: 0, times, own_cpu_s: 0.0 });
        sut.add(Look { at_ns: 1_000_000_000, times, own_cpu_s: 0.01 });
        assert_eq!(sut.load().foreign_cpu_pct, Some(0.0));
    }
}
