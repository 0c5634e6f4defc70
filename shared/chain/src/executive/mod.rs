//! `executive.toml`: what is watched while a chain runs, and what is done about it. As written ([`ExecutiveFile`]) and as
//! checked ([`Executive`]).

mod check;
mod file;

pub use check::{Executive, ExecutiveError};
pub use file::{
    Action, ChainBudgetFile, Condition, EventsFile, ExecutiveFile, HealthFile, LimitFile, RuleFile, SupervisorFile,
    Watch,
};
