//! The vocabulary of a spinning lidar: sensor model, returns, columns, rings and obstacle classes.
//!
//! Everything is in SI units and in the recording's own sensor frame: x forward, y left, z up along the spin axis.
//! Azimuth is counter-clockwise from +x in [−π, π); a Velodyne head turns the other way, so its azimuths fall with time.
//!
//! ```
//! use lidar::{ObstacleClass, Return};
//! let r = Return { x: 3.0, y: 4.0, z: 0.0, column: 7, ring: 21, intensity: 90 };
//! assert_eq!(r.range_m(), 5.0);
//! assert_eq!(ObstacleClass::Conical.name(), "conical");
//! ```

mod class;
mod returns;
mod sensor;

pub use class::ObstacleClass;
pub use returns::{Column, Return, Ring};
pub use sensor::{Laser, SensorError, SensorFile, SensorModel};

/// Most rings a sensor may have (HDL-64E: 64).
pub const MAX_RINGS: usize = 64;

/// Most columns of a sweep (HDL-32E at 5 Hz: 4,340).
pub const MAX_COLUMNS: usize = 4_608;

/// Most returns of a sweep: 32 rings × 4,608 columns, or 64 × 2,304, or an HDL-32E at 10 Hz in dual-return mode.
pub const MAX_RETURNS: usize = 147_456;
