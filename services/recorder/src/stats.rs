//! Counts and latency distributions, built up part by part from traces. Reads no clock; allocates nothing once made.

use hdrhistogram::CreationError;
use lidar::ObstacleClass;
use messages::{Detections, MIN_FEATURE_POINTS, Refusal, Step, Trace, Verdict};

use crate::answers::Answers;
use crate::cause::{Cause, Judge, Kind};
use crate::latency::Latency;
use crate::segments::Segments;
use crate::settings::Settings;
use crate::snapshot::{Snapshot, count, count_verdicts};
use crate::stage_stats::{StageStatistics, Verdicts};
use crate::sweeps::{Ending, Rejection, Sweeps};
use crate::timeline::{Counts, Timeline};
use crate::worst::Worst;

/// Statistics of one life of the recorder.
pub(crate) struct Statistics {
    paced: bool,
    rate: f64,
    deadline_ms: f64,
    stages: Vec<StageStatistics>,
    /// The recorder's own verdicts.
    verdicts: Verdicts,
    end_to_end: Latency,
    answers: Answers,
    source_late: Latency,
    obstacle: Latency,
    seam: Latency,
    worst: Worst,
    timeline: Timeline,
    judge: Judge,
    misses: u64,
    /// Sweeps without an answer because a part of them was not used here, by verdict.
    rejected_sweeps: Verdicts,
    parts: u64,
    /// Duration of the last sweep's turn; 0 before the first.
    period_ns: u64,
    sweeps: Sweeps,
    /// Sweeps that were answered, by the step's number.
    steps: [u64; Step::ALL.len()],
    returns: u64,
    refused: [u64; Refusal::ALL.len()],
    /// By the class's number.
    detections: [u64; ObstacleClass::ALL.len()],
}

/// What a part meant for its sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    /// From the sweep's last return to its last detection sent [ns].
    pub(crate) end_to_end_ns: u64,
    /// Why that was past the deadline, if it was.
    pub(crate) missed: Option<Cause>,
}

impl Statistics {
    pub(crate) fn new(settings: &Settings) -> Result<Self, CreationError> {
        Ok(Self {
            paced: settings.paced,
            rate: settings.rate,
            deadline_ms: settings.deadline_ms,
            stages: settings.stages.iter().map(|name| StageStatistics::new(name)).collect::<Result<_, _>>()?,
            verdicts: Verdicts::default(),
            end_to_end: Latency::new()?,
            answers: Answers::new()?,
            source_late: Latency::new()?,
            obstacle: Latency::new()?,
            seam: Latency::new()?,
            worst: Worst::default(),
            timeline: Timeline::new(),
            judge: Judge::new(),
            misses: 0,
            rejected_sweeps: Verdicts::default(),
            parts: 0,
            period_ns: 0,
            sweeps: Sweeps::default(),
            steps: [0; Step::ALL.len()],
            returns: 0,
            refused: [0; Refusal::ALL.len()],
            detections: [0; ObstacleClass::ALL.len()],
        })
    }

    /// Adds a part; `verdict` is what the recorder made of it. Its sweep's answer, if it is with this part.
    pub(crate) fn add(&mut self, trace: &Trace, input: &Detections, verdict: Verdict) -> Option<Answer> {
        let segments = Segments::of(trace);
        let before = self.counts();
        let answer = self.add_part(trace, input, verdict, &segments);
        let at_ns = trace.hops().last().map_or(trace.due_ns, |hop| hop.finished_ns);
        self.timeline.note(at_ns, &before, &self.counts(), answer.map(|_| &segments));
        answer
    }

    fn counts(&self) -> Counts {
        Counts { misses: self.misses, missing: self.sweeps.missing, detections: self.detections }
    }

    fn add_part(&mut self, trace: &Trace, input: &Detections, verdict: Verdict, segments: &Segments) -> Option<Answer> {
        self.parts += 1;
        self.verdicts[verdict as usize] += 1;
        let unused = matches!(verdict, Verdict::RejectedMalformed | Verdict::RejectedStale);
        let hops = trace.hops().iter().enumerate();
        let rejection = hops
            .map(|(stage, hop)| Rejection { stage, verdict: hop.verdict })
            .find(|rejection| rejection.verdict.is_rejected())
            .or(unused.then_some(Rejection { stage: self.stages.len(), verdict }));
        let (begins, ending) = self.sweeps.add(&trace.part, input.header.is_complete(), rejection);
        if !unused {
            self.add_rows(trace, input);
        }
        if segments.hop_count == 0 {
            return None;
        }
        for (place, (stage, hop)) in self.stages.iter_mut().zip(trace.hops()).enumerate() {
            stage.add(&segments.hops[place], hop.verdict, place == 0, begins);
        }
        self.source_late.record(segments.source_late_ns);
        let answer = match ending {
            Some(Ending::Answered) => Some(self.add_answer(trace, segments)),
            Some(Ending::Rejected(rejection)) => {
                self.add_rejected(rejection);
                None
            }
            None => None,
        };
        self.judge.note(trace, segments);
        answer
    }

    fn add_answer(&mut self, trace: &Trace, segments: &Segments) -> Answer {
        let end_to_end_ns = segments.end_to_end_ns;
        self.end_to_end.record(end_to_end_ns);
        self.steps[trace.part.step() as usize] += 1;
        self.stages.iter_mut().for_each(StageStatistics::answer);
        let cause = self.judge.cause(trace, segments);
        self.judge.note_answer(trace);
        self.worst.add(end_to_end_ns, cause, trace);
        if !self.paced {
            return Answer { end_to_end_ns, missed: None };
        }
        self.answers.add(trace.part.sweep, end_to_end_ns, self.host_ns(self.period_ns));
        let missed = (end_to_end_ns as f64 > self.deadline_ms * 1e6).then_some(cause);
        if let Some(Cause { stage, kind }) = missed {
            self.misses += 1;
            if let Some(stage) = self.stages.get_mut(stage) {
                stage.misses[kind as usize] += 1;
            }
        }
        Answer { end_to_end_ns, missed }
    }

