use std::collections::BTreeMap;

use chain::{Mode, SUPERVISOR};
use messages::Step;
use runtime::page::{PageMap, Tier};
use runtime::{Plan, SOURCE, ShellError, clock};
use serde::{Deserialize, Serialize};
use transport::Instance;

use crate::executive::condition_name;
use crate::processes::usage::cpu_and_memory;

/// A running chain at this moment.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Status {
    /// The instance.
    pub instance: String,
    /// The mode that was asked for last, by its word.
    pub mode: String,
    /// From the moment when it was asked for until it was in effect [ms]; null while it is not.
    pub mode_took_ms: Option<f64>,
    /// Changes of mode so far.
    pub mode_changes: u64,
    /// Changes that did not take effect within two sweeps.
    pub modes_late: u64,
    /// Commands carried out so far.
    pub commands_accepted: u64,
    /// Commands refused so far.
    pub commands_refused: u64,
    /// Sweeps that the source has published.
    pub sweep: u64,
    /// Sectors that a sweep travels as: so many parts are one sweep.
    pub sectors: u32,
    /// Step of degradation in force.
    pub step: String,
    /// Of the latest sweep, from its last return to its last detection sent; null before the first.
    #[serde(default)]
    pub latency_ms: Option<f64>,
    /// The stages in flow order, the source first.
    pub stages: Vec<StageStatus>,
}

/// One stage at this moment.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct StageStatus {
    /// Its name.
    pub stage: String,
    /// Its process.
    pub pid: u64,
    /// Where it is in its life.
    pub state: String,
    /// Which build of the stage it is: `configured`, `built-in` or `stand-in`.
    pub tier: String,
    /// What is the matter with it: dead, hung, spinning, slow, silent, flooding; well.
    pub condition: String,
    /// Restarts so far.
    pub restarts: u64,
    /// Since its working thread last showed that it is alive [ms].
    pub heartbeat_age_ms: f64,
    /// Parts received.
    pub received: u64,
    /// Parts published; the sink: accepted.
    pub published: u64,
    /// Parts that overflowed the queue before it.
    pub dropped: u64,
    /// Parts that died with a process on the way to it, or in it.
    pub lost: u64,
    /// Parts processed; the sink: written.
    #[serde(default)]
    pub processed: u64,
    /// Parts rejected, by reason.
    #[serde(default)]
    pub rejected: BTreeMap<String, u64>,
    /// Sweeps on which it was busy for longer than its budget.
    #[serde(default)]
    pub overruns: u64,
    /// Parts that were waiting when it had finished the one before.
    #[serde(default)]
    pub slips: u64,
    /// Sweeps that left it after the deadline.
    #[serde(default)]
    pub late: u64,
    /// Parts that wait for it; null for the source.
    #[serde(default)]
    pub queue: Option<u64>,
    /// CPU time of its process [s]; null where none lives.
    #[serde(default)]
    pub cpu_s: Option<f64>,
    /// Memory resident [MiB]; null where none lives.
    #[serde(default)]
    pub rss_mib: Option<f64>,
}

/// Reads the pages of a running instance.
pub fn status(instance: &Instance) -> Result<Status, ShellError> {
    let plan = Plan::read(instance)?;
    let mut stages = Vec::new();
    let (mut published_before, mut latency_ms) = (None, None);
    for stage in plan.stages() {
        let page = PageMap::open(&Plan::page_path(instance, stage))?;
        let lives = page.incarnation.get() > page.settled_incarnation.get();
        let used = cpu_and_memory(page.pid.get() as u32).filter(|_| lives);
        if page.answered_ns.get() > 0 {
            latency_ms = Some(page.latency_ns.get() as f64 / 1e6);
        }
        stages.push(StageStatus {
            stage: stage.to_owned(),
            pid: page.pid.get(),
            state: page.state().name().to_owned(),
            tier: Tier::from_number(page.tier.get()).name().to_owned(),
            condition: condition_name(page.condition.get()).to_owned(),
            restarts: page.incarnation.get().saturating_sub(1),
            heartbeat_age_ms: clock::now_ns().saturating_sub(page.heartbeat_ns.get()) as f64 / 1e6,
            received: page.received.get(),
            published: page.published.get(),
            dropped: page.dropped.get(),
            lost: page.lost.get(),
            processed: page.processed.get(),
            rejected: page.rejected_by_reason().map(|(verdict, parts)| (verdict.name().to_owned(), parts)).collect(),
            overruns: page.overruns.get(),
            slips: page.slips.get(),
            late: page.late.get(),
            queue: published_before.map(|published: u64| published.saturating_sub(page.next_sequence.get())),
            cpu_s: used.map(|(cpu_s, _)| cpu_s),
            rss_mib: used.map(|(_, rss_kib)| rss_kib as f64 / 1024.0),
        });
        published_before = Some(page.published.get());
    }
    let sectors = plan.chain.sectors;
    let source = PageMap::open(&Plan::page_path(instance, SOURCE))?;
    let sweep = source.next_ordinal_out.get() / u64::from(sectors.max(1));
    let step = Step::from_number(source.step.get() as u32).name().to_owned();
    let own = PageMap::open(&Plan::page_path(instance, SUPERVISOR))?;
    let mode = Mode::from_number(own.mode.get());
    // The chain begins in its first mode: nobody asked for it.
    let took_ns = own.mode_took_ns.get();
    let mode_took_ms = (own.mode_asked_ns.get() == 0 || took_ns > 0).then_some(took_ns as f64 / 1e6);
    Ok(Status {
        instance: instance.name().to_owned(),
        mode: mode.name().to_owned(),
        mode_took_ms,
        mode_changes: own.mode_changes.get(),
        modes_late: own.modes_late.get(),
        commands_accepted: own.commands_accepted.get(),
        commands_refused: own.commands_refused.get(),
        sweep,
        sectors,
        step,
        latency_ms,
        stages,
    })
}
