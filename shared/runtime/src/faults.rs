//! Faults that a stage's own process has on purpose, asked for on its page (`encke inject`).
//!
//! Without one they cost one look at a word of the page a part and a turn of the loop. Each is had at a moment at which the
//! ledger can be closed: with a part in hand, before anything of it is sent.

use std::hint::black_box;

use events::EventId;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::page::{Page, Said};
use crate::{Shell, clock};

/// Events that a storm says [1/s].
pub const STORM_PER_S: u64 = 10_000;
/// Memory that a process may still get when its heap is to be exhausted [bytes]: little, so that the machine has no part in it.
const HEAP_LEFT: u64 = 64 << 20;
const CHUNK: usize = 1 << 20;

/// A fault of the shell, by its number in the catalogue of faults. Numbers from [`FIRST_OF_SWEEPS`] on are for the source
/// to make of its sweeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum ShellFault {
    /// Panics with a message held and another loaned.
    Panic = 10,
    /// Waits for what never comes.
    Deadlock = 11,
    /// Computes without end.
    Spin = 12,
    /// Computes so many times as long.
    SlowTimes = 13,
    /// Dies with the next part, and at each start of a tier up to the one named.
    CrashLoop = 14,
    /// Asks for memory until there is none for it.
    HeapExhaustion = 15,
    /// Says events without end.
    EventStorm = 16,
}

/// First number of the faults that change what the source sends.
pub const FIRST_OF_SWEEPS: u64 = 100;

impl ShellFault {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Panic,
        Self::Deadlock,
        Self::Spin,
        Self::SlowTimes,
        Self::CrashLoop,
        Self::HeapExhaustion,
        Self::EventStorm,
    ];

    fn from_number(number: u64) -> Option<Self> {
        Self::ALL.into_iter().find(|fault| *fault as u64 == number)
    }
}

/// A fault as it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    /// Its number in the catalogue.
    pub number: u64,
    /// How strong it is; what that means is the fault's.
    pub by: i32,
    /// Of what is random in it.
    pub seed: u32,
    /// How often it is to be had; a storm: events.
    pub times: u64,
}

impl Page {
    /// Asks the page's process for a fault; replaces what was asked before.
    pub fn ask_for(&self, asked: Asked) {
        self.fault.set(0);
        self.fault_argument.set(u64::from(asked.seed) << 32 | u64::from(asked.by as u32));
        self.fault_left.set(asked.times);
        // Last: whoever sees the number sees the rest.
        self.fault.set(asked.number);
    }

    /// Asks for no fault any more.
    pub fn ask_for_none(&self) {
        self.fault.set(0);
        self.fault_left.set(0);
    }

    /// What is asked for; none where that is nothing.
    fn asked(&self) -> Option<Asked> {
        let number = self.fault.get();
        let (argument, times) = (self.fault_argument.get(), self.fault_left.get());
        (number > 0).then_some(Asked { number, by: argument as u32 as i32, seed: (argument >> 32) as u32, times })
    }

    /// Counts one time of what is asked for; with the last the fault is over. False where it was already.
    fn have_once(&self) -> bool {
        let some = self.fault_left.take_one();
        if self.fault_left.get() == 0 {
            self.fault.set(0);
        }
        some
    }
}

impl Shell {
    /// The fault that holds for the sweep that the source has made; each is counted down.
    pub fn sweep_fault(&self) -> Option<Asked> {
        if self.page.fault.get() < FIRST_OF_SWEEPS {
            return None;
        }
        let asked = self.page.asked()?;
        self.page.have_once().then(|| {
            self.say_fault(asked);
            asked
        })
    }

    /// Has a fault that is to be had with a part in hand.
    pub(crate) fn fault_in_hand(&self) {
        if self.page.fault.get() > 0 {
            self.have_fault();
        }
    }

    #[cold]
    fn have_fault(&self) {
        let Some(asked) = self.page.asked() else { return };
        let Some(fault) = ShellFault::from_number(asked.number) else { return };
        match fault {
            ShellFault::SlowTimes | ShellFault::EventStorm => return,
            // The part in hand is the first to die with; the starts are counted.
            ShellFault::CrashLoop if self.dies_at_start(asked) => {}
            ShellFault::CrashLoop => return,
            _ if !self.page.have_once() => return,
            _ => {}
        }
        self.say_fault(asked);
        match fault {
            ShellFault::Panic => panic!("a fault on purpose, with a part in hand"),
            ShellFault::Deadlock => loop {
                std::thread::park();
            },
            ShellFault::Spin => loop {
                black_box(clock::now_ns());
            },
            ShellFault::HeapExhaustion => exhaust_heap(),
            _ => std::process::abort(),
        }
    }

