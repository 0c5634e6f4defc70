//! What the first packets of a capture, or of a live sensor, say of their sensor.

use std::path::PathBuf;

use lidar::SensorModel;

use super::packet::Packet;
use super::product::sensor_of;
use super::spacing::{Spacing, expected_us, is_another};
use crate::capture::{Capture, Got};
use crate::error::ReplayError;
use crate::faults::Faults;

/// Packets that are looked at, at most.
const LOOKED_AT: usize = 1_000;

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
        let found = Self::look(path.clone(), |packet| Ok(matches!(capture.next(packet, &mut faults)?, Got::Packet(_))));
        capture.rewind();
        found?.ok_or_else(|| {
            let what = "holds no Velodyne data packet (1206 bytes with blocks FF EE)".to_owned();
            ReplayError::Empty { path, what }
        })
    }

    /// Looks at data packets as long as `next` gives some, until they say enough; none where there is none.
    ///
    /// # Errors
    /// Those of `next`.
    pub(crate) fn look(
        path: PathBuf,
        mut next: impl FnMut(&mut Packet) -> Result<bool, ReplayError>,
    ) -> Result<Option<Self>, ReplayError> {
        let (mut packet, mut spacing) = (Packet::default(), Spacing::default());
        let mut found: Option<(u8, bool)> = None;
        for _ in 0..LOOKED_AT {
            if spacing.is_enough() || !next(&mut packet)? {
                break;
            }
            if spacing.add(&packet) {
                let product_id = found.map_or(packet.product_id(), |(product_id, _)| product_id);
                found = Some((product_id, packet.is_dual()));
            }
        }
        let step_us = spacing.usual_us();
        Ok(found.map(|(product_id, is_dual)| Self { path, product_id, is_dual, step_us }))
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
        let expected_us = expected_us(sensor, self.is_dual);
        if is_another(found_us, expected_us) {
            let sensor = sensor.name().to_owned();
            return Err(ReplayError::OtherSensor { path: self.path, sensor, found_us, expected_us });
        }
        Ok(())
    }
}
