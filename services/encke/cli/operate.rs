//! Options of the commands that act on a running chain.

use std::time::Duration;

use clap::{Args, ValueEnum};

use super::parse_duration;

/// A fault that can be put into a running chain.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Fault {
    Kill,
    Stop,
    Slow,
    Swallow,
}

/// Options of `encke inject`.
#[derive(Args, Clone, Debug)]
pub(crate) struct InjectArgs {
    /// The fault.
    #[arg(value_enum)]
    pub(crate) fault: Fault,
    /// The stage.
    pub(crate) stage: String,
    /// stop: for how long.
    #[arg(long = "for", value_name = "TIME", default_value = "500ms", value_parser = parse_duration)]
    pub(crate) length: Duration,
    /// slow: by how much each sweep.
    #[arg(long, value_name = "TIME", default_value = "20ms", value_parser = parse_duration)]
    pub(crate) by: Duration,
    /// The chain. [default: the only one that runs]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
}

/// What to ask of a running chain.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Request {
    /// Its mode, its stages and their counts.
    Status,
    /// Stop in order, drain, report.
    Stop,
    /// With --pace step: one more sweep.
    Step,
}

/// Options of `encke ctl`.
#[derive(Args, Clone, Debug)]
pub(crate) struct CtlArgs {
    /// What to do.
    #[arg(value_enum)]
    pub(crate) request: Request,
    /// The chain. [default: the only one that runs]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}
