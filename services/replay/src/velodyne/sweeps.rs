//! Firing cycles gathered into sweeps, channels turned into positions.
//!
//! A sweep begins where the azimuth wraps, or behind the gap of a sensor that is set to less than a whole turn: then the
//! wrap lies within what it sees, and is no place to cut.

use std::f64::consts::{PI, TAU};

use lidar::{Column, MAX_COLUMNS, Return, SensorModel};
use messages::{Message, Sweep};

use super::cycles::{Cycle, Cycles, Step};
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

impl Beam {
    /// Where a return is [m] whose column's sine and cosine of azimuth, clockwise, are known.
    #[inline]
    fn position_m(&self, (sin_column, cos_column): (f64, f64), range_m: f64) -> [f64; 3] {
        // az(b, c) = az(b) + rate * offset(c), by the addition theorems.
        let (cos_turn, sin_turn) = self.turned;
        let cos_azimuth = cos_column * cos_turn - sin_column * sin_turn;
        let sin_azimuth = sin_column * cos_turn + cos_column * sin_turn;
        [
            range_m * self.cos_elevation * cos_azimuth,
            -range_m * self.cos_elevation * sin_azimuth,
            range_m * self.sin_elevation,
        ]
    }
}

/// What became of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Progress {
    /// It is done.
    Sweep,
    /// It is not: a live sensor is silent for now.
    Nothing,
    /// The capture has ended before its first cycle.
    End,
}

/// A sweep that is being gathered.
#[derive(Clone, Copy, Debug)]
struct Open {
    first: Cycle,
    last: Cycle,
    turned_cdeg: f64,
    /// Azimuth of the block begun last. Cut between blocks: the second cycle of a block may lie beyond the wrap and yet
    /// belong to the turn.
    block_cdeg: f64,
}

