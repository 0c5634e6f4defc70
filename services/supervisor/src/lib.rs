//! Creates the services, starts the stages, watches them, restarts them, settles their accounts, and says at the end
//! where every part went.
//!
//! Reading order: [`run`] → `watch` (the loop) → `processes` → `restarts` (after a death) → `control`, `modes` (what it is told) →
//! `executive` (what it finds by itself) → `ending` → `report` (the account and all else). `house` is what it begins with, or adopts.

mod control;
mod ending;
mod error;
mod executive;
mod house;
mod manager;
mod modes;
mod processes;
mod report;
mod restarts;
mod telling;
mod watch;

pub use control::{Answer, Command, CommandsReport, ControlError, MAX_LINE_BYTES, Tables, Word, await_tables, command};
pub use error::SupervisorError;
pub use house::remains::stage_process;
pub use house::{Running, find_adoptable, running_instances};
pub use modes::overload::{Move, OverloadReport};
pub use modes::steering::SafeReport;
pub use modes::{By, ModesReport};
pub use processes::beside::RecordingReport;
pub use processes::machine::{CpuTimes, MachineLoad};
pub use processes::noise::measure_noise;
pub use processes::usage::ProcessReport;
pub use report::events_report::EventsReport;
pub use report::ledger::{GapReport, HopReport, LedgerReport};
pub use report::status::{StageStatus, Status, status};
pub use report::summary::summary;
pub use report::timeline_report::{Event, MachineTimeline, ProcessTimeline, TimelineReport};
pub use report::{DeadlineReport, LEAST_MARGIN_PCT, LatencyReport, Report, StageLatency, TraceReport, VerdictReport};
pub use watch::{Settings, run};
