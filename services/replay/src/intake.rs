use lidar::Return;
use messages::{Refusal, Sweep};

use crate::error::ReplayError;

/// Ranges that are accepted [m], both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Limits {
    near_m: f64,
    far_m: f64,
}

impl Limits {
    pub(crate) fn checked(near_m: f64, far_m: f64) -> Result<Self, ReplayError> {
        // False for NaN too.
        if near_m >= 0.0 && near_m < far_m && far_m.is_finite() {
            Ok(Self { near_m, far_m })
        } else {
            Err(ReplayError::Limits { near_m, far_m })
        }
    }

    /// Why a return at `position_m` is refused, if it is.
    #[inline]
    pub(crate) fn refusal(&self, position_m: [f64; 3]) -> Option<Refusal> {
        let [x, y, z] = position_m;
        // What is finite here may not be in a message.
        if !position_m.iter().all(|c| (*c as f32).is_finite()) {
            return Some(Refusal::NotFinite);
        }
        if x == 0.0 && y == 0.0 && z == 0.0 {
            return Some(Refusal::AtOrigin);
        }
        let range_m = (x * x + y * y + z * z).sqrt();
        if range_m < self.near_m {
            Some(Refusal::TooNear)
        } else if range_m > self.far_m {
            Some(Refusal::TooFar)
        } else {
            None
        }
    }
}

/// Puts a recorded return into `sweep`, or counts why not; either way it takes the next index of the sweep.
#[inline]
pub(crate) fn take(sweep: &mut Sweep, limits: &Limits, position_m: [f64; 3], at: Return) {
    match limits.refusal(position_m) {
        Some(reason) => refuse(sweep, reason, 1),
        None => {
            let [x, y, z] = position_m.map(|c| c as f32);
            let index = sweep.header.recorded;
            if sweep.returns.push(Return { x, y, z, ..at }).is_err() {
                refuse(sweep, Refusal::OverCapacity, 1);
            } else {
                if index as usize + 1 != sweep.returns.len() {
                    // As large as `returns`, so never full.
                    let _ = sweep.recorded_index.push(index);
                }
                sweep.header.recorded += 1;
            }
        }
    }
}

/// Counts `times` recorded returns that are none to the chain.
pub(crate) fn refuse(sweep: &mut Sweep, reason: Refusal, times: u32) {
    if sweep.recorded_index.is_empty() {
        // The first refusal: from here on an index is no longer a place, so those before are written down.
        for place in 0..sweep.returns.len() {
            let _ = sweep.recorded_index.push(place as u32);
        }
    }
    sweep.header.recorded = sweep.header.recorded.saturating_add(times);
    sweep.header.refused[reason as usize] = sweep.header.refused[reason as usize].saturating_add(times);
}

#[cfg(test)]
mod tests {
    use super::*;
    use lidar::MAX_RETURNS;
    use messages::Message;
    use zerocopy::FromZeros;

    const AT: Return = Return { x: 0.0, y: 0.0, z: 0.0, column: 3, ring: 2, intensity: 1 };

    #[test]
    fn a_refused_return_keeps_its_place_in_the_numbering() {
        let limits = Limits::checked(1.0, 10.0).unwrap();
        let nan = f64::NAN;
        type Case<'a> = (&'a [[f64; 3]], &'a [u32], [u32; 5]);
        let cases: [Case<'_>; 6] = [
            (&[], &[], [0; 5]),
            (&[[1.0, 0.0, 0.0], [10.0, 0.0, 0.0]], &[], [0; 5]),
            (&[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], &[1], [0, 1, 0, 0, 0]),
            (&[[2.0, 0.0, 0.0], [0.0, nan, 0.0], [3.0, 0.0, 0.0]], &[0, 2], [1, 0, 0, 0, 0]),
            (&[[2.0, 0.0, 0.0], [0.5, 0.0, 0.0]], &[0], [0, 0, 1, 0, 0]),
            (&[[11.0, 0.0, 0.0], [1e300, 0.0, 0.0], [2.0, 0.0, 0.0]], &[2], [1, 0, 0, 1, 0]),
        ];
        let mut sweep = Sweep::new_box_zeroed().unwrap();
        for (positions, indices, refused) in cases {
            sweep.clear();
            positions.iter().for_each(|&p| take(&mut sweep, &limits, p, AT));
            assert_eq!(&sweep.recorded_index[..], indices, "{positions:?}");
            assert_eq!(sweep.header.refused, refused, "{positions:?}");
            assert_eq!(sweep.header.recorded as usize, positions.len());
            assert_eq!(sweep.header.accepted() as usize, sweep.returns.len());
        }
    }

    #[test]
    fn one_return_more_than_a_sweep_holds_is_refused_as_over_capacity() {
        let limits = Limits::checked(0.0, 10.0).unwrap();
        let mut sweep = Sweep::new_box_zeroed().unwrap();
        for _ in 0..MAX_RETURNS {
            take(&mut sweep, &limits, [1.0, 0.0, 0.0], AT);
        }
        assert!(sweep.recorded_index.is_empty());
        take(&mut sweep, &limits, [1.0, 0.0, 0.0], AT);
        assert_eq!(sweep.header.refused[Refusal::OverCapacity as usize], 1);
        assert_eq!(sweep.header.recorded as usize, MAX_RETURNS + 1);
        assert_eq!(sweep.recorded_index.len(), MAX_RETURNS);
        assert_eq!(sweep.recorded_index[MAX_RETURNS - 1] as usize, MAX_RETURNS - 1);
    }

    #[test]
    fn limits_that_contradict_each_other_are_refused() {
        for (near, far) in [(-1.0, 5.0), (5.0, 5.0), (f64::NAN, 5.0), (0.0, f64::INFINITY), (0.0, f64::NAN)] {
            assert!(Limits::checked(near, far).is_err(), "{near} {far}");
        }
    }
}
