//! What the tests of this room share.
#![allow(dead_code, unreachable_pub, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

pub mod container;

use std::path::{Path, PathBuf};

use lidar::{SensorFile, SensorModel};
use messages::{Message, Sweep, Truth};
use replay::{Options, Recording, ReplayError, open};
use stage::{Next, Source};
use zerocopy::FromZeros;

/// A file of the recorded data, or nothing (said aloud) where the data are missing and not demanded.
pub fn data(name: &str) -> Option<PathBuf> {
    let fallback = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = std::env::var_os("ENCKE_DATA").map_or_else(|| PathBuf::from(fallback), PathBuf::from);
    let path = root.join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(std::env::var_os("ENCKE_DATA_REQUIRED").is_none_or(|v| v != "1"), "{} is missing", path.display());
    println!("skipped: {} is missing; set ENCKE_DATA to the folder of recorded data", path.display());
    None
}

/// Sensor models from `config/sensors/`.
pub fn sensors(name: &str) -> Result<SensorModel, Box<dyn std::error::Error + Send + Sync>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/sensors");
    let file: SensorFile = toml::from_str(&std::fs::read_to_string(folder.join(format!("{name}.toml")))?)?;
    Ok(file.checked()?)
}

pub fn hdl_32e() -> SensorModel {
    sensors("hdl-32e").unwrap()
}

pub fn opened(path: &Path) -> Result<Recording, ReplayError> {
    open(path, &Options::default(), &sensors)
}

pub fn new_sweep() -> Box<Sweep> {
    Sweep::new_box_zeroed().unwrap()
}

/// All sweeps of a recording.
pub fn all(recording: &mut Recording) -> Vec<Box<Sweep>> {
    let mut truth = Truth::new_box_zeroed().unwrap();
    let mut sweeps = Vec::new();
    loop {
        let mut sweep = new_sweep();
        if recording.next(&mut sweep, &mut truth).unwrap() == Next::End {
            return sweeps;
        }
        sweeps.push(sweep);
    }
}

/// The next sweep into `sweep`; false at the end.
pub fn next(recording: &mut Recording, sweep: &mut Sweep, truth: &mut Truth) -> bool {
    sweep.clear();
    recording.next(sweep, truth).unwrap() == Next::Sweep
}

/// What every sweep promises, whatever it was read from.
pub fn assert_true(sweep: &Sweep) {
    let header = &sweep.header;
    assert_eq!(header.accepted() as usize, sweep.returns.len());
    let refused: u32 = header.refused.iter().sum();
    assert_eq!(sweep.recorded_index.len(), if refused == 0 { 0 } else { sweep.returns.len() });
    assert!(sweep.recorded_index.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(sweep.recorded_index.last().is_none_or(|&last| last < header.recorded));
    assert!(sweep.returns.iter().all(|found| found.position().iter().all(|c| c.is_finite())));
    assert!(header.period_ns > 0);
    if !header.is_organised() {
        assert!(sweep.columns.is_empty() && sweep.rings.is_empty() && header.column_step_rad == 0.0);
        assert!(sweep.returns.iter().all(|found| found.column == 0 && found.ring == 0));
        return;
    }
    assert!(sweep.returns.windows(2).all(|pair| pair[0].column <= pair[1].column), "firing order");
    for found in &sweep.returns {
        let column = sweep.columns[usize::from(found.column)];
        assert_eq!(column.valid, 1);
        assert!((-std::f32::consts::PI..std::f32::consts::PI).contains(&column.azimuth_rad));
        assert!(usize::from(found.ring) < sweep.rings.len());
    }
    assert!(sweep.columns.windows(2).all(|pair| pair[0].offset_ns <= pair[1].offset_ns), "time rises");
}
