use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use runtime::Pace;

/// Onboard lidar perception for spacecraft in clutter: a chain of processes that turns lidar sweeps into classified
/// obstacles at sensor rate, with every deadline watched and every sweep accounted for.
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
    /// Measure the chain's classifier against its bars; exit 1 where one falls short. Or repeat the paper's experiments.
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
    /// Look at a running chain, or stop it.
    #[command(after_help = "Examples:\n  encke ctl status --json\n  encke ctl stop --instance flight-1")]
    Ctl(CtlArgs),
    /// Say what this machine allows the chain, and what to do about the rest.
    #[command(after_help = DOCTOR_NOTES)]
    Doctor(DoctorArgs),
    /// Show a running chain in the terminal.
    #[command(after_help = TOP_NOTES)]
    Top(TopArgs),
    /// Serve a running chain to Foxglove, over a WebSocket.
    #[command(after_help = LIVE_NOTES)]
    Live(LiveArgs),
}

const RUN_EXAMPLES: &str = "Examples:
  encke run                                        the default scene, 100 sweeps
  encke run --from capture.pcap --detections d.jsonl --labels l.csv
  encke run --from config/scenes/ring-crossing.toml --duration 60s --report report.json
  encke run --from sweeps/ --pace fast             as fast as it goes, nothing dropped
  encke run --duration 10s --trace trace.json      open the file in ui.perfetto.dev

Ctrl-C and SIGTERM stop the chain in order, drain it, and print the summary.";

const SIMULATE_EXAMPLES: &str = "Examples:
  encke simulate --scene config/scenes/default.toml --sweeps 50 --out scene.pcap
  encke simulate --scene config/scenes/reference.toml --sweeps 5 --out sweeps/";

const EVALUATE_NOTES: &str = "\
Simulated scenes that nothing was trained on go through clusterer, extractor and the classifier,
as configured. What is looked at, and the targets: config/evaluation/reference.toml; what each
bar measures: services/ground/README.md.
Exit codes: 0 all bars hold, 1 one falls short, 2 cannot start.

Examples:
  encke evaluate                                   the bars as a table
  encke evaluate --out report/                     with plots: report/evaluate.html
  encke evaluate --from capture.pcap               and how much is claimed of a recording
  encke evaluate --paper --out report/             the paper's tables and figures: report/paper.html";

const BENCH_NOTES: &str = "Stages, each on what those before it left:
  cluster      the clusterer's `process`: clusters, and the cells round them
  normals      nearest neighbours of every point, and normals; clusters with features only
  histogram    angles of all pairs and the joint histogram, on the neighbours and normals found
  svm          the classifier's `process` with its support vector machine, posterior included;
               with --model: decision values and votes, several clusters at a time, no posterior
  fit          the extractor's whole `process` from the clusters, with solids and no histograms
  paper_chain  cluster, the extractor's whole `process` with histograms (normals, histogram,
               choice of columns) and no solids, svm
  full_chain   cluster, extractor and classifier as their files have them
  paper_last_sector, full_last_sector
               what both chains have still to do when the last of the chain's sectors has come

The sweep is a recording's first complete one (its first where none is), or a scene's first.
Reading it is not timed. All runs must give the same output to the byte, else the exit code is 1.
JSON lines of `fit` also say how many clusters had a fit, and the mean of residuals evaluated for one.

--hop times something else: how long a sweep of 1.1 MB takes from one process to another that
sleeps, through the chain's shared memory and through a Unix socket, by turns.

Examples:
  encke bench --from config/scenes/default.toml
  encke bench --hop --runs 2000
  encke bench --from sweeps/s4k.csv sweeps/s70k.csv --runs 50 --range 0.5 --json";

const DOCTOR_NOTES: &str = "\
ok: as it should be. warn: the chain runs, and would run better with the remedy. fail: it cannot run.
Nothing is changed: what is tried is undone at once.
Exit codes: 0 the chain can run, 1 it cannot, 2 its configuration cannot be read.

Examples:
  encke doctor
  encke doctor --chain config/chain.toml --json    also what chain.toml asks for and would be refused";

const INJECT_EXAMPLES: &str = "Faults:
  kill     SIGKILL to the stage's process
  stop     SIGSTOP, and SIGCONT after --for (500 ms)
  slow     make its work on each sweep longer by --by (20 ms); --by 0ms ends it
  swallow  let it lose one part and say nothing: the ledger must come out OPEN

Example:
  encke inject stop clusterer --for 500ms";

