//! A run's statistics from its recorded sweeps: the recorder's own, fed with one whole sweep after the other.
//!
//! A recording holds the trace of each sweep's last part. So times are those of that part; what the parts before it took
//! is not known, nor when obstacles of earlier sectors were sent: only a run of whole sweeps has obstacle latencies.

use std::collections::BTreeMap;
use std::sync::Arc;

use messages::{Detections, Message, Trace, Tracks};
use recorder::{LatencyPoints, Recorder, Settings, Snapshot, SweepTimeline};
use serde_json::{Value, json};
use stage::Sink;
use zerocopy::FromZeros;

use super::RunFigures;

/// The stages by position, as the chain is shipped; a recording does not name them.
const STAGES: [&str; 8] =
    ["source", "clusterer", "extractor", "classifier", "tracker", "stage 5", "stage 6", "stage 7"];
/// What no sweep takes, where the deadline is not known [ms].
const NEVER_MS: f64 = 3_600_000.0;

/// Sweeps so far.
pub(crate) struct Tally {
    recorder: Recorder,
    /// What the recorder is given: detections, and no tracks.
    message: Box<Tracks>,
    paced: bool,
    deadline_ms: Option<f64>,
    sectors: u64,
    hops: usize,
    /// Host time of the first sweep's first firing, and of the latest answer [ns].
    host_ns: Option<(u64, u64)>,
}

impl Tally {
    /// For a run at a pace (`fast` or a sensor's), with a deadline where it is known.
    pub(crate) fn new(paced: bool, deadline_ms: Option<f64>, sectors: u64) -> Option<Self> {
        let deadline_ms = deadline_ms.filter(|ms| *ms > 0.0 && *ms <= NEVER_MS);
        let settings = Settings {
            detections: None,
            tracks: None,
            labels: None,
            trace: None,
            statistics: None,
            resume: false,
            queue_parts: 1,
            lossless: true,
            in_order_from: None,
            paced,
            rate: 1.0,
            deadline_ms: deadline_ms.unwrap_or(NEVER_MS),
            stages: STAGES.map(str::to_owned).to_vec(),
        };
        let recorder = Recorder::start(settings, Arc::new(|_| ())).ok()?;
        let message = Tracks::new_box_zeroed().ok()?;
        Some(Self { recorder, message, paced, deadline_ms, sectors, hops: 0, host_ns: None })
    }

    /// Adds a sweep by the trace of its last part.
    pub(crate) fn add(&mut self, mut trace: Trace, detections: &Detections) {
        self.sectors = self.sectors.max(trace.part.sectors.into());
        self.hops = self.hops.max(trace.hops().len());
        let end_ns = trace.hops().last().map_or(trace.due_ns, |hop| hop.finished_ns);
        let (begin_ns, latest_ns) = self.host_ns.unwrap_or((trace.sweep_start_ns, end_ns));
        self.host_ns = Some((begin_ns.min(trace.sweep_start_ns), latest_ns.max(end_ns)));
        let part = &mut trace.part;
        (part.ordinal, part.sector, part.sectors) = (part.sweep, 0, 1);
        self.message.clear();
        self.message.detections.copy_from(detections);
        self.recorder.accept(&trace, &self.message);
    }

    /// Begin and end of the recorded sweeps in host time [ns].
    pub(crate) fn host_ns(&self) -> Option<(u64, u64)> {
        self.host_ns
    }

    /// What a report would say; none where that cannot be put into figures, which would be a defect.
    pub(crate) fn figures(&self) -> Option<RunFigures> {
        let mut snapshot = Snapshot::default();
        self.recorder.snapshot_into(&mut snapshot);
        let stages = &STAGES[..self.hops.min(STAGES.len())];
        let (begin_ns, end_ns) = self.host_ns.unwrap_or_default();
        let mut spent = SweepTimeline::of(&snapshot.timeline, stages, begin_ns);
        spent.spent_ms.truncate(stages.len());
        let latency: BTreeMap<&str, Value> = (snapshot.stages.iter().zip(stages))
            .map(|(stage, &name)| {
                let [transport, queued, busy] = [&stage.transport, &stage.queued, &stage.busy].map(|l| l.percentiles());
                (name, json!({"transport": transport, "queued": queued, "busy": busy}))
            })
            .collect();
        let whole = self.sectors <= 1;
        let deadline = self.deadline_ms.filter(|_| self.paced).map(|deadline_ms| {
            let margin = snapshot.margin_p999_pct();
            json!({"deadline_ms": deadline_ms, "misses": snapshot.deadline.misses + snapshot.missing_sweeps,
                   "margin_p999_pct": margin, "causes": causes(&snapshot)})
        });
        let mut points = LatencyPoints::of(&snapshot);
        if !whole {
            (points.obstacle, points.seam) = (Vec::new(), Vec::new());
        }
        let value = json!({
            "sweeps": snapshot.sweeps,
            "sectors": self.sectors,
            "period_ms": snapshot.period_ns.map(|ns| ns as f64 / 1e6),
            "duration_s": end_ns.saturating_sub(begin_ns) as f64 / 1e9,
            "latency_ms": {"end_to_end": snapshot.end_to_end.percentiles(),
                           "end_to_end_corrected": snapshot.end_to_end_corrected.percentiles(), "stages": latency},
            "obstacle_latency_ms": whole.then(|| snapshot.obstacle.percentiles()),
            "seam_latency_ms": whole.then(|| snapshot.seam.percentiles()),
            "deadline": deadline,
            "worst_sweeps": snapshot.worst,
            "steps": snapshot.steps,
            "detections": snapshot.detections,
            "returns": snapshot.returns,
            "refused": snapshot.refused,
            "complete_sweeps": snapshot.complete_sweeps,
            "latency_histogram_ms": points,
            "timeline": spent,
        });
        serde_json::from_value(value).ok()
    }
}

/// Misses by cause; sweeps that are not in the recording have none that it tells.
fn causes(snapshot: &Snapshot) -> BTreeMap<String, u64> {
    let mut causes = snapshot.deadline.causes.clone();
    if snapshot.missing_sweeps > 0 {
        causes.insert("not in the recording".to_owned(), snapshot.missing_sweeps);
    }
    causes
}
