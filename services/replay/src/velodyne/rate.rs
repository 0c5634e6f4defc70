//! Whether a capture's packets can be those of the sensor supposed.

use std::path::PathBuf;

use lidar::SensorModel;

use super::packet::{BLOCKS, HOUR_US, Packet};
use crate::capture::Capture;
use crate::error::ReplayError;
use crate::faults::Faults;

/// Packets that are looked at.
const PROBED: usize = 100;
/// Fewer of them say nothing.
const FEW: usize = 8;

/// Looks at the first data packets of `files`.
///
/// # Errors
/// There is none, or they come at another rate: the factory byte cannot tell, as early VLP-16 carry the HDL-32E's.
pub(crate) fn check_rate(files: &[PathBuf], sensor: &SensorModel) -> Result<(), ReplayError> {
    let path = files.first().cloned().unwrap_or_default();
    let mut capture = Capture::new(files.to_vec());
    // The reader proper will find them again, and count them.
    let mut faults = Faults::muted();
    let mut packet = Packet::default();
    let (mut steps_us, mut before_us) = (Vec::with_capacity(PROBED), None);
    let mut is_dual = false;
    let mut is_any = false;
    while steps_us.len() < PROBED && capture.next(&mut packet, &mut faults)?.is_some() {
        if !(0..BLOCKS).any(|block| packet.is_block(block)) {
            continue;
        }
        is_any = true;
        is_dual = packet.is_dual();
        let stamp_us = packet.stamp_us() % HOUR_US;
        if let Some(before_us) = before_us.replace(stamp_us) {
            let step_us = (stamp_us + HOUR_US - before_us) % HOUR_US;
            // Recorded twice, on two interfaces say.
            steps_us.extend((step_us > 0).then_some(step_us));
        }
    }
    if !is_any {
        let what = "holds no Velodyne data packet (a UDP datagram of 1206 bytes with blocks FF EE)".to_owned();
        return Err(ReplayError::Empty { path, what });
    }
    if steps_us.len() < FEW {
        return Ok(());
    }
    steps_us.sort_unstable();
    let found_us = steps_us[steps_us.len() / 2];
    let cycles = BLOCKS as u64 * u64::from(sensor.cycles_per_block()) / if is_dual { 2 } else { 1 };
    let expected_us = (cycles * u64::from(sensor.cycle_ns()) + 500) / 1_000;
    if found_us.abs_diff(expected_us) * 5 > expected_us {
        return Err(ReplayError::OtherSensor { path, sensor: sensor.name().to_owned(), found_us, expected_us });
    }
    Ok(())
}