const REPORT_NOTES: &str = "\
The page needs nothing else: no script, no font, no address. It shows the distribution of latency and
how it went over time, what sweeps spent it on, misses by cause, the slowest sweeps, the ledger, CPU and
memory, and detections by class. What the file lacks, the page says.
Exit codes: 0 done, 2 the file is no report, or the page cannot be written.

Examples:
  encke run --report r.json && encke report r.json            writes r.html
  encke report flight.mcap --out flight.html
  encke report flight.mcap --json";

const LIVE_NOTES: &str = "\
Topics: /encke/sweep, /encke/clusters, /encke/detections, /encke/events, /encke/status. It runs behind everything else on
the machine; what a slow viewer cannot take is not sent, and counted. Standard output has the address, and at the end where
the messages went.

Examples:
  encke live                                   then open ws://127.0.0.1:8765 in Foxglove
  encke live --instance flight-1 --port 9000 --wait";

const VIEW_NOTES: &str = "\
The page needs WebGL 2 and no network; any browser of 2023 or later shows it. A written page holds its sweeps, and leaves
some out evenly where they would take more than --limit-mb. A served one fetches them as it shows them: for long recordings.

Examples:
  encke view run.mcap                              writes run.html
  encke view run.mcap --out page.html --first 100 --sweeps 50 --open
  encke view run.mcap --serve                      says where; Ctrl-C ends it
  encke view --live                                the chain that runs, as it runs";

/// Options of `encke run`.
#[derive(Args, Clone, Debug)]
pub(crate) struct RunArgs {
    /// The topology: [default: ./config/chain.toml, else the one built in]
    #[arg(long, value_name = "FILE")]
    pub(crate) chain: Option<PathBuf>,
    /// A scene (.toml) or a recording, a file or a folder. [default: chain.toml's]
    #[arg(long, value_name = "SOURCE")]
    pub(crate) from: Option<PathBuf>,
    /// Format of the recording, where it is not to be found by content.
    #[arg(long)]
    pub(crate) format: Option<String>,
    /// Sensor model: the stem of a file in config/sensors.
    #[arg(long, value_name = "NAME")]
    pub(crate) sensor: Option<String>,
    /// Refuse returns nearer than this. [default: the sensor file's]
    #[arg(long, value_name = "M")]
    pub(crate) min_range: Option<f64>,
    /// Refuse returns farther than this. [default: the sensor file's]
    #[arg(long, value_name = "M")]
    pub(crate) max_range: Option<f64>,
    /// At sensor rate (a slow stage drops and counts), or as fast as the chain goes (nothing is dropped).
    #[arg(long, value_enum, default_value_t = PaceArg::Realtime)]
    pub(crate) pace: PaceArg,
    /// So many times as fast as the sensor was: 0.1 to 10. Not with --pace fast.
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
    /// Write the cluster of every return: sweep,return,cluster; - is standard output.
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) labels: Option<PathBuf>,
    /// Write the way of every part through the stages, for ui.perfetto.dev; - is standard output.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) trace: Option<PathBuf>,
    /// Record sweeps, detections and more, to replay them or to look at them in Foxglove.
    #[arg(long, value_name = "FILE.mcap")]
    pub(crate) record: Option<PathBuf>,
    /// Write the summary as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) report: Option<PathBuf>,
    /// Name of this chain among those on the machine. [default: unique to the run]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Supervise stages that somebody else starts.
    #[arg(long)]
    pub(crate) no_spawn: bool,
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

/// `--pace`.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum PaceArg {
    Realtime,
    Fast,
}

impl From<PaceArg> for Pace {
    fn from(pace: PaceArg) -> Self {
        match pace {
            PaceArg::Realtime => Self::Realtime,
            PaceArg::Fast => Self::Fast,
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

fn parse_duration(text: &str) -> Result<Duration, String> {
    humantime::parse_duration(text).map_err(|cause| format!("{cause}; write 500ms, 30s, 5m or 2h"))
}

/// Options of `encke stage`.
#[derive(Args, Clone, Debug)]
pub(crate) struct StageArgs {
    /// The stage: source, clusterer, extractor, classifier, recorder.
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
    /// Where to: a `.pcap` of HDL-32E packets, or a folder of CSV files.
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
    /// What to look at, and the targets. [default: config/evaluation/reference.toml; with --paper
    /// config/training/paper.toml]
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) plan: Option<PathBuf>,
    /// Folder for evaluate.json and evaluate.html, or paper.json and paper.html.
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
    /// Its stages and their counts.
    Status,
    /// Stop in order, drain, report.
    Stop,
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
