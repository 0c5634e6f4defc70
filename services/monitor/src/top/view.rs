use serde::Serialize;

/// All that is shown of a chain at one moment. Times in milliseconds, shares in percent of one core.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct View {
    /// The instance.
    pub instance: String,
    /// Where sweeps come from.
    pub source: String,
    /// `realtime` or `fast`.
    pub pace: &'static str,
    /// Sectors that a sweep travels as.
    pub sectors: u32,
    /// Since the supervisor started [s]; none when it is gone.
    pub uptime_s: Option<f64>,
    /// Step of degradation in force.
    pub step: &'static str,
    /// Sweeps that the source has published.
    pub sweep: u64,
    /// Sweeps that the source sends in a second.
    pub sweeps_per_s: f64,
    /// Why there is nothing new, where it is so.
    pub notice: Option<String>,
    /// From a sweep's last return to its last detection sent.
    pub latency: LatencyView,
    /// The stages in flow order, the source first, the sink last.
    pub stages: Vec<StageView>,
    /// The supervisor's process.
    pub supervisor: ProcessView,
    /// This viewer's process.
    pub viewer: ProcessView,
    /// The latest sweep's obstacles.
    pub detections: DetectionsView,
    /// Obstacles through time, at the end of the latest sweep.
    pub tracks: TracksView,
    /// What happened, oldest first: the latest of the log.
    pub events: Vec<EventView>,
    /// What this viewer saw pass and what it missed.
    pub tap: TapView,
}

/// How long sweeps took, of the last hundred that were answered.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LatencyView {
    /// The deadline; none where there is no pace.
    pub deadline_ms: Option<f64>,
    /// Sweeps that the percentiles are of.
    pub sweeps: usize,
    /// Half took at most this.
    pub p50_ms: Option<f64>,
    /// 99 of a hundred took at most this.
    pub p99_ms: Option<f64>,
    /// The longest.
    pub max_ms: Option<f64>,
    /// Sweeps of the window that were late or not answered.
    pub missed: usize,
    /// The same since this viewer is attached.
    pub missed_in_all: u64,
    /// Sweep after sweep, the latest last; null = not answered.
    pub recent_ms: Vec<Option<f64>>,
}

/// One stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StageView {
    /// Its name.
    pub stage: String,
    /// Its process; that of its last life while none lives.
    pub pid: u64,
    /// Where it is in its life; `died` between two lives.
    pub state: &'static str,
    /// Restarts so far.
    pub restarts: u64,
    /// Since its working thread last showed that it is alive.
    pub heartbeat_age_ms: f64,
    /// Parts that it takes (the source: sends) in a second.
    pub parts_per_s: f64,
    /// Sweeps' worth of parts in a second.
    pub sweeps_per_s: f64,
    /// Share of the time in which it works on parts; none for the sink, whose stamps no trace has.
    pub busy_pct: Option<f64>,
    /// Work on one sweep: half took at most this.
    pub busy_p50_ms: Option<f64>,
    /// 99 of a hundred took at most this.
    pub busy_p99_ms: Option<f64>,
    /// Parts that wait for it; none for the source.
    pub queue: Option<u64>,
    /// Parts received.
    pub received: u64,
    /// Parts published; the sink: accepted.
    pub published: u64,
    /// Parts processed; the sink: written.
    pub processed: u64,
    /// Parts rejected.
    pub rejected: u64,
    /// Parts that overflowed its queue.
    pub dropped: u64,
    /// Parts that died with a process.
    pub lost: u64,
    /// Sweeps beyond its budget.
    pub overruns: u64,
    /// Parts that waited while it was busy.
    pub slips: u64,
    /// Sweeps that left it after the deadline.
    pub late: u64,
    /// What its process uses.
    pub process: ProcessView,
}

/// A process; none of both when it is gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ProcessView {
    /// CPU time over time.
    pub cpu_pct: Option<f64>,
    /// Memory resident [MiB].
    pub rss_mib: Option<f64>,
}

/// Obstacles of one sweep.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DetectionsView {
    /// The sweep; none before the first.
    pub sweep: Option<u64>,
    /// Whether every part of it was seen.
    pub complete: bool,
    /// Clusters of each class, in the order of reports.
    pub classes: Vec<(&'static str, usize)>,
    /// Those with a class first, the nearest first; at most [`DetectionsView::MAX_ROWS`].
    pub rows: Vec<DetectionRow>,
}

impl DetectionsView {
    /// Most rows of a view.
    pub const MAX_ROWS: usize = 200;

    /// Clusters of all classes.
    pub fn clusters(&self) -> usize {
        self.classes.iter().map(|(_, clusters)| clusters).sum()
    }
}

/// One obstacle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DetectionRow {
    /// Its number in `--detections`.
    pub cluster: usize,
    /// Its class.
    pub class: &'static str,
    /// Probability of that class; none where it is unclassified.
    pub p: Option<f32>,
    /// Distance of its centroid [m].
    pub range_m: f32,
    /// Extents of its solid [m]; none where it has none.
    pub size_m: Option<[f32; 3]>,
    /// Its returns.
    pub points: u32,
}

/// Obstacles through time, at the end of a sweep.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TracksView {
    /// The sweep; none before the first.
    pub sweep: Option<u64>,
    /// Whether the tracker could answer it; where not, there are no rows, and that says nothing of obstacles.
    pub known: bool,
    /// Tracks of each state: confirmed, coasting, tentative.
    pub states: Vec<(&'static str, usize)>,
    /// Tracks on alert.
    pub alerts: usize,
    /// The most dangerous first; at most [`TracksView::MAX_ROWS`].
    pub rows: Vec<TrackRow>,
}

impl TracksView {
    /// Most rows of a view.
    pub const MAX_ROWS: usize = 200;
}

/// One obstacle through time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TrackRow {
    /// Its number.
    pub track: u64,
    /// `tentative`, `confirmed` or `coasting`.
    pub state: &'static str,
    /// Its likeliest class over all sweeps.
    pub class: &'static str,
    /// Probability of that class; none where it is unclassified.
    pub p: Option<f32>,
    /// Distance of its middle [m].
    pub range_m: f32,
    /// Speed relative to the sensor [m/s].
    pub speed_mps: f32,
    /// Sweeps since its birth, from 1.
    pub age_sweeps: u32,
    /// Sweeps since its last detection.
    pub last_seen_sweeps: u32,
    /// Until its closest approach [s]; none for a tentative track, like the two below.
    pub time_s: Option<f32>,
    /// Distance of its middle then [m].
    pub distance_m: Option<f32>,
    /// How likely it is met within the horizon.
    pub collision_probability: Option<f32>,
    /// Whether that is more than allowed.
    pub alert: bool,
}

/// Something that happened.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct EventView {
    /// Since the supervisor started [s], the first time.
    pub at_s: f64,
    /// Sweep at which it happened first.
    pub sweep: u64,
    /// The stage, or `chain`.
    pub stage: String,
    /// What.
    pub what: String,
    /// Whether it is a warning or worse.
    pub grave: bool,
}

/// The viewer's own account.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TapView {
    /// Parts seen.
    pub parts: u64,
    /// Parts that passed unseen.
    pub missed: u64,
}
