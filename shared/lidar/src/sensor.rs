use serde::Deserialize;

use crate::{MAX_RINGS, Ring};

/// A sensor file of `config/sensors/`, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorFile {
    /// The sensor's name, the stem of its file.
    pub name: String,
    /// Factory byte 1205 of a data packet.
    pub product_id: u8,
    /// Firing cycles in one block of a data packet (VLP-16: 2).
    pub cycles_per_block: u32,
    /// Slowest and fastest rotation [Hz].
    pub rotation_hz: [f64; 2],
    /// Time from one firing cycle to the next [ns].
    pub cycle_ns: u32,
    /// Firing time of each laser after its cycle's start [ns], in firing order.
    pub firing_offset_ns: Vec<u32>,
    /// Elevation of each laser [deg], in firing order.
    pub elevation_deg: Vec<f64>,
    /// Azimuth of each laser relative to its column [deg], clockwise, in firing order.
    pub azimuth_offset_deg: Vec<f64>,
    /// One count of a distance field [m].
    pub quantum_m: f64,
    /// Standard deviation of a range [m].
    pub range_sigma_m: f64,
    /// Ranges that are accepted from a recording [m]: nearest, farthest.
    pub accepted_range_m: [f64; 2],
    /// Ranges at which the sensor sees a surface [m]: nearest, farthest. For simulation.
    pub reach_m: [f64; 2],
}

/// One laser of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laser {
    /// Elevation [rad].
    pub elevation_rad: f64,
    /// Azimuth relative to the column [rad], clockwise seen from above.
    pub azimuth_offset_rad: f64,
    /// Firing time after the cycle's start [ns].
    pub offset_ns: u32,
    /// Rank by elevation, 0 = lowest.
    pub ring: u8,
}

/// A checked sensor model: what is known of a sensor before its first firing.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorModel {
    name: String,
    product_id: u8,
    cycles_per_block: u32,
    rotation_hz: [f64; 2],
    cycle_ns: u32,
    lasers: Vec<Laser>,
    rings: Vec<Ring>,
    quantum_m: f64,
    range_sigma_m: f64,
    accepted_range_m: [f64; 2],
    reach_m: [f64; 2],
}

/// Why a sensor file is refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SensorError {
    /// No laser, or more than a message can carry.
    #[error("elevation_deg has {0} lasers, must be 1 to {MAX_RINGS}")]
    Lasers(usize),
    /// The per-laser lists differ in length.
    #[error("{key} has {found} entries, must have {expected}, one for each entry of elevation_deg")]
    Lengths {
        /// The list's key.
        key: &'static str,
        /// Its length.
        found: usize,
        /// The number of lasers.
        expected: usize,
    },
    /// An elevation lies outside (−90°, 90°) or appears twice.
    #[error("elevation_deg has {0}, must be within (-90, 90) and given once")]
    Elevation(f64),
    /// A firing happens after its cycle has ended, or out of order.
    #[error("firing_offset_ns has {0}, must rise and stay below cycle_ns")]
    Firing(u32),
    /// A number that must be positive and finite is not.
    #[error("{key} is {value}, must be {expected}")]
    Number {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
}

impl SensorFile {
    /// The model that this file describes.
    pub fn checked(self) -> Result<SensorModel, SensorError> {
        let count = self.elevation_deg.len();
        if count == 0 || count > MAX_RINGS {
            return Err(SensorError::Lasers(count));
        }
        for (key, found) in
            [("firing_offset_ns", self.firing_offset_ns.len()), ("azimuth_offset_deg", self.azimuth_offset_deg.len())]
        {
            if found != count {
                return Err(SensorError::Lengths { key, found, expected: count });
            }
        }
        self.check_numbers()?;

        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| self.elevation_deg[a].total_cmp(&self.elevation_deg[b]));
        let mut lasers: Vec<Laser> = (0..count)
            .map(|laser| Laser {
                elevation_rad: self.elevation_deg[laser].to_radians(),
                azimuth_offset_rad: self.azimuth_offset_deg[laser].to_radians(),
                offset_ns: self.firing_offset_ns[laser],
                ring: 0,
            })
            .collect();
        for (ring, &laser) in order.iter().enumerate() {
            lasers[laser].ring = ring as u8;
        }
        let rings = order
            .iter()
            .map(|&laser| Ring {
                elevation_rad: self.elevation_deg[laser].to_radians() as f32,
                offset_ns: self.firing_offset_ns[laser],
            })
            .collect();
        Ok(SensorModel {
            name: self.name,
            product_id: self.product_id,
            cycles_per_block: self.cycles_per_block,
            rotation_hz: self.rotation_hz,
            cycle_ns: self.cycle_ns,
            lasers,
            rings,
            quantum_m: self.quantum_m,
            range_sigma_m: self.range_sigma_m,
            accepted_range_m: self.accepted_range_m,
            reach_m: self.reach_m,
        })
    }

    fn check_numbers(&self) -> Result<(), SensorError> {
        for (index, &elevation) in self.elevation_deg.iter().enumerate() {
            let inside = elevation.abs() < 90.0; // false for NaN too
            if !inside || self.elevation_deg[..index].contains(&elevation) {
                return Err(SensorError::Elevation(elevation));
            }
        }
        for (index, &offset) in self.firing_offset_ns.iter().enumerate() {
            // Equal offsets are lasers that fire together (VLP-32C).
            if offset >= self.cycle_ns || (index > 0 && offset < self.firing_offset_ns[index - 1]) {
                return Err(SensorError::Firing(offset));
            }
        }
        for &offset in &self.azimuth_offset_deg {
            number("azimuth_offset_deg", offset, "within (-45, 45)", offset.abs() < 45.0)?;
        }
        let cycles = f64::from(self.cycles_per_block);
        number("cycles_per_block", cycles, "1 or 2", (1.0..=2.0).contains(&cycles))?;
        let [slow, fast] = self.rotation_hz;
        number("rotation_hz[0]", slow, "within [1, 100]", (1.0..=100.0).contains(&slow))?;
        number("rotation_hz[1]", fast, "within [rotation_hz[0], 100]", (slow..=100.0).contains(&fast))?;
        number("quantum_m", self.quantum_m, "within (0, 1]", self.quantum_m > 0.0 && self.quantum_m <= 1.0)?;
        number("range_sigma_m", self.range_sigma_m, "within [0, 10]", (0.0..=10.0).contains(&self.range_sigma_m))?;
        for (key, [near, far]) in [("accepted_range_m", self.accepted_range_m), ("reach_m", self.reach_m)] {
            number(key, near, "0 or more and below its second value", near >= 0.0 && near < far)?;
            number(key, far, "finite", far.is_finite())?;
        }
        Ok(())
    }
}

