//! The shell round a stage, written once: wait, stamp, process, send, count.
//!
//! [`run_stage`], [`run_source`] and [`run_sink`] are the three main loops; [`run_tap`] reads along beside them. Each has the same order for a part, and the
//! order is what makes the ledger close after a sudden death at any point (see [`page`]):
//! receive → in hand → process → send → published → counted → out of hand → release.

pub mod clock;
mod cycle;
mod deadline;
mod error;
pub mod faults;
mod guardian;
mod kept;
pub mod logging;
mod pacer;
pub mod page;
mod plan;
mod reader;
pub mod realtime;
mod refused;
mod run_delay;
mod shell;
mod shutdown;
mod sink;
mod source;
mod stand_in;
mod tables;
mod tap;
mod window;

pub use cycle::run_stage;
pub use error::ShellError;
pub use plan::{Outputs, Pace, Plan, SOURCE, SourcePlan, TAPE};
pub use run_delay::RunDelay;
pub use shell::{AllocationCount, Shell};
pub use shutdown::{Shutdown, ignore_file_limit, stop_signals};
pub use sink::run_sink;
pub use source::run_source;
pub use stand_in::run_stand_in;
pub use tap::run_tap;
