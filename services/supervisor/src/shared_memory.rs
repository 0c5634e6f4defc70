//! Whether the chain's files in shared memory are still there: somebody may have cleaned up, as systemd does at a user's last
//! logout (`RemoveIPC`). Who has them mapped goes on; who comes later finds nothing, or makes others of the same name.

use std::collections::BTreeSet;

/// Files of services: there from the first process to the last.
const OF_SERVICES: &str = ".dynamic";
/// Files of writers: there as long as their process.
const OF_WRITERS: &str = ".data";

/// The files at the last look.
#[derive(Default)]
pub(crate) struct SharedMemory {
    services: BTreeSet<String>,
    writers: BTreeSet<String>,
    /// Sum of all lives at that look.
    lives: u64,
}

impl SharedMemory {
    /// How many files have gone since the last look that should be there. `lives` is a number that changes when a process
    /// starts or ends: those of writers may come and go with it.
    pub(crate) fn gone(&mut self, names: Vec<String>, lives: u64) -> usize {
        let (mut services, mut writers) = (BTreeSet::new(), BTreeSet::new());
        for name in names {
            if name.ends_with(OF_SERVICES) {
                services.insert(name);
            } else if name.ends_with(OF_WRITERS) {
                writers.insert(name);
            }
        }
        let mut gone = self.services.difference(&services).count();
        if lives == self.lives {
            gone += self.writers.difference(&writers).count();
        }
        (self.services, self.writers, self.lives) = (services, writers, lives);
        gone
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
        assert_eq!(sut.gone(names(&["a.dynamic", "v.data"]), 6), 0, "a writer died, and another one came");
        assert_eq!(sut.gone(names(&["a.dynamic", "v.data"]), 6), 0);
        assert_eq!(sut.gone(names(&["a.dynamic", "v.data", "b.dynamic"]), 6), 0);
    }

    #[test]
    fn what_goes_while_all_live_was_deleted() {
        let mut sut = SharedMemory::default();
        sut.gone(names(&["a.dynamic", "w.data", "c.connection"]), 5);
        assert_eq!(sut.gone(names(&["a.dynamic"]), 5), 1);
        assert_eq!(sut.gone(names(&[]), 6), 1, "a service lives as long as the chain");
        assert_eq!(sut.gone(names(&[]), 6), 0, "each is told once");
    }
}
