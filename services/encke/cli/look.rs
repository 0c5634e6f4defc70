//! Options of the commands that look at a run: while it goes on, or afterwards.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};

use super::parse_duration;

/// Options of `encke report`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ReportArgs {
    /// A report of `encke run --report`, or a recording of `encke run --record`; found by content.
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// The page; - is standard output. [default: FILE with the ending .html]
    #[arg(long, value_name = "FILE.html", conflicts_with = "json")]
    pub(crate) out: Option<PathBuf>,
    /// Print the figures as JSON instead: those of a recording are worked out from it.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Options of `encke ctl events`.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub(crate) struct EventsArgs {
    /// events: go on with what happens, until the chain ends.
    #[arg(long)]
    pub(crate) follow: bool,
    /// events: only from this number on.
    #[arg(long, value_name = "NUMBER")]
    pub(crate) since: Option<u64>,
    /// events: only those that are at least so grave.
    #[arg(long, value_enum, value_name = "HOW")]
    pub(crate) severity: Option<SeverityArg>,
    /// events: of a file that `encke run --events` wrote, instead of a running chain.
    #[arg(long, value_name = "FILE.jsonl", conflicts_with = "instance")]
    pub(crate) file: Option<PathBuf>,
    /// events: print what can happen, as a table, instead.
    #[arg(long, conflicts_with_all = ["follow", "since", "severity", "file", "instance"])]
    pub(crate) dictionary: bool,
}

/// `--severity`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SeverityArg {
    Info,
    Warning,
    Error,
    Critical,
}

/// Options of `encke metrics`.
#[derive(Args, Clone, Debug)]
pub(crate) struct MetricsArgs {
    /// Address and port to listen on; port 0 is any that is free.
    #[arg(long, value_name = "ADDR:PORT", default_value = "127.0.0.1:9464")]
    pub(crate) listen: std::net::SocketAddr,
    /// The chain. [default: the only one that runs]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Allow an address that others than this machine can reach; they see the chain, without password and encryption.
    #[arg(long)]
    pub(crate) anywhere: bool,
}

/// Options of `encke top`.
#[derive(Args, Clone, Debug)]
pub(crate) struct TopArgs {
    /// The chain. [default: the only one that runs]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Between two looks.
    #[arg(long, value_name = "TIME", default_value = "500ms", value_parser = parse_duration)]
    pub(crate) interval: Duration,
    /// Print one snapshot, taken over two intervals, and leave.
    #[arg(long)]
    pub(crate) once: bool,
    /// Print the snapshot as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Options of `encke live`.
#[derive(Args, Clone, Debug)]
pub(crate) struct LiveArgs {
    /// The chain. [default: the only one that runs]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Address to listen on; whoever reaches another than this machine's own sees the chain.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1")]
    pub(crate) bind: String,
    /// Port to listen on; 0 is any that is free.
    #[arg(long, default_value_t = 8765)]
    pub(crate) port: u16,
    /// When the chain ends, wait for its next start.
    #[arg(long)]
    pub(crate) wait: bool,
    /// Print where the messages went as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Options of `encke view`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ViewArgs {
    /// A recording of Encke's: `encke run --record FILE.mcap`.
    #[arg(value_name = "FILE.mcap", required_unless_present = "live")]
    pub(crate) file: Option<PathBuf>,
    /// Serve what a running chain sees instead; it neither waits for that nor knows of it.
    #[arg(long, conflicts_with_all = ["file", "out", "first", "sweeps", "every", "limit_mb"])]
    pub(crate) live: bool,
    /// The chain. [default: the only one that runs]
    #[arg(long, value_name = "NAME", requires = "live")]
    pub(crate) instance: Option<String>,
    /// The page. [default: the recording's name with .html]
    #[arg(long, value_name = "PAGE.html")]
    pub(crate) out: Option<PathBuf>,
    /// Serve the page and its sweeps instead, until stopped; only to this machine unless another address is given.
    #[arg(long, value_name = "ADDR:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:0")]
    #[arg(conflicts_with_all = ["out", "limit_mb"])]
    pub(crate) serve: Option<std::net::SocketAddr>,
    /// Leave out so many sweeps at the start.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) first: usize,
    /// Look at so many sweeps from there. [default: all]
    #[arg(long, value_name = "N")]
    pub(crate) sweeps: Option<usize>,
    /// Show every K-th of them.
    #[arg(long, value_name = "K", default_value_t = 1)]
    pub(crate) every: usize,
    /// Show at most so many returns of a sweep. [default: all]
    #[arg(long, value_name = "N")]
    pub(crate) points: Option<usize>,
    /// Most that the sweeps in a written page may take [MB].
    #[arg(long, value_name = "MB", default_value_t = 40)]
    pub(crate) limit_mb: usize,
    /// Open it in the browser.
    #[arg(long)]
    pub(crate) open: bool,
}
