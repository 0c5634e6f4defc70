//! Data packets as one row of firing cycles, in time: those received, and those that must have been between them.

use lidar::SensorModel;

use super::packet::{BLOCKS, CHANNELS, HOUR_US, Packet, TURN_CDEG};
use crate::capture::{Arrival, Capture};
use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};

/// A packet this much older than the one before came late; older ones mean that the clock was set [µs].
const LATE_US: u64 = 10_000;
const TURN: f64 = TURN_CDEG as f64;
const NS_PER_HOUR: i128 = HOUR_US as i128 * 1_000;

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
    /// It is the first of its block: where a sweep may begin.
    pub(crate) begins_block: bool,
}

/// What a slot (a block, or a pair of them in dual-return mode) holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Slot {
    Received,
    Unknown,
    Absent,
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
    cycle_ns: u64,
    cycles_per_block: usize,
    max_cdeg_per_ns: f64,
    before: Option<Before>,
    /// Stamp of a packet that did not fit to the one before; the next packet decides who was right.
    suspect_us: Option<u64>,
    /// Turning rate over the packet at hand [0.01°/ns].
    cdeg_per_ns: f64,
    slots: [Slot; BLOCKS],
    azimuths_cdeg: [f64; BLOCKS],
    slot_count: usize,
    time_ns: u64,
    /// Next cycle of the packet at hand to give, counted over all slots.
    next: usize,
    /// Cycles between the packet before and this one that are still to give, and how many there were.
    missing: (usize, usize),
    gap_from: Option<Before>,
    is_break: bool,
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
        Ok(Self {
            capture,
            packet: Packet::default(),
            cycle_ns: u64::from(sensor.cycle_ns()),
            cycles_per_block,
            max_cdeg_per_ns: 1.5 * sensor.rotation_hz()[1] * TURN / 1e9,
            before: None,
            suspect_us: None,
            cdeg_per_ns: 0.0,
            slots: [Slot::Absent; BLOCKS],
            azimuths_cdeg: [0.0; BLOCKS],
            slot_count: 0,
            time_ns: 0,
            next: 0,
            missing: (0, 0),
            gap_from: None,
            is_break: false,
        })
    }

    /// Starts again with the capture's first packet.
    pub(crate) fn rewind(&mut self) {
        self.capture.rewind();
        self.before = None;
        self.suspect_us = None;
        self.cdeg_per_ns = 0.0;
        self.slot_count = 0;
        self.next = 0;
        self.missing = (0, 0);
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
        BLOCKS / self.slot_count.max(1)
    }

    /// The next firing cycle; nothing at the capture's end.
    pub(crate) fn next(&mut self, faults: &mut Faults) -> Result<Option<Cycle>, ReplayError> {
        loop {
            if let Some(cycle) = self.next_missing().or_else(|| self.next_of_packet()) {
                return Ok(Some(cycle));
            }
            let Some(arrival) = self.capture.next(&mut self.packet, faults)? else { return Ok(None) };
            self.admit(arrival, faults);
        }
    }

    /// A cycle that was lost before the packet at hand, evenly between what is known on both sides.
    fn next_missing(&mut self) -> Option<Cycle> {
        let (left, all) = self.missing;
        let from = self.gap_from.filter(|_| left > 0)?;
        let done = all - left;
        self.missing.0 -= 1;
        let to_cdeg = self.first_cdeg();
        let share = done as f64 / all as f64;
        let advance_cdeg = (to_cdeg - from.next_cdeg).rem_euclid(TURN);
        let span_ns = self.time_ns.saturating_sub(from.next_ns);
        Some(Cycle {
            azimuth_cdeg: (from.next_cdeg + share * advance_cdeg).rem_euclid(TURN),
            time_ns: from.next_ns + (share * span_ns as f64) as u64,
            at: None,
            is_break: false,
            begins_block: done % self.cycles_per_block == 0,
        })
    }

    fn next_of_packet(&mut self) -> Option<Cycle> {
        loop {
            let (slot, cycle) = (self.next / self.cycles_per_block, self.next % self.cycles_per_block);
            if slot >= self.slot_count {
                return None;
            }
            self.next += 1;
            if self.slots[slot] == Slot::Absent {
                continue;
            }
            let after_block_ns = cycle as u64 * self.cycle_ns;
            let azimuth_cdeg = self.azimuths_cdeg[slot] + self.cdeg_per_ns * after_block_ns as f64;
            return Some(Cycle {
                azimuth_cdeg: azimuth_cdeg.rem_euclid(TURN),
                time_ns: self.time_ns + slot as u64 * self.slot_ns() + after_block_ns,
                at: (self.slots[slot] == Slot::Received).then_some((slot, cycle)),
                is_break: std::mem::take(&mut self.is_break),
                begins_block: cycle == 0,
            });
        }
    }

    fn slot_ns(&self) -> u64 {
        self.cycles_per_block as u64 * self.cycle_ns
    }

    /// Azimuth at the packet's stamp [0.01°].
    fn first_cdeg(&self) -> f64 {
        self.azimuths_cdeg[0]
    }

    /// Reads the packet at hand and puts it behind the one before. A packet that is of no use leaves nothing to give.
    fn admit(&mut self, arrival: Arrival, faults: &mut Faults) {
        self.next = 0;
        self.slot_count = 0;
        self.missing = (0, 0);
        let place = Place::Byte(arrival.offset);
        let stamp_us = self.packet.stamp_us();
        let slot_count = if self.packet.is_dual() { BLOCKS / 2 } else { BLOCKS };
        let Some(rate) = self.read_slots(slot_count) else {
            faults.note(Fault::NoBlock, 1, self.capture.path(), place, "a data packet without a block flag");
            return;
        };
        if stamp_us >= HOUR_US {
            let what = "a stamp beyond the hour";
            faults.note(Fault::BadStamp, 1, self.capture.path(), place, what);
            return;
        }
        let packet_ns = slot_count as u64 * self.slot_ns();
        match self.before {
            None => {
                self.time_ns = absolute_ns(arrival.host_ns, stamp_us);
                self.is_break = true;
            }
            Some(before) => {
                // The hour wraps; half of it backwards is taken for backwards.
                let step_us = (stamp_us + HOUR_US - before.stamp_us) % HOUR_US;
                if step_us == 0 || HOUR_US - step_us <= LATE_US {
                    faults.note(Fault::LatePacket, 1, self.capture.path(), place, "a packet came twice or late");
                    return;
                }
                let time_ns = before.time_ns + step_us * 1_000;
                let lost_ns = time_ns.saturating_sub(before.next_ns);
                let lost = (lost_ns as f64 / packet_ns as f64).round();
                let lost_cdeg = lost * packet_ns as f64 * rate;
                let lost_cycles = lost * (slot_count * self.cycles_per_block) as f64;
                if lost_cdeg < TURN / 2.0 && lost_cycles <= lidar::MAX_COLUMNS as f64 / 2.0 {
                    self.time_ns = time_ns;
                    if lost > 0.0 {
                        let what = "by the stamps, packets are missing before this one";
                        faults.note(Fault::LostPacket, lost as u64, self.capture.path(), place, what);
                        self.missing = (lost_cycles as usize, lost_cycles as usize);
                        self.gap_from = Some(before);
                    }
                } else if !self.follows_suspect(stamp_us, packet_ns) {
                    let what = "the stamp jumps: the packet is left out";
                    faults.note(Fault::BadStamp, 1, self.capture.path(), place, what);
                    self.suspect_us = Some(stamp_us);
                    return;
                } else {
                    let what = "the recording goes on at another time: the sweep ends here";
                    faults.note(Fault::Break, 1, self.capture.path(), place, what);
                    self.time_ns = absolute_ns(arrival.host_ns, stamp_us);
                    self.is_break = true;
                }
            }
        }
        self.suspect_us = None;
        self.cdeg_per_ns = rate;
        self.slot_count = slot_count;
        let unknown = self.slots[..slot_count].iter().filter(|&&slot| slot == Slot::Unknown).count();
        if unknown > 0 {
            let what = "a block without its flag, or with an azimuth beyond the turn";
            faults.note(Fault::BadBlock, unknown as u64, self.capture.path(), place, what);
        }
        let present =
            self.slots[..slot_count].iter().rposition(|&slot| slot != Slot::Absent).map_or(0, |last| last + 1);
        let present_ns = present as u64 * self.slot_ns();
        self.before = Some(Before {
            stamp_us,
            time_ns: self.time_ns,
            next_ns: self.time_ns + present_ns,
            next_cdeg: (self.first_cdeg() + rate * present_ns as f64).rem_euclid(TURN),
        });
    }

    /// Whether the packet comes shortly after one that was left out for its stamp.
    fn follows_suspect(&self, stamp_us: u64, packet_ns: u64) -> bool {
        self.suspect_us.is_some_and(|suspect_us| {
            let step_us = (stamp_us + HOUR_US - suspect_us) % HOUR_US;
            step_us > 0 && step_us * 1_000 <= 100 * packet_ns
        })
    }

    /// Fills the slots and their azimuths; the packet's one turning rate [0.01°/ns]. None without any block.
    fn read_slots(&mut self, slot_count: usize) -> Option<f64> {
        let blocks = BLOCKS / slot_count;
        for slot in 0..slot_count {
            let range = slot * blocks..(slot + 1) * blocks;
            self.slots[slot] = if range.clone().any(|block| self.packet.is_block(block)) {
                Slot::Received
            } else if range.clone().all(|block| self.packet.is_absent(block)) {
                Slot::Absent
            } else {
                Slot::Unknown
            };
            let block = range.clone().find(|&block| self.packet.is_block(block)).unwrap_or(range.start);
            self.azimuths_cdeg[slot] = f64::from(self.packet.azimuth_cdeg(block));
        }
        let slots = &self.slots[..slot_count];
        let first = slots.iter().position(|&slot| slot == Slot::Received)?;
        let last = slots.iter().rposition(|&slot| slot == Slot::Received)?;
        // rate = ((az(11) - az(0)) mod 36000) / (11 cycles), or over the blocks that there are.
        let advance_cdeg = (self.azimuths_cdeg[last] - self.azimuths_cdeg[first]).rem_euclid(TURN);
        let mut rate = advance_cdeg / ((last - first).max(1) as f64 * self.slot_ns() as f64);
        // Over few blocks the rounding of azimuths to 0.01° would tell more than the rate.
        let are_few = 2 * (last - first + 1) < slot_count && self.cdeg_per_ns > 0.0;
        if first == last || are_few || rate > self.max_cdeg_per_ns {
            rate = self.cdeg_per_ns;
        }
        for slot in 0..slot_count {
            if self.slots[slot] != Slot::Received {
                let ahead_ns = (slot as f64 - first as f64) * self.slot_ns() as f64;
                let supposed_cdeg = self.azimuths_cdeg[first] + rate * ahead_ns;
                // Only the flag may be torn: then the azimuth is where it must be.
                let off_cdeg = (self.azimuths_cdeg[slot] - supposed_cdeg + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0;
                if off_cdeg.abs() > rate * self.slot_ns() as f64 {
                    self.azimuths_cdeg[slot] = supposed_cdeg.rem_euclid(TURN);
                }
            }
        }
        Some(rate)
    }
}

