//! Whether the chain's files in shared memory are still there: somebody may have cleaned up, as systemd does at a user's last
//! logout (`RemoveIPC`). Who has them mapped goes on; who comes later finds nothing, or makes others of the same name.

use std::collections::BTreeSet;

use crate::processes::child::Watched;
use crate::restarts::lives::Lives;
use crate::watch::Watch;

/// Files of services: there from the first process to the last.
const OF_SERVICES: &str = ".dynamic";
/// Files of writers: there as long as their process.
const OF_WRITERS: &str = ".data";

/// Between two looks [ns].
const LOOK_NS: u64 = 500_000_000;

/// The files that should be there.
#[derive(Default)]
pub(crate) struct SharedMemory {
    services: BTreeSet<String>,
    writers: BTreeSet<String>,
    /// Sum of all lives when those of writers were noted.
    lives: u64,
    /// Were missing at the last look. A process that leaves takes its files with it a moment before it is seen to have left.
    missing: BTreeSet<String>,
    next_look_ns: u64,
    /// Files were deleted, and all processes are to have new ones.
    pub(crate) is_to_be_renewed: bool,
}

impl SharedMemory {
    /// Whether it is time to look again.
    pub(crate) fn is_due(&mut self, now_ns: u64) -> bool {
        let due = now_ns >= self.next_look_ns;
        if due {
            self.next_look_ns = now_ns + LOOK_NS;
        }
        due
    }

    /// How many files that should be there were missing at this look and at the one before. `lives` is a number that changes
    /// when a process starts or is settled: files of writers may come and go with it.
    pub(crate) fn gone(&mut self, names: Vec<String>, lives: u64) -> usize {
        let names: BTreeSet<String> = names.into_iter().collect();
        if lives != self.lives {
            (self.writers, self.lives) = (BTreeSet::new(), lives);
        }
        let expected = self.services.union(&self.writers);
        let missing: BTreeSet<String> = expected.filter(|name| !names.contains(*name)).cloned().collect();
        let gone = missing.intersection(&self.missing).count();
        self.missing = missing;
        self.services.extend(names.iter().filter(|name| name.ends_with(OF_SERVICES)).cloned());
        self.writers.extend(names.into_iter().filter(|name| name.ends_with(OF_WRITERS)));
        gone
    }

    /// How many files of services that should be there are missing. No process takes these with it.
    pub(crate) fn missing_services(&self, names: &[String]) -> usize {
        self.services.iter().filter(|service| !names.contains(*service)).count()
    }
}

impl Watch<'_> {
    /// Looks whether files of the chain in shared memory were deleted: a process that starts later could not join it, because
    /// services can be created anew only when nobody has the old ones.
    pub(crate) fn look_for_files(&mut self, now_ns: u64) {
        let is_leaving = |(stage, lives): (&Watched, &Lives)| stage.told && !lives.is_given_up();
        let leave = self.stop_asked || self.failed.is_some() || self.stages.iter().zip(&self.lives).any(is_leaving);
        if !self.begun
            || self.renewing
            || leave
            || self.shared_memory.is_to_be_renewed
            || !self.shared_memory.is_due(now_ns)
        {
            return;
        }
        let beside = self.tape.iter().map(|tape| &tape.process);
        let lives = self.stages.iter().chain(beside);
        let lives = lives.map(|one| one.page.incarnation.get() + one.page.settled_incarnation.get()).sum();
        let gone = self.shared_memory.gone(self.instance.shared_memory(), lives);
        if gone > 0 {
            self.lose_shared_memory(gone);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn what_a_process_takes_with_it_is_not_gone() {
        let mut sut = SharedMemory::default();
        assert_eq!(sut.gone(names(&["a.dynamic", "w.data", "c.connection"]), 5), 0);
        assert_eq!(sut.gone(names(&["a.dynamic"]), 5), 0, "a writer has just left");
        assert_eq!(sut.gone(names(&["a.dynamic", "v.data"]), 6), 0, "another one came");
        assert_eq!(sut.gone(names(&["a.dynamic", "v.data"]), 6), 0);
        assert_eq!(sut.gone(names(&["a.dynamic", "v.data", "b.dynamic"]), 6), 0);
    }

    #[test]
    fn what_stays_away_while_all_live_was_deleted() {
        let mut sut = SharedMemory::default();
        sut.gone(names(&["a.dynamic", "w.data", "c.connection"]), 5);
        assert_eq!((sut.gone(names(&["a.dynamic"]), 5), sut.gone(names(&["a.dynamic"]), 5)), (0, 1));
        let mut sut = SharedMemory::default();
        sut.gone(names(&["a.dynamic", "w.data"]), 5);
        assert_eq!((sut.gone(names(&[]), 6), sut.gone(names(&[]), 7)), (0, 1), "a service lives as long as the chain");
    }

    #[test]
    fn services_are_missing_whoever_lives() {
        let mut sut = SharedMemory::default();
        sut.gone(names(&["a.dynamic", "b.dynamic", "w.data"]), 5);
        assert_eq!(sut.missing_services(&names(&["b.dynamic", "a.dynamic"])), 0, "a writer may have gone");
        assert_eq!(sut.missing_services(&names(&["b.dynamic", "w.data"])), 1);
    }

    #[test]
    fn looks_are_half_a_second_apart() {
        let mut sut = SharedMemory::default();
        let due = [1, 2, LOOK_NS, LOOK_NS + 1].map(|now_ns| sut.is_due(now_ns));
        assert_eq!(due, [true, false, false, true]);
    }
}
