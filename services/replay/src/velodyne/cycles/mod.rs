//! Data packets as one row of firing cycles, in time: those received, and those that must have been between them.

mod join;

use lidar::SensorModel;

use super::field::Gap;
use super::packet::{CHANNELS, Packet, TURN_CDEG};
use super::slots::{Slot, Slots};
use crate::capture::{Arrival, Capture, Got};
use crate::error::ReplayError;
use crate::faults::{Fault, Faults};

const TURN: f64 = TURN_CDEG as f64;
/// Turns after which a field of view must have shown its edges.
const TURNS_TO_LOOK_AT: f64 = 3.0;

/// One firing cycle of all lasers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cycle {
    /// Azimuth of its first firing [0.01°], clockwise, in [0, 36000).
    pub(crate) azimuth_cdeg: f64,
    /// Sensor time of its first firing [ns] since 1970, as far as the capture knows the hour.
    pub(crate) time_ns: u64,
    /// Where its channels are in the packet at hand: slot and cycle of the slot; none for a cycle not received.
    pub(crate) at: Option<(usize, usize)>,
    /// The recording does not go on from the cycle before.
    pub(crate) is_break: bool,
    /// It is the first behind the gap of the sensor's field of view.
    pub(crate) is_edge: bool,
    /// It is the first of its block: where a sweep may begin.
    pub(crate) begins_block: bool,
}

/// What was found next.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Step {
    /// A firing cycle.
    Cycle(Cycle),
    /// Nothing yet: a live sensor is silent for now.
    Nothing,
    /// The capture has ended.
    End,
}

/// The packet before, as far as the next one's place in time depends on it.
#[derive(Clone, Copy, Debug)]
struct Before {
    stamp_us: u64,
    time_ns: u64,
    /// When the packet after it should start [ns].
    next_ns: u64,
    /// Azimuth at that time [0.01°].
    next_cdeg: f64,
}

/// Firing cycles of a capture.
pub(crate) struct Cycles {
    capture: Capture,
    packet: Packet,
    /// The packet after the one at hand, where that is needed to place the latter's end in time.
    ahead: Packet,
    ahead_arrival: Option<Arrival>,
    cycle_ns: u64,
    cycles_per_block: usize,
    before: Option<Before>,
    /// Stamp of a packet that did not fit to the one before; the next packet decides who was right.
    suspect_us: Option<u64>,
    /// Turning rate over the packet at hand [0.01°/ns].
    cdeg_per_ns: f64,
    slots: Slots,
    time_ns: u64,
    /// Next cycle of the packet at hand to give, counted over all slots.
    next: usize,
    /// Slots that may be given: up to a jump whose time is not known yet.
    known: usize,
    /// How much later than the packet's stamp says its slots from the jump on fired [ns].
    jump_ns: u64,
    /// Cycles between the packet before and this one that are still to give, and how many there were.
    missing: (usize, usize),
    lost_from: Option<Before>,
    is_break: bool,
    is_edge: bool,
    /// What the sensor is set to leave out of the turn, once that was seen.
    gap: Option<Gap>,
    /// A gap between two packets: lost ones, or the field of view.
    maybe_gap: Option<Gap>,
}

impl Cycles {
    pub(crate) fn new(capture: Capture, sensor: &SensorModel) -> Result<Self, ReplayError> {
        let cycles_per_block = sensor.cycles_per_block() as usize;
        if sensor.lasers().len() * cycles_per_block != CHANNELS {
            return Err(ReplayError::NotABlock {
                name: sensor.name().to_owned(),
                lasers: sensor.lasers().len(),
                cycles: sensor.cycles_per_block(),
            });
        }
        let cycle_ns = u64::from(sensor.cycle_ns());
        Ok(Self {
            capture,
            packet: Packet::default(),
            ahead: Packet::default(),
            ahead_arrival: None,
            cycle_ns,
            cycles_per_block,
            before: None,
            suspect_us: None,
            cdeg_per_ns: 0.0,
            slots: Slots::new(cycles_per_block as u64 * cycle_ns, sensor.rotation_hz()[1]),
            time_ns: 0,
            next: 0,
            known: 0,
            jump_ns: 0,
            missing: (0, 0),
            lost_from: None,
            is_break: false,
            is_edge: false,
            gap: None,
            maybe_gap: None,
        })
    }

