//! Memory that is there when it is needed.

use std::fs;
use std::hint::black_box;

use chain::Chain;
use messages::{Clusters, Descriptors, Detections, Sweep, Tracks, Truth};
use rustix::mm::{MlockAllFlags, mlockall, munlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::CapabilitySet;
use transport::Segment;

use super::scheduling::may;
use super::{Refusal, Setting};

const MIB: u64 = 1 << 20;
const PAGE: usize = 4096;
/// Stack that is touched: no stage's `process` needs as much (the main thread may have 8 MiB).
const STACK: usize = 512 * 1024;
/// Heap that is touched and kept. A stage allocates only while it starts; the recorder's buffers are of this order.
const HEAP: usize = 4 << 20;
/// Address space that a process may still map beside its messages: heap, thread stacks, libraries.
const SPARE: u64 = 64 * MIB;

/// The segment of a message by its name in chain.toml; none for a name that no message has.
pub fn segment_of(message: &str, queue_parts: usize) -> Option<Segment> {
    Some(match message {
        "Sweep" => Segment::of::<Sweep>(queue_parts),
        "Truth" => Segment::of::<Truth>(queue_parts),
        "Clusters" => Segment::of::<Clusters>(queue_parts),
        "Descriptors" => Segment::of::<Descriptors>(queue_parts),
        "Detections" => Segment::of::<Detections>(queue_parts),
        "Tracks" => Segment::of::<Tracks>(queue_parts),
        _ => return None,
    })
}

/// Address space of one process, against which the kernel holds the limit of locked memory.
///
/// With MCL_ONFAULT only pages that are touched stay in memory, but the limit is held against all that is mapped
/// (mlock(2)); and once MCL_FUTURE is set, a segment that exceeds it cannot be mapped any more. So nothing is locked
/// unless the limit covers what will be mapped at worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LockPlan {
    /// What is mapped, and will be [bytes].
    pub bytes: u64,
}

impl LockPlan {
    /// The plan of a running process that has mapped its own writing end.
    pub(super) fn of(chain: &Chain, process: &str) -> Self {
        Self { bytes: mapped_bytes() + Self::to_be_mapped(chain, process) + SPARE }
    }

    /// The plan of a process that does not run yet, from what this one has mapped. Never less than what the process will
    /// reckon itself: its writer's segment may be mapped by then, and its threads have heaps of their own.
    pub fn foreseen(chain: &Chain, process: &str) -> Self {
        let stage = chain.stages.iter().find(|stage| stage.name == process);
        let bytes_of =
            |message: &str| segment_of(message, chain.queue_parts()).map_or(0, |segment| segment.virtual_bytes());
        let written = match stage {
            Some(stage) => stage.writes.as_deref().map_or(0, bytes_of),
            None if process == crate::SOURCE => bytes_of("Sweep") + bytes_of("Truth"),
            None => 0,
        };
        let read = stage.map_or(0, |stage| bytes_of(&stage.reads));
        Self { bytes: mapped_bytes() + written + read + Self::to_be_mapped(chain, process) + 3 * SPARE }
    }

    /// What a reader maps: its writer's segment, and that of the writer's successor before the old one is let go.
    fn to_be_mapped(chain: &Chain, process: &str) -> u64 {
        let stage = chain.stages.iter().find(|stage| stage.name == process);
        let segment = stage.and_then(|stage| segment_of(&stage.reads, chain.queue_parts()));
        segment.map_or(0, |segment| 2 * segment.virtual_bytes())
    }

