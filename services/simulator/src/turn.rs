//! One turn of the head: when and in which direction each laser fires.
//!
//! The head turns clockwise seen from above: its own azimuth rises from 0 with time, the frame's azimuth falls.
//! It turns at the speed at which a whole number of firing cycles make a turn, so that sweep follows sweep without a
//! gap and every sweep has the same columns.

#[cfg(test)]
mod tests;

use std::f64::consts::{PI, TAU};

use lidar::{Column, Ring, SensorModel};
use nalgebra::Vector3;

/// Counts of an azimuth field in one turn: 0.01° each.
const COUNTS_PER_TURN: i64 = 36_000;

/// Firing cycles in one data packet.
const PACKET_COLUMNS: i64 = 12;

/// One beam, in the order of rings.
struct Beam {
    elevation_rad: f64,
    horizontal: f64,
    vertical: f64,
    offset_s: f64,
}

/// Firing directions and times of a turn.
pub(crate) struct Turn {
    columns: Vec<Column>,
    /// Cosine and sine of the head's azimuth at each column's first firing.
    heading: Vec<[f64; 2]>,
    beams: Vec<Beam>,
    rings: Vec<Ring>,
    /// The ring of each laser, in firing order.
    firing_order: Vec<u8>,
    /// Cosine and sine of each beam's azimuth relative to its column, for the two speeds a packet can show.
    tilts: [Vec<[f64; 2]>; 2],
    /// Least and greatest of those angles [rad].
    tilt_range_rad: [f64; 2],
    /// Which of `tilts` holds for each column of the current sweep.
    speed: Vec<u8>,
    cycle_ns: u32,
    quantised: bool,
}

