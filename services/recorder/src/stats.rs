//! Counts and latency distributions, built up part by part from traces. Reads no clock; allocates nothing once made.

use hdrhistogram::CreationError;
use lidar::ObstacleClass;
use messages::{Detections, MIN_FEATURE_POINTS, Part, Refusal, Trace, Verdict};

use crate::latency::Latency;
use crate::part_rows::is_rejected;
use crate::segments::{HopSegments, Kind, Segment, Segments};
use crate::settings::Settings;
use crate::snapshot::{Snapshot, count};
use crate::worst::Worst;

type Verdicts = [u64; Verdict::ALL.len()];

/// Statistics of one life of the recorder.
pub(crate) struct Statistics {
    paced: bool,
    deadline_ms: f64,
    stages: Vec<StageStatistics>,
    /// The recorder's own verdicts.
    verdicts: Verdicts,
    end_to_end: Latency,
    source_late: Latency,
    obstacle: Latency,
    seam: Latency,
    worst: Worst,
    misses: u64,
    source_late_misses: u64,
    parts: u64,
    /// Duration of the last sweep's turn; 0 before the first.
    period_ns: u64,
    sweeps: Sweeps,
    returns: u64,
    refused: [u64; Refusal::ALL.len()],
    /// By the class's number.
    detections: [u64; ObstacleClass::ALL.len()],
}

struct StageStatistics {
    name: String,
    transport: Latency,
    queued: Latency,
    busy: Latency,
    verdicts: Verdicts,
    /// Misses of which it was the cause, by [`Kind`].
    misses: [u64; Kind::ALL.len()],
}

/// Which sweeps were seen, and how well.
#[derive(Default)]
struct Sweeps {
    seen: u64,
    complete: u64,
    missing: u64,
    first: Option<u64>,
    last: Option<u64>,
    /// Sectors of the last sweep that came and were used.
    sectors: u32,
}

impl StageStatistics {
    fn new(name: &str) -> Result<Self, CreationError> {
        Ok(Self {
            name: name.to_owned(),
            transport: Latency::new()?,
            queued: Latency::new()?,
            busy: Latency::new()?,
            verdicts: Verdicts::default(),
            misses: [0; Kind::ALL.len()],
        })
    }

    fn add(&mut self, segments: &HopSegments, verdict: Verdict, is_source: bool) {
        self.verdicts[verdict as usize] += 1;
        self.busy.record(segments.busy_ns);
        if !is_source {
            self.transport.record(segments.transport_ns);
            self.queued.record(segments.queued_ns);
        }
    }
}

impl Sweeps {
    /// Notes a part; `used` unless a stage or the recorder rejected it.
    fn add(&mut self, part: &Part, complete: bool, used: bool) {
        if self.last != Some(part.sweep) {
            let skipped = self.last.map_or(0, |last| part.sweep.saturating_sub(last.saturating_add(1)));
            self.missing += skipped;
            self.seen += 1;
            self.first.get_or_insert(part.sweep);
            self.last = self.last.max(Some(part.sweep));
            self.sectors = 0;
        }
        self.sectors += u32::from(used);
        if part.is_last() && complete && self.sectors == part.sectors.max(1) {
            self.complete += 1;
        }
    }
}

impl Statistics {
    pub(crate) fn new(settings: &Settings) -> Result<Self, CreationError> {
        Ok(Self {
            paced: settings.paced,
            deadline_ms: settings.deadline_ms,
            stages: settings.stages.iter().map(|name| StageStatistics::new(name)).collect::<Result<_, _>>()?,
            verdicts: Verdicts::default(),
            end_to_end: Latency::new()?,
            source_late: Latency::new()?,
            obstacle: Latency::new()?,
            seam: Latency::new()?,
            worst: Worst::default(),
            misses: 0,
            source_late_misses: 0,
            parts: 0,
            period_ns: 0,
            sweeps: Sweeps::default(),
            returns: 0,
            refused: [0; Refusal::ALL.len()],
            detections: [0; ObstacleClass::ALL.len()],
        })
    }

    /// Adds a part; `verdict` is what the recorder made of it.
    pub(crate) fn add(&mut self, trace: &Trace, input: &Detections, verdict: Verdict) {
        self.parts += 1;
        self.verdicts[verdict as usize] += 1;
        let malformed = verdict == Verdict::RejectedMalformed;
        self.sweeps.add(&trace.part, input.header.is_complete(), !malformed && !is_rejected(trace));
        self.add_way(trace);
        if !malformed {
            self.add_rows(trace, input);
        }
    }