    /// A sweep of which every part came, and that has no answer.
    fn add_rejected(&mut self, Rejection { stage, verdict }: Rejection) {
        if !self.paced || verdict == Verdict::RejectedShed {
            return;
        }
        self.misses += 1;
        match (self.stages.get_mut(stage), verdict) {
            // Nothing is missing: the sectors before were with the life before.
            (Some(stage), Verdict::RejectedIncomplete) => stage.misses[Kind::Restart as usize] += 1,
            (Some(stage), verdict) => stage.rejected_sweeps[verdict as usize] += 1,
            (None, verdict) => self.rejected_sweeps[verdict as usize] += 1,
        }
    }

    fn add_rows(&mut self, trace: &Trace, input: &Detections) {
        self.period_ns = input.header.period_ns;
        self.returns += u64::from(input.header.accepted());
        for (sum, &refused) in self.refused.iter_mut().zip(&input.header.refused) {
            *sum += u64::from(refused);
        }
        let sent_ns = trace.hops().last().map(|hop| hop.finished_ns).filter(|_| self.paced);
        for detection in &input.detections {
            self.detections[detection.class as usize] += 1;
            let Some(sent_ns) = sent_ns else { continue };
            if detection.summary.points as usize >= MIN_FEATURE_POINTS {
                let offset_ns = self.host_ns(detection.summary.last_offset_ns.into());
                let last_return_ns = trace.sweep_start_ns.saturating_add(offset_ns);
                let latency = if detection.summary.seam == 0 { &mut self.obstacle } else { &mut self.seam };
                latency.record(sent_ns.saturating_sub(last_return_ns));
            }
        }
    }

    /// Host time that a stretch of sensor time takes [ns].
    fn host_ns(&self, sensor_ns: u64) -> u64 {
        if self.rate == 1.0 { sensor_ns } else { (sensor_ns as f64 / self.rate) as u64 }
    }

    fn stage_names(&self) -> Vec<&str> {
        self.stages.iter().map(|stage| stage.name.as_str()).collect()
    }

    /// Copies everything into `snapshot`.
    pub(crate) fn snapshot_into(&self, snapshot: &mut Snapshot) {
        snapshot.version = crate::snapshot::VERSION;
        snapshot.parts = self.parts;
        self.sweeps_into(snapshot);
        snapshot.period_ns = Some(self.period_ns).filter(|&period_ns| period_ns > 0);
        snapshot.returns = self.returns;
        for (reason, &refused) in Refusal::ALL.into_iter().zip(&self.refused) {
            count(&mut snapshot.refused, reason.name(), refused);
        }
        for class in ObstacleClass::ALL {
            snapshot.detections.insert(class, self.detections[class as usize]);
        }
        self.end_to_end.snapshot_into(&mut snapshot.end_to_end);
        self.answers.snapshot_into(&mut snapshot.end_to_end_corrected, &mut snapshot.answered);
        self.source_late.snapshot_into(&mut snapshot.source_late);
        self.obstacle.snapshot_into(&mut snapshot.obstacle);
        self.seam.snapshot_into(&mut snapshot.seam);
        count_verdicts(&mut snapshot.verdicts, &self.verdicts);
        snapshot.worst = self.worst.snapshot(&self.stage_names());
        snapshot.stages.resize_with(self.stages.len(), Default::default);
        for (from, to) in self.stages.iter().zip(&mut snapshot.stages) {
            from.snapshot_into(to);
        }
        self.timeline.snapshot_into(&mut snapshot.timeline, self.stages.len());
        self.misses_into(snapshot);
    }

    fn sweeps_into(&self, snapshot: &mut Snapshot) {
        snapshot.sweeps = self.sweeps.seen;
        snapshot.complete_sweeps = self.sweeps.complete;
        snapshot.missing_sweeps = self.sweeps.missing;
        snapshot.first_sweep = self.sweeps.first;
        snapshot.last_sweep = self.sweeps.last;
        snapshot.missing_parts = self.sweeps.missing_parts;
        snapshot.first_ordinal = self.sweeps.first_ordinal;
        snapshot.last_ordinal = self.sweeps.last_ordinal;
        for step in Step::ALL {
            count(&mut snapshot.steps, step.name(), self.steps[step as usize]);
        }
    }

    fn misses_into(&self, snapshot: &mut Snapshot) {
        snapshot.deadline.deadline_ms = self.deadline_ms;
        snapshot.deadline.misses = self.misses;
        let causes = &mut snapshot.deadline.causes;
        for stage in &self.stages {
            let late = Kind::ALL.iter().map(|kind| (kind.name(), stage.misses[*kind as usize]));
            let rejected =
                Verdict::ALL.iter().map(|verdict| (verdict.name(), stage.rejected_sweeps[*verdict as usize]));
            for (what, misses) in late.chain(rejected).filter(|&(_, misses)| misses > 0) {
                count(causes, &format!("{} {what}", stage.name), misses);
            }
        }
        let here = Verdict::ALL.iter().map(|verdict| (verdict.name(), self.rejected_sweeps[*verdict as usize]));
        for (what, misses) in here.filter(|&(_, misses)| misses > 0) {
            count(causes, &format!("recorder {what}"), misses);
        }
    }
}
