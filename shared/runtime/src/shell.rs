use std::fs::File;
use std::time::Duration;

use events::EventId;
use messages::Part;
use rustix::fs::{FlockOperation, flock};
use transport::{Instance, Node};

use crate::guardian::Guardian;
use crate::page::{PageMap, Said, State};
use crate::{Plan, ShellError, Shutdown, clock};

/// How long a stage started by hand waits for its instance, and a successor for the settlement of its predecessor.
const PATIENCE_NS: u64 = 10_000_000_000;

/// The longest sleep without a look at signals and requests.
pub(crate) const IDLE: Duration = Duration::from_millis(50);

/// Time on purpose from which on a stage computes and does not sleep [ns]: below the least that is called hung.
const LONG_NS: u64 = 100_000_000;

/// Parts after which memory is warm and allocations are counted.
pub(crate) const WARM_UP_PARTS: u64 = 20;

/// Heap allocations of this process so far; the executable brings the counting allocator.
pub type AllocationCount = fn() -> u64;

/// What every stage's process has: its place in the instance, its page, its end.
pub struct Shell {
    pub(crate) name: String,
    pub(crate) position: u16,
    pub(crate) instance: Instance,
    pub(crate) plan: Plan,
    pub(crate) page: PageMap,
    pub(crate) incarnation: u32,
    pub(crate) shutdown: Shutdown,
    guardian: Guardian,
    /// Held as long as this life lasts: there are never two of a stage.
    _place: File,
    pub(crate) allocations: AllocationCount,
}

impl Shell {
    /// Waits for the instance's supervisor and reads its plan.
    pub fn find_plan(instance: &Instance) -> Result<Plan, ShellError> {
        if !clock::wait_for(PATIENCE_NS, || Plan::exists(instance)) {
            return Err(ShellError::NoInstance(instance.name().to_owned()));
        }
        Plan::read(instance)
    }

    /// Begins a life of stage `name`: its predecessor's account is settled, its page is this process's from here on.
    pub fn enter(instance: Instance, plan: Plan, name: &str, allocations: AllocationCount) -> Result<Self, ShellError> {
        let shutdown = Shutdown::install(plan.supervisor_pid)?;
        let guardian = Guardian::of(&instance, &plan, name)?;
        let path = Plan::page_path(&instance, name);
        let page = PageMap::open(&path)?;
        let place = File::open(&path).map_err(|cause| ShellError::File { path, cause: cause.to_string() })?;
        let is_free = || flock(&place, FlockOperation::NonBlockingLockExclusive).is_ok();
        if !clock::wait_for(PATIENCE_NS, || is_free() || shutdown.asked()) || !is_free() {
            return Err(ShellError::Taken(name.to_owned()));
        }
        let before = page.incarnation.get();
        let settled = || page.settled_incarnation.get() == before;
        if !clock::wait_for(PATIENCE_NS, || settled() || shutdown.asked()) || !settled() {
            return Err(ShellError::Unsettled(name.to_owned()));
        }
        let position = plan.stages().position(|stage| stage == name).unwrap_or(0) as u16;
        page.pid.set(u64::from(std::process::id()));
        page.set_state(State::Starting);
        page.incarnation.set(before + 1);
        page.table_active.set(plan.generation);
        page.beat(clock::now_ns());
        let shell = Self {
            name: name.to_owned(),
            position,
            instance,
            plan,
            page,
            incarnation: before as u32 + 1,
            shutdown,
            guardian,
            _place: place,
            allocations,
        };
        shell.fault_at_start();
        Ok(shell)
    }

    /// The run's plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The instance.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// This life, counted from 1.
    pub fn incarnation(&self) -> u32 {
        self.incarnation
    }

    /// Sweeps that this sink, or its lives before, have answered.
    pub fn answered_sweeps(&self) -> u64 {
        self.page.next_ordinal_out.get() / u64::from(self.plan.chain.sectors.max(1))
    }

    pub(crate) fn join(&self) -> Result<Node, ShellError> {
        Ok(Node::join(&self.instance, &self.name, self.plan.chain.queue_parts())?)
    }

    pub(crate) fn running(&self) {
        // Everything is mapped by now, and the recorder's writer has been started as an ordinary thread.
        crate::realtime::take_seat_of_stage(&self.instance, &self.plan.chain, &self.name);
        self.page.set_state(State::Running);
        self.page.beat(clock::now_ns());
        tracing::debug!(stage = self.name, incarnation = self.incarnation, "running");
    }

    /// Makes the work on a sweep longer, with its last part, where a fault on purpose asks for it. What is long computes, as a
    /// slow stage does: who sleeps for so long waits in vain, as far as anybody can tell.
    pub(crate) fn slow_down(&self, part: Part) {
        let slow_ns = self.page.slow_ns.get();
        if slow_ns == 0 || !part.is_last() {
            return;
        }
        if slow_ns < LONG_NS {
            clock::sleep_ns(slow_ns);
            return;
        }
        let end_ns = clock::now_ns() + slow_ns;
        while clock::now_ns() < end_ns && !self.leaving() {}
    }

    /// Says on the page what happened at part `ordinal`, `parts` of which are concerned.
    pub(crate) fn say(&self, id: EventId, ordinal: u64, parts: u64) {
        let sweep = ordinal / u64::from(self.plan.chain.sectors.max(1));
        self.page.say(Said { id, time_ns: clock::now_ns(), sweep, a: parts, b: ordinal });
    }

    /// Whether it is time to leave: asked to, or nobody has been left to ask for too long.
    pub(crate) fn leaving(&self) -> bool {
        self.shutdown.asked() || self.guardian.abandoned()
    }

    pub(crate) fn left(&self) {
        self.page.set_state(State::Stopped);
        self.page.beat(clock::now_ns());
    }
}
