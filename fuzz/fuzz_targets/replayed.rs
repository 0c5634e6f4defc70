//! What all targets of the replay room do with their bytes.

use std::cell::RefCell;
use std::fs::File;
use std::io::{Seek, Write};
use std::path::PathBuf;

use lidar::{SensorFile, SensorModel};
use messages::{Message, Sweep, Truth};
use replay::{Format, Options, open};
use stage::{Next, Source};
use zerocopy::FromZeros;

/// What is used again from one execution to the next.
struct Bench {
    path: PathBuf,
    file: File,
    sensors: [SensorModel; 2],
    sweep: Box<Sweep>,
    truth: Box<Truth>,
}

impl Bench {
    fn new() -> Self {
        let (file, path) = tempfile::NamedTempFile::new().expect("a temporary file").keep().expect("the file stays");
        let texts = [include_str!("../../config/sensors/hdl-32e.toml"), include_str!("../../config/sensors/hdl-64e.toml")];
        let sensor = |text| toml::from_str::<SensorFile>(text).expect("a sensor file").checked().expect("a sensor");
        Self {
            path,
            file,
            sensors: texts.map(sensor),
            sweep: Sweep::new_box_zeroed().expect("memory"),
            truth: Truth::new_box_zeroed().expect("memory"),
        }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        // A file that stays behind harms nothing.
        let _ = std::fs::remove_file(&self.path);
    }
}

thread_local! {
    static BENCH: RefCell<Bench> = RefCell::new(Bench::new());
}

/// Replays `bytes` as a file, to its end. Every sweep keeps its promises.
///
/// # Panics
/// When it does not: that is what fuzzing looks for.
pub fn replayed(bytes: &[u8], format: Option<Format>) {
    BENCH.with_borrow_mut(|bench| {
        bench.file.set_len(0).expect("an empty file");
        bench.file.rewind().expect("its start");
        bench.file.write_all(bytes).expect("room for the bytes");
        let sensors = |name: &str| Ok(bench.sensors[usize::from(name == "hdl-64e")].clone());
        let options = Options { format, ..Options::default() };
        let Ok(mut recording) = open(&bench.path, &options, &sensors) else { return };
        let sweep = &mut *bench.sweep;
        loop {
            sweep.clear();
            match recording.next(sweep, &mut bench.truth) {
                Ok(Next::Sweep) => check(sweep),
                Ok(Next::End | Next::Nothing) | Err(_) => return,
            }
        }
    });
}

fn check(sweep: &Sweep) {
    let header = &sweep.header;
    assert_eq!(header.accepted() as usize, sweep.returns.len());
    assert!(header.period_ns > 0);
    assert!(sweep.recorded_index.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(sweep.recorded_index.last().is_none_or(|&last| last < header.recorded));
    for found in &sweep.returns {
        assert!(found.position().iter().all(|c| c.is_finite()));
        let is_placed = usize::from(found.column) < sweep.columns.len() && usize::from(found.ring) < sweep.rings.len();
        assert!(!header.is_organised() || is_placed);
    }
}
