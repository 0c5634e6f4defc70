//! A running chain as a viewer has it: the plan, the pages, a place to tap from.

use runtime::page::PageView;
use runtime::{Pace, Plan, Shutdown};
use transport::{Instance, Node};

use crate::MonitorError;

/// Attached to a running instance.
pub(crate) struct Attached {
    pub(crate) facts: Facts,
    /// The stages' pages in flow order.
    pub(crate) pages: Vec<PageView>,
    pub(crate) node: Node,
    /// Signals to this process, and whether the supervisor lives.
    pub(crate) shutdown: Shutdown,
}

/// What does not change while the chain runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Facts {
    pub(crate) instance: String,
    pub(crate) source: String,
    /// At the sensor's pace; only then is there a deadline.
    pub(crate) paced: bool,
    pub(crate) sectors: u32,
    pub(crate) deadline_ms: f64,
    /// In flow order, the source first, the sink last.
    pub(crate) stages: Vec<String>,
    pub(crate) supervisor_pid: u32,
}

impl Attached {
    /// Attaches to an instance whose supervisor is up, under `name`.
    ///
    /// # Errors
    /// A file of it cannot be read; it may be starting or ending.
    pub(crate) fn to(instance: &Instance, name: &str) -> Result<Self, MonitorError> {
        let plan = Plan::read(instance)?;
        let shutdown = Shutdown::install(plan.supervisor_pid)?;
        let pages = plan.stages().map(|stage| PageView::open(&Plan::page_path(instance, stage)));
        let pages = pages.collect::<Result<_, _>>()?;
        let node = Node::visit(instance, name, plan.chain.queue_parts())?;
        Ok(Self { facts: Facts::of(instance, &plan), pages, node, shutdown })
    }
}

impl Facts {
    fn of(instance: &Instance, plan: &Plan) -> Self {
        Self {
            instance: instance.name().to_owned(),
            source: plan.source.from.display().to_string(),
            paced: plan.pace == Pace::Realtime,
            sectors: plan.chain.sectors.max(1),
            deadline_ms: plan.chain.deadline_ms,
            stages: plan.stages().map(str::to_owned).collect(),
            supervisor_pid: plan.supervisor_pid,
        }
    }
}
