//! What a run was: its account, its statistics, its timeline, and how all of it is told.

mod closing;
pub(crate) mod events_report;
pub(crate) mod ledger;
pub(crate) mod progress;
pub(crate) mod status;
pub(crate) mod summary;
pub(crate) mod timeline;
pub(crate) mod timeline_report;

use std::collections::{BTreeMap, BTreeSet};

use chain::Mode;
use lidar::ObstacleClass;
use recorder::{LatencyPoints, LostSweeps, Percentiles, Snapshot, TrackCounts, WorstSweep};
use runtime::{Pace, Plan};
use serde::{Deserialize, Serialize};

use crate::control::CommandsReport;
use crate::modes::overload::OverloadReport;
use crate::modes::steering::SafeReport;
use crate::modes::{By, ModesReport};
use crate::processes::beside::RecordingReport;
use crate::processes::machine::MachineLoad;
use crate::processes::usage::ProcessReport;
use crate::report::events_report::EventsReport;
use crate::report::ledger::LedgerReport;
use crate::report::timeline_report::TimelineReport;

/// Everything that is known of a run, as `--report` writes it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Report {
    /// Version of the program.
    pub encke: String,
    /// The machine: cores and kernel.
    pub machine: String,
    /// Where sweeps came from.
    pub source: String,
    /// Sweeps that the source published.
    pub sweeps: u64,
    /// Sectors that a sweep travelled as.
    pub sectors: u32,
    /// How fast.
    pub pace: Pace,
    /// Range d of the clusterer [m].
    pub cluster_range_m: Option<f64>,
    /// Duration of a turn [ms], of the last sweep.
    pub period_ms: Option<f64>,
    /// From the first stage up to the last down [s].
    pub duration_s: f64,
    /// Where every part went.
    pub ledger: LedgerReport,
    /// Where the time went.
    pub latency_ms: LatencyReport,
    /// From an obstacle's last return to its detection sent; clusters of 5 points or more, off the seam.
    pub obstacle_latency_ms: Percentiles,
    /// The same of obstacles on the seam.
    pub seam_latency_ms: Percentiles,
    /// Misses and what caused them.
    pub deadline: DeadlineReport,
    /// Overruns, slips, and what was left out under overload.
    pub overload: OverloadReport,
    /// The sweeps that took longest, longest first, each with the way of its last part.
    pub worst_sweeps: Vec<WorstSweep>,
    /// Sweeps that were answered, by the step of degradation at which they were processed.
    pub steps: BTreeMap<String, u64>,
    /// The processes, the source first, the supervisor last.
    pub processes: Vec<ProcessReport>,
    /// What happened.
    #[serde(default)]
    pub events: EventsReport,
    /// Who had the cores.
    pub machine_load: MachineLoad,
    /// How late a thread that waits for the time is woken.
    pub noise_ms: Percentiles,
    /// Real-time settings that the kernel refused, one line each.
    pub realtime_refused: Vec<String>,
    /// Detections by class.
    pub detections: BTreeMap<ObstacleClass, u64>,
    /// Tracks and alerts in numbers, where any table of tracks came.
    #[serde(default)]
    pub tracks: Option<TrackCounts>,
    /// Accepted returns of all sweeps.
    pub returns: u64,
    /// Refused returns of all sweeps, by reason.
    pub refused: BTreeMap<String, u64>,
    /// Sweeps that were seen from wrap to wrap.
    pub complete_sweeps: u64,
    /// Sweeps that a file lacks because it could not be written.
    pub lost_sweeps: LostSweeps,
    /// The trace file in numbers, where one was written.
    pub trace: Option<TraceReport>,
    /// What was recorded, where anything was.
    pub recording: Option<RecordingReport>,
    /// Why the run stopped before its end, where it did.
    pub stopped: Option<String>,
    /// The mode at the end.
    pub mode: Mode,
    /// Changes of mode.
    pub modes: ModesReport,
    /// How the chain came into safe mode, where it did; a spent budget before a command.
    pub safe_entered: Option<SafeReport>,
    /// Commands that came.
    pub commands: CommandsReport,
    /// How the command ends, and why.
    pub verdict: VerdictReport,
    /// The distributions that `latency_ms` and its neighbours give percentiles of.
    pub latency_histogram_ms: LatencyPoints,
    /// How all this went over time.
    pub timeline: TimelineReport,
}

