//! The tracker that is timed: it knows every obstacle, and takes the same sweep again and again.

use std::hash::Hasher;

use messages::{Detections, Message, Part, Tracks};
use runtime::Plan;
use stage::Stage;
use tracker::Tracker;

use super::stages::{Rejected, zeroed};
use crate::{Failure, dispatch};

/// Sweeps after which every obstacle that stands still has a confirmed track.
const WARM_SWEEPS: u64 = 20;

/// The tracker, and what it made last.
pub(super) struct Tracking {
    tracker: Tracker,
    input: Box<Detections>,
    tracks: Box<Tracks>,
    part: Part,
    is_warm: bool,
}

impl Tracking {
    /// Builds the tracker as its file says.
    pub(super) fn new(plan: &Plan) -> Result<Self, Failure> {
        Ok(Self {
            tracker: dispatch::init::<Tracker>(plan, |_| Ok(()))?,
            input: zeroed()?,
            tracks: zeroed()?,
            part: Part { sectors: 1, ..Part::default() },
            is_warm: false,
        })
    }

    /// Another sweep's detections follow.
    pub(super) fn unload(&mut self) {
        self.is_warm = false;
    }

    /// Whether it follows the obstacles of the sweep.
    pub(super) fn is_warm(&self) -> bool {
        self.is_warm
    }

    /// Lets it see the same detections, sweep after sweep.
    pub(super) fn warm_up(&mut self, detections: &Detections) -> Result<(), Rejected> {
        self.input.copy_from(detections);
        for _ in 0..WARM_SWEEPS {
            self.part.sweep += 1;
            self.part.ordinal = self.part.sweep;
            self.part.attempt = 0;
            self.input.header.sensor_time_ns += self.input.header.period_ns;
            self.part.sensor_time_ns = self.input.header.sensor_time_ns;
            self.process()?;
        }
        self.is_warm = true;
        Ok(())
    }

    /// Takes the last sweep once more, as one that is sent again: so it answers the same each time.
    pub(super) fn process_again(&mut self) -> Result<(), Rejected> {
        self.part.attempt += 1;
        self.process()
    }

    fn process(&mut self) -> Result<(), Rejected> {
        self.tracks.clear();
        Rejected::unless_taken(Tracker::NAME, self.tracker.process(self.part, &self.input, &mut self.tracks))
    }

    pub(super) fn write(&self, hash: &mut dyn Hasher) {
        hash.write(self.tracks.table.tracks.item_bytes());
        hash.write(self.tracks.table.keys.item_bytes());
    }
}
