//! Whether a supervisor stands behind a stage. Without one the stage goes on for a while, so that a successor can adopt it;
//! then it leaves in order.

use std::fs::File;
use std::sync::atomic::{AtomicU64, Ordering};

use rustix::fs::{FlockOperation, flock};
use transport::Instance;

use crate::page::{PageMap, State};
use crate::{Plan, ShellError, TAPE, clock};

/// Between two looks at the lock [ns]: no system call more often, whatever the rate of parts.
const LOOK_NS: u64 = 100_000_000;
/// A process that shows no progress for so long does not leave in order any more: nobody waits for it [ns].
const GONE_NS: u64 = 1_000_000_000;

/// The instance's lock, seen by one of its stages. A supervisor that is merely stopped holds it.
pub(crate) struct Guardian {
    lock: File,
    /// How long to go on without a supervisor [ns].
    orphan_ns: u64,
    /// Page of the process that is to leave before this one; none for the source.
    before: Option<PageMap>,
    next_look_ns: AtomicU64,
    /// When the lock was found free [ns]; 0 while somebody holds it.
    since_ns: AtomicU64,
}

impl Guardian {
    /// The guardian of stage `name`, or of the tape.
    ///
    /// # Errors
    /// The lock or a page is not there.
    pub(crate) fn of(instance: &Instance, plan: &Plan, name: &str) -> Result<Self, ShellError> {
        let path = instance.lock_path();
        let lock = File::open(&path).map_err(|cause| ShellError::File { path, cause: cause.to_string() })?;
        let before = match name {
            TAPE => plan.stages().last(),
            name => plan.stages().take_while(|stage| *stage != name).last(),
        };
        let before = before.map(|stage| PageMap::open(&Plan::page_path(instance, stage))).transpose()?;
        let orphan_ns = (plan.executive.supervisor.orphan_s * 1e9) as u64;
        Ok(Self { lock, orphan_ns, before, next_look_ns: AtomicU64::new(0), since_ns: AtomicU64::new(0) })
    }

    /// Whether to leave: nobody has held the lock for long enough, and whoever sends to this process has left.
    pub(crate) fn abandoned(&self) -> bool {
        let now_ns = clock::now_ns();
        if now_ns >= self.next_look_ns.load(Ordering::Relaxed) {
            self.next_look_ns.store(now_ns + LOOK_NS, Ordering::Relaxed);
            self.look(now_ns);
        }
        let since_ns = self.since_ns.load(Ordering::Relaxed);
        since_ns > 0 && now_ns.saturating_sub(since_ns) >= self.orphan_ns && self.is_next_to_leave(now_ns)
    }

    fn look(&self, now_ns: u64) {
        if flock(&self.lock, FlockOperation::NonBlockingLockShared).is_err() {
            self.since_ns.store(0, Ordering::Relaxed);
            return;
        }
        let _ = flock(&self.lock, FlockOperation::Unlock);
        if self.since_ns.load(Ordering::Relaxed) == 0 {
            self.since_ns.store(now_ns, Ordering::Relaxed);
        }
    }

    fn is_next_to_leave(&self, now_ns: u64) -> bool {
        self.before.as_ref().is_none_or(|page| {
            page.state() == State::Stopped || now_ns.saturating_sub(page.heartbeat_ns.get()) >= GONE_NS
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guardian(dir: &std::path::Path, orphan_ns: u64) -> Guardian {
        let before = PageMap::create(&dir.join("before.page")).unwrap();
        before.beat(clock::now_ns() + 60_000_000_000);
        Guardian {
            lock: File::create(dir.join("lock")).unwrap(),
            orphan_ns,
            before: Some(before),
            next_look_ns: AtomicU64::new(0),
            since_ns: AtomicU64::new(0),
        }
    }

    #[test]
    fn a_stage_stays_while_the_lock_is_held_and_leaves_after_the_one_before_it() {
        let dir = tempfile::tempdir().unwrap();
        let sut = guardian(dir.path(), 0);
        let holder = File::open(dir.path().join("lock")).unwrap();
        flock(&holder, FlockOperation::LockExclusive).unwrap();
        sut.before.as_ref().unwrap().set_state(State::Stopped);
        assert!(!sut.abandoned());

        drop(holder);
        assert!(!sut.abandoned(), "it looks again only when it is time");
        sut.next_look_ns.store(0, Ordering::Relaxed);
        assert!(sut.abandoned());
        sut.before.as_ref().unwrap().set_state(State::Running);
        assert!(!sut.abandoned(), "the one before still sends");
        sut.before.as_ref().unwrap().beat(0);
        assert!(sut.abandoned(), "the one before is dead");
    }

    #[test]
    fn a_successor_in_time_keeps_the_stage() {
        let dir = tempfile::tempdir().unwrap();
        let sut = guardian(dir.path(), u64::MAX);
        assert!(!sut.abandoned());
        assert_ne!(sut.since_ns.load(Ordering::Relaxed), 0);
        let holder = File::open(dir.path().join("lock")).unwrap();
        flock(&holder, FlockOperation::LockExclusive).unwrap();
        sut.next_look_ns.store(0, Ordering::Relaxed);
        assert!(!sut.abandoned());
        assert_eq!(sut.since_ns.load(Ordering::Relaxed), 0);
    }
}
