//! Firing cycles gathered into sweeps, channels turned into positions.

use std::f64::consts::{PI, TAU};

use lidar::{Column, MAX_COLUMNS, Return, SensorModel};
use messages::Sweep;

use super::cycles::{Cycle, Cycles};
use super::packet::{CHANNELS, TURN_CDEG};
use crate::capture::Capture;
use crate::error::ReplayError;
use crate::faults::Faults;
use crate::intake::{Limits, take};
use crate::time::nominal_period_ns;

const TURN: f64 = TURN_CDEG as f64;

/// A laser as its returns are computed.
#[derive(Clone, Copy, Debug)]
struct Beam {
    cos_elevation: f64,
    sin_elevation: f64,
    azimuth_offset_rad: f64,
    offset_ns: f64,
    ring: u8,
    /// Cosine and sine of the azimuth relative to the column's first firing, clockwise, at the packet's rate.
    turned: (f64, f64),
}

/// Sweeps of a capture, cut where the azimuth wraps.
pub(crate) struct Sweeps {
    cycles: Cycles,
    sensor: SensorModel,
    limits: Limits,
    is_dual_kept: bool,
    beams: Vec<Beam>,
    beams_rate: f64,
    /// First cycle of the next sweep.
    pending: Option<Cycle>,
    /// The next sweep was seen from its wrap.
    begins_whole: bool,
    period_ns: Option<u64>,
}

impl Sweeps {
    pub(crate) fn new(
        capture: Capture,
        sensor: &SensorModel,
        limits: Limits,
        is_dual_kept: bool,
    ) -> Result<Self, ReplayError> {
        let beams = sensor.lasers().iter().map(|laser| Beam {
            cos_elevation: laser.elevation_rad.cos(),
            sin_elevation: laser.elevation_rad.sin(),
            azimuth_offset_rad: laser.azimuth_offset_rad,
            offset_ns: f64::from(laser.offset_ns),
            ring: laser.ring,
            turned: (1.0, 0.0),
        });
        Ok(Self {
            cycles: Cycles::new(capture, sensor)?,
            sensor: sensor.clone(),
            limits,
            is_dual_kept,
            beams: beams.collect(),
            beams_rate: f64::NAN,
            pending: None,
            begins_whole: false,
            period_ns: None,
        })
    }

    /// Starts again with the capture's first packet.
    pub(crate) fn rewind(&mut self) {
        self.cycles.rewind();
        self.pending = None;
    }

