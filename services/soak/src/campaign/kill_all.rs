use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use runtime::clock;
use rustix::process::Signal;

use super::KillAllFile;
use super::cycles::{Cycle, cycle};
use crate::SoakError;
use crate::look::processes_of;
use crate::run::{Run, Setup, signal};

/// How long a killed process may take to be gone [ns].
const GONE_NS: u64 = 2_000_000_000;
/// How long the next run goes on [ns].
const RUN_NS: u64 = 300_000_000;

/// Starts the chain, kills the supervisor and all stages in any order at any time, and starts it anew, which must be as clean as any
/// start; again and again.
pub(crate) fn kill_all(
    file: &KillAllFile,
    setup: &Setup,
    seed: u64,
    interrupted: &AtomicBool,
    mut each: impl FnMut(usize, &Cycle),
) -> Result<Vec<Cycle>, SoakError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut all = Vec::new();
    while all.len() < file.times && !interrupted.load(Ordering::Relaxed) {
        let after_ms = rng.random::<f64>() * file.within_ms;
        let killed = kill_once(setup, after_ms, &mut rng)?;
        let next = Cycle { killed: Some(killed), ..cycle(setup, RUN_NS)? };
        each(all.len(), &next);
        all.push(next);
    }
    Ok(all)
}

/// Starts a chain and kills all of it; gives when and how.
fn kill_once(setup: &Setup, after_ms: f64, rng: &mut ChaCha8Rng) -> Result<String, SoakError> {
    let mut run = Run::start(setup, &[] as &[OsString])?;
    clock::sleep_ns((after_ms * 1e6) as u64);
    let supervisor = run.pid();
    let mut pids = processes_of(&setup.instance);
    pids.push(supervisor);
    pids.shuffle(rng);
    pids.iter().for_each(|pid| signal(*pid, Signal::KILL));
    // One that the supervisor started while the others were killed.
    clock::wait_for(GONE_NS, || {
        let rest = processes_of(&setup.instance);
        rest.iter().for_each(|pid| signal(*pid, Signal::KILL));
        run.ended().is_some() && rest.is_empty()
    });
    let place = pids.iter().position(|pid| *pid == supervisor).unwrap_or(0);
    Ok(format!("{after_ms:.0} ms after the start, {} processes, the supervisor as number {}", pids.len(), place + 1))
}
