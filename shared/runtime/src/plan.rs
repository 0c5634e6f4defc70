use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use chain::Chain;
use chain::executive::Executive;
use serde::{Deserialize, Serialize};
use transport::Instance;

use crate::ShellError;

/// Name of the source among the stages of a chain.
pub const SOURCE: &str = "source";

/// Sweeps that are kept beside those that wait in a queue, where they may have to be sent again: the one under way, and
/// one that the sink has and has not yet written.
const KEPT_BESIDE: usize = 2;

/// Name of the process that reads along and keeps what the chain says.
pub const TAPE: &str = "tape";

/// Everything that the processes of one run must agree on. Written once by the supervisor into the instance's folder.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Plan {
    /// Process of the supervisor.
    pub supervisor_pid: u32,
    /// The topology.
    pub chain: Chain,
    /// What is watched while it runs, and what is done about it.
    pub executive: Executive,
    /// Generation of `parameters` and `executive`: how often they were replaced while the chain ran.
    pub generation: u64,
    /// Text of each stage's parameter file, by the stage's name.
    pub parameters: BTreeMap<String, String>,
    /// Where sweeps come from.
    pub source: SourcePlan,
    /// Name of the sensor model that they are read with, once that is found.
    pub sensor: String,
    /// How fast.
    pub pace: Pace,
    /// Sweeps after which the source ends.
    pub sweeps: Option<u64>,
    /// Sensor time after which the source ends [ns].
    pub duration_ns: Option<u64>,
    /// What the sink writes.
    pub outputs: Outputs,
    /// Folders in which configuration is looked for before what is built in; absolute.
    pub config_dirs: Vec<PathBuf>,
}

/// Where sweeps come from.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct SourcePlan {
    /// A scene, a recording, or a live sensor's address.
    pub from: PathBuf,
    /// Format of the recording, where it is not to be found by content.
    pub format: Option<String>,
    /// The topic of an MCAP file that holds several, where it is not to be found.
    pub topic: Option<String>,
    /// Both returns of a firing in dual-return mode, not the strongest alone.
    pub both_returns: bool,
    /// Sensor model, where it is not to be found by format or scene.
    pub sensor: Option<String>,
    /// Nearest accepted range [m], where it is not the sensor file's.
    pub min_range_m: Option<f64>,
    /// Farthest accepted range [m], where it is not the sensor file's.
    pub max_range_m: Option<f64>,
    /// Seconds of sensor time in a second of host time at [`Pace::Realtime`], 0.1 to 10.
    pub rate: f64,
    /// Each sweep waits until somebody asks for it (`encke ctl step`).
    pub single_step: bool,
    /// Start again at the recording's end.
    pub repeat: bool,
    /// Seed of the scene, where it is not the scene's own.
    pub seed: Option<u64>,
}

/// How fast the source sends.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Pace {
    /// At the sensor's rate; a slow stage drops and counts.
    Realtime,
    /// As fast as the chain goes; nothing is dropped.
    Fast,
}

/// What the sink writes.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Outputs {
    /// Detections, one JSON line a sweep.
    pub detections: Option<PathBuf>,
    /// Tracks, one JSON line a sweep.
    pub tracks: Option<PathBuf>,
    /// Labels, one CSV row a return.
    pub labels: Option<PathBuf>,
    /// The way of every part in the Trace Event Format.
    pub trace: Option<PathBuf>,
    /// Sweeps, detections and more, in MCAP.
    pub record: Option<PathBuf>,
    /// What happens, one JSON line an event; the supervisor writes it.
    pub events: Option<PathBuf>,
}

impl Plan {
    /// Where an instance's plan lies.
    fn path(instance: &Instance) -> PathBuf {
        instance.dir().join("plan.json")
    }

    /// Writes the plan; appears as a whole or not at all, because stages may be waiting for it.
    pub fn write(&self, instance: &Instance) -> Result<(), ShellError> {
        let path = Self::path(instance);
        let text = serde_json::to_vec_pretty(self).map_err(|cause| failed(&path, cause))?;
        let scratch = path.with_extension("part");
        fs::write(&scratch, text).and_then(|()| fs::rename(&scratch, &path)).map_err(|cause| failed(&path, cause))
    }

    /// Reads the plan of a running instance.
    pub fn read(instance: &Instance) -> Result<Self, ShellError> {
        let path = Self::path(instance);
        let text = fs::read(&path).map_err(|cause| failed(&path, cause))?;
        serde_json::from_slice(&text).map_err(|cause| failed(&path, cause))
    }

    /// Whether the instance has a plan yet.
    pub fn exists(instance: &Instance) -> bool {
        Self::path(instance).exists()
    }

    /// Where a stage's page lies.
    pub fn page_path(instance: &Instance, stage: &str) -> PathBuf {
        instance.dir().join(format!("{stage}.page"))
    }

    /// Where the sink keeps the statistics of one of its lives.
    pub fn snapshot_path(instance: &Instance, incarnation: u32) -> PathBuf {
        instance.dir().join(format!("statistics.{incarnation}.json"))
    }

    /// Where the supervisor writes what happens.
    pub fn events_path(instance: &Instance) -> PathBuf {
        instance.dir().join("events.jsonl")
    }

    /// Where the tape keeps what one of its lives has written.
    pub fn counts_path(instance: &Instance, incarnation: u32) -> PathBuf {
        instance.dir().join(format!("recorded.{incarnation}.json"))
    }

    /// Names of all stages in flow order, the source first, the sink last.
    pub fn stages(&self) -> impl Iterator<Item = &str> {
        std::iter::once(SOURCE).chain(self.chain.stages.iter().map(|stage| stage.name.as_str()))
    }

    /// Name of the process that reads along and writes [`Outputs::record`], where there is one.
    pub fn tape(&self) -> Option<&'static str> {
        self.outputs.record.is_some().then_some(TAPE)
    }

    /// The next generation: other parameters of stages, by name (those left out stay), and another table of the executive.
    pub fn replace_tables(&mut self, parameters: BTreeMap<String, String>, executive: Executive) {
        self.parameters.extend(parameters);
        self.executive = executive;
        self.generation += 1;
    }

    /// Sweeps that the source may send again at [`Pace::Fast`].
    pub fn kept_sweeps(&self) -> usize {
        self.chain.queue_sweeps + KEPT_BESIDE
    }

    /// Parts that may be in flight at [`Pace::Fast`]. Half a queue: after a death up to twice as many may be.
    pub fn window_parts(&self) -> u64 {
        (self.chain.queue_parts() as u64 / 2).max(1)
    }
}

fn failed(path: &Path, cause: impl ToString) -> ShellError {
    ShellError::File { path: path.to_owned(), cause: cause.to_string() }
}
