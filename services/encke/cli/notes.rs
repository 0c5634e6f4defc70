//! What stands below the options in `--help`.

pub(super) const RUN_EXAMPLES: &str = "Examples:
  encke run                                        the default scene, 100 sweeps
  encke run --from capture.pcap --detections d.jsonl --tracks t.jsonl --labels l.csv
  encke run --from config/scenes/ring-crossing.toml --duration 60s --report report.json
  encke run --from 'sweeps/*.csv' --pace fast      as fast as it goes, nothing dropped
  encke run --from udp://127.0.0.1:2368            a live sensor, until stopped
  encke run --record run.mcap                      for Foxglove, and to be replayed: --from run.mcap
  encke run --duration 10s --trace trace.json      open the file in ui.perfetto.dev

Ctrl-C, SIGTERM and a terminal that closes (SIGHUP, unless under nohup) stop the chain in order, drain it, and print the
summary.";

pub(super) const SIMULATE_EXAMPLES: &str = "Examples:
  encke simulate --scene config/scenes/default.toml --sweeps 50 --out scene.pcap
  encke simulate --scene config/scenes/reference.toml --sweeps 5 --out sweeps/
  encke simulate --scene config/scenes/asteroid.toml --out asteroid.mcap";

pub(super) const EVALUATE_NOTES: &str = "\
Simulated scenes that nothing was trained on go through clusterer, extractor and the classifier,
as configured. What is looked at, and the targets: config/evaluation/reference.toml; what each
bar measures: services/ground/README.md. --tracks does the same for the tracker behind them, on
scenes in motion: config/evaluation/tracks.toml.
Exit codes: 0 all bars hold, 1 one falls short, 2 cannot start.

Examples:
  encke evaluate                                   the bars as a table
  encke evaluate --out report/                     with plots: report/evaluate.html
  encke evaluate --from capture.pcap               and how much is claimed of a recording
  encke evaluate --tracks --out report/            tracks against truth: report/tracks.html
  encke evaluate --tracks --from capture.pcap      what can be said of tracks without truth
  encke evaluate --paper --out report/             the paper's tables and figures: report/paper.html";

pub(super) const BENCH_NOTES: &str = "Stages, each on what those before it left:
  cluster      the clusterer's `process`: clusters, and the cells round them
  normals      nearest neighbours of every point, and normals; clusters with features only
  histogram    angles of all pairs and the joint histogram, on the neighbours and normals found
  svm          the classifier's `process` with its support vector machine, posterior included;
               with --model: decision values and votes, several clusters at a time, no posterior
  fit          the extractor's whole `process` from the clusters, with solids and no histograms
  paper_chain  cluster, the extractor's whole `process` with histograms (normals, histogram,
               choice of columns) and no solids, svm
  full_chain   cluster, extractor and classifier as their files have them
  track        the tracker's `process` on what the full chain found, twenty sweeps after it met that first
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

pub(super) const DOCTOR_NOTES: &str = "\
ok: as it should be. warn: the chain runs, and would run better with the remedy. fail: it cannot run.
Nothing is changed: what is tried is undone at once.
Exit codes: 0 the chain can run, 1 it cannot, 2 its configuration cannot be read.

Examples:
  encke doctor
  encke doctor --chain config/chain.toml --json    also what chain.toml asks for and would be refused";

pub(super) const CTL_EXAMPLES: &str =
    "Commands are taken of the chain's own user alone, 50 a second at most. Exit 1: the chain refused, and said why.
Examples:
  encke ctl status --json
  encke ctl events --follow --severity warning
  encke ctl pause                      then resume
  encke ctl safe                       resume leads out of it, and of degrade
  encke ctl restart extractor
  encke ctl reload                     reads the chain's parameters and executive.toml again
  encke ctl stop --instance flight-1";

pub(super) const INJECT_EXAMPLES: &str = "\
slow and slow-times last to the end of the run where --for names no time; slow --by 0ms ends slow. Faults that a stage
has itself are counted down by it (--times); the others are over when the command returns.
Exit codes: 0 done, 1 the process is not there, 2 the chain, the stage or the fault cannot be had like that.

Examples:
  encke inject kill classifier
  encke inject stop clusterer --for 500ms
  encke inject panic extractor --times 3
  encke inject dust --level 3 --times 50 --seed 7
  encke inject clock-step --by=-1h
  encke inject cpu-hog --workers 2 --for 10s";

pub(super) const SOAK_NOTES: &str = "\
The chain runs as a process of its own and is looked at from outside. --faults names a campaign: a list of faults, or one of the
kinds kills, kill-all, cycles, mode-changes, day, which have a length of their own. What must be reached: config/soak.toml; how
each bar is measured: services/soak/README.md.
DIR gets verdict.html, verdict.json, samples.csv, events.jsonl, the run's own report, and of faults matrix.md.
Ctrl-C ends it early, with a verdict over what was.
Exit codes: 0 all bars hold, 1 one was not reached, 2 cannot start.

Examples:
  encke soak --duration 2h --out soak/
  encke soak --faults config/faults/kills.toml --seed 7 --out kills/
  encke soak --faults config/faults/day.toml --out day/";

pub(super) const REPORT_NOTES: &str = "\
The page needs nothing else: no script, no font, no address. It shows the distribution of latency and
how it went over time, what sweeps spent it on, misses by cause, the slowest sweeps, the ledger, CPU and
memory, and detections by class. What the file lacks, the page says.
Exit codes: 0 done, 2 the file is no report, or the page cannot be written.

Examples:
  encke run --report r.json && encke report r.json            writes r.html
  encke report flight.mcap --out flight.html
  encke report flight.mcap --json";

pub(super) const TOP_NOTES: &str = "\
Looks only: the chain neither waits for it nor knows of it. Where standard output is no terminal, one snapshot is printed.
Keys: q leaves, tab chooses a panel, enter zooms it, p pauses, ? says more.

Examples:
  encke top
  encke top --instance flight-1 --interval 250ms
  encke top --once --json";

pub(super) const METRICS_NOTES: &str = "\
Looks only: the chain neither waits for it nor knows of it. GET /metrics gives counters and states as Prometheus' text. While no
chain of this name runs, `encke_up` is 0; Ctrl-C ends it. Standard output has the address.

Examples:
  encke metrics                                then http://127.0.0.1:9464/metrics
  encke metrics --listen 127.0.0.1:0 --instance flight-1";

pub(super) const LIVE_NOTES: &str = "\
Topics: /encke/sweep, /encke/clusters, /encke/detections, /encke/tracks, /encke/events, /encke/status. It runs behind
everything else on the machine; what a slow viewer cannot take is not sent, and counted. Standard output has the address, and
at the end where the messages went.

Examples:
  encke live                                   then open ws://127.0.0.1:8765 in Foxglove
  encke live --instance flight-1 --port 9000 --wait";

pub(super) const VIEW_NOTES: &str = "\
The page needs WebGL 2 and no network; any browser of 2023 or later shows it. A written page holds its sweeps, and leaves
some out evenly where they would take more than --limit-mb. A served one fetches them as it shows them: for long recordings.

Examples:
  encke view run.mcap                              writes run.html
  encke view run.mcap --out page.html --first 100 --sweeps 50 --open
  encke view run.mcap --serve                      says where; Ctrl-C ends it
  encke view --live                                the chain that runs, as it runs";
