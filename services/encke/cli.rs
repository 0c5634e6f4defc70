mod look;
mod notes;
mod operate;
mod soak;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
pub(crate) use look::{EventsArgs, LiveArgs, MetricsArgs, ReportArgs, SeverityArg, TopArgs, ViewArgs};
use notes::*;
pub(crate) use operate::{CtlArgs, InjectArgs, Request};
use runtime::Pace;
pub(crate) use soak::SoakArgs;

/// Onboard lidar perception for spacecraft in clutter: a chain of processes that turns lidar sweeps into classified,
/// tracked obstacles at sensor rate, with every deadline watched and every sweep accounted for.
///
/// `encke` alone runs the chain on the default scene for 100 sweeps and prints a summary.
#[derive(Parser)]
#[command(version, after_help = "Exit codes: 0 done, 1 the run itself failed, 2 could not start.")]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

impl Cli {
    /// The command; without one, `run`.
    pub(crate) fn chosen(self) -> Command {
        self.command.unwrap_or_else(|| Command::Run(Box::default()))
    }
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Run the chain on a scene or a recording.
    #[command(after_help = RUN_EXAMPLES)]
    Run(Box<RunArgs>),
    /// Be one stage of a running instance (the supervisor starts these).
    #[command(after_help = "Example:\n  encke stage clusterer --instance flight-1")]
    Stage(StageArgs),
    /// Write simulated sweeps to a file, without the chain, and the truth beside it.
    #[command(after_help = SIMULATE_EXAMPLES)]
    Simulate(SimulateArgs),
    /// Train the paper's classifiers on simulated obstacles.
    #[command(after_help = "Example:\n  encke train --plan config/training/paper.toml --out config/models")]
    Train(TrainArgs),
    /// Measure the chain's classifier, or its tracker, against bars; exit 1 where one falls short. Or repeat the paper's
    /// experiments.
    #[command(after_help = EVALUATE_NOTES)]
    Evaluate(EvaluateArgs),
    /// Time each stage's work on one sweep, without processes, on one thread.
    #[command(after_help = BENCH_NOTES)]
    Bench(BenchArgs),
    /// The reading end of `encke bench --hop`.
    #[command(hide = true)]
    BenchHopPeer(HopPeerArgs),
    /// Put one fault into a running chain, to see it accounted for.
    #[command(after_help = INJECT_EXAMPLES)]
    Inject(InjectArgs),
    /// Run the chain for long, with faults or without, and judge what that has shown.
    #[command(after_help = SOAK_NOTES)]
    Soak(Box<SoakArgs>),
    /// Look at a running chain, command it, or stop it.
    #[command(after_help = CTL_EXAMPLES)]
    Ctl(CtlArgs),
    /// Say what this machine allows the chain, and what to do about the rest.
    #[command(after_help = DOCTOR_NOTES)]
    Doctor(DoctorArgs),
    /// Make one HTML page, with plots, of a run's report or recording.
    #[command(after_help = REPORT_NOTES)]
    Report(ReportArgs),
    /// Show a running chain in the terminal.
    #[command(after_help = TOP_NOTES)]
    Top(TopArgs),
    /// Serve a running chain's counters to Prometheus, over HTTP.
    #[command(after_help = METRICS_NOTES)]
    Metrics(MetricsArgs),
    /// Serve a running chain to Foxglove, over a WebSocket.
    #[command(after_help = LIVE_NOTES)]
    Live(LiveArgs),
    /// Show a recording in a browser: cloud, obstacles, latencies. As one page that needs nothing else, or served.
    #[command(after_help = VIEW_NOTES)]
    View(ViewArgs),
}