    fn add_way(&mut self, trace: &Trace) {
        let segments = Segments::of(trace);
        if segments.hop_count == 0 {
            return;
        }
        for (place, (stage, hop)) in self.stages.iter_mut().zip(trace.hops()).enumerate() {
            stage.add(&segments.hops[place], hop.verdict, place == 0);
        }
        self.source_late.record(segments.source_late_ns);
        if !trace.part.is_last() {
            return;
        }
        self.end_to_end.record(segments.end_to_end_ns);
        self.worst.add(trace.part.sweep, segments.end_to_end_ns, segments.longest());
        if self.paced && segments.end_to_end_ns as f64 > self.deadline_ms * 1e6 {
            self.misses += 1;
            match segments.longest() {
                Segment::SourceLate => self.source_late_misses += 1,
                Segment::Stage(stage, kind) => {
                    if let Some(stage) = self.stages.get_mut(stage) {
                        stage.misses[kind as usize] += 1;
                    }
                }
            }
        }
    }

    fn add_rows(&mut self, trace: &Trace, input: &Detections) {
        self.period_ns = input.header.period_ns;
        self.returns += u64::from(input.header.accepted());
        for (sum, &refused) in self.refused.iter_mut().zip(&input.header.refused) {
            *sum += u64::from(refused);
        }
        let sent_ns = trace.hops().last().map(|hop| hop.finished_ns).filter(|_| self.paced);
        let start_ns = sweep_start_ns(trace, input.header.period_ns);
        for detection in &input.detections {
            self.detections[detection.class as usize] += 1;
            let Some(sent_ns) = sent_ns else { continue };
            if detection.summary.points as usize >= MIN_FEATURE_POINTS {
                let latency_ns = i128::from(sent_ns) - start_ns - i128::from(detection.summary.last_offset_ns);
                let latency = if detection.summary.seam == 0 { &mut self.obstacle } else { &mut self.seam };
                latency.record(u64::try_from(latency_ns.max(0)).unwrap_or(u64::MAX));
            }
        }
    }

    fn name(&self, segment: Segment) -> String {
        match segment {
            Segment::SourceLate => "source late".to_owned(),
            Segment::Stage(place, kind) => {
                let stage = self.stages.get(place).map_or("a stage beyond the chain", |stage| &stage.name);
                format!("{stage} {}", kind.name())
            }
        }
    }

    /// Copies everything into `snapshot`.
    pub(crate) fn snapshot_into(&self, snapshot: &mut Snapshot) {
        snapshot.version = crate::snapshot::VERSION;
        snapshot.parts = self.parts;
        snapshot.sweeps = self.sweeps.seen;
        snapshot.complete_sweeps = self.sweeps.complete;
        snapshot.missing_sweeps = self.sweeps.missing;
        snapshot.first_sweep = self.sweeps.first;
        snapshot.last_sweep = self.sweeps.last;
        snapshot.period_ns = Some(self.period_ns).filter(|&period_ns| period_ns > 0);
        snapshot.returns = self.returns;
        for (reason, &refused) in Refusal::ALL.into_iter().zip(&self.refused) {
            count(&mut snapshot.refused, reason.name(), refused);
        }
        for class in ObstacleClass::ALL {
            snapshot.detections.insert(class, self.detections[class as usize]);
        }
        self.end_to_end.snapshot_into(&mut snapshot.end_to_end);
        self.source_late.snapshot_into(&mut snapshot.source_late);
        self.obstacle.snapshot_into(&mut snapshot.obstacle);
        self.seam.snapshot_into(&mut snapshot.seam);
        count_verdicts(&mut snapshot.verdicts, &self.verdicts);
        snapshot.worst = self.worst.snapshot(|segment| self.name(segment));
        snapshot.deadline.deadline_ms = self.deadline_ms;
        snapshot.deadline.misses = self.misses;
        count(&mut snapshot.deadline.causes, "source late", self.source_late_misses);
        snapshot.stages.resize_with(self.stages.len(), Default::default);
        for (from, to) in self.stages.iter().zip(&mut snapshot.stages) {
            to.stage.clone_from(&from.name);
            from.transport.snapshot_into(&mut to.transport);
            from.queued.snapshot_into(&mut to.queued);
            from.busy.snapshot_into(&mut to.busy);
            count_verdicts(&mut to.verdicts, &from.verdicts);
            for kind in Kind::ALL.into_iter().filter(|&kind| from.misses[kind as usize] > 0) {
                let cause = format!("{} {}", from.name, kind.name());
                count(&mut snapshot.deadline.causes, &cause, from.misses[kind as usize]);
            }
        }
    }
}

/// Host time at which the part's sweep began [ns]: its last return was due at the end of the part's sector.
fn sweep_start_ns(trace: &Trace, period_ns: u64) -> i128 {
    let Part { sector, sectors, .. } = trace.part;
    let elapsed_ns = i128::from(period_ns) * (i128::from(sector) + 1) / i128::from(sectors.max(1));
    i128::from(trace.due_ns) - elapsed_ns
}

/// Verdicts other than `Complete`, which is every other part.
fn count_verdicts(names: &mut std::collections::BTreeMap<String, u64>, verdicts: &Verdicts) {
    for verdict in Verdict::ALL.into_iter().filter(|&verdict| verdict != Verdict::Complete) {
        count(names, verdict.name(), verdicts[verdict as usize]);
    }
}
