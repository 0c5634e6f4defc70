use serde::{Deserialize, Serialize};

use crate::{EventId, Severity};

/// Whom an event is said of that concerns no single process.
pub const CHAIN: &str = "chain";

/// Something that happened: one line of the log.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Event {
    /// Place in the log, from 0, without gaps.
    pub number: u64,
    /// Host time [ns].
    pub time_ns: u64,
    /// Time of day [ns since 1970], as far as the machine knew it.
    pub utc_ns: u64,
    /// Number in the dictionary.
    pub id: u32,
    /// Its word there.
    pub name: String,
    /// How grave it is.
    pub severity: Severity,
    /// The process that it is about, or [`CHAIN`].
    pub stage: String,
    /// The sweep that the source was at.
    pub sweep: u64,
    /// What happened, one line.
    pub text: String,
    /// Events of this id and process that were left unsaid since the last one that was said.
    pub unsaid: u64,
}

impl Event {
    /// Its entry in the dictionary; none in a log of another version.
    pub fn event_id(&self) -> Option<EventId> {
        EventId::from_number(self.id)
    }
}