/// How the command ends.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct VerdictReport {
    /// Why with exit code 1; null for 0.
    pub failed: Option<String>,
    /// The same with `--strict`.
    pub failed_strict: Option<String>,
}

/// The trace file in numbers. A part has about three events in each stage.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct TraceReport {
    /// Events in the file.
    pub events: u64,
    /// Parts that came to the recorder and have no events: its writer was behind, or the file had failed.
    pub lost: u64,
    /// Parts that never came to the recorder.
    pub missing: u64,
    /// Whether the file had failed.
    pub failed: bool,
}

/// Where the time went.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct LatencyReport {
    /// From a sweep's last return to its last detection sent, of every sweep that was answered.
    pub end_to_end: Percentiles,
    /// The same, and for each sweep without an answer the time from its last return to the next answer; at the sensor's
    /// pace only.
    pub end_to_end_corrected: Percentiles,
    /// By stage.
    pub stages: BTreeMap<String, StageLatency>,
}

/// One stage's share.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct StageLatency {
    /// From sent (and the stage free) until `process` began, once a part.
    pub transport: Percentiles,
    /// Sent, and the stage still busy with the part before, once a part.
    pub queued: Percentiles,
    /// In `process`, all parts of a sweep together.
    pub busy: Percentiles,
    /// In `process`, once a part.
    pub busy_part: Percentiles,
}

/// Sweeps that came late or not at all.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct DeadlineReport {
    /// From a sweep's last return to its last detection sent [ms].
    pub deadline_ms: f64,
    /// Sweeps that missed it: late, rejected (unless on purpose), dropped or lost.
    pub misses: u64,
    /// Share of the deadline that 99.9 % of the sweeps leave free [%], by the corrected distribution.
    pub margin_p999_pct: Option<f64>,
    /// Whether that is at least [`LEAST_MARGIN_PCT`].
    pub margin_ok: Option<bool>,
    /// Misses by cause, one each: a stage and what it was late by.
    pub causes: BTreeMap<String, u64>,
}

/// Margin of the deadline that flight software keeps at its worst [%].
pub const LEAST_MARGIN_PCT: f64 = 30.0;

/// What the supervisor knows at the end.
pub(crate) struct Facts<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) snapshot: Snapshot,
    pub(crate) ledger: LedgerReport,
    pub(crate) published: u64,
    pub(crate) duration_s: f64,
    pub(crate) processes: Vec<ProcessReport>,
    pub(crate) overload: OverloadReport,
    pub(crate) machine_load: MachineLoad,
    pub(crate) noise_ms: Percentiles,
    pub(crate) realtime_refused: Vec<String>,
    pub(crate) stopped: Option<String>,
    pub(crate) events: EventsReport,
    pub(crate) recording: Option<RecordingReport>,
    pub(crate) timeline: TimelineReport,
    pub(crate) mode: Mode,
    pub(crate) modes: ModesReport,
    pub(crate) safe_entered: Option<SafeReport>,
    pub(crate) commands: CommandsReport,
}

impl Report {
    pub(crate) fn of(facts: Facts<'_>) -> Self {
        let Facts { plan, snapshot, ledger, published, duration_s, processes, overload, stopped, .. } = facts;
        let stages = snapshot.stages.iter().map(|stage| {
            let latency = StageLatency {
                transport: stage.transport.percentiles(),
                queued: stage.queued.percentiles(),
                busy: stage.busy.percentiles(),
                busy_part: stage.busy_part.percentiles(),
            };
            (stage.stage.clone(), latency)
        });
        let mut report = Self {
            encke: env!("CARGO_PKG_VERSION").to_owned(),
            machine: machine(),
            source: plan.source.from.display().to_string(),
            sweeps: published / u64::from(plan.chain.sectors.max(1)),
            sectors: plan.chain.sectors,
            pace: plan.pace,
            cluster_range_m: cluster_range_m(plan),
            period_ms: snapshot.period_ns.map(|period_ns| period_ns as f64 / 1e6),
            duration_s,
            latency_ms: LatencyReport {
                end_to_end: snapshot.end_to_end.percentiles(),
                end_to_end_corrected: snapshot.end_to_end_corrected.percentiles(),
                stages: stages.collect(),
            },
            obstacle_latency_ms: snapshot.obstacle.percentiles(),
            seam_latency_ms: snapshot.seam.percentiles(),
            deadline: deadline(plan, &snapshot, &ledger),
            overload,
            latency_histogram_ms: LatencyPoints::of(&snapshot),
            worst_sweeps: snapshot.worst,
            steps: snapshot.steps,
            processes,
            events: facts.events,
            machine_load: facts.machine_load,
            noise_ms: facts.noise_ms,
            realtime_refused: facts.realtime_refused,
            detections: ObstacleClass::ALL
                .into_iter()
                .map(|class| (class, snapshot.detections.get(&class).copied().unwrap_or(0)))
                .collect(),
            tracks: snapshot.tracks,
            returns: snapshot.returns,
            refused: snapshot.refused,
            complete_sweeps: snapshot.complete_sweeps,
            lost_sweeps: snapshot.lost_sweeps,
            trace: snapshot.trace.map(|trace| TraceReport {
                events: trace.events,
                lost: trace.lost,
                missing: snapshot.missing_parts,
                failed: trace.failed,
            }),
            ledger,
            recording: facts.recording,
            stopped,
            mode: facts.mode,
            modes: facts.modes,
            safe_entered: facts.safe_entered,
            commands: facts.commands,
            verdict: VerdictReport::default(),
            timeline: facts.timeline,
        };
        let [failed, failed_strict] = [false, true].map(|strict| report.failure(strict));
        report.verdict = VerdictReport { failed, failed_strict };
        report
    }

