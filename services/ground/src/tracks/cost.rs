//! What the tracker takes, on one thread.

use super::chase::{Chase, Rooms};
use super::frame::is_believed;
use super::plan::TracksPlan;
use crate::bars::quantile;
use crate::{Clock, EvaluateError, View};

/// Time of the tracker a sweep.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackerTime {
    /// Sweeps.
    pub sweeps: u32,
    /// Tracks that are believed, mean over these sweeps.
    pub tracks: f64,
    /// Median and 99th percentile \[ms\]; none without a sweep.
    pub ms: Option<[f64; 2]>,
}

impl TrackerTime {
    pub(crate) fn measure(plan: &TracksPlan, rooms: Rooms<'_>, clock: Clock<'_>) -> Result<Self, EvaluateError> {
        let view = View { count: Some(plan.cost.obstacles), ..View::of(&plan.scene) };
        let mut chase = Chase::new(&view, rooms)?;
        let mut simulator = chase.observer().simulator(plan.cost_seed())?;
        let (mut taken_ms, mut tracks) = (Vec::new(), 0);
        for sweep in 0..plan.cost.sweeps {
            let mut took = |work: &mut dyn FnMut()| {
                let started_ns = clock();
                work();
                taken_ms.push(clock().saturating_sub(started_ns) as f64 * 1e-6);
            };
            let ((), verdict) = chase.follow(|into, truth| simulator.sweep(sweep.into(), into, truth), &mut took)?;
            if verdict.is_rejected() {
                return Err(EvaluateError::Tracker(verdict));
            }
            tracks += chase.seen().table.tracks.iter().filter(|track| is_believed(track)).count();
        }
        let of = |at| quantile(taken_ms.clone(), at);
        Ok(Self {
            sweeps: plan.cost.sweeps,
            tracks: tracks as f64 / f64::from(plan.cost.sweeps.max(1)),
            ms: of(0.5).zip(of(0.99)).map(|(median, most)| [median, most]),
        })
    }
}
