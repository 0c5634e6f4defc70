//! Commands to a running chain: one JSON object a line through a socket in the instance's folder, one JSON object back.

mod client;
pub(crate) mod commands;
mod in_use;
mod lines;
mod rate;
mod reload;
mod server;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use transport::Instance;

pub use client::{ControlError, command};
pub use in_use::await_tables;
pub(crate) use server::{Asked, Server};

/// Longest line of either side [bytes], its end included.
pub const MAX_LINE_BYTES: usize = 1 << 20;

/// What can be asked of a running chain.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Word {
    /// The source stands still between two sweeps; all processes wait.
    Pause,
    /// Out of the pause; where there is none, all of its work again, and another chance for every stage.
    Resume,
    /// One step of the ladder more is left out.
    Degrade,
    /// The least that is useful.
    Safe,
    /// One stage's process is ended and started again.
    Restart,
    /// All of them.
    RestartChain,
    /// Other parameters from some sweep on.
    Reload,
}

/// A command.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
    /// What is asked.
    pub command: Word,
    /// Of which stage; [`Word::Restart`] alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<String>,
    /// With what; [`Word::Reload`] alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tables: Option<Tables>,
}

/// Texts of configuration files, for a chain that runs.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Tables {
    /// Of each stage's parameters, by the stage's name.
    pub parameters: BTreeMap<String, String>,
    /// Of `executive.toml`.
    pub executive: String,
}

/// What became of a command.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize)]
pub struct Answer {
    /// Whether it is carried out.
    pub accepted: bool,
    /// How, or why not: one line.
    pub text: String,
}

/// Commands in a run.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
pub struct CommandsReport {
    /// Carried out.
    pub accepted: u64,
    /// Refused: wrong, too long, too many, or of another user.
    pub refused: u64,
}

impl Command {
    /// A command that says all by its word.
    pub fn of(command: Word) -> Self {
        Self { command, stage: None, tables: None }
    }
}

impl Word {
    /// The command's word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Degrade => "degrade",
            Self::Safe => "safe",
            Self::Restart => "restart",
            Self::RestartChain => "restart-chain",
            Self::Reload => "reload",
        }
    }
}

impl Answer {
    pub(crate) fn yes(text: impl Into<String>) -> Self {
        Self { accepted: true, text: text.into() }
    }

    pub(crate) fn no(text: impl Into<String>) -> Self {
        Self { accepted: false, text: text.into() }
    }
}

/// Where an instance's commands go.
fn socket_path(instance: &Instance) -> PathBuf {
    instance.dir().join("control")
}