/// Sweeps of a capture.
pub(crate) struct Sweeps {
    cycles: Cycles,
    sensor: SensorModel,
    limits: Limits,
    is_dual_kept: bool,
    beams: Vec<Beam>,
    beams_rate: f64,
    open: Option<Open>,
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
            open: None,
            pending: None,
            begins_whole: false,
            period_ns: None,
        })
    }

    /// See [`Cycles::look_for_gap`]. Not for live sensors, which show it as they go.
    pub(crate) fn look_for_gap(&mut self) -> Result<(), ReplayError> {
        self.cycles.look_for_gap()
    }

    /// Starts again with the capture's first packet.
    pub(crate) fn rewind(&mut self) {
        self.cycles.rewind();
        self.open = None;
        self.pending = None;
    }

    /// Where the packets come from.
    pub(crate) fn capture(&mut self) -> &mut Capture {
        self.cycles.capture()
    }

    /// Fills `sweep` with the next turn. Where nothing came yet, it wants the same sweep again, as it is.
    pub(crate) fn next(&mut self, sweep: &mut Sweep, faults: &mut Faults) -> Result<Progress, ReplayError> {
        let mut open = match self.open.take() {
            Some(open) => open,
            None => {
                let first = match self.pending.take() {
                    Some(cycle) => cycle,
                    None => match self.cycles.next(faults)? {
                        Step::Cycle(cycle) => cycle,
                        Step::Nothing => return Ok(Progress::Nothing),
                        Step::End => return Ok(Progress::End),
                    },
                };
                self.begin(first, sweep)
            }
        };
        let ends_whole = loop {
            let cycle = match self.cycles.next(faults)? {
                Step::Cycle(cycle) => cycle,
                Step::Nothing => {
                    self.open = Some(open);
                    return Ok(Progress::Nothing);
                }
                Step::End => break self.reaches_wrap(open.block_cdeg),
            };
            let is_beyond = cycle.begins_block && open.block_cdeg - cycle.azimuth_cdeg > TURN / 2.0;
            let wraps = is_beyond && !self.cycles.has_gap();
            if cycle.is_break || cycle.is_edge || wraps || sweep.columns.len() == MAX_COLUMNS {
                self.pending = Some(cycle);
                break if cycle.is_break { self.reaches_wrap(open.block_cdeg) } else { wraps };
            }
            // Signed, so that a head that stands still or trembles does not turn.
            let step = (cycle.azimuth_cdeg - open.last.azimuth_cdeg + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0;
            open.turned_cdeg += step;
            open.last = cycle;
            if cycle.begins_block {
                open.block_cdeg = cycle.azimuth_cdeg;
            }
            self.put(cycle, open.first.time_ns, sweep);
        };
        self.end(open, ends_whole, sweep);
        Ok(Progress::Sweep)
    }

    /// Ends the sweep that is being gathered where it is, incomplete; false if there is none. What comes next does not
    /// go on from it.
    pub(crate) fn flush(&mut self, sweep: &mut Sweep) -> bool {
        let Some(open) = self.open.take() else { return false };
        self.end(open, false, sweep);
        self.cycles.interrupt();
        true
    }

    /// Drops the sweep that is being gathered, and the packets at hand.
    pub(crate) fn discard(&mut self, sweep: &mut Sweep) {
        self.flush(sweep);
        sweep.clear();
        self.cycles.discard();
    }

    fn begin(&mut self, first: Cycle, sweep: &mut Sweep) -> Open {
        if first.is_break {
            // Seen from its wrap when the block before the first must have been in the turn before.
            let block_step_cdeg = self.step_cdeg() * f64::from(self.sensor.cycles_per_block());
            self.begins_whole = first.azimuth_cdeg < block_step_cdeg && !self.cycles.has_gap();
        }
        for &ring in self.sensor.rings() {
            // A model has at most as many rings as a message.
            let _ = sweep.rings.push(ring);
        }
        self.put(first, first.time_ns, sweep);
        Open { first, last: first, turned_cdeg: 0.0, block_cdeg: first.azimuth_cdeg }
    }

    fn end(&mut self, open: Open, ends_whole: bool, sweep: &mut Sweep) {
        let is_complete = self.begins_whole && ends_whole;
        self.finish(sweep, open.first, open.last, open.turned_cdeg, is_complete);
        self.begins_whole = ends_whole;
    }

    /// Whether the block after one at `block_cdeg` would have begun the next turn, give or take half a block.
    fn reaches_wrap(&self, block_cdeg: f64) -> bool {
        let block_step_cdeg = self.step_cdeg() * f64::from(self.sensor.cycles_per_block());
        block_step_cdeg > 0.0 && block_cdeg + 1.5 * block_step_cdeg > TURN && !self.cycles.has_gap()
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
        const NONE: &[[u8; 3]] = &[[0; 3]; CHANNELS];
        let lasers = self.beams.len();
        let packet = self.cycles.packet();
        // A second cycle's channels lie behind those of the first.
        let channels = |block| packet.channels(block).and_then(|all| all.get(half * lasers..)).unwrap_or(NONE);
        // In dual-return mode the last returns come first.
        let (one, other) = match self.cycles.blocks_per_slot() {
            1 => (channels(slot), None),
            _ => (channels(slot * 2), Some(channels(slot * 2 + 1))),
        };
        let column = azimuth_rad.sin_cos();
        let (limits, quantum_m) = (&self.limits, self.sensor.quantum_m());
        let put = |sweep: &mut Sweep, beam: &Beam, [low, high, intensity]: [u8; 3]| {
            let distance = u16::from_le_bytes([low, high]);
            if distance != 0 {
                let at = Return { column: index, ring: beam.ring, intensity, ..Return::default() };
                take(sweep, limits, beam.position_m(column, f64::from(distance) * quantum_m), at);
            }
        };
        match other {
            None => self.beams.iter().zip(one).for_each(|(beam, &echo)| put(sweep, beam, echo)),
            Some(other) => {
                for (beam, (&last, &other)) in self.beams.iter().zip(one.iter().zip(other)) {
                    if !self.is_dual_kept {
                        put(sweep, beam, stronger(last, other));
                        continue;
                    }
                    put(sweep, beam, last);
                    // The same echo twice is one return.
                    if other != last {
                        put(sweep, beam, other);
                    }
                }
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

/// The stronger of two echoes of a firing. Beside the last one a packet has the strongest, or the second strongest where
/// the last is the strongest (VLP-32C User Manual, section 9.3.2): intensities tell which.
fn stronger(last: [u8; 3], other: [u8; 3]) -> [u8; 3] {
    let is_return = |[low, high, _]: [u8; 3]| low != 0 || high != 0;
    if is_return(last) && (!is_return(other) || last[2] > other[2]) { last } else { other }
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
