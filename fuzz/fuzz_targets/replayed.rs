//! What all targets of the replay room do with their bytes.

use std::io::Write;

use lidar::SensorFile;
use messages::{Message, Sweep, Truth};
use replay::{Format, Options, open};
use stage::{Next, Source};
use zerocopy::FromZeros;

/// Replays `bytes` as a file, to its end. Every sweep keeps its numbers.
///
/// # Panics
/// When it does not: that is what fuzzing looks for.
pub fn replayed(bytes: &[u8], format: Option<Format>) {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(bytes).expect("room for the bytes");
    let sensors = |_: &str| {
        let file: SensorFile = toml::from_str(include_str!("../../config/sensors/hdl-32e.toml"))?;
        Ok(file.checked()?)
    };
    let options = Options { format, ..Options::default() };
    let Ok(mut recording) = open(file.path(), &options, &sensors) else { return };
    let mut sweep = Sweep::new_box_zeroed().expect("memory");
    let mut truth = Truth::new_box_zeroed().expect("memory");
    loop {
        sweep.clear();
        match recording.next(&mut sweep, &mut truth) {
            Ok(Next::Sweep) => {}
            Ok(Next::End) | Err(_) => return,
        }
        assert_eq!(sweep.header.accepted() as usize, sweep.returns.len());
        for found in &sweep.returns {
            assert!(found.position().iter().all(|c| c.is_finite()));
            assert!(!sweep.header.is_organised() || usize::from(found.column) < sweep.columns.len());
        }
    }
}
