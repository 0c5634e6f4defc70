//! What `--from` may be.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lidar::{SensorFile, SensorModel};
use replay::{Format, Options, Recording};
use runtime::SourcePlan;
use simulator::{SceneFile, Simulator};

use crate::Failure;
use crate::assets::Assets;

/// A source that can be run.
pub(crate) enum Opened {
    Scene(Box<Simulator>),
    Recording(Box<Recording>),
}

/// Whether a source is a scene: by its ending, since a scene is configuration, not data.
pub(crate) fn is_scene(from: &Path) -> bool {
    from.extension().is_some_and(|extension| extension == "toml")
}

/// The source as every process of the run can find it: an absolute path, or that of a scene in the configuration.
pub(crate) fn locate(from: &Path, assets: &Assets) -> Result<PathBuf, Failure> {
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
        "{}: no such file or folder, and no pattern that a file matches; --from takes a scene (.toml) or a recording",
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
        ..Options::default()
    };
    let lookup = |name: &str| sensor(name, assets).map_err(Into::into);
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
