//! What the blocks of one packet say: which were received, their azimuths, the turning rate, and a jump among them.

use super::packet::{BLOCKS, Packet, TURN_CDEG};

const TURN: f64 = TURN_CDEG as f64;
/// Azimuth between neighbouring blocks that may be the edge of a field of view, beyond three steps [0.01°].
const LEAST_JUMP_CDEG: f64 = 100.0;

/// What a slot (a block, or a pair of them in dual-return mode) holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Slot {
    Received,
    Unknown,
    Absent,
}

/// The slots of a packet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slots {
    /// Slots in use: 12, or 6 in dual-return mode; 0 where there is no packet.
    pub(super) count: usize,
    pub(super) kinds: [Slot; BLOCKS],
    /// Azimuth of each slot's first firing [0.01°], clockwise, in [0, 36000).
    pub(super) azimuths_cdeg: [f64; BLOCKS],
    /// The only slot that lies far beyond the one before it, if there is one.
    pub(super) jump: Option<usize>,
    /// Time from slot to slot [ns].
    slot_ns: f64,
    max_cdeg_per_ns: f64,
}

impl Slots {
    /// No slots yet, of a sensor that turns at `fastest_hz` at most.
    pub(super) fn new(slot_ns: u64, fastest_hz: f64) -> Self {
        Self {
            count: 0,
            kinds: [Slot::Absent; BLOCKS],
            azimuths_cdeg: [0.0; BLOCKS],
            jump: None,
            slot_ns: slot_ns as f64,
            max_cdeg_per_ns: 1.5 * fastest_hz * TURN / 1e9,
        }
    }

    /// Blocks of one slot: two in dual-return mode.
    pub(super) fn blocks(&self) -> usize {
        BLOCKS / self.count.max(1)
    }

    /// Unknown slots.
    pub(super) fn unknown(&self) -> usize {
        self.kinds[..self.count].iter().filter(|&&slot| slot == Slot::Unknown).count()
    }

    /// Slots up to the last that is not absent.
    pub(super) fn present(&self) -> usize {
        self.kinds[..self.count].iter().rposition(|&slot| slot != Slot::Absent).map_or(0, |last| last + 1)
    }

    /// Takes in the slots of a packet that turned at `before_cdeg_per_ns` up to here (0 = not known); gives the packet's
    /// one turning rate [0.01°/ns], and takes in nothing without any block.
    pub(super) fn read(&mut self, packet: &Packet, before_cdeg_per_ns: f64) -> Option<f64> {
        let count = if packet.is_dual() { BLOCKS / 2 } else { BLOCKS };
        let blocks = BLOCKS / count;
        for slot in 0..count {
            let range = slot * blocks..(slot + 1) * blocks;
            self.kinds[slot] = if range.clone().any(|block| packet.is_block(block)) {
                Slot::Received
            } else if range.clone().all(|block| packet.is_absent(block)) {
                Slot::Absent
            } else {
                Slot::Unknown
            };
            let block = range.clone().find(|&block| packet.is_block(block)).unwrap_or(range.start);
            self.azimuths_cdeg[slot] = f64::from(packet.azimuth_cdeg(block));
        }
        let kinds = &self.kinds[..count];
        let first = kinds.iter().position(|&slot| slot == Slot::Received)?;
        let last = kinds.iter().rposition(|&slot| slot == Slot::Received)?;
        self.count = count;
        // rate = ((az(11) - az(0)) mod 36000) / (11 cycles), or over the blocks that there are.
        let mut rate = self.rate(first, last);
        // With a jump the packet as a whole turns by more than its slots.
        let usual_cdeg = before_cdeg_per_ns.min(self.max_cdeg_per_ns) * self.slot_ns;
        let whole_cdeg = rate * (last - first).max(1) as f64 * self.slot_ns;
        let may_jump = usual_cdeg == 0.0 || whole_cdeg > count as f64 * usual_cdeg + LEAST_JUMP_CDEG;
        self.jump = if may_jump { self.find_jump(usual_cdeg) } else { None };
        if let Some(jump) = self.jump {
            // On the longer side of the jump.
            rate = if 2 * jump > count { self.rate(first, jump - 1) } else { self.rate(jump, last) };
        }
        // Over few blocks the rounding of azimuths to 0.01° would tell more than the rate.
        let are_few = (2 * (last - first + 1) < count || self.jump.is_some()) && before_cdeg_per_ns > 0.0;
        if first == last || are_few || rate > self.max_cdeg_per_ns {
            rate = before_cdeg_per_ns;
        }
        if self.unknown() > 0 {
            self.place_unknown(first, rate);
        }
        Some(rate)
    }

    /// Turning rate from slot to slot [0.01°/ns].
    fn rate(&self, from: usize, to: usize) -> f64 {
        let advance_cdeg = (self.azimuths_cdeg[to] - self.azimuths_cdeg[from]).rem_euclid(TURN);
        advance_cdeg / ((to - from).max(1) as f64 * self.slot_ns)
    }

    /// A sensor whose field of view is set to less than a turn sends no blocks beyond it, and goes on in the same packet
    /// where the head has come round to it again.
    fn find_jump(&self, usual_cdeg: f64) -> Option<usize> {
        let advance_cdeg = |slot: usize| (self.azimuths_cdeg[slot] - self.azimuths_cdeg[slot - 1]).rem_euclid(TURN);
        let received = |slot: usize| self.kinds[slot] == Slot::Received && self.kinds[slot - 1] == Slot::Received;
        let most_cdeg = 3.0 * usual_cdeg + LEAST_JUMP_CDEG;
        // A head that trembles goes back by a little.
        let is_jump = |advance_cdeg: f64| (most_cdeg..TURN - LEAST_JUMP_CDEG).contains(&advance_cdeg);
        let mut found = (1..self.count).filter(|&slot| received(slot) && is_jump(advance_cdeg(slot)));
        found.next().filter(|_| found.next().is_none())
    }

    /// Gives slots without a block the azimuth that they must have had.
    fn place_unknown(&mut self, first: usize, rate: f64) {
        for slot in 0..self.count {
            if self.kinds[slot] != Slot::Received {
                let ahead_ns = (slot as f64 - first as f64) * self.slot_ns;
                let supposed_cdeg = self.azimuths_cdeg[first] + rate * ahead_ns;
                // Only the flag may be torn: then the azimuth is where it must be.
                let off_cdeg = (self.azimuths_cdeg[slot] - supposed_cdeg + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0;
                if off_cdeg.abs() > rate * self.slot_ns {
                    self.azimuths_cdeg[slot] = supposed_cdeg.rem_euclid(TURN);
                }
            }
        }
    }
}
