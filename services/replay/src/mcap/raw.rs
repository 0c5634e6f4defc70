//! Encke's own sweeps, to the bit.

use std::collections::VecDeque;

use lidar::Return;
use messages::{Message as _, Raw, Sweep};
use zerocopy::FromZeros;

use super::messages::Messages;
use crate::error::ReplayError;
use crate::faults::{Fault, Faults};
use crate::intake::Limits;

/// Sweeps of the topic that holds them raw.
pub(crate) struct RawSweeps {
    messages: Messages,
    /// Ranges that the caller asks for; sweeps are given as they are without.
    limits: Option<Limits>,
    /// Start and duration of the sweep before [ns].
    before_ns: Option<(u64, u64)>,
    /// Number and start of the latest sweeps.
    latest: VecDeque<(u32, u64)>,
}

/// Sweeps that a file may hold again of the one before: those that were on their way when its writer died.
const MOST_AGAIN: usize = 512;

impl RawSweeps {
    /// Sees that there is at least one sweep.
    pub(crate) fn new(messages: Messages, limits: Option<Limits>) -> Result<Self, ReplayError> {
        let mut sut = Self { messages, limits, before_ns: None, latest: VecDeque::with_capacity(MOST_AGAIN) };
        let empty = |what: String, sut: &Self| ReplayError::Empty { path: sut.messages.place().0.to_owned(), what };
        let Ok(mut sweep) = Sweep::new_box_zeroed() else {
            return Err(empty("cannot be read without memory for a sweep".to_owned(), &sut));
        };
        if !sut.next(&mut sweep, &mut Faults::muted()) {
            return Err(empty(format!("holds no sweep in topic {}", sut.messages.topic()), &sut));
        }
        sut.rewind();
        Ok(sut)
    }

    /// Starts again with the first sweep.
    pub(crate) fn rewind(&mut self) {
        self.messages.rewind();
        self.before_ns = None;
        self.latest.clear();
    }

    /// Fills `sweep` with the next one; false after the last.
    pub(crate) fn next(&mut self, sweep: &mut Sweep, faults: &mut Faults) -> bool {
        loop {
            let Some(message) = self.messages.next(faults) else { return false };
            sweep.clear();
            let (sequence, goes_on) = (message.sequence, message.goes_on);
            let read = sweep.read_raw(message.data).map_err(|error| error.to_string());
            match read.and_then(|()| check(sweep)) {
                Ok(()) => {
                    let this = (sequence, sweep.header.sensor_time_ns);
                    if goes_on && self.latest.contains(&this) {
                        continue;
                    }
                    if self.latest.len() == MOST_AGAIN {
                        self.latest.pop_front();
                    }
                    self.latest.push_back(this);
                    break;
                }
                Err(what) => {
                    let (path, place) = self.messages.place();
                    faults.note(Fault::BadMessage, 1, path, place, what);
                    sweep.clear();
                }
            }
        }
        self.check_clock(sweep, faults);
        if let Some(limits) = &self.limits {
            narrow(sweep, limits);
        }
        true
    }

    fn check_clock(&mut self, sweep: &Sweep, faults: &mut Faults) {
        let (start_ns, period_ns) = (sweep.header.sensor_time_ns, sweep.header.period_ns);
        let before_ns = self.before_ns.replace((start_ns, period_ns));
        let Some((before_ns, lasting_ns)) = before_ns else { return };
        let (path, place) = self.messages.place();
        if start_ns < before_ns {
            faults.note(Fault::ClockStep, 1, path, place, format!("time goes back by {} ns", before_ns - start_ns));
        } else if start_ns - before_ns > lasting_ns.saturating_add(lasting_ns / 2) {
            faults.note(Fault::ClockStep, 1, path, place, format!("time goes on by {} ns", start_ns - before_ns));
        }
    }
}

/// What every sweep must keep that a stage is given: stages rely on it.
fn check(sweep: &Sweep) -> Result<(), String> {
    let header = &sweep.header;
    let refused = header.refused.iter().fold(0_u64, |sum, &count| sum + u64::from(count));
    let fails = |what: &str| Err(format!("a sweep in which {what}"));
    if u64::from(header.recorded) != refused + sweep.returns.len() as u64 {
        return fails("recorded, refused and accepted returns do not add up");
    }
    if sweep.first_column != 0 || sweep.first_return != 0 {
        return fails("the first sector is missing");
    }
    if sweep.recorded_index.len() != if refused == 0 { 0 } else { sweep.returns.len() }
        || sweep.recorded_index.windows(2).any(|pair| pair[0] >= pair[1])
        || sweep.recorded_index.last().is_some_and(|&last| last >= header.recorded)
    {
        return fails("returns are not numbered in rising order");
    }
    if header.period_ns == 0 || header.complete > 1 || header.organised > 1 {
        return fails("period_ns, complete or organised cannot be");
    }
    let floats = [header.column_step_rad, header.range_sigma_m, header.reach_m, header.stray_rad];
    if floats.iter().any(|&value| !(value.is_finite() && value >= 0.0)) {
        return fails("a length or angle of the header is negative or not finite");
    }
    let is_finite = |found: &Return| found.position().iter().all(|c| c.is_finite());
    if !header.is_organised() {
        let is_plain = |found: &Return| found.column == 0 && found.ring == 0 && is_finite(found);
        let is_empty = sweep.columns.is_empty() && sweep.rings.is_empty();
        let what = "an unorganised cloud has columns, or a return is not finite";
        return if is_empty && sweep.returns.iter().all(is_plain) { Ok(()) } else { fails(what) };
    }
    let azimuths = -std::f32::consts::PI..std::f32::consts::PI;
    if sweep.columns.iter().any(|column| column.valid > 1 || !azimuths.contains(&column.azimuth_rad))
        || sweep.columns.windows(2).any(|pair| pair[0].offset_ns > pair[1].offset_ns)
    {
        return fails("columns do not follow one another in time, or have no azimuth");
    }
    if sweep.rings.iter().any(|ring| !ring.elevation_rad.is_finite())
        || sweep.rings.windows(2).any(|pair| pair[0].elevation_rad >= pair[1].elevation_rad)
    {
        return fails("rings do not rise");
    }
    let mut before = 0;
    let is_placed = |found: &Return| {
        let is_valid = sweep.columns.get(usize::from(found.column)).is_some_and(|column| column.valid == 1);
        let is_next = std::mem::replace(&mut before, found.column) <= found.column;
        is_finite(found) && is_valid && is_next && usize::from(found.ring) < sweep.rings.len()
    };
    if !sweep.returns.iter().all(is_placed) {
        return fails("returns are not finite, or do not lie in their columns and rings, in firing order");
    }
    Ok(())
}

/// Refuses returns outside `limits`; the others keep their numbers.
fn narrow(sweep: &mut Sweep, limits: &Limits) {
    let is_outside = |found: &Return| limits.refusal(found.position().map(f64::from));
    if sweep.returns.iter().all(|found| is_outside(found).is_none()) {
        return;
    }
    if sweep.recorded_index.is_empty() {
        for place in 0..sweep.returns.len() {
            // As large as `returns`, so never full.
            let _ = sweep.recorded_index.push(place as u32);
        }
    }
    let mut kept = 0;
    for place in 0..sweep.returns.len() {
        let found = sweep.returns[place];
        match is_outside(&found) {
            Some(reason) => sweep.header.refused[reason as usize] += 1,
            None => {
                sweep.returns[kept] = found;
                sweep.recorded_index[kept] = sweep.recorded_index[place];
                kept += 1;
            }
        }
    }
    sweep.returns.truncate(kept);
    sweep.recorded_index.truncate(kept);
}
