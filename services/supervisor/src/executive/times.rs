//! The limits of `[health]` in host time.

use chain::executive::HealthFile;

/// The period of a source that nothing paces [ns].
const PERIOD_NS: u64 = 100_000_000;
/// No limit may be below three of the longest sleeps of a stage that has nothing to do [ns].
const LEAST_NS: u64 = 150_000_000;
/// How much longer one sweep may take where nothing paces it.
const UNPACED: u64 = 30;

/// How long is too long, at the source's present rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Times {
    /// A sensor's clock paces the source.
    pub(crate) paced: bool,
    /// From one sweep to the next [ns].
    pub(crate) period_ns: u64,
    /// Age of a heartbeat from which on the kernel is asked [ns].
    pub(crate) asked_ns: u64,
    /// Age of a heartbeat of who neither computes nor makes progress [ns].
    pub(crate) hung_ns: u64,
    /// Age of a heartbeat of who computes [ns].
    pub(crate) spinning_ns: u64,
    /// How long input may wait, or a source send nothing [ns].
    pub(crate) silent_ns: u64,
}

impl Times {
    /// Of the source's present period; 0 where nothing paces it.
    pub(crate) fn of(health: &HealthFile, period_ns: u64, paced: bool) -> Self {
        let period_ns = if paced && period_ns > 0 { period_ns } else { PERIOD_NS };
        let sweeps = |sweeps: f64| ((sweeps * period_ns as f64) as u64).max(LEAST_NS);
        let hung_ns = sweeps(health.hung_sweeps);
        let spinning_ns = (health.spinning_ms * 1e6) as u64;
        Self {
            paced,
            period_ns,
            asked_ns: hung_ns / 2,
            hung_ns,
            spinning_ns: spinning_ns.saturating_mul(if paced { 1 } else { UNPACED }).max(hung_ns),
            silent_ns: sweeps(health.silent_sweeps),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) const HEALTH: HealthFile = HealthFile {
        hung_sweeps: 1.5,
        spinning_ms: 1000.0,
        silent_sweeps: 2.0,
        slow_overruns: 3,
        flood_ratio: 1.5,
        flood_events_per_s: 500.0,
    };

    #[test]
    fn limits_follow_the_sensors_rate_down_to_what_an_idle_stage_sleeps() {
        let at = |period_ns| Times::of(&HEALTH, period_ns, true);
        assert_eq!((at(100_000_000).hung_ns, at(100_000_000).silent_ns), (150_000_000, 200_000_000));
        assert_eq!(at(200_000_000).hung_ns, 300_000_000);
        assert_eq!(at(10_000_000).hung_ns, LEAST_NS, "an idle stage beats every 50 ms");
        assert_eq!(at(1_000_000_000).spinning_ns, 1_500_000_000, "who spins is hung for long already");
    }

    #[test]
    fn without_a_sensors_clock_a_sweep_may_take_thirty_times_as_long() {
        let fast = Times::of(&HEALTH, 0, false);
        assert_eq!((fast.period_ns, fast.hung_ns, fast.spinning_ns), (PERIOD_NS, 150_000_000, 30_000_000_000));
    }
}