    /// Reads on for a few turns to see whether the sensor sends whole ones, then starts again.
    pub(crate) fn look_for_gap(&mut self) -> Result<(), ReplayError> {
        // The reading proper will find them again, and count them.
        let mut faults = Faults::muted();
        let (mut turned_cdeg, mut before_cdeg) = (0.0, None);
        while self.gap.is_none() && turned_cdeg < TURNS_TO_LOOK_AT * TURN {
            // A head that stands still shows no edge either.
            turned_cdeg += 1.0;
            let Step::Cycle(cycle) = self.next(&mut faults)? else { break };
            let before_cdeg = before_cdeg.replace(cycle.azimuth_cdeg).unwrap_or(cycle.azimuth_cdeg);
            let step_cdeg = (cycle.azimuth_cdeg - before_cdeg + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0;
            turned_cdeg += step_cdeg.max(0.0);
        }
        self.rewind();
        Ok(())
    }

    /// Starts again with the capture's first packet. What is known of the field of view stays.
    pub(crate) fn rewind(&mut self) {
        self.capture.rewind();
        self.ahead_arrival = None;
        self.cdeg_per_ns = 0.0;
        self.maybe_gap = None;
        self.interrupt();
    }

    /// Forgets the packet before: the next one begins a new row of cycles.
    pub(crate) fn interrupt(&mut self) {
        self.before = None;
        self.suspect_us = None;
        self.slots.count = 0;
        (self.next, self.known) = (0, 0);
        self.missing = (0, 0);
        self.is_edge = false;
    }

    /// The same, and also forgets a packet that was looked ahead at.
    pub(crate) fn discard(&mut self) {
        self.interrupt();
        self.ahead_arrival = None;
    }

    /// Where the packets come from.
    pub(crate) fn capture(&mut self) -> &mut Capture {
        &mut self.capture
    }

    /// The packet that the last cycle given lies in.
    pub(crate) fn packet(&self) -> &Packet {
        &self.packet
    }

    /// Turning rate over that packet [0.01°/ns].
    pub(crate) fn cdeg_per_ns(&self) -> f64 {
        self.cdeg_per_ns
    }

    /// Blocks of one slot: two in dual-return mode.
    pub(crate) fn blocks_per_slot(&self) -> usize {
        self.slots.blocks()
    }

    /// Whether the sensor leaves out a part of the turn.
    pub(crate) fn has_gap(&self) -> bool {
        self.gap.is_some()
    }

    /// The next firing cycle.
    pub(crate) fn next(&mut self, faults: &mut Faults) -> Result<Step, ReplayError> {
        loop {
            if let Some(cycle) = self.next_missing().or_else(|| self.next_of_packet()) {
                return Ok(Step::Cycle(cycle));
            }
            if self.known < self.slots.count {
                if !self.look_ahead(faults)? {
                    return Ok(Step::Nothing);
                }
                continue;
            }
            let arrival = match self.ahead_arrival.take() {
                Some(arrival) => {
                    std::mem::swap(&mut self.packet, &mut self.ahead);
                    arrival
                }
                None => match self.capture.next(&mut self.packet, faults)? {
                    Got::Packet(arrival) => arrival,
                    Got::Nothing => return Ok(Step::Nothing),
                    Got::End => return Ok(Step::End),
                },
            };
            self.admit(arrival, faults);
        }
    }

    /// A cycle that was lost before the packet at hand, evenly between what is known on both sides.
    fn next_missing(&mut self) -> Option<Cycle> {
        let (mut left, all) = self.missing;
        while left > 0 {
            let from = self.lost_from?;
            let done = all - left;
            left -= 1;
            self.missing.0 = left;
            let share = done as f64 / all as f64;
            let advance_cdeg = (self.first_cdeg() - from.next_cdeg).rem_euclid(TURN);
            let azimuth_cdeg = (from.next_cdeg + share * advance_cdeg).rem_euclid(TURN);
            if self.gap.is_some_and(|gap| gap.covers(azimuth_cdeg)) {
                self.is_edge = true;
                continue;
            }
            let span_ns = self.time_ns.saturating_sub(from.next_ns);
            return Some(Cycle {
                azimuth_cdeg,
                time_ns: from.next_ns + (share * span_ns as f64) as u64,
                at: None,
                is_break: false,
                is_edge: std::mem::take(&mut self.is_edge),
                begins_block: done % self.cycles_per_block == 0,
            });
        }
        None
    }

    fn next_of_packet(&mut self) -> Option<Cycle> {
        loop {
            let (slot, cycle) = (self.next / self.cycles_per_block, self.next % self.cycles_per_block);
            if slot >= self.known {
                return None;
            }
            self.next += 1;
            if self.slots.kinds[slot] == Slot::Absent {
                continue;
            }
            let after_block_ns = cycle as u64 * self.cycle_ns;
            let azimuth_cdeg = self.slots.azimuths_cdeg[slot] + self.cdeg_per_ns * after_block_ns as f64;
            let jump_ns = if self.slots.jump.is_some_and(|jump| slot >= jump) { self.jump_ns } else { 0 };
            return Some(Cycle {
                azimuth_cdeg: azimuth_cdeg.rem_euclid(TURN),
                time_ns: self.time_ns + jump_ns + slot as u64 * self.slot_ns() + after_block_ns,
                at: (self.slots.kinds[slot] == Slot::Received).then_some((slot, cycle)),
                is_break: std::mem::take(&mut self.is_break),
                is_edge: std::mem::take(&mut self.is_edge),
                begins_block: cycle == 0,
            });
        }
    }

    fn slot_ns(&self) -> u64 {
        self.cycles_per_block as u64 * self.cycle_ns
    }

    /// Azimuth from slot to slot [0.01°].
    fn slot_cdeg(&self) -> f64 {
        self.cdeg_per_ns * self.slot_ns() as f64
    }

    /// Azimuth at the packet's stamp [0.01°].
    fn first_cdeg(&self) -> f64 {
        self.slots.azimuths_cdeg[0]
    }

    /// Reads the packet after the one at hand, which says when the blocks behind a jump were fired. False when it is
    /// not there yet.
    fn look_ahead(&mut self, faults: &mut Faults) -> Result<bool, ReplayError> {
        let next = loop {
            match self.capture.next(&mut self.ahead, faults)? {
                // Recorded twice, say.
                Got::Packet(arrival) if self.ahead.stamp_us() == self.packet.stamp_us() => {
                    let what = "a packet came twice or late";
                    faults.note(Fault::LatePacket, 1, self.capture.path(), arrival.place, what);
                }
                Got::Packet(arrival) => break Some(arrival),
                Got::Nothing => return Ok(false),
                Got::End => break None,
            }
        };
        self.ahead_arrival = next;
        self.place_jump(next.is_some());
        Ok(true)
    }
}
