//! One `encke run`, started, adopted, stopped and watched as its user would: by commands.

use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};

use runtime::page::{PageView, State};
use runtime::{Plan, clock};
use rustix::process::{Pid, Signal, kill_process};
use supervisor::Report;
use transport::Instance;

use crate::SoakError;

/// This executable, whatever has become of its file.
const ENCKE: &str = "/proc/self/exe";
/// How long a chain may take to come up [s].
const START_PATIENCE_S: u64 = 30;
/// How long it may take to end in order [ns].
const STOP_PATIENCE_NS: u64 = 40_000_000_000;

/// What to run, and where.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The instance.
    pub instance: Instance,
    /// Options of `encke run` that say what it runs: source, chain, rate.
    pub arguments: Vec<OsString>,
    /// Folder for all that is written.
    pub out: PathBuf,
}

/// A command of this executable.
pub(crate) fn encke(words: impl IntoIterator<Item = impl Into<OsString>>) -> Command {
    let mut command = Command::new(ENCKE);
    command.args(words.into_iter().map(Into::into)).stdin(Stdio::null());
    // Ctrl-C is for the soak, which ends the chain in order.
    command.process_group(0);
    command
}

/// A chain that was started, and its successors.
pub(crate) struct Run<'a> {
    setup: &'a Setup,
    child: Child,
    reports: Vec<PathBuf>,
    adoptions: u32,
}

impl<'a> Run<'a> {
    /// Starts the chain; it goes on until it is stopped. `more` are further options of `encke run`.
    pub(crate) fn start(setup: &'a Setup, more: &[OsString]) -> Result<Self, SoakError> {
        let mut run =
            Self { setup, child: spawn(setup, &report_path(setup, 0), more)?, reports: Vec::new(), adoptions: 0 };
        run.reports.push(report_path(setup, 0));
        Ok(run)
    }

    /// Starts a successor of a supervisor that died: it takes over the stages that went on, or starts anew.
    pub(crate) fn adopt(&mut self, more: &[OsString]) -> Result<(), SoakError> {
        self.adoptions += 1;
        let report = report_path(self.setup, self.reports.len());
        let mut all = vec![OsString::from("--adopt")];
        all.extend_from_slice(more);
        self.child = spawn(self.setup, &report, &all)?;
        self.reports.push(report);
        Ok(())
    }

    /// Process of the supervisor.
    pub(crate) fn pid(&self) -> u64 {
        self.child.id().into()
    }

    /// How the supervisor ended, if it has.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    /// Waits until all stages are up and gives the time that took [ms].
    pub(crate) fn await_up(&mut self) -> Result<f64, SoakError> {
        let begin_ns = clock::now_ns();
        let mut died = false;
        let up = clock::wait_for(START_PATIENCE_S * 1_000_000_000, || {
            died = self.ended().is_some();
            died || is_up(&self.setup.instance)
        });
        if up && !died {
            return Ok((clock::now_ns() - begin_ns) as f64 / 1e6);
        }
        Err(SoakError::NotUp { patience_s: START_PATIENCE_S, log: self.setup.out.join("run.log") })
    }

    /// Asks the chain to end in order and waits for it; what does not end is killed. Gives how it ended.
    pub(crate) fn stop(&mut self) -> Option<ExitStatus> {
        let asked = encke(["ctl", "stop", "--instance", self.setup.instance.name()])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        if !asked.is_ok_and(|status| status.success()) {
            signal(self.pid(), Signal::TERM);
        }
        if !clock::wait_for(STOP_PATIENCE_NS, || self.ended().is_some()) {
            signal(self.pid(), Signal::KILL);
            clock::wait_for(1_000_000_000, || self.ended().is_some());
        }
        self.ended()
    }

    /// The reports that were written, one for each supervisor that ended by itself.
    pub(crate) fn reports(&self) -> Vec<Report> {
        let read = |path: &PathBuf| serde_json::from_slice(&std::fs::read(path).ok()?).ok();
        self.reports.iter().filter_map(read).collect()
    }

    /// Supervisors that had died and were followed by another.
    pub(crate) fn adoptions(&self) -> u32 {
        self.adoptions
    }
}

impl Drop for Run<'_> {
    fn drop(&mut self) {
        if self.ended().is_none() {
            self.stop();
        }
    }
}

fn report_path(setup: &Setup, number: usize) -> PathBuf {
    let name = if number == 0 { "report.json".to_owned() } else { format!("report-{number}.json") };
    setup.out.join(name)
}

fn spawn(setup: &Setup, report: &Path, more: &[OsString]) -> Result<Child, SoakError> {
    let log = |name: &str| -> Result<File, SoakError> {
        let path = setup.out.join(name);
        OpenOptions::new().create(true).append(true).open(&path).map_err(SoakError::file(&path))
    };
    let mut command = encke(["run", "--instance", setup.instance.name(), "--duration", "forever", "--report"]);
    command.arg(report).args(&setup.arguments).args(more);
    command.stdout(log("summary.txt")?).stderr(log("run.log")?).spawn().map_err(SoakError::file(Path::new(ENCKE)))
}

/// Whether all stages of the instance are connected.
pub(crate) fn is_up(instance: &Instance) -> bool {
    let Ok(plan) = Plan::read(instance) else { return false };
    plan.stages().all(|stage| {
        let page = PageView::open(&Plan::page_path(instance, stage));
        page.is_ok_and(|page| page.counts().state == State::Running)
    })
}

/// Sends a signal; whoever is gone does not get it.
pub(crate) fn signal(pid: u64, signal: Signal) {
    if let Some(pid) = i32::try_from(pid).ok().and_then(Pid::from_raw) {
        let _ = kill_process(pid, signal);
    }
}

/// What an instance left on disk, in shared memory, and among the processes.
pub(crate) fn leftovers(instance: &Instance) -> Vec<String> {
    let mut left = instance.shared_memory();
    left.extend(instance.dir().exists().then(|| instance.dir().display().to_string()));
    left.extend(crate::look::processes_of(instance).into_iter().map(|pid| format!("process {pid}")));
    left
}