    /// Fills `sweep` with the next turn; false at the capture's end.
    pub(crate) fn next(&mut self, sweep: &mut Sweep, faults: &mut Faults) -> Result<bool, ReplayError> {
        let first = match self.pending.take() {
            Some(cycle) => cycle,
            None => match self.cycles.next(faults)? {
                Some(cycle) => cycle,
                None => return Ok(false),
            },
        };
        if first.is_break {
            // Seen from its wrap when the block before the first must have been in the turn before.
            let block_step_cdeg = self.step_cdeg() * f64::from(self.sensor.cycles_per_block());
            self.begins_whole = first.azimuth_cdeg < block_step_cdeg;
        }
        for &ring in self.sensor.rings() {
            // A model has at most as many rings as a message.
            let _ = sweep.rings.push(ring);
        }
        let (mut last, mut turned_cdeg) = (first, 0.0);
        // Cut between blocks: the second cycle of a block may lie beyond the wrap and yet belong to the turn.
        let mut block_cdeg = first.azimuth_cdeg;
        self.put(first, first.time_ns, sweep);
        let ends_whole = loop {
            let Some(cycle) = self.cycles.next(faults)? else { break self.reaches_wrap(block_cdeg) };
            let wraps = cycle.begins_block && block_cdeg - cycle.azimuth_cdeg > TURN / 2.0;
            if cycle.is_break || wraps || sweep.columns.len() == MAX_COLUMNS {
                self.pending = Some(cycle);
                break if cycle.is_break { self.reaches_wrap(block_cdeg) } else { wraps };
            }
            // Signed, so that a head that stands still or trembles does not turn.
            let step = (cycle.azimuth_cdeg - last.azimuth_cdeg + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0;
            turned_cdeg += step;
            last = cycle;
            if cycle.begins_block {
                block_cdeg = cycle.azimuth_cdeg;
            }
            self.put(cycle, first.time_ns, sweep);
        };
        let is_complete = self.begins_whole && ends_whole;
        self.finish(sweep, first, last, turned_cdeg, is_complete);
        self.begins_whole = ends_whole;
        Ok(true)
    }

    /// Whether the block after one at `block_cdeg` would have begun the next turn, give or take half a block.
    fn reaches_wrap(&self, block_cdeg: f64) -> bool {
        let block_step_cdeg = self.step_cdeg() * f64::from(self.sensor.cycles_per_block());
        block_step_cdeg > 0.0 && block_cdeg + 1.5 * block_step_cdeg > TURN
    }

    /// Azimuth from cycle to cycle over the packet at hand [0.01°].
    fn step_cdeg(&self) -> f64 {
        self.cycles.cdeg_per_ns() * f64::from(self.sensor.cycle_ns())
    }

    fn finish(&mut self, sweep: &mut Sweep, first: Cycle, last: Cycle, turned_cdeg: f64, is_complete: bool) {
        let lasting_ns = last.time_ns.saturating_sub(first.time_ns) as f64;
        if is_complete {
            self.period_ns = Some(match self.pending.filter(|next| !next.is_break) {
                Some(next) => next.time_ns.saturating_sub(first.time_ns),
                None => lasting_ns as u64 + u64::from(self.sensor.cycle_ns()),
            });
        }
        // A part of a turn before any whole one: from its rate, if there is enough of it.
        let measured_ns = (turned_cdeg > TURN / 36.0).then(|| (lasting_ns * TURN / turned_cdeg) as u64);
        let header = &mut sweep.header;
        header.sensor_time_ns = first.time_ns;
        header.period_ns = self.period_ns.or(measured_ns).unwrap_or_else(|| nominal_period_ns(&self.sensor));
        header.complete = u32::from(is_complete);
        header.organised = 1;
        let steps = sweep.columns.len().saturating_sub(1);
        let step_cdeg = if steps == 0 { self.step_cdeg() } else { turned_cdeg / steps as f64 };
        header.column_step_rad = (step_cdeg.max(0.0) / TURN * TAU) as f32;
        header.range_sigma_m = self.sensor.range_sigma_m() as f32;
        header.reach_m = self.sensor.reach_m()[1] as f32;
    }

    /// Adds a column and its returns.
    fn put(&mut self, cycle: Cycle, start_ns: u64, sweep: &mut Sweep) {
        let azimuth_rad = cycle.azimuth_cdeg / TURN * TAU;
        let column = Column {
            azimuth_rad: to_frame(azimuth_rad),
            offset_ns: u32::try_from(cycle.time_ns.saturating_sub(start_ns)).unwrap_or(u32::MAX),
            valid: u32::from(cycle.at.is_some()),
        };
        let index = sweep.columns.len() as u16;
        // The caller cuts before it is full.
        let _ = sweep.columns.push(column);
        let Some((slot, half)) = cycle.at else { return };

        self.turn_beams();
        let blocks = self.cycles.blocks_per_slot();
        let (sin_column, cos_column) = azimuth_rad.sin_cos();
        let lasers = self.beams.len();
        for (laser, beam) in self.beams.iter().enumerate() {
            let channel = half * lasers + laser;
            debug_assert!(channel < CHANNELS);
            let packet = self.cycles.packet();
            let echo = |block: usize| if packet.is_block(block) { packet.channel(block, channel) } else { (0, 0) };
            let echoes = match (blocks, self.is_dual_kept) {
                (1, _) => [echo(slot), (0, 0)],
                (_, false) => [echo(slot * 2 + 1), (0, 0)],
                // The same echo twice is one return.
                (_, true) if echo(slot * 2) == echo(slot * 2 + 1) => [echo(slot * 2), (0, 0)],
                (_, true) => [echo(slot * 2), echo(slot * 2 + 1)],
            };
            for (distance, intensity) in echoes {
                if distance == 0 {
                    continue;
                }
                let range_m = f64::from(distance) * self.sensor.quantum_m();
                // az(b, c) = az(b) + rate * offset(c), by the addition theorems.
                let (cos_turn, sin_turn) = beam.turned;
                let cos_azimuth = cos_column * cos_turn - sin_column * sin_turn;
                let sin_azimuth = sin_column * cos_turn + cos_column * sin_turn;
                let position_m = [
                    range_m * beam.cos_elevation * cos_azimuth,
                    -range_m * beam.cos_elevation * sin_azimuth,
                    range_m * beam.sin_elevation,
                ];
                let at = Return { column: index, ring: beam.ring, intensity, ..Return::default() };
                take(sweep, &self.limits, position_m, at);
            }
        }
    }

    fn turn_beams(&mut self) {
        let rate = self.cycles.cdeg_per_ns();
        if self.beams_rate == rate {
            return;
        }
        self.beams_rate = rate;
        for beam in &mut self.beams {
            let turn_rad = rate * beam.offset_ns / TURN * TAU + beam.azimuth_offset_rad;
            beam.turned = (turn_rad.cos(), turn_rad.sin());
        }
    }
}

/// From the sensor's azimuth (clockwise) to the frame's (counter-clockwise, in [−π, π), after rounding too).
pub(crate) fn to_frame(clockwise_rad: f64) -> f32 {
    let azimuth_rad = ((PI - clockwise_rad).rem_euclid(TAU) - PI) as f32;
    if azimuth_rad >= std::f32::consts::PI { -std::f32::consts::PI } else { azimuth_rad }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frames_azimuth_is_counter_clockwise_and_never_reaches_pi() {
        assert_eq!(to_frame(0.0), 0.0);
        assert!((to_frame(0.5) + 0.5).abs() < 1e-7);
        assert!((to_frame(TAU - 0.5) - 0.5).abs() < 1e-6);
        for clockwise in [PI, PI - 1e-9, PI + 1e-9, PI - 1e-4, PI + 1e-4, TAU, 0.0] {
            let azimuth = to_frame(clockwise);
            assert!((-std::f32::consts::PI..std::f32::consts::PI).contains(&azimuth), "{clockwise}: {azimuth}");
        }
    }
}
