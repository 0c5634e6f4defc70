//! `chain.toml`, the topology: as written ([`ChainFile`]) and as checked ([`Chain`]); and [`executive`], what is watched while
//! it runs.
//!
//! The chain is linear: a source, stages that each read what the one before writes, a sink. Nothing else can be said
//! in the file, and what contradicts it is refused: a stage that skips one, a loop, a reader of the truth.

mod check;
pub mod executive;
mod file;
mod mode;
mod overload;
mod realtime;

pub use check::{Chain, ChainError, RestartBudget, Wired};
pub use file::{ChainFile, OverloadFile, SourceFile, StageFile};
pub use mode::Mode;
pub use overload::Overload;
pub use realtime::{Realtime, RealtimeFile, SUPERVISOR, Seat, SeatFile};
