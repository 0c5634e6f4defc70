//! Runs the chain for a long time, does to it what a campaign asks for, looks at everything from outside, and ends with a verdict:
//! `encke soak`.
//!
//! Reading order: [`soak`] → `session` (one turn: look, sample) → `look` (what is seen) → `campaign` (what is done) →
//! `statistics`, `matrix` → `judge` (the bars) → [`Verdict`] → `page`.

mod bars;
mod campaign;
mod error;
mod injection;
mod judge;
mod look;
mod matrix;
mod page;
mod run;
mod session;
mod soak;
mod statistics;
mod verdict;

pub use bars::{Bars, BarsFile, DayBars, FaultBars, KillBars, ModeBars, NoFaultBars, StartBars};
pub use campaign::{Campaign, Cycle, CyclesFile, DayFile, KillAllFile, KillsFile, ModeChangesFile, Step, StepFile};
pub use error::SoakError;
pub use injection::Injection;
pub use look::{Growth, ProcessRecord, Steady};
pub use matrix::{Invariants, Line, Matrix, Row};
pub use page::with_section;
pub use run::Setup;
pub use soak::{Settings, soak};
pub use statistics::{Drift, Slope, Tally, WindowReport};
pub use verdict::{Available, Bar, Grave, ObserverCost, SharedMemoryRecord, Timeline, Verdict};