/// Options of `encke run`.
#[derive(Args, Clone, Debug)]
pub(crate) struct RunArgs {
    /// The topology: [default: ./config/chain.toml, else the one built in]
    #[arg(long, value_name = "FILE")]
    pub(crate) chain: Option<PathBuf>,
    /// A scene (.toml), a recording (a file, a folder, a quoted pattern), or udp://ADDRESS:PORT. [default: chain.toml's]
    #[arg(long, value_name = "SOURCE")]
    pub(crate) from: Option<PathBuf>,
    /// Format of the recording, where it is not to be found by content.
    #[arg(long)]
    pub(crate) format: Option<String>,
    /// Sensor model: the stem of a file in config/sensors.
    #[arg(long, value_name = "NAME")]
    pub(crate) sensor: Option<String>,
    /// The topic of an MCAP file to read, where several hold sweeps.
    #[arg(long, value_name = "NAME")]
    pub(crate) topic: Option<String>,
    /// Of a firing that gave two returns: the strongest, or both.
    #[arg(long, value_enum, default_value_t = ReturnsArg::Strongest)]
    pub(crate) returns: ReturnsArg,
    /// Refuse returns nearer than this. [default: the sensor file's]
    #[arg(long, value_name = "M")]
    pub(crate) min_range: Option<f64>,
    /// Refuse returns farther than this. [default: the sensor file's]
    #[arg(long, value_name = "M")]
    pub(crate) max_range: Option<f64>,
    /// At sensor rate (a slow stage drops and counts), as fast as the chain goes (nothing is dropped), or the same a sweep
    /// at a time: `encke ctl step` asks for the next.
    #[arg(long, value_enum, default_value_t = PaceArg::Realtime)]
    pub(crate) pace: PaceArg,
    /// So many times as fast as the sensor was: 0.1 to 10. With --pace realtime.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = parse_rate)]
    pub(crate) rate: f64,
    /// Stop after N sweeps. [default: 100 for a scene, all of a recording]
    #[arg(long, value_name = "N", conflicts_with = "duration")]
    pub(crate) sweeps: Option<u64>,
    /// Stop after this much sensor time: 30s, 5m, 2h, forever.
    #[arg(long, value_parser = parse_span)]
    pub(crate) duration: Option<Span>,
    /// Azimuth sectors that a sweep travels as. [default: chain.toml's]
    #[arg(long, value_name = "S")]
    pub(crate) sectors: Option<u32>,
    /// Start again at the recording's end.
    #[arg(long = "loop")]
    pub(crate) repeat: bool,
    /// Seed of the scene. [default: the scene's own]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Write detections, one JSON line a sweep; - is standard output.
    #[arg(long, value_name = "FILE.jsonl")]
    pub(crate) detections: Option<PathBuf>,
    /// Write tracks, one JSON line a sweep; - is standard output.
    #[arg(long, value_name = "FILE.jsonl")]
    pub(crate) tracks: Option<PathBuf>,
    /// Write the cluster of every return: sweep,return,cluster; - is standard output.
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) labels: Option<PathBuf>,
    /// Write the way of every part through the stages, for ui.perfetto.dev; - is standard output.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) trace: Option<PathBuf>,
    /// Record sweeps, detections and more, to replay them or to look at them in Foxglove.
    #[arg(long, value_name = "FILE.mcap")]
    pub(crate) record: Option<PathBuf>,
    /// Write what happens, one JSON line an event: a copy of the log that `encke ctl events` shows; - is standard output.
    #[arg(long, value_name = "FILE.jsonl")]
    pub(crate) events: Option<PathBuf>,
    /// Write the summary as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) report: Option<PathBuf>,
    /// Name of this chain among those on the machine. [default: unique to the run]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Supervise stages that somebody else starts.
    #[arg(long)]
    pub(crate) no_spawn: bool,
    /// If the instance's supervisor died and its stages go on with the same options, take them over; else start as usual.
    #[arg(long, requires = "instance")]
    pub(crate) adopt: bool,
    /// Exit 1 on any deadline miss, drop or loss.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Print the summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

impl Default for RunArgs {
    fn default() -> Self {
        #[derive(Parser)]
        struct Bare {
            #[command(flatten)]
            args: RunArgs,
        }
        Bare::parse_from(["encke"]).args
    }
}

/// `--returns`.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ReturnsArg {
    Strongest,
    Both,
}

/// `--pace`.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum PaceArg {
    Realtime,
    Fast,
    Step,
}

impl From<PaceArg> for Pace {
    fn from(pace: PaceArg) -> Self {
        match pace {
            PaceArg::Realtime => Self::Realtime,
            PaceArg::Fast | PaceArg::Step => Self::Fast,
        }
    }
}

/// A stretch of time on the command line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Span {
    Forever,
    For(Duration),
}

fn parse_span(text: &str) -> Result<Span, String> {
    if text == "forever" {
        return Ok(Span::Forever);
    }
    let duration = parse_duration(text)?;
    if duration.is_zero() { Err("must be more than 0s".to_owned()) } else { Ok(Span::For(duration)) }
}

fn parse_rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|cause| format!("{cause}"))?;
    if (0.1..=10.0).contains(&rate) { Ok(rate) } else { Err("must be 0.1 to 10".to_owned()) }
}

pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    humantime::parse_duration(text).map_err(|cause| format!("{cause}; write 500ms, 30s, 5m or 2h"))
}

/// Options of `encke stage`.
#[derive(Args, Clone, Debug)]
pub(crate) struct StageArgs {
    /// The stage: source, clusterer, extractor, classifier, tracker, recorder.
    pub(crate) name: String,
    /// The instance that it belongs to.
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: String,
}

/// Options of `encke simulate`.
#[derive(Args, Clone, Debug)]
pub(crate) struct SimulateArgs {
    /// The scene.
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) scene: PathBuf,
    /// How many sweeps.
    #[arg(long, value_name = "N", default_value_t = 10)]
    pub(crate) sweeps: u64,
    /// Where to: a `.pcap` of HDL-32E packets, an `.mcap` of messages, or a folder of CSV files.
    #[arg(long, value_name = "X")]
    pub(crate) out: PathBuf,
    /// Seed of the scene. [default: the scene's own]
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
}