    /// Locks what this process touches, now and later.
    pub(super) fn lock(&self) -> Result<(), Refusal> {
        self.check()?;
        mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT)
            .map_err(|cause| self.refused(format!("the kernel says {cause}")))
    }

    /// Whether the limit covers it, or does not hold for this process.
    pub fn check(&self) -> Result<(), Refusal> {
        let limit = getrlimit(Resource::Memlock).current;
        match limit.filter(|limit| *limit < self.bytes && !may(CapabilitySet::IPC_LOCK)) {
            Some(limit) => Err(self.refused(format!(
                "{} MiB of address space may be mapped, and RLIMIT_MEMLOCK is {}",
                self.bytes.div_ceil(MIB),
                if limit < MIB { format!("{} KiB", limit / 1024) } else { format!("{} MiB", limit / MIB) },
            ))),
            None => Ok(()),
        }
    }

    fn refused(&self, reason: String) -> Refusal {
        let remedy = "set `LimitMEMLOCK=infinity` in the systemd unit, `memlock unlimited` in \
                      /etc/security/limits.conf, or `setcap cap_ipc_lock+ep` on the executable";
        Refusal::new(Setting::LockMemory, self.bytes.div_ceil(MIB), reason, remedy.to_owned())
    }
}

/// Whether a process of the chain could lock its memory; what is tried is undone.
pub fn try_lock(chain: &Chain, process: &str) -> Result<(), Refusal> {
    let locked = LockPlan::foreseen(chain, process).lock();
    let _ = munlockall(); // nothing was locked before
    locked
}

/// Touches this thread's stack and a reserve of heap, so that the first part finds them.
///
/// It covers the stack of the working thread and the heap. Shared memory is not covered: a place for a message becomes
/// warm when it is first written, which is once for each place that is ever in use.
pub(super) fn prefault() {
    touch_stack();
    // The first block is a mapping of its own. Freeing it raises glibc's thresholds (mallopt(3), M_MMAP_THRESHOLD), so
    // that the second comes from the heap, and the heap is not given back when that is freed.
    for _ in 0..2 {
        let mut reserve = vec![0_u8; HEAP];
        reserve.iter_mut().step_by(PAGE).for_each(|byte| *byte = 1);
        black_box(&mut reserve);
    }
}

#[inline(never)]
fn touch_stack() {
    let mut stack = [0_u8; STACK];
    stack.iter_mut().step_by(PAGE).for_each(|byte| *byte = 1);
    black_box(&mut stack);
}

/// Address space of this process [bytes]; 0 where the kernel does not say.
fn mapped_bytes() -> u64 {
    let statm = fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = statm.split_whitespace().next().and_then(|pages| pages.parse::<u64>().ok());
    pages.unwrap_or(0) * rustix::param::page_size() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_message_of_the_chain_has_a_bill() {
        for message in ["Sweep", "Truth", "Clusters", "Descriptors", "Detections", "Tracks"] {
            assert!(segment_of(message, 4).unwrap().virtual_bytes() > 0, "{message}");
        }
        assert!(segment_of("Parties", 4).is_none());
    }

    #[test]
    fn a_plan_beyond_the_limit_is_refused_with_both_figures() {
        let plan = LockPlan { bytes: u64::MAX };
        if let Err(refusal) = plan.check() {
            assert!(
                refusal.reason.contains("RLIMIT_MEMLOCK is") && refusal.remedy.contains("LimitMEMLOCK"),
                "{refusal:?}"
            );
        }
    }

    /// Pages that this thread has touched for the first time (proc(5), field 10).
    fn first_touches() -> u64 {
        let stat = fs::read_to_string("/proc/thread-self/stat").unwrap();
        stat.rsplit_once(')').unwrap().1.split_whitespace().nth(7).unwrap().parse().unwrap()
    }

    #[test]
    fn what_was_touched_beforehand_costs_nothing_later() {
        let touches = || {
            let before = first_touches();
            touch_stack();
            drop(black_box(vec![1_u8; HEAP / 2]));
            first_touches() - before
        };
        let pages = ((HEAP / 2 + STACK) / PAGE) as u64;
        prefault();
        let warm = touches();
        assert!(warm < pages / 10, "{warm} of {pages} pages were touched for the first time");
    }
}
