use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};

use runtime::page::{PageMap, State};
use runtime::{Plan, SOURCE};
use rustix::process::{Pid, Signal, kill_process};
use transport::Instance;

use crate::SupervisorError;
use crate::budget::Restarts;
use crate::house::stage_process;
use crate::processes::Usage;

/// How a stage's process ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// By itself, with this code.
    Code(i32),
    /// By this signal.
    Signal(i32),
    /// Somehow; it was not ours to wait for.
    Gone,
}

/// A stage as the supervisor sees it.
pub(crate) struct Watched {
    pub(crate) name: String,
    pub(crate) page: PageMap,
    pub(crate) restarts: Restarts,
    pub(crate) usage: Usage,
    /// Every process it ever was.
    pub(crate) pids: Vec<u32>,
    /// A life has ended and its successor is not connected yet.
    pub(crate) recovering: bool,
    /// It was told to leave.
    pub(crate) told: bool,
    instance: Instance,
    child: Option<Child>,
    ours: bool,
}

impl Watched {
    /// A stage that is not running yet, with a fresh page. `ours` says whether the supervisor starts it.
    pub(crate) fn new(instance: &Instance, plan: &Plan, position: usize, ours: bool) -> Result<Self, SupervisorError> {
        Self::named(instance, plan, plan.stages().nth(position).unwrap_or(SOURCE), ours)
    }

    /// The same by name, for a process that is no stage of the chain.
    pub(crate) fn named(instance: &Instance, plan: &Plan, name: &str, ours: bool) -> Result<Self, SupervisorError> {
        let name = name.to_owned();
        let page = PageMap::create(&Plan::page_path(instance, &name))?;
        let restarts = Restarts::new(plan.chain.restart_budget);
        Ok(Self {
            name,
            page,
            restarts,
            usage: Usage::default(),
            pids: Vec::new(),
            recovering: false,
            told: false,
            instance: instance.clone(),
            child: None,
            ours,
        })
    }

    /// Starts a process for it, where that is the supervisor's task.
    pub(crate) fn start(&mut self) -> Result<(), SupervisorError> {
        if !self.ours {
            return Ok(());
        }
        // In a group of its own: Ctrl-C at the terminal is for the supervisor, which ends the chain in order.
        let child = Command::new("/proc/self/exe")
            .args(["stage", &self.name, "--instance", self.instance.name()])
            .stdin(Stdio::null())
            .process_group(0)
            .spawn()
            .map_err(|cause| SupervisorError::Spawn { stage: self.name.clone(), cause })?;
        self.pids.push(child.id());
        self.child = Some(child);
        Ok(())
    }

    /// Whether it has a connected process.
    pub(crate) fn is_up(&self) -> bool {
        let settled = self.page.settled_incarnation.get();
        self.page.incarnation.get() > settled && matches!(self.page.state(), State::Running | State::Ended)
    }

    /// Whether a process of it lives.
    pub(crate) fn is_alive(&self) -> bool {
        if self.ours { self.child.is_some() } else { self.pid().is_some() }
    }

    /// Its process, if it has one.
    pub(crate) fn pid(&self) -> Option<Pid> {
        if let Some(child) = &self.child {
            return Pid::from_raw(child.id() as i32);
        }
        let lives = self.page.incarnation.get() > self.page.settled_incarnation.get();
        // By its command line: a process that nobody has waited for yet still answers signals.
        if self.ours || !lives { None } else { stage_process(&self.instance, &self.page) }
    }

    /// Whether its process has ended since the last look, and how.
    pub(crate) fn look(&mut self) -> Option<Ended> {
        use std::os::unix::process::ExitStatusExt;
        if self.ours {
            let status = self.child.as_mut()?.try_wait().ok().flatten()?;
            self.child = None;
            return Some(match (status.code(), status.signal()) {
                (Some(code), _) => Ended::Code(code),
                (None, Some(signal)) => Ended::Signal(signal),
                (None, None) => Ended::Gone,
            });
        }
        let pid = self.page.pid.get() as u32;
        let lives = self.page.incarnation.get() > self.page.settled_incarnation.get();
        if lives && self.pids.last() != Some(&pid) {
            self.pids.push(pid);
        }
        (lives && self.pid().is_none()).then_some(Ended::Gone)
    }

    /// Asks it to leave.
    pub(crate) fn tell(&mut self) {
        self.told = true;
        self.signal(Signal::TERM);
    }

    /// Ends it at once.
    pub(crate) fn kill(&self) {
        self.signal(Signal::KILL);
    }

    fn signal(&self, signal: Signal) {
        if let Some(pid) = self.pid() {
            let _ = kill_process(pid, signal); // it may have gone a moment ago
        }
    }
}
