//! What can happen in a chain, by number: the dictionary, the record of one event, the log of a run.

mod dictionary;
mod event;
mod log;

pub use dictionary::{DICTIONARY, Entry, EventId, Severity};
pub use event::{CHAIN, Event};
pub use log::{Log, LogError};
