use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout};

use crate::Step;

/// Most hops of a chain: the source and seven stages.
pub const MAX_HOPS: usize = 8;

/// Which piece of which sweep a message is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Part {
    /// `sweep · sectors + sector`: given once by the source, carried 1:1 by every stage.
    pub ordinal: u64,
    /// Number of the sweep, from 0; goes on rising when a source restarts.
    pub sweep: u64,
    /// Sector of the sweep, from 0.
    pub sector: u32,
    /// Sectors that a sweep travels as; 1 = whole sweeps.
    pub sectors: u32,
    /// Sensor time of the sweep's first firing [ns].
    pub sensor_time_ns: u64,
    /// Number of the [`Step`] of degradation at which the whole sweep is to be processed.
    pub step: u32,
    /// How often the source had gone back to send parts again before it sent this one.
    pub attempt: u32,
}

impl Part {
    /// Degradation at which the whole sweep is to be processed.
    pub fn step(&self) -> Step {
        Step::from_number(self.step)
    }

    /// Whether nothing of the sweep is looked at: every odd one at [`Step::EverySecondSweep`].
    pub fn is_shed(&self) -> bool {
        self.step() == Step::EverySecondSweep && self.sweep % 2 == 1
    }

    /// Whether the sweep ends with this part.
    pub fn is_last(&self) -> bool {
        self.sector + 1 >= self.sectors
    }
}

/// What became of a part in a stage.
///
/// `Complete` and `Partial` count as processed. The output of a rejected part still goes out, empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(u8)]
pub enum Verdict {
    /// All of the input was used.
    #[default]
    Complete = 0,
    /// Cells round some clusters were left out: the message was full.
    PartialCells = 1,
    /// Sectors of this sweep are missing: open clusters were discarded.
    RejectedIncomplete = 2,
    /// The message contradicts itself (a place out of range, a length that does not match).
    RejectedMalformed = 3,
    /// The sink could not take it: its writer was behind at real time.
    RejectedSinkFull = 4,
    /// No solids were fitted to the last clusters: the message was full.
    PartialFits = 5,
    /// Older than the allowed age when it was received: nobody may act on it any more.
    RejectedStale = 6,
    /// Left out on purpose: at [`Step::EverySecondSweep`] every odd sweep is.
    RejectedShed = 7,
    /// At the sink: of a sweep that it has answered already.
    RejectedDouble = 8,
    /// At the sink: a part before it is missing, or was without what came before it; both will be sent again.
    RejectedAhead = 9,
    /// The stage could not be kept running: a stand-in answers for it.
    RejectedDown = 10,
    /// New obstacles were left out: the tracker had its most already.
    PartialTracks = 11,
}

impl Verdict {
    /// All verdicts, by their number.
    pub const ALL: [Self; 12] = [
        Self::Complete,
        Self::PartialCells,
        Self::RejectedIncomplete,
        Self::RejectedMalformed,
        Self::RejectedSinkFull,
        Self::PartialFits,
        Self::RejectedStale,
        Self::RejectedShed,
        Self::RejectedDouble,
        Self::RejectedAhead,
        Self::RejectedDown,
        Self::PartialTracks,
    ];

    /// Whether the part counts as rejected in the ledger.
    pub const fn is_rejected(self) -> bool {
        matches!(
            self,
            Self::RejectedIncomplete
                | Self::RejectedMalformed
                | Self::RejectedSinkFull
                | Self::RejectedStale
                | Self::RejectedShed
                | Self::RejectedDouble
                | Self::RejectedAhead
                | Self::RejectedDown
        )
    }

    /// The verdict's word in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::PartialCells => "partial_cells",
            Self::PartialFits => "partial_fits",
            Self::RejectedIncomplete => "incomplete",
            Self::RejectedMalformed => "malformed",
            Self::RejectedSinkFull => "sink_full",
            Self::RejectedStale => "stale",
            Self::RejectedShed => "shed",
            Self::RejectedDouble => "double",
            Self::RejectedAhead => "ahead",
            Self::RejectedDown => "down",
            Self::PartialTracks => "partial_tracks",
        }
    }
}

/// One stage's stamps on a part. Host time, [ns] of the monotonic clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Hop {
    /// The part's number among all that this stage ever published, through restarts: a gap is a loss on this hop.
    pub sequence: u64,
    /// When the stage had finished its part before and was free for this one. Later than the sender's `finished_ns`
    /// where the part had to queue.
    pub free_ns: u64,
    /// When the input was taken from shared memory; for the source, when it began to make the part.
    pub received_ns: u64,
    /// When `process` began; for the source, when it had made the part and waited for its time.
    pub started_ns: u64,
    /// When `process` had ended, just before the output was sent.
    pub finished_ns: u64,
    /// Part of the time from `free_ns` to `started_ns` in which the stage was ready to run and had no core [ns], as the
    /// kernel counts it; saturates at 4.3 s.
    pub taken_before_ns: u32,
    /// The same of the time from `started_ns` to `finished_ns` [ns].
    pub taken_busy_ns: u32,
    /// Incarnation of the stage, from 1.
    pub incarnation: u32,
    /// Position of the stage in the chain; the source is 0.
    pub stage: u16,
    /// What became of the part.
    pub verdict: Verdict,
    /// Fills the struct to a multiple of its alignment.
    pub reserved: u8,
}

/// Travels beside every message; written only by the shell.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromZeros, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Trace {
    /// The part.
    pub part: Part,
    /// Host time at which the part's last return was, or should have been, complete [ns].
    pub due_ns: u64,
    /// Host time at which the first firing of the sweep was, or should have been, [ns].
    pub sweep_start_ns: u64,
    /// Number of hops stamped.
    pub hop_count: u64,
    /// The hops, source first.
    pub hops: [Hop; MAX_HOPS],
}

impl Trace {
    /// The stamped hops, source first.
    pub fn hops(&self) -> &[Hop] {
        &self.hops[..(self.hop_count as usize).min(MAX_HOPS)]
    }

    /// Appends a hop; a chain has at most [`MAX_HOPS`], which `chain` checks.
    pub fn push(&mut self, hop: Hop) {
        if let Some(slot) = self.hops.get_mut(self.hop_count as usize) {
            *slot = hop;
            self.hop_count += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verdict_stands_at_its_own_number() {
        for (number, verdict) in Verdict::ALL.into_iter().enumerate() {
            assert_eq!(verdict as usize, number);
        }
    }

    #[test]
    fn a_part_is_the_last_of_its_sweep_by_its_sector() {
        let part = |sector| Part { sector, sectors: 4, ..Part::default() };
        assert!(!part(2).is_last());
        assert!(part(3).is_last());
    }
}
