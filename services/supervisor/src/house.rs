//! One supervisor per instance, and nothing left behind by those that died.

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use runtime::page::{Page, PageMap};
use runtime::{Plan, clock};
use rustix::fs::{FlockOperation, flock};
use rustix::process::{Pid, Signal, kill_process};
use transport::Instance;

use crate::SupervisorError;

/// The lock of a running instance, held by its supervisor as long as it lives.
const LOCK: &str = "lock";
/// Orders the starts and clean-ups of all instances of a user.
const START_LOCK: &str = ".lock";

/// An instance that this process supervises.
pub(crate) struct House {
    instance: Instance,
    _lock: File,
}

impl House {
    /// Takes the instance: removes what dead supervisors left (of any instance), makes a fresh folder, locks it.
    pub(crate) fn take(instance: Instance, iceoryx2_config: &str) -> Result<Self, SupervisorError> {
        let base = Instance::base_dir();
        instance.make_private_dir()?;
        let _starting = lock(&base.join(START_LOCK))?;
        for other in Instance::all() {
            match Running::of(&other) {
                Some(Running { pid, .. }) if other == instance => {
                    return Err(SupervisorError::Running { name: instance.name().to_owned(), pid });
                }
                Some(_) => {}
                None => remove_remains(&other)?,
            }
        }
        instance.make_private_dir()?;
        let mut lock = lock(&instance.dir().join(LOCK))?;
        let written = writeln!(lock, "{}", std::process::id());
        written.map_err(|cause| system("write the instance's lock", cause))?;
        instance.write_config(iceoryx2_config, std::process::id())?;
        Ok(Self { instance, _lock: lock })
    }

    pub(crate) fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Leaves nothing behind. All other processes of the instance are gone.
    pub(crate) fn leave(self) -> Result<(), SupervisorError> {
        let _starting = lock(&Instance::base_dir().join(START_LOCK))?;
        Ok(self.instance.remove()?)
    }
}

/// A running instance.
#[derive(Clone, Debug)]
pub struct Running {
    /// Its name.
    pub name: String,
    /// Process of its supervisor.
    pub pid: u32,
}

impl Running {
    /// The instance's supervisor, if one lives.
    pub fn of(instance: &Instance) -> Option<Self> {
        let path = instance.dir().join(LOCK);
        let mut file = File::open(&path).ok()?;
        if flock(&file, FlockOperation::NonBlockingLockShared).is_ok() {
            return None; // nobody holds it: its owner is dead
        }
        let mut text = String::new();
        file.read_to_string(&mut text).ok()?;
        Some(Self { name: instance.name().to_owned(), pid: text.trim().parse().ok()? })
    }
}

/// All running instances of this user, by name.
pub fn running_instances() -> Vec<Running> {
    Instance::all().iter().filter_map(Running::of).collect()
}

fn lock(path: &Path) -> Result<File, SupervisorError> {
    let open = OpenOptions::new().create(true).truncate(false).read(true).write(true).mode(0o600).open(path);
    let file = open.map_err(|cause| system("open a lock", cause))?;
    // Never waits long: the start lock orders rivals, and a look at an instance holds its lock for a moment.
    flock(&file, FlockOperation::LockExclusive).map_err(|cause| system("take a lock", cause.into()))?;
    Ok(file)
}

/// Ends the stages of a supervisor that died, if any still run, and removes its instance.
fn remove_remains(instance: &Instance) -> Result<(), SupervisorError> {
    for pid in stages_of(instance) {
        let _ = kill_process(pid, Signal::KILL); // it may have left by itself
        clock::wait_for(1_000_000_000, || !is_stage_of(pid, instance));
    }
    Ok(instance.remove()?)
}

fn stages_of(instance: &Instance) -> Vec<Pid> {
    let Ok(plan) = Plan::read(instance) else { return Vec::new() };
    let pages = plan.stages().filter_map(|stage| PageMap::open(&Plan::page_path(instance, stage)).ok());
    pages.filter_map(|page| stage_process(instance, &page)).collect()
}

/// The process of a stage of an instance, if it lives and is one.
pub fn stage_process(instance: &Instance, page: &Page) -> Option<Pid> {
    Pid::from_raw(page.pid.get() as i32).filter(|pid| is_stage_of(*pid, instance))
}

/// Whether the process is `encke stage … --instance NAME`: process numbers are used again.
fn is_stage_of(pid: Pid, instance: &Instance) -> bool {
    let line = fs::read(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).unwrap_or_default();
    let words: Vec<&[u8]> = line.split(|byte| *byte == 0).collect();
    words.contains(&b"stage".as_slice()) && words.contains(&instance.name().as_bytes())
}

fn system(what: &str, cause: std::io::Error) -> SupervisorError {
    SupervisorError::System { what: what.to_owned(), cause }
}
