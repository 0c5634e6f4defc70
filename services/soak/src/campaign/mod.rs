//! What is done to the chain while it is looked at, besides nothing.

mod conduct;
mod cycles;
mod day;
mod file;
mod kill_all;
mod kills;
mod modes;

pub(crate) use conduct::Conductor;
pub use cycles::Cycle;
pub(crate) use cycles::cycles;
pub use day::Step;
pub(crate) use day::{afterwards, day};
pub use file::{Campaign, CyclesFile, DayFile, KillAllFile, KillsFile, ModeChangesFile, StepFile};
pub(crate) use kill_all::kill_all;
pub(crate) use kills::kills;
pub(crate) use modes::ModeChanges;
