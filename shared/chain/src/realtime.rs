//! What a chain asks of the kernel's scheduler and memory. Whether the kernel grants it is known only when it is asked:
//! here stands what may be asked at all.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::{ChainError, ChainFile};

/// Name of the supervisor among the processes of a chain.
pub const SUPERVISOR: &str = "supervisor";

/// Name of the source among them.
const SOURCE: &str = "source";

/// Highest priority under SCHED_FIFO (sched(7)).
const MAX_PRIORITY: u32 = 99;
/// Cores that a set of cores can name (CPU_SETSIZE).
const MAX_CORES: u32 = 1024;

/// `[realtime]` as written: what holds for every process of the chain.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RealtimeFile {
    /// Keep memory that was once touched from being paged out.
    pub lock_memory: bool,
    /// Touch stack and heap reserve before the first part.
    pub prefault: bool,
    /// Where the supervisor runs.
    pub supervisor: Option<SeatFile>,
}

/// `realtime = { … }` of one process as written.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SeatFile {
    /// The one core that it may use, counted from 0; none: any.
    pub core: Option<u32>,
    /// Priority under SCHED_FIFO, 1 to 99; 0 or none: ordinary scheduling.
    pub priority: Option<u32>,
}

/// What is asked of the kernel, checked.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Realtime {
    /// Keep memory that was once touched from being paged out.
    pub lock_memory: bool,
    /// Touch stack and heap reserve before the first part.
    pub prefault: bool,
    /// Seats of the processes that ask for one, by name: `source`, a stage, `supervisor`.
    pub seats: BTreeMap<String, Seat>,
}

/// Where one process's working thread runs.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
pub struct Seat {
    /// The one core that it may use; none: any.
    pub core: Option<u32>,
    /// Priority under SCHED_FIFO, 1 to 99; 0: ordinary scheduling.
    pub priority: u32,
}

impl Realtime {
    pub(crate) fn checked(file: &ChainFile) -> Result<Self, ChainError> {
        let table = file.realtime.as_ref();
        let stages = file.stages.iter().map(|stage| (stage.name.as_str(), stage.realtime));
        let written = [(SUPERVISOR, table.and_then(|table| table.supervisor)), (SOURCE, file.source.realtime)];
        let mut seats = BTreeMap::new();
        for (process, seat) in written.into_iter().chain(stages) {
            let seat = seat.unwrap_or_default();
            let seat = Seat { core: seat.core, priority: seat.priority.unwrap_or(0) };
            let refused =
                |key, value, expected| Err(ChainError::Realtime { process: process.to_owned(), key, value, expected });
            if seat.priority > MAX_PRIORITY {
                return refused("priority", seat.priority, "0 (ordinary scheduling) to 99");
            }
            if let Some(core) = seat.core.filter(|core| *core >= MAX_CORES) {
                return refused("core", core, "0 to 1023");
            }
            if seat != Seat::default() {
                seats.insert(process.to_owned(), seat);
            }
        }
        let (lock_memory, prefault) = table.map_or((false, false), |table| (table.lock_memory, table.prefault));
        Ok(Self { lock_memory, prefault, seats })
    }

    /// Where a process runs.
    pub fn seat(&self, process: &str) -> Seat {
        self.seats.get(process).copied().unwrap_or_default()
    }

    /// Whether anything is asked.
    pub fn asks(&self) -> bool {
        *self != Self::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHIPPED: &str = include_str!("../../../config/chain.toml");

    fn checked(from: &str, to: &str) -> Result<Realtime, String> {
        let text = SHIPPED.replacen(from, to, 1);
        assert_ne!(text, SHIPPED, "{from:?} stands in chain.toml");
        let chain = ChainFile::parse(&text).and_then(ChainFile::checked);
        chain.map(|chain| chain.realtime).map_err(|error| error.to_string())
    }

    #[test]
    fn the_shipped_chain_asks_for_nothing() {
        let chain = ChainFile::parse(SHIPPED).unwrap().checked().unwrap();
        assert!(!chain.realtime.asks());
    }

    #[test]
    fn a_seat_is_found_by_the_name_of_its_process() {
        let at = "parameters = \"stages/clusterer.toml\"";
        let realtime = checked(at, &format!("{at}\nrealtime = {{ core = 1, priority = 40 }}")).unwrap();
        assert!(realtime.asks());
        assert_eq!(realtime.seat("clusterer"), Seat { core: Some(1), priority: 40 });
        assert_eq!(realtime.seat("extractor"), Seat::default());
        let realtime = checked("prefault = false", "prefault = false\nsupervisor = { priority = 50 }").unwrap();
        assert_eq!(realtime.seat(SUPERVISOR).priority, 50);
        let realtime = checked("sweeps = 100", "sweeps = 100\nrealtime = { priority = 10 }").unwrap();
        assert_eq!(realtime.seat(SOURCE).priority, 10);
    }

    #[test]
    fn a_seat_that_no_kernel_has_is_refused_by_process_and_key() {
        let seat = |seat: &str| checked("sweeps = 100", &format!("sweeps = 100\nrealtime = {seat}")).unwrap_err();
        assert!(seat("{ priority = 100 }").contains("source: realtime.priority is 100, must be 0"));
        assert!(seat("{ core = 1024 }").contains("source: realtime.core is 1024, must be 0 to 1023"));
        assert!(seat("{ priority = -1 }").contains("-1"));
        assert!(seat("{ prio = 1 }").contains("unknown field `prio`"));
        assert!(checked("prefault = false", "prefault = 3").unwrap_err().contains("prefault"));
        assert!(checked("prefault = false", "").unwrap_err().contains("prefault"));
    }
}