fn number(key: &'static str, value: f64, expected: &'static str, holds: bool) -> Result<(), SensorError> {
    if holds { Ok(()) } else { Err(SensorError::Number { key, value, expected }) }
}

impl SensorModel {
    /// The sensor's name, as in `--sensor`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Factory byte 1205 of this sensor's data packets.
    pub fn product_id(&self) -> u8 {
        self.product_id
    }

    /// Firing cycles in one block of a data packet.
    pub fn cycles_per_block(&self) -> u32 {
        self.cycles_per_block
    }

    /// Slowest and fastest rotation [Hz].
    pub fn rotation_hz(&self) -> [f64; 2] {
        self.rotation_hz
    }

    /// Time from one firing cycle to the next [ns].
    pub fn cycle_ns(&self) -> u32 {
        self.cycle_ns
    }

    /// The lasers in firing order.
    pub fn lasers(&self) -> &[Laser] {
        &self.lasers
    }

    /// The beams by elevation, lowest first: what a sweep carries.
    pub fn rings(&self) -> &[Ring] {
        &self.rings
    }

    /// One count of a distance field [m].
    pub fn quantum_m(&self) -> f64 {
        self.quantum_m
    }

    /// Standard deviation of a range [m].
    pub fn range_sigma_m(&self) -> f64 {
        self.range_sigma_m
    }

    /// Ranges accepted from a recording [m]: nearest, farthest.
    pub fn accepted_range_m(&self) -> [f64; 2] {
        self.accepted_range_m
    }

    /// Ranges at which the sensor sees a surface [m]: nearest, farthest.
    pub fn reach_m(&self) -> [f64; 2] {
        self.reach_m
    }

    /// Columns that a real sensor fires in one turn of `rotation_hz`: the whole firing cycles that fit.
    pub fn columns_per_turn(&self, rotation_hz: f64) -> usize {
        (1e9 / (rotation_hz * f64::from(self.cycle_ns))) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hdl_32e() -> SensorFile {
        toml::from_str(include_str!("../../../config/sensors/hdl-32e.toml")).unwrap()
    }

    #[test]
    fn the_hdl_32e_has_the_manuals_rings_and_columns() {
        let model = hdl_32e().checked().unwrap();
        assert_eq!(model.lasers().len(), 32);
        assert_eq!(model.lasers()[15].elevation_rad, 0.0);
        assert_eq!(model.lasers()[15].ring, 23);
        assert_eq!(model.lasers()[31].offset_ns, 35_712);
        assert!((model.rings()[0].elevation_rad + 30.67_f32.to_radians()).abs() < 1e-6);
        assert_eq!(model.columns_per_turn(10.0), 2_170);
        assert_eq!(model.columns_per_turn(20.0), 1_085);
    }

    #[test]
    fn even_channels_are_the_lower_rings_and_odd_ones_the_upper() {
        let model = hdl_32e().checked().unwrap();
        for (channel, laser) in model.lasers().iter().enumerate() {
            let expected = if channel % 2 == 0 { channel / 2 } else { 16 + (channel - 1) / 2 };
            assert_eq!(usize::from(laser.ring), expected);
        }
    }

    #[test]
    fn each_broken_key_is_refused_by_name() {
        let refused = |breaks: fn(&mut SensorFile)| {
            let mut file = hdl_32e();
            breaks(&mut file);
            file.checked().unwrap_err().to_string()
        };
        assert!(refused(|f| f.elevation_deg.clear()).contains("elevation_deg has 0 lasers"));
        assert!(refused(|f| f.elevation_deg[3] = f64::NAN).contains("elevation_deg has NaN"));
        assert!(refused(|f| f.elevation_deg[3] = f.elevation_deg[4]).contains("given once"));
        assert!(refused(|f| f.firing_offset_ns[31] = 46_080).contains("firing_offset_ns has 46080"));
        assert!(refused(|f| f.firing_offset_ns.truncate(31)).contains("firing_offset_ns has 31 entries, must have 32"));
        assert!(refused(|f| f.azimuth_offset_deg[0] = 90.0).contains("azimuth_offset_deg is 90"));
        assert!(refused(|f| f.cycles_per_block = 0).contains("cycles_per_block is 0"));
        assert!(refused(|f| f.rotation_hz = [20.0, 5.0]).contains("rotation_hz[1] is 5"));
        assert!(refused(|f| f.quantum_m = 0.0).contains("quantum_m is 0"));
        assert!(refused(|f| f.range_sigma_m = -1.0).contains("range_sigma_m is -1"));
        assert!(refused(|f| f.accepted_range_m = [5.0, 5.0]).contains("accepted_range_m is 5"));
        assert!(refused(|f| f.reach_m = [1.0, f64::INFINITY]).contains("reach_m is inf"));
    }
}
