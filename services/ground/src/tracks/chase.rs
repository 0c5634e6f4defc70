//! Who follows: simulator or recording, clusterer, extractor, classifier and tracker in a row, without processes.

use messages::{Detections, Message, Part, Sweep, SweepHeader, TrackTable, Tracks, Truth, Verdict};
use zerocopy::FromZeros;

use super::frame::{Looked, actual_at};
use crate::bars::Witness;
use crate::{EvaluateError, Files, Judges, View};

/// A tracker: fills the tracks, which arrive empty.
pub type Follower = Box<dyn FnMut(Part, &Detections, &mut Tracks) -> Verdict>;

/// Makes a tracker that has seen nothing, for any thread; each must say the same of the same detections.
pub type Followers<'a> = &'a (dyn Fn() -> Follower + Sync);

/// Whom the chain's stages come from.
#[derive(Clone, Copy)]
pub(crate) struct Rooms<'a> {
    pub(crate) read: Files<'a>,
    pub(crate) judges: Judges<'a>,
    pub(crate) followers: Followers<'a>,
}

/// All rooms in a row.
pub(crate) struct Chase {
    witness: Witness,
    follower: Follower,
    tracks: Box<Tracks>,
    next: u64,
}

/// What is known of a sweep once it was followed.
pub(crate) struct Seen<'a> {
    pub(crate) truth: &'a Truth,
    pub(crate) header: &'a SweepHeader,
    pub(crate) detections: &'a Detections,
    pub(crate) table: &'a TrackTable,
}

impl Seen<'_> {
    /// Truth and tracks at the same time.
    pub(crate) fn looked(&self) -> Looked {
        let actual = actual_at(self.truth, self.header, self.table.time_ns);
        Looked { actual, tracks: self.table.tracks.to_vec() }
    }
}

impl Chase {
    pub(crate) fn new(view: &View, rooms: Rooms<'_>) -> Result<Self, EvaluateError> {
        let tracks = Tracks::new_box_zeroed().map_err(|_| EvaluateError::NoMemory)?;
        let witness = Witness::new(view, rooms.read, rooms.judges)?;
        Ok(Self { witness, follower: (rooms.followers)(), tracks, next: 0 })
    }

    /// Forgets what was followed: another scene begins.
    pub(crate) fn begin(&mut self, rooms: Rooms<'_>) {
        self.follower = (rooms.followers)();
        self.next = 0;
    }

    pub(crate) fn observer(&mut self) -> &mut crate::Observer {
        &mut self.witness.observer
    }

    /// Whatever `fill` puts into an empty sweep, looked at and followed, and what the tracker said of it. `time` is round
    /// the tracker's work alone.
    pub(crate) fn follow<R>(
        &mut self,
        fill: impl FnOnce(&mut Sweep, &mut Truth) -> R,
        time: &mut dyn FnMut(&mut dyn FnMut()),
    ) -> Result<(R, Verdict), EvaluateError> {
        let filled = self.witness.observer.look(fill);
        let detections = self.witness.bench.detect(self.witness.observer.seen().descriptors)?;
        let (sweep, sensor_time_ns) = (self.next, detections.header.sensor_time_ns);
        let part = Part { ordinal: sweep, sweep, sector: 0, sectors: 1, sensor_time_ns, step: 0, attempt: 0 };
        self.next += 1;
        self.tracks.clear();
        let mut verdict = Verdict::default();
        time(&mut || verdict = (self.follower)(part, detections, &mut self.tracks));
        Ok((filled, verdict))
    }

    /// The n-th sweep of a simulator, followed.
    pub(crate) fn step(&mut self, simulator: &mut simulator::Simulator, sweep: u64) -> Result<Seen<'_>, EvaluateError> {
        let fill = |into: &mut Sweep, truth: &mut Truth| simulator.sweep(sweep, into, truth);
        let ((), verdict) = self.follow(fill, &mut |work| work())?;
        if verdict.is_rejected() || self.tracks.table.time_ns == 0 {
            return Err(EvaluateError::Tracker(verdict));
        }
        Ok(self.seen())
    }

    /// What was followed last.
    pub(crate) fn seen(&self) -> Seen<'_> {
        let seen = self.witness.observer.seen();
        Seen {
            truth: seen.truth,
            header: &seen.clusters.header,
            detections: self.witness.bench.detections(),
            table: &self.tracks.table,
        }
    }
}
