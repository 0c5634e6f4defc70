use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

use crate::EgoMotion;

/// Why a recorded return is no return to the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Refusal {
    /// A coordinate is NaN or infinite.
    NotFinite = 0,
    /// At the sensor itself: how clouds write "nothing came back".
    AtOrigin = 1,
    /// Nearer than the accepted range.
    TooNear = 2,
    /// Farther than the accepted range.
    TooFar = 3,
    /// The sweep held its most returns already.
    OverCapacity = 4,
}

impl Refusal {
    /// All reasons, in the order of [`SweepHeader::refused`].
    pub const ALL: [Self; 5] = [Self::NotFinite, Self::AtOrigin, Self::TooNear, Self::TooFar, Self::OverCapacity];

    /// The reason's word in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotFinite => "not_finite",
            Self::AtOrigin => "at_origin",
            Self::TooNear => "too_near",
            Self::TooFar => "too_far",
            Self::OverCapacity => "over_capacity",
        }
    }
}

/// What every message of the chain says of its sweep. Written by the source, passed on unchanged.
///
/// `recorded` and `refused` are of the part; all else is the same in every part, except that `complete` may still be 0
/// before the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct SweepHeader {
    /// Sensor time of the sweep's first firing [ns]; the epoch is the recording's own.
    pub sensor_time_ns: u64,
    /// Duration of the turn [ns]: measured where the recording allows, else the sensor's nominal one.
    pub period_ns: u64,
    /// Returns of this part as recorded, refused ones included.
    pub recorded: u32,
    /// Refused returns by [`Refusal`]; those of the whole sweep are in its last part.
    pub refused: [u32; Refusal::ALL.len()],
    /// 1 when the turn was seen from wrap to wrap; known with the last sector.
    pub complete: u32,
    /// 1 when returns carry ring and column in firing order; 0 for an unorganised cloud.
    pub organised: u32,
    /// Usual azimuth between neighbouring columns [rad], positive; 0 for an unorganised cloud.
    pub column_step_rad: f32,
    /// Standard deviation of a range [m].
    pub range_sigma_m: f32,
    /// Farthest range at which the sensor would have seen a surface [m]: beyond it a miss says nothing.
    pub reach_m: f32,
    /// Bound on how far returns stray from their columns [rad], positive, where the sweep may be cut (see
    /// [`crate::Cutter`]); 0 where it may not, and all of it travels in its last sector.
    pub stray_rad: f32,
    /// How the sensor itself moved, where the source knows.
    pub ego: EgoMotion,
}

impl SweepHeader {
    /// Returns of this part that were accepted.
    pub fn accepted(&self) -> u32 {
        self.recorded.saturating_sub(self.refused.iter().sum())
    }

    /// Whether the whole turn was seen.
    pub fn is_complete(&self) -> bool {
        self.complete != 0
    }

    /// Whether returns carry ring and column.
    pub fn is_organised(&self) -> bool {
        self.organised != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepted_returns_are_those_recorded_less_those_refused() {
        let mut header = SweepHeader { recorded: 10, ..SweepHeader::default() };
        header.refused[Refusal::TooNear as usize] = 3;
        assert_eq!(header.accepted(), 7);
    }

    #[test]
    fn every_reason_stands_at_its_own_index() {
        for (index, reason) in Refusal::ALL.into_iter().enumerate() {
            assert_eq!(reason as usize, index);
        }
    }
}
