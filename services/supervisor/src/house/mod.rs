//! One supervisor per instance, and nothing left behind by those that died.

pub(crate) mod adopting;
pub(crate) mod remains;
pub(crate) mod services;

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use runtime::{Plan, clock};
use rustix::fs::{FlockOperation, flock};
use rustix::process::Pid;
use transport::Instance;

use crate::house::remains::{living, take_down};
use crate::{Settings, SupervisorError};

/// Orders the starts and clean-ups of all instances of a user.
const START_LOCK: &str = ".lock";

/// An instance that this process supervises.
pub(crate) struct House {
    instance: Instance,
    iceoryx2_config: String,
    _lock: File,
    adopted: Option<Adopted>,
}

/// A chain whose supervisor died, and that goes on.
pub(crate) struct Adopted {
    /// The plan that it runs by, now with this process as supervisor.
    pub(crate) plan: Plan,
    /// Its living processes, by the stage's name.
    pub(crate) living: Vec<(String, Pid)>,
    /// The supervisor that died.
    pub(crate) before: u32,
}

impl House {
    /// Takes the instance. What dead supervisors left is removed, of any instance of which no process lives; processes of
    /// another instance that wait to be adopted are left alone.
    ///
    /// Of this instance they are adopted, if that is wished (`adopt`) and they run by the same plan; else they are ended,
    /// and a fresh folder is made.
    pub(crate) fn take(settings: &Settings<'_>) -> Result<Self, SupervisorError> {
        let instance = &settings.instance;
        instance.make_private_dir()?;
        let _starting = lock(&Instance::base_dir().join(START_LOCK))?;
        if let Some(Running { pid, .. }) = Running::of(instance) {
            return Err(SupervisorError::Running { name: instance.name().to_owned(), pid });
        }
        for other in Instance::all() {
            if other != *instance && Running::of(&other).is_none() && living(&other).is_empty() {
                other.remove()?;
            }
        }
        let adopted = if settings.adopt { Adopted::of(instance, &settings.plan) } else { None };
        if adopted.is_none() {
            return Self::begin(instance.clone(), settings.iceoryx2_config);
        }
        // The stages look at the lock for a moment each, and find it taken from here on.
        let lock = mark(&instance.lock_path())?;
        let iceoryx2_config = settings.iceoryx2_config.to_owned();
        Ok(Self { instance: instance.clone(), iceoryx2_config, _lock: lock, adopted })
    }

    /// Takes the instance as if nobody had been there, after all.
    pub(crate) fn start_over(self, iceoryx2_config: &str) -> Result<Self, SupervisorError> {
        let _starting = lock(&Instance::base_dir().join(START_LOCK))?;
        Self::begin(self.instance, iceoryx2_config)
    }

    fn begin(instance: Instance, iceoryx2_config: &str) -> Result<Self, SupervisorError> {
        let ended = take_down(&instance);
        if ended > 0 {
            tracing::warn!(instance = instance.name(), ended, "ended the processes of a supervisor that died");
        }
        instance.remove()?;
        instance.make_private_dir()?;
        let lock = mark(&instance.lock_path())?;
        instance.write_config(iceoryx2_config, std::process::id())?;
        Ok(Self { instance, iceoryx2_config: iceoryx2_config.to_owned(), _lock: lock, adopted: None })
    }

    /// Whoever joins the instance from now on finds nothing in shared memory of those who joined before.
    pub(crate) fn begin_generation(&self) -> Result<(), SupervisorError> {
        let generation = format!("{}-{}", std::process::id(), clock::now_ns() / 1_000_000);
        Ok(self.instance.write_config(&self.iceoryx2_config, generation)?)
    }

    /// What there was to adopt.
    pub(crate) fn adopted(&self) -> Option<&Adopted> {
        self.adopted.as_ref()
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
        let mut file = File::open(instance.lock_path()).ok()?;
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

impl Adopted {
    /// What is there to adopt: a living process, and a plan that is the one wanted.
    fn of(instance: &Instance, wanted: &Plan) -> Option<Self> {
        let living = living(instance);
        let running = Plan::read(instance).ok().filter(|_| !living.is_empty())?;
        let before = running.supervisor_pid;
        match adoptable(&running, wanted) {
            Ok(plan) => Some(Self { plan, living, before }),
            Err(differs) => {
                tracing::warn!(
                    instance = instance.name(),
                    differs = differs.join(", "),
                    "not adopted: the chain was started otherwise; it is ended, and started anew"
                );
                None
            }
        }
    }
}

/// The plan under which a successor takes over a running chain, or what of it differs from what the successor wants. Tables
/// that were replaced while the chain ran stay in use.
fn adoptable(running: &Plan, wanted: &Plan) -> Result<Plan, Vec<String>> {
    let plan = Plan { supervisor_pid: wanted.supervisor_pid, ..running.clone() };
    let mut wanted = Plan { generation: running.generation, sensor: running.sensor.clone(), ..wanted.clone() };
    if running.generation > 0 {
        (wanted.parameters, wanted.executive) = (running.parameters.clone(), running.executive.clone());
    }
    // As a file has them: a number that was written and read may differ in its last bit.
    let table = |plan: &Plan| -> Result<serde_json::Map<String, serde_json::Value>, serde_json::Error> {
        serde_json::from_slice(&serde_json::to_vec(plan)?)
    };
    let (Ok(one), Ok(other)) = (table(&plan), table(&wanted)) else { return Err(vec!["plan".to_owned()]) };
    let differ: Vec<String> =
        one.into_iter().filter(|(key, value)| other.get(key) != Some(value)).map(|(key, _)| key).collect();
    if differ.is_empty() { Ok(plan) } else { Err(differ) }
}

/// The plan of the chain that [`crate::run`] would adopt for this one, if there is such a chain. What it runs by was checked
/// when it was started, and its source may be in use: it need not, and cannot always, be opened again.
pub fn find_adoptable(instance: &Instance, wanted: &Plan) -> Option<Plan> {
    if Running::of(instance).is_some() || living(instance).is_empty() {
        return None;
    }
    adoptable(&Plan::read(instance).ok()?, wanted).ok()
}

/// Takes an instance's lock and says who has it.
fn mark(path: &Path) -> Result<File, SupervisorError> {
    let mut lock = lock(path)?;
    let written = lock.set_len(0).and_then(|()| writeln!(lock, "{}", std::process::id()));
    written.map_err(|cause| system("write the instance's lock", cause))?;
    Ok(lock)
}

fn lock(path: &Path) -> Result<File, SupervisorError> {
    let open = OpenOptions::new().create(true).truncate(false).read(true).write(true).mode(0o600).open(path);
    let file = open.map_err(|cause| system("open a lock", cause))?;
    // Never waits long: the start lock orders rivals, and a look at an instance holds its lock for a moment.
    flock(&file, FlockOperation::LockExclusive).map_err(|cause| system("take a lock", cause.into()))?;
    Ok(file)
}

fn system(what: &str, cause: std::io::Error) -> SupervisorError {
    SupervisorError::System { what: what.to_owned(), cause }
}