/// Options of `encke train`.
#[derive(Args, Clone, Debug)]
pub(crate) struct TrainArgs {
    /// What to train on.
    #[arg(long, value_name = "FILE.toml", default_value = "config/training/paper.toml")]
    pub(crate) plan: PathBuf,
    /// Folder for the models.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
}

/// Options of `encke evaluate`.
#[derive(Args, Clone, Debug)]
pub(crate) struct EvaluateArgs {
    /// Repeat the paper's experiments instead.
    #[arg(long, requires = "out", conflicts_with_all = ["from", "format", "sensor", "chain"])]
    pub(crate) paper: bool,
    /// Score the chain's tracks instead, on scenes in motion; with --from say what can be said of a recording's.
    #[arg(long, conflicts_with = "paper")]
    pub(crate) tracks: bool,
    /// What to look at, and the targets. [default: config/evaluation/reference.toml; with --tracks
    /// config/evaluation/tracks.toml; with --paper config/training/paper.toml]
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) plan: Option<PathBuf>,
    /// Folder for evaluate.json and evaluate.html; or tracks.json and tracks.html; or paper.json and paper.html.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Print the JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// Also say how much is claimed of this recording, whose truth is not known.
    #[arg(long, value_name = "RECORDING")]
    pub(crate) from: Option<PathBuf>,
    /// Format of the recording, where it is not to be found by content.
    #[arg(long, requires = "from")]
    pub(crate) format: Option<String>,
    /// Sensor model of the recording: the stem of a file in config/sensors.
    #[arg(long, value_name = "NAME", requires = "from")]
    pub(crate) sensor: Option<String>,
    /// Topology and parameters: [default: ./config/chain.toml, else the one built in]
    #[arg(long, value_name = "FILE")]
    pub(crate) chain: Option<PathBuf>,
}

/// Options of `encke bench`.
#[derive(Args, Clone, Debug)]
pub(crate) struct BenchArgs {
    /// Scenes (.toml) or recordings, as `encke run` takes them; one sweep of each.
    #[arg(long, value_name = "FILE", required_unless_present = "hop", num_args = 1..)]
    pub(crate) from: Vec<PathBuf>,
    /// Time the hop from process to process instead of the stages. [runs: 1000]
    #[arg(long, conflicts_with_all = ["from", "range", "min_points", "model", "format", "sensor"])]
    pub(crate) hop: bool,
    /// How often each stage is timed, after a few runs that are not.
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    #[arg(default_value_if("hop", "true", "1000"))]
    pub(crate) runs: u32,
    /// The clusterer's range d [m]. [default: its file's range_d_m]
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    pub(crate) range: Option<f32>,
    /// Clusters of fewer points get no features; under 5 none does. [default: its file's min_points]
    #[arg(long, value_name = "N")]
    pub(crate) min_points: Option<u32>,
    /// Another support vector machine for svm and paper_chain, in libsvm's format; it needs no card.
    #[arg(long, value_name = "FILE.libsvm")]
    pub(crate) model: Option<PathBuf>,
    /// Topology and parameters: [default: ./config/chain.toml, else the one built in]
    #[arg(long, value_name = "FILE")]
    pub(crate) chain: Option<PathBuf>,
    /// Format of the recordings, where it is not to be found by content.
    #[arg(long)]
    pub(crate) format: Option<String>,
    /// Sensor model of the recordings: the stem of a file in config/sensors.
    #[arg(long, value_name = "NAME")]
    pub(crate) sensor: Option<String>,
    /// Print one JSON object for each stage and sweep.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What `encke bench --hop` tells the process that it starts.
#[derive(Args, Clone, Debug)]
pub(crate) struct HopPeerArgs {
    /// The instance to read from.
    #[arg(long)]
    pub(crate) instance: String,
    /// Messages that come through shared memory; as many come through the socket.
    #[arg(long)]
    pub(crate) messages: u32,
}

/// Options of `encke doctor`.
#[derive(Args, Clone, Debug)]
pub(crate) struct DoctorArgs {
    /// Topology and parameters: [default: ./config/chain.toml, else the one built in]
    #[arg(long, value_name = "FILE")]
    pub(crate) chain: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn encke_alone_runs_the_chain() {
        let Command::Run(args) = Cli::parse_from(["encke"]).chosen() else { panic!("not run") };
        assert!(args.from.is_none() && args.sweeps.is_none() && !args.strict);
    }

    #[test]
    fn spans_are_read_as_people_write_them() {
        assert_eq!(parse_span("30s"), Ok(Span::For(Duration::from_secs(30))));
        assert_eq!(parse_span("forever"), Ok(Span::Forever));
        assert!(parse_span("0s").is_err());
        assert!(parse_span("30").is_err());
    }
}
