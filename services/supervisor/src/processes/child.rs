use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};

use runtime::page::{PageMap, State};
use runtime::{Plan, SOURCE};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, Signal, kill_process, pidfd_open, pidfd_send_signal};
use transport::Instance;

use crate::SupervisorError;
use crate::house::remains::{stage_of, stage_process};
use crate::processes::usage::Usage;
use crate::restarts::budget::Restarts;

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
    process: Option<Process>,
    ours: bool,
}

/// A process that the supervisor looks after.
enum Process {
    /// It started it.
    Child(Child),
    /// The supervisor before it did. No handle where the kernel, or a sandbox, gives none.
    Adopted { pid: Pid, handle: Option<OwnedFd> },
    /// It died while nobody looked after it; that is still to be told.
    Departed,
}

impl Watched {
    /// A stage that is not running yet, with a fresh page. `ours` says whether the supervisor starts it.
    pub(crate) fn new(instance: &Instance, plan: &Plan, position: usize, ours: bool) -> Result<Self, SupervisorError> {
        Self::named(instance, plan, plan.stages().nth(position).unwrap_or(SOURCE), ours)
    }

    /// The same by name, for a process that is no stage of the chain.
    pub(crate) fn named(instance: &Instance, plan: &Plan, name: &str, ours: bool) -> Result<Self, SupervisorError> {
        let page = PageMap::create(&Plan::page_path(instance, name))?;
        Ok(Self::with_page(instance, plan, name, ours, page))
    }

    /// A stage, or a process beside the chain, of a supervisor that died: with its page as it is, and its process, if one
    /// of `living` is it.
    pub(crate) fn adopt(
        instance: &Instance,
        plan: &Plan,
        name: &str,
        ours: bool,
        living: &[(String, Pid)],
    ) -> Result<Self, SupervisorError> {
        let page = PageMap::open(&Plan::page_path(instance, name))?;
        let mut adopted = Self::with_page(instance, plan, name, ours, page);
        // What was published before it was connected may not have been named yet; once more does no harm.
        adopted.recovering = true;
        if ours {
            let has_lived = adopted.page.incarnation.get() > adopted.page.settled_incarnation.get();
            let on_page = adopted.page.pid.get();
            // One that has not taken its page yet stands nowhere but in the list of processes.
            let is_it = |pid: &Pid| !has_lived || pid.as_raw_nonzero().get() as u64 == on_page;
            let pids = living.iter().filter(|(stage, _)| stage == name).map(|(_, pid)| *pid).filter(is_it);
            let handles = pids.map(|pid| (pid, pidfd_open(pid, PidfdFlags::empty()).ok()));
            // The number may have been used again before there was a handle.
            let mut handles = handles.filter(|(pid, _)| stage_of(*pid, instance).is_some());
            adopted.process = match handles.next() {
                Some((pid, handle)) => Some(Process::Adopted { pid, handle }),
                None => has_lived.then_some(Process::Departed),
            };
            adopted.pids.extend(adopted.pid().map(|pid| pid.as_raw_nonzero().get() as u32));
        }
        Ok(adopted)
    }

    fn with_page(instance: &Instance, plan: &Plan, name: &str, ours: bool, page: PageMap) -> Self {
        let name = name.to_owned();
        let restarts = Restarts::new(plan.chain.restart_budget);
        Self {
            name,
            page,
            restarts,
            usage: Usage::default(),
            pids: Vec::new(),
            recovering: false,
            told: false,
            instance: instance.clone(),
            process: None,
            ours,
        }
    }

    /// Starts a process for it, where that is the supervisor's task and there is none.
    pub(crate) fn start(&mut self) -> Result<(), SupervisorError> {
        if !self.ours || self.process.is_some() {
            return Ok(());
        }
        // In a group of its own: Ctrl-C at the terminal is for the supervisor, which ends the chain in order.
        let child = Command::new("/proc/self/exe")
            .args(["stage", &self.name, "--instance", self.instance.name()])
            .stdin(Stdio::null())
            // The service manager listens to the supervisor alone.
            .env_remove("NOTIFY_SOCKET")
            .process_group(0)
            .spawn()
            .map_err(|cause| SupervisorError::Spawn { stage: self.name.clone(), cause })?;
        self.pids.push(child.id());
        self.process = Some(Process::Child(child));
        Ok(())
    }

    /// Whether it has a connected process.
    pub(crate) fn is_up(&self) -> bool {
        let settled = self.page.settled_incarnation.get();
        self.page.incarnation.get() > settled && matches!(self.page.state(), State::Running | State::Ended)
    }

    /// Whether a process of it lives.
    pub(crate) fn is_alive(&self) -> bool {
        if self.ours { self.process.is_some() } else { self.pid().is_some() }
    }

    /// Its process, if it has one.
    pub(crate) fn pid(&self) -> Option<Pid> {
        match &self.process {
            Some(Process::Child(child)) => return Pid::from_raw(child.id() as i32),
            Some(Process::Adopted { pid, .. }) => return Some(*pid),
            Some(Process::Departed) | None => {}
        }
        let lives = self.page.incarnation.get() > self.page.settled_incarnation.get();
        // By its command line: a process that nobody has waited for yet still answers signals.
        if self.ours || !lives { None } else { stage_process(&self.instance, &self.page) }
    }

    /// The last process that it was: of one that ended, the one that did, though it may not have taken its page yet.
    pub(crate) fn last_pid(&self) -> u64 {
        self.pids.last().map_or_else(|| self.page.pid.get(), |pid| u64::from(*pid))
    }

    /// Whether its process has ended since the last look, and how.
    pub(crate) fn look(&mut self) -> Option<Ended> {
        if self.ours {
            let ended = self.process.as_mut()?.ended(&self.instance)?;
            self.process = None;
            return Some(ended);
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
        // It may have gone a moment ago.
        if let Some(Process::Adopted { handle: Some(handle), .. }) = &self.process {
            let _ = pidfd_send_signal(handle, signal);
        } else if let Some(pid) = self.pid() {
            let _ = kill_process(pid, signal);
        }
    }
}

impl Process {
    /// How it ended, if it did.
    fn ended(&mut self, instance: &Instance) -> Option<Ended> {
        use std::os::unix::process::ExitStatusExt;
        match self {
            Self::Child(child) => {
                let status = child.try_wait().ok().flatten()?;
                Some(match (status.code(), status.signal()) {
                    (Some(code), _) => Ended::Code(code),
                    (None, Some(signal)) => Ended::Signal(signal),
                    (None, None) => Ended::Gone,
                })
            }
            Self::Adopted { pid, handle: None } => stage_of(*pid, instance).is_none().then_some(Ended::Gone),
            Self::Adopted { handle: Some(handle), .. } => {
                // Also when whoever is its parent now never waits for it.
                let mut handles = [PollFd::new(handle, PollFlags::IN)];
                let at_once = Timespec { tv_sec: 0, tv_nsec: 0 };
                poll(&mut handles, Some(&at_once)).is_ok_and(|ready| ready > 0).then_some(Ended::Gone)
            }
            Self::Departed => Some(Ended::Gone),
        }
    }
}