    /// Parts dropped on any hop.
    pub fn dropped(&self) -> u64 {
        self.ledger.hops.iter().flat_map(|hop| hop.dropped.values()).sum()
    }

    /// Parts lost on any hop.
    pub fn lost(&self) -> u64 {
        self.ledger.hops.iter().map(|hop| hop.lost).sum()
    }

    /// Parts that the sink could not take because its writer was behind.
    fn refused_by_sink(&self) -> u64 {
        let name = messages::Verdict::RejectedSinkFull.name();
        self.ledger.hops.iter().filter_map(|hop| hop.rejected.get(name)).sum()
    }

    /// Why the run failed, if it did; `strict` counts misses, drops and losses as failures at any pace.
    pub fn failure(&self, strict: bool) -> Option<String> {
        let missing = self.dropped() + self.lost() + self.refused_by_sink();
        if !self.ledger.closed {
            return Some("the ledger is OPEN: parts are in no category, or in two".to_owned());
        }
        if let Some(reason) = &self.stopped {
            return Some(reason.clone());
        }
        if let Some(SafeReport { by: By::Executive, reason, .. }) = &self.safe_entered {
            return Some(format!("safe mode was entered: {reason}"));
        }
        let LostSweeps { detections, tracks, labels } = self.lost_sweeps;
        if detections + tracks + labels > 0 {
            return Some(format!(
                "a file failed: detections lack {detections} sweeps, tracks {tracks}, labels {labels}"
            ));
        }
        if let Some(TraceReport { lost, failed: true, .. }) = self.trace {
            return Some(format!("a file failed: the trace lacks {lost} parts"));
        }
        let lossless = strict || self.pace == Pace::Fast;
        if let Some(failure) = self.recording.as_ref().and_then(|recording| recording.failure(lossless)) {
            return Some(failure);
        }
        if missing > 0 && lossless {
            return Some(format!("{missing} parts were dropped or lost"));
        }
        if strict && self.deadline.misses > 0 {
            return Some(format!("{} deadline misses", self.deadline.misses));
        }
        None
    }
}

/// Late and rejected sweeps as the sink saw them; dropped and lost ones never had an answer, so they missed it too.
fn deadline(plan: &Plan, snapshot: &Snapshot, ledger: &LedgerReport) -> DeadlineReport {
    let deadline_ms = plan.chain.deadline_ms;
    if plan.pace == Pace::Fast {
        return DeadlineReport { deadline_ms, ..DeadlineReport::default() };
    }
    let mut causes = snapshot.deadline.causes.clone();
    let mut misses = snapshot.deadline.misses;
    for (cause, sweeps) in missing_sweeps(ledger, plan.chain.sectors) {
        *causes.entry(cause).or_default() += sweeps;
        misses += sweeps;
    }
    let margin_p999_pct = snapshot.margin_p999_pct();
    let margin_ok = margin_p999_pct.map(|margin| margin >= LEAST_MARGIN_PCT);
    DeadlineReport { deadline_ms, misses, margin_p999_pct, margin_ok, causes }
}