impl Turn {
    /// A turn of `columns` firing cycles (at least 1). `quantised`: azimuths as a data packet can carry them.
    pub(crate) fn new(sensor: &SensorModel, columns: usize, quantised: bool) -> Self {
        let count = columns as i64;
        let heading_rad = |column: i64| match quantised {
            true => counts(column, count) as f64 * (TAU / COUNTS_PER_TURN as f64),
            false => column as f64 * (TAU / count as f64),
        };
        let cycle_ns = sensor.cycle_ns();
        // A reader of packets takes the speed from a packet's first and last azimuth. With whole counts of 0.01°
        // it finds one of two speeds, and turns each laser's azimuth on by that (data sheet: azimuth interpolation).
        let packet_cycles = PACKET_COLUMNS - 1;
        let slow_counts = (packet_cycles * COUNTS_PER_TURN).div_euclid(count);
        let speeds_radpns = match quantised {
            true => [slow_counts, slow_counts + 1].map(|counts| {
                counts as f64 * (TAU / COUNTS_PER_TURN as f64) / (packet_cycles as f64 * f64::from(cycle_ns))
            }),
            false => [TAU / (count as f64 * f64::from(cycle_ns)); 2],
        };

        let mut by_ring: Vec<_> = sensor.lasers().to_vec();
        by_ring.sort_by_key(|laser| laser.ring);
        let angles_rad = speeds_radpns.map(|speed| {
            by_ring.iter().map(move |laser| laser.azimuth_offset_rad + speed * f64::from(laser.offset_ns))
        });
        let tilt_range_rad = angles_rad
            .iter()
            .cloned()
            .flatten()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], tilt| [low.min(tilt), high.max(tilt)]);

        Self {
            columns: (0..count)
                .map(|column| Column {
                    azimuth_rad: to_frame(heading_rad(column)) as f32,
                    offset_ns: column as u32 * cycle_ns,
                    valid: 1,
                })
                .collect(),
            heading: (0..count).map(|column| cosine_and_sine(heading_rad(column))).collect(),
            beams: by_ring
                .iter()
                .map(|laser| Beam {
                    elevation_rad: laser.elevation_rad,
                    horizontal: laser.elevation_rad.cos(),
                    vertical: laser.elevation_rad.sin(),
                    offset_s: f64::from(laser.offset_ns) * 1e-9,
                })
                .collect(),
            rings: sensor.rings().to_vec(),
            firing_order: sensor.lasers().iter().map(|laser| laser.ring).collect(),
            tilts: angles_rad.map(|angles| angles.map(cosine_and_sine).collect()),
            tilt_range_rad,
            speed: vec![0; columns],
            cycle_ns,
            quantised,
        }
    }

    /// Prepares for a sweep: packets of 12 columns follow each other from sweep 0 on, across the ends of sweeps.
    pub(crate) fn begin(&mut self, sweep: u64) {
        if !self.quantised {
            return;
        }
        let count = self.columns.len() as i64;
        let slow_counts = ((PACKET_COLUMNS - 1) * COUNTS_PER_TURN).div_euclid(count);
        // Columns of the packet that was begun in the sweep before.
        let begun = (sweep % PACKET_COLUMNS as u64) as i64 * count % PACKET_COLUMNS;
        let mut first = -begun;
        while first < count {
            let seen = counts(first + PACKET_COLUMNS - 1, count) - counts(first, count);
            let speed = u8::from(seen > slow_counts);
            let from = first.max(0) as usize;
            let to = (first + PACKET_COLUMNS).min(count) as usize;
            self.speed[from..to].fill(speed);
            first += PACKET_COLUMNS;
        }
    }

    /// Unit vector of one firing of the current sweep, sensor frame.
    #[inline]
    pub(crate) fn direction(&self, column: usize, ring: usize) -> Vector3<f64> {
        let [cos_heading, sin_heading] = self.heading[column];
        let [cos_tilt, sin_tilt] = self.tilts[usize::from(self.speed[column])][ring];
        let beam = &self.beams[ring];
        Vector3::new(
            beam.horizontal * (cos_heading * cos_tilt - sin_heading * sin_tilt),
            -beam.horizontal * (sin_heading * cos_tilt + cos_heading * sin_tilt),
            beam.vertical,
        )
    }

    /// Time of a column's first firing after the sweep's start [s].
    pub(crate) fn column_s(&self, column: usize) -> f64 {
        column as f64 * f64::from(self.cycle_ns) * 1e-9
    }

    /// Time of a beam's firing after its column's first [s].
    pub(crate) fn beam_s(&self, ring: usize) -> f64 {
        self.beams[ring].offset_s
    }

    /// The first ring whose elevation is not below `elevation_rad`; the number of rings when all are.
    pub(crate) fn first_ring_from(&self, elevation_rad: f64) -> usize {
        self.beams.partition_point(|beam| beam.elevation_rad < elevation_rad)
    }

    /// Columns of the sweep.
    pub(crate) fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Beams by elevation, lowest first.
    pub(crate) fn rings(&self) -> &[Ring] {
        &self.rings
    }

    /// The rings in the order in which a column fires them.
    pub(crate) fn firing_order(&self) -> &[u8] {
        &self.firing_order
    }

    /// Angle between columns [rad].
    pub(crate) fn step_rad(&self) -> f64 {
        TAU / self.columns.len() as f64
    }

    /// Least and greatest azimuth of a firing relative to `column · step` [rad], clockwise.
    pub(crate) fn lead_range_rad(&self) -> [f64; 2] {
        let rounding = match self.quantised {
            true => 0.5 * TAU / COUNTS_PER_TURN as f64,
            false => 0.0,
        };
        let [low, high] = self.tilt_range_rad;
        [low - rounding, high + rounding]
    }

    /// Duration of the turn [ns].
    pub(crate) fn period_ns(&self) -> u64 {
        self.columns.len() as u64 * u64::from(self.cycle_ns)
    }
}

/// The head's azimuth at a column's first firing, in counts rounded to nearest; columns before 0 and past the end are
/// those of the neighbouring turns.
fn counts(column: i64, columns: i64) -> i64 {
    (2 * column * COUNTS_PER_TURN + columns).div_euclid(2 * columns)
}

/// The frame's azimuth in [−π, π) for a head's azimuth in [0, 2π).
fn to_frame(heading_rad: f64) -> f64 {
    if heading_rad < PI { -heading_rad } else { TAU - heading_rad }
}

fn cosine_and_sine(angle_rad: f64) -> [f64; 2] {
    let (sin, cos) = angle_rad.sin_cos();
    [cos, sin]
}
