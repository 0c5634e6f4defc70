use std::collections::BTreeMap;

use lidar::ObstacleClass;
use recorder::{LostSweeps, Percentiles, Snapshot, WorstSweep};
use runtime::{Pace, Plan};
use serde::{Deserialize, Serialize};

use crate::ledger::LedgerReport;
use crate::overload::OverloadReport;
use crate::processes::ProcessReport;

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
    /// The sweeps that took longest, longest first.
    pub worst_sweeps: Vec<WorstSweep>,
    /// The processes, the source first, the supervisor last.
    pub processes: Vec<ProcessReport>,
    /// Detections by class.
    pub detections: BTreeMap<ObstacleClass, u64>,
    /// Accepted returns of all sweeps.
    pub returns: u64,
    /// Refused returns of all sweeps, by reason.
    pub refused: BTreeMap<String, u64>,
    /// Sweeps that were seen from wrap to wrap.
    pub complete_sweeps: u64,
    /// Sweeps that a file lacks because it could not be written.
    pub lost_sweeps: LostSweeps,
    /// Why the run stopped before its end, where it did.
    pub stopped: Option<String>,
}

/// Where the time went.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct LatencyReport {
    /// From a sweep's last return to its last detection sent.
    pub end_to_end: Percentiles,
    /// By stage.
    pub stages: BTreeMap<String, StageLatency>,
}

/// One stage's share.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct StageLatency {
    /// From sent (and the stage free) until `process` began.
    pub transport: Percentiles,
    /// Sent, and the stage still busy with the part before.
    pub queued: Percentiles,
    /// In `process`.
    pub busy: Percentiles,
}

/// Sweeps that came late or not at all.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct DeadlineReport {
    /// From a sweep's last return to its last detection sent [ms].
    pub deadline_ms: f64,
    /// Sweeps that missed it: late, dropped or lost.
    pub misses: u64,
    /// Share of the deadline that 99.9 % of the sweeps leave free [%].
    pub margin_p999_pct: Option<f64>,
    /// Misses by cause.
    pub causes: BTreeMap<String, u64>,
}

/// What the supervisor knows at the end.
pub(crate) struct Facts<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) snapshot: Snapshot,
    pub(crate) ledger: LedgerReport,
    pub(crate) published: u64,
    pub(crate) duration_s: f64,
    pub(crate) processes: Vec<ProcessReport>,
    pub(crate) overload: OverloadReport,
    pub(crate) stopped: Option<String>,
}

impl Report {
    pub(crate) fn of(facts: Facts<'_>) -> Self {
        let Facts { plan, snapshot, ledger, published, duration_s, processes, overload, stopped } = facts;
        let stages = snapshot.stages.iter().map(|stage| {
            let latency = StageLatency {
                transport: stage.transport.percentiles(),
                queued: stage.queued.percentiles(),
                busy: stage.busy.percentiles(),
            };
            (stage.stage.clone(), latency)
        });
        Self {
            encke: env!("CARGO_PKG_VERSION").to_owned(),
            machine: machine(),
            source: plan.source.from.display().to_string(),
            sweeps: published / u64::from(plan.chain.sectors.max(1)),
            sectors: plan.chain.sectors,
            pace: plan.pace,
            cluster_range_m: cluster_range_m(plan),
            period_ms: snapshot.period_ns.map(|period_ns| period_ns as f64 / 1e6),
            duration_s,
            latency_ms: LatencyReport { end_to_end: snapshot.end_to_end.percentiles(), stages: stages.collect() },
            obstacle_latency_ms: snapshot.obstacle.percentiles(),
            seam_latency_ms: snapshot.seam.percentiles(),
            deadline: deadline(plan, &snapshot, &ledger),
            overload,
            worst_sweeps: snapshot.worst,
            processes,
            detections: ObstacleClass::ALL
                .into_iter()
                .map(|class| (class, snapshot.detections.get(&class).copied().unwrap_or(0)))
                .collect(),
            returns: snapshot.returns,
            refused: snapshot.refused,
            complete_sweeps: snapshot.complete_sweeps,
            lost_sweeps: snapshot.lost_sweeps,
            ledger,
            stopped,
        }
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
        let LostSweeps { detections, labels } = self.lost_sweeps;
        if detections + labels > 0 {
            return Some(format!("a file failed: detections lack {detections} sweeps, labels {labels}"));
        }
        if missing > 0 && (strict || self.pace == Pace::Fast) {
            return Some(format!("{missing} parts were dropped or lost"));
        }
        if strict && self.deadline.misses > 0 {
            return Some(format!("{} deadline misses", self.deadline.misses));
        }
        None
    }
}

/// Late sweeps as the sink saw them; dropped and lost ones never had an answer, so they missed it too.
fn deadline(plan: &Plan, snapshot: &Snapshot, ledger: &LedgerReport) -> DeadlineReport {
    let deadline_ms = plan.chain.deadline_ms;
    if plan.pace == Pace::Fast {
        return DeadlineReport { deadline_ms, ..DeadlineReport::default() };
    }
    let mut causes = snapshot.deadline.causes.clone();
    let mut misses = snapshot.deadline.misses;
    for hop in &ledger.hops {
        for (cause, parts) in [("dropped", hop.dropped.values().sum()), ("lost", hop.lost)] {
            if parts > 0 {
                *causes.entry(format!("{} {cause}", hop.stage)).or_default() += parts;
                misses += parts;
            }
        }
    }
    DeadlineReport { deadline_ms, misses, margin_p999_pct: snapshot.margin_p999_pct(), causes }
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