/// Sweeps of which parts are missing, each once, by the first hop on the way that missed one and how.
///
/// A gap names the parts at its ends, and how many are missing on this hop; what was missing before is not counted
/// again. The pages keep the latest gaps by name; older ones count as the fewest sweeps that their parts can be.
fn missing_sweeps(ledger: &LedgerReport, sectors: u32) -> BTreeMap<String, u64> {
    let mut causes = BTreeMap::new();
    let mut counted = BTreeSet::new();
    for hop in &ledger.hops {
        for (kind, parts) in [("dropped", hop.dropped.values().sum::<u64>()), ("lost", hop.lost)] {
            let mut sweeps = 0;
            let mut unnamed = parts;
            for gap in ledger.gaps.iter().filter(|gap| gap.stage == hop.stage && gap.kind == kind) {
                unnamed = unnamed.saturating_sub(gap.parts);
                let new = (gap.first_sweep..=gap.last_sweep).filter(|sweep| !counted.contains(sweep));
                let new: Vec<u64> = new.take(usize::try_from(gap.parts).unwrap_or(usize::MAX)).collect();
                sweeps += new.len() as u64;
                counted.extend(new);
            }
            sweeps += unnamed.div_ceil(u64::from(sectors.max(1)));
            if sweeps > 0 {
                causes.insert(format!("{} {kind}", hop.stage), sweeps);
            }
        }
    }
    causes
}

fn cluster_range_m(plan: &Plan) -> Option<f64> {
    let table: toml::Table = plan.parameters.get("clusterer")?.parse().ok()?;
    table.get("range_d_m")?.as_float()
}

fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let system = rustix::system::uname();
    let model = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = model.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    format!(
        "{cores} cores, {}, {} {}",
        model.map_or("unknown CPU", |(_, name)| name.trim()),
        system.sysname().to_string_lossy(),
        system.release().to_string_lossy()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::ledger::{GapReport, HopReport};

    fn hop(stage: &str, dropped: u64, lost: u64) -> HopReport {
        HopReport {
            stage: stage.to_owned(),
            published: 100,
            received: 100 - dropped - lost,
            processed: 100 - dropped - lost,
            rejected: BTreeMap::new(),
            dropped: BTreeMap::from([("overflow".to_owned(), dropped)]),
            lost,
            in_flight: 0,
            open: 0,
        }
    }

    fn gap(stage: &str, kind: &str, first_sweep: u64, last_sweep: u64, parts: u64) -> GapReport {
        GapReport { stage: stage.to_owned(), kind: kind.to_owned(), first_sweep, last_sweep, parts }
    }

    fn missing(hops: Vec<HopReport>, gaps: Vec<GapReport>, sectors: u32) -> Vec<(String, u64)> {
        missing_sweeps(&LedgerReport { closed: true, hops, gaps }, sectors).into_iter().collect()
    }

    #[test]
    fn a_sweep_is_missing_once_whatever_number_of_its_parts_and_hops() {
        let hops = vec![hop("clusterer", 5, 0), hop("extractor", 0, 3)];
        let gaps = vec![
            gap("clusterer", "dropped", 3, 4, 3),
            gap("clusterer", "dropped", 4, 4, 2),
            gap("extractor", "lost", 4, 5, 3),
        ];
        let expected = [("clusterer dropped".to_owned(), 2), ("extractor lost".to_owned(), 1)];
        assert_eq!(missing(hops, gaps, 4), expected);
    }

    #[test]
    fn whole_sweeps_are_as_many_as_parts() {
        // Sweep 5 was dropped before; the extractor lost 4 and 6.
        let hops = vec![hop("clusterer", 1, 0), hop("extractor", 0, 2)];
        let gaps = vec![gap("clusterer", "dropped", 5, 5, 1), gap("extractor", "lost", 4, 6, 2)];
        let expected = [("clusterer dropped".to_owned(), 1), ("extractor lost".to_owned(), 2)];
        assert_eq!(missing(hops, gaps, 1), expected);
    }

    #[test]
    fn gaps_that_are_not_named_any_more_count_by_their_parts() {
        assert_eq!(missing(vec![hop("clusterer", 9, 0)], vec![], 1), [("clusterer dropped".to_owned(), 9)]);
        let named = vec![gap("clusterer", "dropped", 7, 7, 4)];
        assert_eq!(missing(vec![hop("clusterer", 9, 0)], named, 4), [("clusterer dropped".to_owned(), 3)]);
    }
}