/// Puts a stamp [µs since the top of the hour] into the hour of the host's clock, or the one beside it when the result
/// would be more than half an hour off. Never before 1970.
fn absolute_ns(host_ns: u64, stamp_us: u64) -> u64 {
    let host = i128::from(host_ns);
    let mut time = host - host % NS_PER_HOUR + i128::from(stamp_us) * 1_000;
    if time - host > NS_PER_HOUR / 2 && time >= NS_PER_HOUR {
        time -= NS_PER_HOUR;
    } else if host - time > NS_PER_HOUR / 2 {
        time += NS_PER_HOUR;
    }
    u64::try_from(time).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_goes_into_the_hour_nearest_to_the_hosts_clock() {
        const HOUR: u64 = HOUR_US * 1_000;
        let minute = HOUR / 60;
        for (host, stamp_min, expected) in [
            (10 * HOUR + 5 * minute, 5, 10 * HOUR + 5 * minute),
            (10 * HOUR + minute, 59, 9 * HOUR + 59 * minute),
            (10 * HOUR + 59 * minute, 1, 11 * HOUR + minute),
            (0, 59, 59 * minute),
            (0, 0, 0),
        ] {
            assert_eq!(absolute_ns(host, stamp_min * 60_000_000), expected, "{host} {stamp_min}");
        }
    }
}
