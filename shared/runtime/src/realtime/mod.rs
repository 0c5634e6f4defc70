//! What chain.toml asks of the kernel for a process. What is refused is said in words that name the remedy, and the
//! process goes on without.
//!
//! A stage takes its seat when everything is mapped and before it says that it runs; it leaves its refusals as a file in
//! the instance's folder. The supervisor reads them all and warns once for each setting.

mod memory;
mod refusal;
mod scheduling;

use std::fs;
use std::path::PathBuf;

use chain::Chain;
use transport::Instance;

pub use memory::{LockPlan, segment_of, try_lock};
pub use refusal::{Refusal, Refused, Setting, in_words};
pub use scheduling::{AsBefore, allowed_cores, raise, stand_back, try_core, try_priority};

/// Gives the calling thread the seat of `process`, and the process the memory that the chain asks for.
pub fn take_seat(chain: &Chain, process: &str) -> Vec<Refusal> {
    let realtime = &chain.realtime;
    if realtime.prefault {
        memory::prefault();
    }
    let locked = if realtime.lock_memory { LockPlan::of(chain, process).lock() } else { Ok(()) };
    let seat = realtime.seat(process);
    let pinned = seat.core.map_or(Ok(()), scheduling::pin);
    // Last: an ordinary thread is kinder to the others while it starts.
    let raised = if seat.priority > 0 { scheduling::raise(seat.priority) } else { Ok(()) };
    let refused = [locked, pinned, raised].into_iter().filter_map(Result::err);
    refused.map(|reason| Refusal { process: process.to_owned(), ..reason }).collect()
}

/// Takes a stage's seat and leaves word of what was refused.
pub(crate) fn take_seat_of_stage(instance: &Instance, chain: &Chain, stage: &str) {
    if !chain.realtime.asks() {
        return;
    }
    let refusals = take_seat(chain, stage);
    let written = serde_json::to_vec(&refusals).map(|text| fs::write(path(instance, stage), text));
    if !matches!(written, Ok(Ok(()))) {
        tracing::warn!(stage, "what the kernel refused could not be written down: {refusals:?}");
    }
}

/// What the kernel refused to the stages that run by now, in flow order.
pub fn refused_to_stages(instance: &Instance, chain: &Chain) -> Vec<Refusal> {
    if !chain.realtime.asks() {
        return Vec::new();
    }
    let stages = std::iter::once(crate::SOURCE).chain(chain.stages.iter().map(|stage| stage.name.as_str()));
    let texts = stages.filter_map(|stage| fs::read(path(instance, stage)).ok());
    texts.filter_map(|text| serde_json::from_slice::<Vec<Refusal>>(&text).ok()).flatten().collect()
}

fn path(instance: &Instance, stage: &str) -> PathBuf {
    instance.dir().join(format!("{stage}.refused.json"))
}
