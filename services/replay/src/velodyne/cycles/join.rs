//! Where a packet belongs in the row: its time by the one before it, what is missing between them, and what is wrong.

use super::super::field::Gap;
use super::super::packet::HOUR_US;
use super::{Before, Cycles, TURN};
use crate::capture::Arrival;
use crate::faults::{Fault, Faults};
use crate::time::absolute_ns;

/// A packet this much older than the one before came late; older ones mean that the clock was set [µs].
const LATE_US: u64 = 10_000;
/// Least gap between two packets that may be that of a field of view, if it is there again a turn later [0.01°].
const LEAST_GAP_CDEG: f64 = 1_000.0;

/// What is wrong with a packet: a fault, how often, and in words.
type Wrong = (Fault, u64, &'static str);

impl Cycles {
    /// Reads the packet at hand and puts it behind the one before. A packet that is of no use leaves nothing to give.
    pub(super) fn admit(&mut self, arrival: Arrival, faults: &mut Faults) {
        (self.next, self.known, self.slots.count) = (0, 0, 0);
        self.missing = (0, 0);
        let place = arrival.place;
        let stamp_us = self.packet.stamp_us();
        let Some(rate) = self.slots.read(&self.packet, self.cdeg_per_ns) else {
            self.slots.count = 0;
            faults.note(Fault::NoBlock, 1, self.capture.path(), place, "a data packet without a block flag");
            return;
        };
        match self.join(arrival, stamp_us, rate) {
            Ok(None) => {}
            Ok(Some((fault, times, what))) => faults.note(fault, times, self.capture.path(), place, what),
            Err((fault, times, what)) => {
                self.slots.count = 0;
                faults.note(fault, times, self.capture.path(), place, what);
                return;
            }
        }
        self.suspect_us = None;
        self.cdeg_per_ns = rate;
        // Blocks within it: packets were lost, or the sensor was set to another field of view.
        let is_gap = |gap: &Gap| !gap.holds(self.slots.azimuths_cdeg[0]);
        (self.gap, self.maybe_gap) = (self.gap.filter(is_gap), self.maybe_gap.filter(is_gap));
        let unknown = self.slots.unknown();
        if unknown > 0 {
            let what = "a block without its flag, or with an azimuth beyond the turn";
            faults.note(Fault::BadBlock, unknown as u64, self.capture.path(), place, what);
        }
        self.jump_ns = 0;
        self.known = self.slots.jump.unwrap_or(self.slots.count);
        let present_ns = self.slots.present() as u64 * self.slot_ns();
        self.before = Some(Before {
            stamp_us,
            time_ns: self.time_ns,
            next_ns: self.time_ns + present_ns,
            next_cdeg: (self.first_cdeg() + rate * present_ns as f64).rem_euclid(TURN),
        });
    }

    /// Finds the packet's time by the one before. Says what is wrong with it, and fails where it must be left out.
    fn join(&mut self, arrival: Arrival, stamp_us: u64, rate: f64) -> Result<Option<Wrong>, Wrong> {
        if stamp_us >= HOUR_US {
            return Err((Fault::BadStamp, 1, "a stamp beyond the hour"));
        }
        let Some(before) = self.before else {
            self.time_ns = absolute_ns(arrival.host_ns, stamp_us);
            self.is_break = true;
            return Ok(None);
        };
        let packet_ns = self.slots.count as u64 * self.slot_ns();
        let slot_cdeg = rate * self.slot_ns() as f64;
        // Signed: a trembling head goes back by a little.
        let turned_cdeg = (self.first_cdeg() - before.next_cdeg + 3.0 * slot_cdeg).rem_euclid(TURN) - 3.0 * slot_cdeg;
        // The head goes on as if no time had passed.
        let goes_on = slot_cdeg >= 1.0 && turned_cdeg <= 3.0 * slot_cdeg;
        // The hour wraps; half of it backwards is taken for backwards.
        let step_us = (stamp_us + HOUR_US - before.stamp_us) % HOUR_US;
        let is_late = step_us == 0 || HOUR_US - step_us <= LATE_US;
        // Where the head goes on from the packet before, not the packet is late: the clock was set back.
        if step_us == 0 || (is_late && !goes_on && !self.follows_suspect(stamp_us, packet_ns)) {
            return Err((Fault::LatePacket, 1, "a packet came twice or late"));
        }
        let time_ns = before.time_ns + step_us * 1_000;
        let lost_ns = time_ns.saturating_sub(before.next_ns);
        let supposed_cdeg = lost_ns as f64 * rate;
        // As far as time has passed the head must have turned.
        let do_agree = (turned_cdeg - supposed_cdeg).abs() <= supposed_cdeg / 4.0 + 3.0 * slot_cdeg;
        if self.gap.is_none() && self.suspect_us.is_none() && do_agree && turned_cdeg > LEAST_GAP_CDEG {
            let found = Gap::between(before.next_cdeg - slot_cdeg, self.first_cdeg(), slot_cdeg);
            self.gap = self.maybe_gap.replace(found).filter(|known| known.is_same(&found)).map(|_| found);
        }
        let gap = self
            .gap
            .filter(|gap| 2.0 * supposed_cdeg > gap.width_cdeg() && gap.is_passed(before.next_cdeg, turned_cdeg));
        let (lost, lost_cycles) = match gap {
            None => {
                let lost = (lost_ns as f64 / packet_ns as f64).round();
                (lost, lost * (self.slots.count * self.cycles_per_block) as f64)
            }
            // By the azimuths, which say it better than the rate over a packet.
            Some(gap) => {
                let lost = (turned_cdeg - gap.width_cdeg()) / (slot_cdeg * self.slots.count as f64);
                (lost.round().max(0.0), (turned_cdeg / slot_cdeg * self.cycles_per_block as f64).round())
            }
        };
        let lost_cdeg = lost * packet_ns as f64 * rate;
        let agree = lost == 0.0 || slot_cdeg < 1.0 || do_agree;
        // Set back by less than a packet.
        let overlaps = time_ns + self.slot_ns() < before.next_ns;
        let is_short = lost_cdeg < TURN / 2.0 && lost_cycles <= lidar::MAX_COLUMNS as f64;
        if !is_late && !overlaps && is_short && agree {
            self.time_ns = time_ns;
            if lost == 0.0 {
                self.is_edge = gap.is_some();
                return Ok(None);
            }
            self.missing = (lost_cycles as usize, lost_cycles as usize);
            self.lost_from = Some(before);
            let what = "by the stamps, packets are missing before this one";
            return Ok(Some((Fault::LostPacket, lost as u64, what)));
        }
        if !is_late && !overlaps && goes_on && step_us * 1_000 <= packet_ns + LATE_US * 1_000 {
            self.time_ns = time_ns;
            let what = "the sensor's clock was set forward by a little, and no packet is missing";
            return Ok(Some((Fault::ClockStep, 1, what)));
        }
        if !self.follows_suspect(stamp_us, packet_ns) {
            self.suspect_us = Some(stamp_us);
            return Err((Fault::BadStamp, 1, "the stamp jumps: the packet is left out"));
        }
        self.time_ns = absolute_ns(arrival.host_ns, stamp_us);
        self.is_break = true;
        let what = "the recording goes on at another time: the sweep ends here";
        Ok(Some((Fault::Break, 1, what)))
    }

    /// Whether the packet comes shortly after one that was left out for its stamp.
    fn follows_suspect(&self, stamp_us: u64, packet_ns: u64) -> bool {
        self.suspect_us.is_some_and(|suspect_us| {
            let step_us = (stamp_us + HOUR_US - suspect_us) % HOUR_US;
            step_us > 0 && step_us * 1_000 <= 100 * packet_ns
        })
    }

    /// Finds when the blocks behind a jump were fired, by the packet ahead or else by the turning rate, if the jump is
    /// that of a field of view. One that is not (a torn azimuth) takes no time.
    pub(super) fn place_jump(&mut self, is_followed: bool) {
        self.known = self.slots.count;
        let (Some(jump), Some(before)) = (self.slots.jump, self.before) else { return };
        let (slot_ns, slot_cdeg) = (self.slot_ns(), self.slot_cdeg());
        let azimuths_cdeg = &self.slots.azimuths_cdeg;
        let gap = Gap::between(azimuths_cdeg[jump - 1], azimuths_cdeg[jump], slot_cdeg);
        let turning_ns = gap.width_cdeg() / self.cdeg_per_ns.max(f64::MIN_POSITIVE);
        let rest_ns = (self.slots.present() - jump) as u64 * slot_ns;
        let end_cdeg = azimuths_cdeg[jump] + self.cdeg_per_ns * rest_ns as f64;
        let step_us = (self.ahead.stamp_us() + HOUR_US - before.stamp_us) % HOUR_US;
        let measured_ns = (step_us * 1_000).saturating_sub(before.next_ns - before.time_ns);
        let off_cdeg = (f64::from(self.ahead.azimuth_cdeg(0)) - end_cdeg + TURN / 2.0).rem_euclid(TURN) - TURN / 2.0;
        let agree = (measured_ns as f64 - turning_ns).abs() <= turning_ns / 4.0 + 2.0 * slot_ns as f64;
        self.jump_ns = if is_followed && agree && off_cdeg.abs() <= 3.0 * slot_cdeg {
            measured_ns
        } else if self.gap.is_some_and(|known| known.is_same(&gap)) {
            (turning_ns / self.cycle_ns as f64).round() as u64 * self.cycle_ns
        } else {
            return;
        };
        self.gap = Some(gap);
        self.is_edge = true;
        let next_ns = before.next_ns + self.jump_ns;
        self.before = Some(Before { next_ns, next_cdeg: end_cdeg.rem_euclid(TURN), ..before });
    }
}
