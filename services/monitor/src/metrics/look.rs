//! One look at all pages of an instance.

use std::collections::BTreeMap;

use chain::SUPERVISOR;
use events::{Event, EventId};
use runtime::page::{Counts, PageView};
use runtime::{Pace, Plan, TAPE};
use transport::Instance;

use crate::process::Usage;

/// A chain at one moment.
#[derive(Clone, Debug, Default)]
pub(super) struct Look {
    pub(super) instance: String,
    pub(super) source: String,
    pub(super) sensor: String,
    pub(super) pace: &'static str,
    pub(super) sectors: u32,
    /// At the sensor's pace only.
    pub(super) deadline_ms: Option<f64>,
    pub(super) at_ns: u64,
    pub(super) supervisor_pid: u32,
    pub(super) supervisor: (Counts, Option<Usage>),
    /// In flow order, the source first, the sink last.
    pub(super) stages: Vec<(String, Counts, Option<Usage>)>,
    /// The tape, where the run records.
    pub(super) tape: Option<(Counts, Option<Usage>)>,
}

impl Look {
    /// Reads the plan and the pages; none where there is no chain, or it is just starting or ending.
    pub(super) fn take(instance: &Instance) -> Option<Self> {
        let plan = Plan::read(instance).ok()?;
        let page = |name: &str| Some(PageView::open(&Plan::page_path(instance, name)).ok()?.counts());
        let of = |name: &str| {
            let counts = page(name)?;
            let lives = counts.incarnation > counts.settled_incarnation;
            Some((counts, if lives { Usage::of(counts.pid) } else { None }))
        };
        let stages = plan.stages().map(|name| of(name).map(|(counts, usage)| (name.to_owned(), counts, usage)));
        Some(Self {
            instance: instance.name().to_owned(),
            source: plan.source.from.display().to_string(),
            sensor: plan.sensor.clone(),
            pace: if plan.pace == Pace::Realtime { "realtime" } else { "fast" },
            sectors: plan.chain.sectors.max(1),
            deadline_ms: (plan.pace == Pace::Realtime).then_some(plan.chain.deadline_ms),
            at_ns: runtime::clock::now_ns(),
            supervisor_pid: plan.supervisor_pid,
            supervisor: (page(SUPERVISOR)?, Usage::of(u64::from(plan.supervisor_pid))),
            stages: stages.collect::<Option<_>>()?,
            tape: plan.tape().and_then(|_| of(TAPE)),
        })
    }
}

/// Events by number: how often each was said or counted.
#[derive(Clone, Debug, Default)]
pub(super) struct Told {
    pub(super) events: BTreeMap<EventId, u64>,
    pub(super) unsaid: u64,
}

impl Told {
    pub(super) fn add(&mut self, event: &Event) {
        let Some(id) = event.event_id() else { return };
        let count = self.events.entry(id).or_default();
        *count = count.saturating_add(1);
        self.unsaid = self.unsaid.saturating_add(event.unsaid);
    }
}
