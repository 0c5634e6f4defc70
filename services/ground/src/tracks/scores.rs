//! All scores of tracks on scenes whose truth is known.

use std::collections::BTreeSet;

use super::bodies::Bodies;
use super::classes::Classes;
use super::clear_mot::ClearMot;
use super::confirming::Confirming;
use super::consistency::Consistency;
use super::errors::TrackErrors;
use super::frame::{Frame, Looked, is_believed};
use super::hardest::HardObstacle;
use super::hota::Hota;
use super::identity::Identity;
use super::pair::pairs;
use super::plan::TracksPlan;

/// Least returns with which an obstacle counts in a sweep.
pub(crate) const LEAST_RETURNS: u32 = 5;

/// Counts by another least number of returns.
const LARGER: [u32; 2] = [20, 50];

/// Who was followed, for one way of counting.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Followed {
    /// Least returns of obstacles that count; others are neither missed nor false.
    pub least_returns: u32,
    /// Farthest that a track may be from its obstacle \[m\].
    pub match_m: f64,
    /// CLEAR MOT.
    pub clear: ClearMot,
    /// IDF1.
    pub identity: Identity,
}

/// Scores of scenes. Those of several add up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackScores {
    /// Counts: as judged, for obstacles of more returns, for the plan's other distances.
    pub followed: Vec<Followed>,
    /// As judged, by HOTA.
    pub hota: Hota,
    /// Position and velocity.
    pub errors: TrackErrors,
    /// Covariances.
    pub consistency: Consistency,
    /// How soon a track is confirmed.
    pub confirming: Confirming,
    /// Classes.
    pub classes: Classes,
    /// Sizes and spins.
    pub bodies: Bodies,
    /// Obstacles that count in any sweep.
    pub obstacles: u32,
    /// Tracks that were ever confirmed.
    pub tracks: u32,
    /// Obstacles that were followed worst, worst first; a few.
    pub hardest: Vec<HardObstacle>,
}

impl TrackScores {
    /// Of one scene, the plan's `number`-th.
    pub(crate) fn of(sweeps: &[Looked], plan: &TracksPlan, number: u32) -> Self {
        let frames = |least_returns, match_m| -> Vec<Frame> {
            sweeps.iter().map(|looked| Frame::of(looked, least_returns, match_m)).collect()
        };
        let judged = frames(LEAST_RETURNS, plan.match_m);
        let (clear, matches) = ClearMot::of(&judged, plan.match_m);
        let identity = Identity::of(&judged, plan.match_m);
        let mut followed = vec![Followed { least_returns: LEAST_RETURNS, match_m: plan.match_m, clear, identity }];
        let others = LARGER.map(|least| (least, plan.match_m));
        for (least_returns, match_m) in others.into_iter().chain(plan.also_m.iter().map(|&m| (LEAST_RETURNS, m))) {
            let frames = frames(least_returns, match_m);
            let (clear, _) = ClearMot::of(&frames, match_m);
            followed.push(Followed { least_returns, match_m, clear, identity: Identity::of(&frames, match_m) });
        }
        let pairs = pairs(sweeps, &judged, &matches);
        let ids = |of: fn(&Frame) -> Vec<u64>| judged.iter().flat_map(of).collect::<BTreeSet<_>>().len() as u32;
        let believed = sweeps.iter().flat_map(|looked| looked.tracks.iter().filter(|track| is_believed(track)));
        Self {
            followed,
            hota: Hota::of(&judged, plan.zero_m),
            errors: TrackErrors::of(&pairs),
            consistency: Consistency::of(&pairs),
            confirming: Confirming::of(sweeps, &pairs, LEAST_RETURNS),
            classes: Classes::of(sweeps, plan.match_m),
            bodies: Bodies::of(&pairs),
            obstacles: ids(|frame| frame.actual.iter().map(|&id| id.into()).collect()),
            hardest: HardObstacle::of(number, sweeps, &judged, &pairs),
            tracks: believed.map(|track| track.id).collect::<BTreeSet<_>>().len() as u32,
        }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        if self.followed.is_empty() {
            self.clone_from(other);
            return;
        }
        for (followed, other) in self.followed.iter_mut().zip(&other.followed) {
            followed.clear.add(&other.clear);
            followed.identity.add(&other.identity);
        }
        self.hota.add(&other.hota);
        self.errors.add(&other.errors);
        self.consistency.add(&other.consistency);
        self.confirming.add(&other.confirming);
        self.classes.add(&other.classes);
        self.bodies.add(&other.bodies);
        self.obstacles += other.obstacles;
        self.tracks += other.tracks;
        self.hardest.extend(other.hardest.iter().cloned());
        HardObstacle::keep_worst(&mut self.hardest);
    }

    /// Counts as they are judged: obstacles of at least 5 returns, within the plan's distance.
    pub fn judged(&self) -> Followed {
        self.followed.first().copied().unwrap_or_default()
    }
}