    /// Dies, where it is to die at each start.
    pub(crate) fn fault_at_start(&self) {
        let Some(asked) = self.page.asked() else { return };
        if asked.number == ShellFault::CrashLoop as u64 && self.dies_at_start(asked) && self.page.have_once() {
            self.say_fault(asked);
            std::process::abort();
        }
    }

    /// Whether this life is of a tier that a crash loop ends.
    fn dies_at_start(&self, asked: Asked) -> bool {
        self.page.tier.get() as i64 <= i64::from(asked.by)
    }

    /// Makes work that began at `started_ns` as many times as long as is asked for, by computing.
    pub(crate) fn toil(&self, started_ns: u64) {
        if self.page.fault.get() != ShellFault::SlowTimes as u64 {
            return;
        }
        let factor = self.page.asked().map_or(1, |asked| asked.by.max(1) as u64);
        let end_ns = started_ns + (clock::now_ns() - started_ns).saturating_mul(factor);
        while black_box(clock::now_ns()) < end_ns {}
    }

    /// Shows that the working thread is alive; in a storm, says what there is to say since it did so last.
    pub(crate) fn beat(&self) {
        let now_ns = clock::now_ns();
        if self.page.fault.get() == ShellFault::EventStorm as u64 {
            self.storm(now_ns);
        }
        self.page.beat(now_ns);
    }

    #[cold]
    fn storm(&self, now_ns: u64) {
        let Some(asked) = self.page.asked() else { return };
        let since_ns = now_ns.saturating_sub(self.page.heartbeat_ns.get());
        let said = (since_ns * STORM_PER_S / 1_000_000_000).min(asked.times);
        (0..said).for_each(|_| self.say_fault(asked));
        self.page.fault_left.set(asked.times - said);
        if said == asked.times {
            self.page.fault.set(0);
        }
    }

    fn say_fault(&self, asked: Asked) {
        let sweep = self.page.next_ordinal_out.get() / u64::from(self.plan.chain.sectors.max(1));
        let (a, b) = (asked.number, u64::from(asked.by.unsigned_abs()));
        self.page.say(Said { id: EventId::FaultInjected, time_ns: clock::now_ns(), sweep, a, b });
    }
}

/// Lowers this process's own limit to a little above what it has mapped, and asks for memory until that is reached.
fn exhaust_heap() -> ! {
    let mapped = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = mapped.split(' ').next().and_then(|pages| pages.parse::<u64>().ok()).unwrap_or(0);
    let limit = pages * rustix::param::page_size() as u64 + HEAP_LEFT;
    let before = getrlimit(Resource::As);
    // Without the limit the machine would be exhausted, not this process: then nothing is asked for.
    if setrlimit(Resource::As, Rlimit { current: Some(limit), ..before }).is_ok() {
        let mut all: Vec<Vec<u8>> = Vec::new();
        loop {
            // The allocator's failure ends the process.
            all.push(black_box(vec![1; CHUNK]));
        }
    }
    std::process::abort()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::PageMap;

    #[test]
    fn a_fault_is_asked_for_had_and_over() {
        let dir = tempfile::tempdir().unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        assert_eq!(page.asked(), None);
        let asked = Asked { number: 123, by: -3_600_000, seed: u32::MAX, times: 2 };
        page.ask_for(asked);
        assert_eq!(page.asked(), Some(asked));
        assert!(page.have_once());
        assert_eq!(page.asked(), Some(Asked { times: 1, ..asked }));
        assert!(page.have_once());
        assert_eq!(page.asked(), None);
        assert!(!page.have_once());
        page.ask_for(asked);
        page.ask_for_none();
        assert_eq!(page.asked(), None);
    }

    #[test]
    fn every_fault_of_the_shell_has_its_number_below_those_of_sweeps() {
        for fault in ShellFault::ALL {
            assert_eq!(ShellFault::from_number(fault as u64), Some(fault));
            assert!((fault as u64) < FIRST_OF_SWEEPS);
        }
    }
}
