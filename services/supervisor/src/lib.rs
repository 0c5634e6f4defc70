//! Creates the services, starts the stages, watches them, restarts them, settles their accounts, and says at the end
//! where every part went.
//!
//! Reading order: [`run`] → `watch` (the loop) → `restarts`, `settle` (after a death) → `control`, `commands`, `modes` (what it is
//! told) → `ledger` (the account) → `report`.

mod adopting;
mod beside;
mod budget;
mod child;
mod closing;
mod commands;
mod control;
mod ending;
mod error;
mod events_report;
mod executive;
mod house;
mod ledger;
mod lives;
mod machine;
mod manager;
mod modes;
mod noise;
mod overload;
mod processes;
mod progress;
mod reload;
mod remains;
mod renewal;
mod report;
mod restarts;
mod scheduling;
mod services;
mod settle;
mod shared_memory;
mod status;
mod steering;
mod summary;
mod telling;
mod timeline;
mod timeline_report;
mod watch;

pub use beside::RecordingReport;
pub use control::{Answer, Command, CommandsReport, ControlError, MAX_LINE_BYTES, Tables, Word, await_tables, command};
pub use error::SupervisorError;
pub use events_report::EventsReport;
pub use house::{Running, find_adoptable, running_instances};
pub use ledger::{GapReport, HopReport, LedgerReport};
pub use machine::{CpuTimes, MachineLoad};
pub use modes::{By, ModesReport};
pub use noise::measure_noise;
pub use overload::{Move, OverloadReport};
pub use processes::ProcessReport;
pub use remains::stage_process;
pub use report::{DeadlineReport, LEAST_MARGIN_PCT, LatencyReport, Report, StageLatency, TraceReport, VerdictReport};
pub use status::{StageStatus, Status, status};
pub use steering::SafeReport;
pub use summary::summary;
pub use timeline_report::{Event, MachineTimeline, ProcessTimeline, TimelineReport};
pub use watch::{Settings, run};
