//! The obstacles that were followed worst: where to look first.

use std::collections::BTreeSet;

use lidar::ObstacleClass;

use super::errors::RootMeanSquare;
use super::frame::{Frame, Looked};
use super::pair::Pair;

/// How many are told.
const MOST: usize = 12;

/// One obstacle of a scene, and how it was followed.
#[derive(Clone, Debug, PartialEq)]
pub struct HardObstacle {
    /// Number of the scene in the plan.
    pub scene: u32,
    /// Its number in the truth.
    pub id: u16,
    /// What it is.
    pub class: ObstacleClass,
    /// Its full extents [m].
    pub size_m: [f64; 3],
    /// Sweeps in which it counts.
    pub sweeps: u32,
    /// Of these, those without a track on it.
    pub missed: u32,
    /// Different tracks on it.
    pub tracks: u32,
    /// Median of its returns over these sweeps.
    pub returns: u32,
    /// Mean distance of its centre over these sweeps [m].
    pub range_m: f64,
    /// How far tracks on it are off [m].
    pub off_m: RootMeanSquare,
}

impl HardObstacle {
    /// The worst of one scene.
    pub(crate) fn of(scene: u32, sweeps: &[Looked], frames: &[Frame], pairs: &[Pair<'_>]) -> Vec<Self> {
        let ids: BTreeSet<u16> = frames.iter().flat_map(|frame| frame.actual.iter().copied()).collect();
        let found = ids.into_iter().filter_map(|id| {
            let counted = sweeps.iter().zip(frames).filter(|(_, frame)| frame.actual.contains(&id));
            let own: Vec<_> = counted.filter_map(|(looked, _)| looked.actual.iter().find(|one| one.id == id)).collect();
            let first = own.first()?;
            let on: Vec<_> = pairs.iter().filter(|pair| pair.actual.id == id).collect();
            let mut returns: Vec<u32> = own.iter().map(|actual| actual.returns).collect();
            returns.sort_unstable();
            let mut off_m = RootMeanSquare::default();
            on.iter().for_each(|pair| off_m.push(super::frame::distance_m(pair.actual, pair.track)));
            Some(Self {
                scene,
                id,
                class: first.class,
                size_m: first.size_m,
                sweeps: own.len() as u32,
                missed: (own.len() - on.len()) as u32,
                tracks: on.iter().map(|pair| pair.track.id).collect::<BTreeSet<_>>().len() as u32,
                returns: returns[(returns.len() - 1) / 2],
                range_m: own.iter().map(|actual| actual.centre_m.norm()).sum::<f64>() / own.len() as f64,
                off_m,
            })
        });
        let mut worst = found.collect();
        Self::keep_worst(&mut worst);
        worst
    }

    /// Most sweeps without a track first, then farthest off.
    pub(crate) fn keep_worst(all: &mut Vec<Self>) {
        let off_m = |one: &Self| one.off_m.value().unwrap_or(0.0);
        all.sort_by(|a, b| b.missed.cmp(&a.missed).then(off_m(b).total_cmp(&off_m(a))));
        all.truncate(MOST);
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::tests::{actual, track};
    use super::*;

    #[test]
    fn what_is_missed_most_stands_first_and_few_are_told() {
        let sweeps: Vec<Looked> = (0..4)
            .map(|sweep| Looked {
                actual: (0..20).map(|id| actual(id, [f64::from(id), 0.0, 0.0], if id == 0 { 4 } else { 9 })).collect(),
                tracks: (0..20)
                    .filter(|&id| id != 7 || sweep == 0)
                    .map(|id| track(id, [id as f64, 0.1, 0.0]))
                    .collect(),
            })
            .collect();
        let frames: Vec<Frame> = sweeps.iter().map(|looked| Frame::of(looked, 5, 0.5)).collect();
        let (_, matches) = super::super::clear_mot::ClearMot::of(&frames, 0.5);
        let pairs = super::super::pair::pairs(&sweeps, &frames, &matches);
        let sut = HardObstacle::of(3, &sweeps, &frames, &pairs);
        assert_eq!(sut.len(), MOST);
        assert!(sut.iter().all(|one| one.id != 0), "too few returns");
        let worst = &sut[0];
        assert_eq!((worst.scene, worst.id, worst.sweeps, worst.missed, worst.tracks), (3, 7, 4, 3, 1));
        assert!((worst.range_m - 7.0).abs() < 1e-9 && (worst.off_m.value().unwrap() - 0.1).abs() < 1e-6);
    }
}
