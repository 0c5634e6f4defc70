use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use runtime::clock;
use serde::{Deserialize, Serialize};

use super::CyclesFile;
use crate::SoakError;
use crate::run::{Run, Setup, leftovers};

/// One start, and its end.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Cycle {
    /// From the command to all stages up [ms]; null where that did not come.
    pub ready_ms: Option<f64>,
    /// From the command to stop to the end [ms].
    pub stop_ms: Option<f64>,
    /// Exit code; null where a signal ended it.
    pub exit_code: Option<i32>,
    /// When it was killed after its start, and in which order, where that was to be.
    pub killed: Option<String>,
    /// What failed; null where nothing did.
    pub failed: Option<String>,
}

/// Starts and stops the chain again and again; `each` hears of every cycle.
pub(crate) fn cycles(
    file: &CyclesFile,
    setup: &Setup,
    seed: u64,
    interrupted: &AtomicBool,
    mut each: impl FnMut(usize, &Cycle),
) -> Result<Vec<Cycle>, SoakError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut all = Vec::new();
    while all.len() < file.times && !interrupted.load(Ordering::Relaxed) {
        let cycle = cycle(setup, (rng.random::<f64>() * file.run_ms * 1e6) as u64)?;
        each(all.len(), &cycle);
        all.push(cycle);
    }
    Ok(all)
}

/// One start, a run of `run_ns`, and one stop.
pub(super) fn cycle(setup: &Setup, run_ns: u64) -> Result<Cycle, SoakError> {
    let mut run = Run::start(setup, &[] as &[OsString])?;
    let mut cycle = Cycle { ready_ms: run.await_up().ok(), ..Cycle::default() };
    clock::sleep_ns(run_ns);
    let asked_ns = clock::now_ns();
    let ended = run.stop();
    cycle.stop_ms = ended.map(|_| (clock::now_ns() - asked_ns) as f64 / 1e6);
    cycle.exit_code = ended.and_then(|status| status.code());
    let left = leftovers(&setup.instance);
    cycle.failed = if cycle.ready_ms.is_none() {
        Some("did not come up".to_owned())
    } else if cycle.exit_code != Some(0) {
        Some(format!("exit code {:?}", cycle.exit_code))
    } else if !left.is_empty() {
        Some(format!("left behind: {}", left.join(", ")))
    } else {
        run.reports().iter().any(|report| !report.ledger.closed).then(|| "the ledger is OPEN".to_owned())
    };
    Ok(cycle)
}
