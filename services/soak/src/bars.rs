//! `soak.toml`: what a soak must show. As written ([`BarsFile`]) and as checked ([`Bars`]).

use serde::Deserialize;

use crate::SoakError;

/// As written; its fields are those of [`Bars`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BarsFile {
    settle_s: f64,
    idle_pct: f64,
    no_faults: NoFaultBars,
    faults: FaultBars,
    kills: KillBars,
    kill_all: StartBars,
    cycles: StartBars,
    mode_changes: ModeBars,
    day: DayBars,
}

/// As checked.
#[derive(Clone, Debug)]
pub struct Bars {
    /// Time after an injection that does not count [s].
    pub settle_s: f64,
    /// Load by others up to which misses and drift are judged [% of a core].
    pub idle_pct: f64,
    /// Without faults.
    pub no_faults: NoFaultBars,
    /// With faults.
    pub faults: FaultBars,
    /// Each stage killed.
    pub kills: KillBars,
    /// All killed, and a new start.
    pub kill_all: StartBars,
    /// Starts and stops.
    pub cycles: StartBars,
    /// Changes of mode.
    pub mode_changes: ModeBars,
    /// The day in the life.
    pub day: DayBars,
}

/// Without faults.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoFaultBars {
    /// Most deadline misses.
    pub misses: u64,
    /// Most restarts.
    pub restarts: u64,
    /// Most growth of a process's memory after five minutes [%].
    pub memory_growth_pct: f64,
    /// Most growth of the shared memory that is taken, after five minutes [%].
    pub shared_memory_growth_pct: f64,
    /// Most rise of the median latency [%].
    pub p50_drift_pct: f64,
    /// Most rise of p99 [%].
    pub p99_drift_pct: f64,
}

/// With faults.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultBars {
    /// Least availability outside the time after injections [%].
    pub availability_pct: f64,
    /// Least availability outside faults, their length included [%].
    pub availability_outside_faults_pct: f64,
}

/// Each stage killed.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KillBars {
    /// Longest until a kill is detected [ms].
    pub detected_ms: f64,
    /// Longest until there is output again [ms].
    pub output_again_ms: f64,
    /// Least availability outside the time after kills [%].
    pub availability_pct: f64,
}

/// Starts.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartBars {
    /// Most that may fail.
    pub failures: u64,
    /// Longest until all processes are up [ms].
    pub ready_ms: f64,
}

/// Changes of mode.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeBars {
    /// Most that may fail or stick.
    pub failures: u64,
    /// Sweeps until a mode is in effect.
    pub within_sweeps: f64,
}

/// The day in the life.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DayBars {
    /// Most steps that may fail.
    pub failures: u64,
}

impl BarsFile {
    /// Reads the table.
    ///
    /// # Errors
    /// It is no TOML, lacks a key or has one too many.
    pub fn parse(text: &str) -> Result<Self, SoakError> {
        toml::from_str(text).map_err(|cause| table(cause.to_string().trim_end()))
    }

    /// Checks that each number can be a bound.
    ///
    /// # Errors
    /// The first that cannot.
    pub fn checked(self) -> Result<Bars, SoakError> {
        let Self { settle_s, idle_pct, no_faults, faults, kills, kill_all, cycles, mode_changes, day } = self;
        let at_least_zero = [
            ("settle_s", settle_s),
            ("idle_pct", idle_pct),
            ("no_faults.memory_growth_pct", no_faults.memory_growth_pct),
            ("no_faults.shared_memory_growth_pct", no_faults.shared_memory_growth_pct),
            ("no_faults.p50_drift_pct", no_faults.p50_drift_pct),
            ("no_faults.p99_drift_pct", no_faults.p99_drift_pct),
            ("kills.detected_ms", kills.detected_ms),
            ("kills.output_again_ms", kills.output_again_ms),
            ("kill_all.ready_ms", kill_all.ready_ms),
            ("cycles.ready_ms", cycles.ready_ms),
            ("mode_changes.within_sweeps", mode_changes.within_sweeps),
        ];
        if let Some((key, value)) = at_least_zero.into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0)) {
            return Err(table(&format!("{key} is {value}, must be 0 or more")));
        }
        let shares = [
            ("faults.availability_pct", faults.availability_pct),
            ("faults.availability_outside_faults_pct", faults.availability_outside_faults_pct),
            ("kills.availability_pct", kills.availability_pct),
        ];
        if let Some((key, value)) = shares.into_iter().find(|(_, value)| !(0.0..=100.0).contains(value)) {
            return Err(table(&format!("{key} is {value}, must be 0 to 100")));
        }
        Ok(Bars { settle_s, idle_pct, no_faults, faults, kills, kill_all, cycles, mode_changes, day })
    }
}

fn table(cause: &str) -> SoakError {
    SoakError::Table { file: "soak.toml".to_owned(), cause: cause.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHIPPED: &str = include_str!("../../../config/soak.toml");

    #[test]
    fn the_shipped_table_holds() {
        let bars = BarsFile::parse(SHIPPED).unwrap().checked().unwrap();
        assert_eq!((bars.kills.detected_ms, bars.faults.availability_pct), (200.0, 99.0));
    }

    #[test]
    fn what_cannot_be_a_bound_is_refused_by_name() {
        let text = SHIPPED.replace("availability_pct = 99.0", "availability_pct = 101.0");
        let error = BarsFile::parse(&text).unwrap().checked().unwrap_err().to_string();
        assert_eq!(error, "soak.toml: faults.availability_pct is 101, must be 0 to 100");
        let text = SHIPPED.replace("settle_s = 1.0", "settle_s = nan");
        assert!(BarsFile::parse(&text).unwrap().checked().unwrap_err().to_string().contains("settle_s is NaN"));
        assert!(BarsFile::parse(&(SHIPPED.to_owned() + "\n[more]\n")).is_err());
    }
}
