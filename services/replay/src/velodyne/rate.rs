//! What the first packets of a capture say of their sensor.

use std::path::PathBuf;

use lidar::SensorModel;

use super::packet::{BLOCKS, HOUR_US, Packet};
use super::product::sensor_of;
use crate::capture::{Capture, Got};
use crate::error::ReplayError;
use crate::faults::Faults;

/// Packets that are looked at.
const PROBED: usize = 100;
/// Fewer of them say nothing.
const FEW: usize = 8;

/// The first data packets of a capture.
#[derive(Clone, Debug)]
pub(crate) struct Probe {
    path: PathBuf,
    /// Factory byte of the first.
    product_id: u8,
    is_dual: bool,
    /// Usual time between them [µs]; none where there are too few.
    step_us: Option<u64>,
}

impl Probe {
    /// Looks at the first data packets of `capture`, and takes it back to its start.
    ///
    /// # Errors
    /// There is none.
    pub(crate) fn of(capture: &mut Capture) -> Result<Self, ReplayError> {
        let path = capture.path().to_owned();
        // The reader proper will find them again, and count them.
        let mut faults = Faults::muted();
        let mut packet = Packet::default();
        let (mut steps_us, mut before_us) = (Vec::with_capacity(PROBED), None);
        let (mut product_id, mut is_dual) = (None, false);
        for _ in 0..10 * PROBED {
            let Got::Packet(_) = capture.next(&mut packet, &mut faults)? else { break };
            if !(0..BLOCKS).any(|block| packet.is_block(block)) {
                continue;
            }
            product_id = product_id.or(Some(packet.product_id()));
            is_dual = packet.is_dual();
            let stamp_us = packet.stamp_us() % HOUR_US;
            let step_us = (stamp_us + HOUR_US - before_us.unwrap_or(stamp_us)) % HOUR_US;
            // Packets may have been recorded twice, on two interfaces say: only those ahead of all before count.
            if step_us < HOUR_US / 2 {
                before_us = Some(stamp_us);
                steps_us.extend((step_us > 0).then_some(step_us));
            }
            if steps_us.len() == PROBED {
                break;
            }
        }
        capture.rewind();
        let Some(product_id) = product_id else {
            let what = "holds no Velodyne data packet (1206 bytes with blocks FF EE)".to_owned();
            return Err(ReplayError::Empty { path, what });
        };
        steps_us.sort_unstable();
        let step_us = (steps_us.len() >= FEW).then(|| steps_us[steps_us.len() / 2]);
        Ok(Self { path, product_id, is_dual, step_us })
    }

    /// The sensor model that the factory byte names; very old firmware has other content there.
    pub(crate) fn sensor(&self) -> Option<&'static str> {
        sensor_of(self.product_id)
    }

    /// Whether the packets can be those of `sensor`: the factory byte cannot tell, as early VLP-16 carry the HDL-32E's.
    ///
    /// # Errors
    /// They come at another rate.
    pub(crate) fn check_rate(self, sensor: &SensorModel) -> Result<(), ReplayError> {
        let Some(found_us) = self.step_us else { return Ok(()) };
        let cycles = BLOCKS as u64 * u64::from(sensor.cycles_per_block()) / if self.is_dual { 2 } else { 1 };
        let expected_us = (cycles * u64::from(sensor.cycle_ns()) + 500) / 1_000;
        if found_us.abs_diff(expected_us) * 5 > expected_us {
            let sensor = sensor.name().to_owned();
            return Err(ReplayError::OtherSensor { path: self.path, sensor, found_us, expected_us });
        }
        Ok(())
    }
}
