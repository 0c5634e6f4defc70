//! What `--from` may be.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lidar::{SensorFile, SensorModel};
use replay::{Format, Live, LiveAddress, Options, Recording};
use runtime::SourcePlan;
use simulator::{SceneFile, Simulator};

use crate::Failure;
use crate::assets::Assets;

/// A source that can be run.
pub(crate) enum Opened {
    Scene(Box<Simulator>),
    Recording(Box<Recording>),
    Live(Box<Live>),
}

impl Opened {
    /// Name of the sensor model that sweeps are made or read with.
    pub(crate) fn sensor_name(&self) -> &str {
        match self {
            Self::Scene(simulator) => simulator.scene().sensor().name(),
            Self::Recording(recording) => recording.sensor_name(),
            Self::Live(live) => live.sensor_name(),
        }
    }

    /// Whether what comes at once is of that sensor; a recording was looked at when it was opened.
    pub(crate) fn check_sensor(&mut self) -> Result<(), Failure> {
        match self {
            Self::Scene(_) | Self::Recording(_) => Ok(()),
            Self::Live(live) => live.check_sensor().map_err(Failure::start),
        }
    }
}

/// Whether a source is a scene: by its ending, since a scene is configuration, not data.
pub(crate) fn is_scene(from: &Path) -> bool {
    from.extension().is_some_and(|extension| extension == "toml")
}

/// The live sensor that a source names, if it is one.
pub(crate) fn live(from: &Path) -> Result<Option<LiveAddress>, Failure> {
    let from = from.to_string_lossy();
    LiveAddress::is_one(&from).then(|| from.parse().map_err(Failure::start)).transpose()
}

/// The source as every process of the run can find it: an absolute path, or that of a scene in the configuration.
pub(crate) fn locate(from: &Path, assets: &Assets) -> Result<PathBuf, Failure> {
    if live(from)?.is_some() {
        return Ok(from.to_owned());
    }
    if from.exists() {
        return from.canonicalize().map_err(|cause| Failure::start(format!("{}: {cause}", from.display())));
    }
    // A pattern is found again by other processes from the root on.
    if replay::matched(from).is_ok() {
        return std::path::absolute(from).map_err(|cause| Failure::start(format!("{}: {cause}", from.display())));
    }
    let in_config = from.strip_prefix("config").unwrap_or(from);
    if is_scene(from) && assets.bytes(&in_config.to_string_lossy()).is_ok() {
        return Ok(in_config.to_owned());
    }
    Err(Failure::start(format!(
        "{}: no such file or folder, and no pattern that a file matches; --from takes a scene (.toml), a recording, \
         or udp://ADDRESS:PORT",
        from.display()
    )))
}

/// The source that chain.toml names: relative to the configuration, never to the working directory.
pub(crate) fn locate_default(from: &str, assets: &Assets) -> Result<PathBuf, Failure> {
    if let Some(path) = assets.dirs().iter().map(|dir| dir.join(from)).find(|path| path.exists()) {
        return Ok(path);
    }
    assets.bytes(from).map(|_| PathBuf::from(from)).map_err(|cause| Failure::start(format!("chain.toml: {cause}")))
}

/// Opens what the plan names.
pub(crate) fn open(plan: &SourcePlan, assets: &Assets) -> Result<Opened, Failure> {
    if is_scene(&plan.from) {
        return Ok(Opened::Scene(Box::new(scene(&plan.from, plan.seed, assets)?)));
    }
    let format = plan.format.as_deref().map(str::parse::<Format>).transpose().map_err(Failure::start)?;
    let options = Options {
        format,
        sensor: plan.sensor.clone(),
        min_range_m: plan.min_range_m,
        max_range_m: plan.max_range_m,
        repeat: plan.repeat,
        topic: plan.topic.clone(),
        both_returns: plan.both_returns,
    };
    let lookup = |name: &str| sensor(name, assets).map_err(Into::into);
    if let Some(address) = live(&plan.from)? {
        let live = replay::listen(&address, &options, &lookup, runtime::clock::utc_ns).map_err(Failure::start)?;
        return Ok(Opened::Live(Box::new(live)));
    }
    let recording = replay::open(&plan.from, &options, &lookup).map_err(Failure::start)?;
    Ok(Opened::Recording(Box::new(recording)))
}

/// Builds the simulator of a scene.
pub(crate) fn scene(path: &Path, seed: Option<u64>, assets: &Assets) -> Result<Simulator, Failure> {
    let name = path.display();
    let named = |cause: &dyn std::fmt::Display| Failure::start(format!("{name}: {}", cause.to_string().trim_end()));
    let text = assets.text(&path.to_string_lossy()).map_err(|cause| named(&cause))?;
    let mut file: SceneFile = toml::from_str(&text).map_err(|cause| named(&cause))?;
    if let Some(seed) = seed {
        file.seed = seed;
    }
    let sensor = sensor(&file.sensor, assets).map_err(|cause| named(&cause))?;
    let mut meshes = BTreeMap::new();
    for mesh in file.mesh_paths() {
        let beside = path.parent().unwrap_or(Path::new("")).join(mesh);
        let text = assets.text(&beside.to_string_lossy()).map_err(|cause| named(&cause))?;
        meshes.insert(mesh.to_owned(), text);
    }
    Ok(Simulator::new(file.checked(&sensor, &meshes).map_err(|cause| named(&cause))?))
}

/// The sensor model of this name.
pub(crate) fn sensor(name: &str, assets: &Assets) -> Result<SensorModel, String> {
    let path = format!("sensors/{name}.toml");
    let text = assets.text(&path).map_err(|cause| cause.to_string())?;
    let file: SensorFile =
        toml::from_str(&text).map_err(|cause| format!("{path}: {}", cause.to_string().trim_end()))?;
    file.checked().map_err(|cause| format!("{path}: {cause}"))
}
