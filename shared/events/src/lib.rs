//! What can happen in a chain, by number: the dictionary, the record of one event, the log of a run.
//!
//! Reading order: `dictionary` (what can happen) → `event` (one line) → `throttle` (which are said) → `log` (the writing end)
//! → `reader` (the reading end).

mod danger;
mod dictionary;
mod event;
mod log;
mod reader;
mod throttle;

pub use danger::Danger;
pub use dictionary::{DICTIONARY, Entry, EventId, Severity};
pub use event::{CHAIN, Event};
pub use log::{Bounds, Happened, Log, LogError};
pub use reader::Reader;
pub use throttle::Throttle;
