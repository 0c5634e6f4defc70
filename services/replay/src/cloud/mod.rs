//! Sweeps that are recorded as lists of points.

pub(crate) mod csv;
pub(crate) mod fields;
pub(crate) mod files;
pub(crate) mod kitti;
mod lzf;
pub(crate) mod nuscenes;
mod organise;
pub(crate) mod packed;
pub(crate) mod pcd;
pub(crate) mod ply;
mod ply_header;
pub(crate) mod source;
pub(crate) mod sweeps;
pub(crate) mod value;

/// Points kept of one cloud. Four times what a sweep holds: those refused count, those beyond are over capacity anyway.
const MAX_POINTS: usize = 4 * lidar::MAX_RETURNS;

/// A recorded point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    /// Position in the recording's sensor frame [m].
    pub(crate) position_m: [f64; 3],
    /// Azimuth as the file has it, for equality only.
    pub(crate) key: f64,
    /// Time of the firing [ns].
    pub(crate) time_ns: u64,
    /// Ring, where the file has one.
    pub(crate) ring: u8,
    pub(crate) intensity: u8,
}

/// The points of one sweep.
#[derive(Debug, Default)]
pub(crate) struct Cloud {
    pub(crate) points: Vec<Point>,
    /// Points that were not kept.
    pub(crate) beyond: u32,
    pub(crate) has_ring: bool,
    pub(crate) has_key: bool,
    pub(crate) has_time: bool,
    /// The file ends before its points do.
    pub(crate) is_torn: bool,
    /// Time of the first firing [ns], where the file has one.
    pub(crate) start_ns: Option<u64>,
}

impl Cloud {
    /// Makes it empty; keeps its memory.
    pub(crate) fn clear(&mut self) {
        self.points.clear();
        self.beyond = 0;
        self.has_ring = false;
        self.has_key = false;
        self.has_time = false;
        self.is_torn = false;
        self.start_ns = None;
    }

    pub(crate) fn push(&mut self, point: Point) {
        if self.points.len() < MAX_POINTS {
            self.points.push(point);
        } else {
            self.beyond = self.beyond.saturating_add(1);
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
}

/// An intensity in a message; false when it had to be clamped.
fn intensity(value: f64) -> (u8, bool) {
    // NaN becomes 0.
    let clamped = value.round().clamp(0.0, 255.0) as u8;
    (clamped, (0.0..=255.0).contains(&value))
}
