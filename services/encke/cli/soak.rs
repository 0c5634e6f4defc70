//! Options of `encke soak`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::{parse_duration, parse_rate};

/// Options of `encke soak`.
#[derive(Args, Clone, Debug)]
pub(crate) struct SoakArgs {
    /// How long, from the first sweep on: 10m, 2h. Not for campaigns that have a length of their own.
    #[arg(long, value_name = "TIME", value_parser = parse_duration, required_unless_present = "faults")]
    pub(crate) duration: Option<Duration>,
    /// The campaign: what is done to the chain. [default: nothing]
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) faults: Option<PathBuf>,
    /// Seed of the campaign: the same seed gives the same faults at the same times.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// A scene, or a recording, which is repeated. [default: chain.toml's]
    #[arg(long, value_name = "SOURCE")]
    pub(crate) from: Option<PathBuf>,
    /// The topology: [default: ./config/chain.toml, else the one built in]
    #[arg(long, value_name = "FILE")]
    pub(crate) chain: Option<PathBuf>,
    /// So many times as fast as the sensor was: 0.1 to 10.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = parse_rate)]
    pub(crate) rate: f64,
    /// Record it, too: DIR/recording.mcap.
    #[arg(long)]
    pub(crate) record: bool,
    /// Exit 1 also where a bar could not be judged.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Name of the chain. [default: unique to the soak]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Folder for all that is written.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Put the survival matrix into this document, too: as the section that has the campaign's name.
    #[arg(long, value_name = "FILE.md", requires = "faults")]
    pub(crate) matrix: Option<PathBuf>,
    /// Print the verdict as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}
