//! Counting verdicts.

use lidar::ObstacleClass;
use messages::MIN_FEATURE_POINTS;

use super::judged::Judged;
use super::share::{Share, quantile};
use super::solid_error::WITHIN_95;
use crate::Reliability;

/// Points from which errors of solids are measured.
pub(crate) const SOLID_POINTS: u32 = 50;

/// Fewest and most points of each row.
pub(crate) const POINTS: [[u32; 2]; 6] = [[5, 9], [10, 19], [20, 49], [50, 99], [100, 199], [200, u32::MAX]];

/// Fewest and most rings of each row.
pub(crate) const RINGS: [[u32; 2]; 5] = [[1, 1], [2, 2], [3, 3], [4, 4], [5, u32::MAX]];

/// Least posteriors of the rows of [`Tally::thresholds`].
pub(crate) const THRESHOLDS: [f64; 10] = [0.25, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98, 0.99];

/// Posterior from which a verdict counts as confident.
pub(crate) const CONFIDENT: f64 = 0.9;

/// Verdicts on the clusters of at least 5 points of some scenes. What was left unclassified counts as wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Tally {
    /// Clusters of fewer points, which are left out of all else.
    pub small: u32,
    /// Right of all.
    pub all: Share,
    /// Actual class (row, the four solids) by verdict (column, the four solids, then unclassified).
    pub confusion: [[u32; 5]; 4],
    /// Right by number of points: 5 to 9, 10 to 19, 20 to 49, 50 to 99, 100 to 199, 200 and more.
    pub by_points: [Share; 6],
    /// Right by rings seen: 1, 2, 3, 4, 5 and more.
    pub by_rings: [Share; 5],
    /// Of those with a posterior.
    pub reliability: Reliability,
    /// Verdicts of at least this posterior: right ones, and how many of all clusters they are.
    pub thresholds: [Threshold; 10],
    /// Of those with fitted solids: the unclassified.
    pub withheld: Share,
    /// Solids of those of at least 50 points whose class is right.
    pub large_solids: SolidErrors,
    /// Solids of all whose class is right.
    pub solids: SolidErrors,
}

/// Verdicts of at least some posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// The posterior.
    pub posterior: f64,
    /// Right of those kept.
    pub right: Share,
    /// Kept of all.
    pub kept: Share,
}

/// How far fitted solids are off.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolidErrors {
    /// How many solids.
    pub count: u32,
    /// Distance of centres [m]: median and ninth decile.
    pub centre_m: Option<[f64; 2]>,
    /// Mean relative error of a solid's three extents, each list sorted \[%\]: median and ninth decile.
    pub size_per_cent: Option<[f64; 2]>,
    /// Squared error of the centre by its covariance, a degree of freedom: mean and median over solids; 1 and 0.79 where
    /// errors are as normal as the covariance says.
    pub nees_per_dof: Option<[f64; 2]>,
    /// Centres within the ellipsoid that should hold 95 %.
    pub within_95: Share,
}

impl Tally {
    pub(crate) fn of(judged: &[Judged]) -> Self {
        let counted: Vec<&Judged> = judged.iter().filter(|one| one.points >= MIN_FEATURE_POINTS as u32).collect();
        let mut confusion = [[0; 5]; 4];
        for one in &counted {
            if let Some(row) = one.actual.solid_index() {
                confusion[row][one.verdict.solid_index().unwrap_or(4)] += 1;
            }
        }
        let right = |picked: &dyn Fn(&Judged) -> bool| {
            Share::of(counted.iter().filter(|one| picked(one)).map(|one| one.is_right()))
        };
        let within = |[least, most]: [u32; 2], value: u32| (least..=most).contains(&value);
        let posteriors = counted.iter().filter(|one| one.confidence() > 0.0);
        let solid_of = |one: &&&Judged| one.is_right() && one.points >= SOLID_POINTS;
        Self {
            small: (judged.len() - counted.len()) as u32,
            all: right(&|_| true),
            confusion,
            by_points: POINTS.map(|range| right(&|one| within(range, one.points))),
            by_rings: RINGS.map(|range| right(&|one| within(range, one.rings))),
            reliability: Reliability::of(
                posteriors.filter_map(|one| Some((one.posterior, one.actual.solid_index()? as u8))),
            ),
            thresholds: THRESHOLDS.map(|posterior| Threshold {
                posterior,
                right: right(&|one| one.confidence() >= posterior),
                kept: Share::of(counted.iter().map(|one| one.confidence() >= posterior)),
            }),
            withheld: Share::of(
                counted.iter().filter(|one| one.fitted).map(|one| one.verdict == ObstacleClass::Unclassified),
            ),
            large_solids: SolidErrors::of(counted.iter().filter(solid_of)),
            solids: SolidErrors::of(counted.iter().filter(|one| one.is_right())),
        }
    }

    /// Right of those of at least 50 points.
    pub fn large(&self) -> Share {
        let [.., a, b, c] = self.by_points;
        Share { count: a.count + b.count + c.count, of: a.of + b.of + c.of }
    }

    /// The class of the least share right among those that are there, and that share.
    pub fn worst_class(&self) -> Option<(ObstacleClass, Share)> {
        let rows = self.confusion.iter().enumerate().filter_map(|(row, counts)| {
            let share = Share { count: counts[row], of: counts.iter().sum() };
            Some((ObstacleClass::SOLIDS[row], share, share.per_cent()?))
        });
        rows.min_by(|a, b| a.2.total_cmp(&b.2)).map(|(class, share, _)| (class, share))
    }

    /// Verdicts of a posterior of at least 0.9.
    pub fn confident(&self) -> Threshold {
        let found = self.thresholds.iter().find(|row| row.posterior == CONFIDENT);
        found.copied().unwrap_or(self.thresholds[0])
    }
}

impl SolidErrors {
    fn of<'a>(judged: impl Iterator<Item = &'a &'a Judged>) -> Self {
        let errors: Vec<_> = judged.filter_map(|one| one.solid).collect();
        let both =
            |values: Vec<f64>, [one, other]: [f64; 2]| Some([quantile(values.clone(), one)?, quantile(values, other)?]);
        let nees: Vec<f64> = errors.iter().filter_map(|error| error.nees).map(|nees| nees / 3.0).collect();
        let mean = nees.iter().sum::<f64>() / nees.len().max(1) as f64;
        Self {
            count: errors.len() as u32,
            centre_m: both(errors.iter().map(|error| error.centre_m).collect(), [0.5, 0.9]),
            size_per_cent: both(errors.iter().map(|error| 100.0 * error.size).collect(), [0.5, 0.9]),
            nees_per_dof: quantile(nees, 0.5).map(|median| [mean, median]),
            within_95: Share::of(errors.iter().map(|error| error.nees.is_some_and(|nees| nees <= WITHIN_95))),
        }
    }
}

#[cfg(test)]
mod tests {
    use ObstacleClass::{Conical, Cylindrical, Ellipsoidal, Rectangular, Unclassified};

    use super::super::solid_error::SolidError;
    use super::*;

    fn one(actual: ObstacleClass, verdict: ObstacleClass, points: u32, sure: f64) -> Judged {
        let posterior = std::array::from_fn(|q| match verdict.solid_index() {
            None => 0.0,
            Some(own) if own == q => sure,
            Some(_) => (1.0 - sure) / 3.0,
        });
        Judged { object: 0, actual, points, rings: points.min(7), fitted: true, verdict, posterior, solid: None }
    }

    #[test]
    fn every_cluster_of_five_points_stands_in_one_place_of_each_table() {
        let sut = Tally::of(&[
            one(Conical, Unclassified, 4, 0.0),
            one(Conical, Unclassified, 5, 0.0),
            one(Conical, Conical, 9, 0.9),
            one(Rectangular, Rectangular, 49, 0.99),
            one(Rectangular, Ellipsoidal, 50, 0.4),
            one(Cylindrical, Cylindrical, 5_000, 0.95),
        ]);
        assert_eq!((sut.small, sut.all), (1, Share { count: 3, of: 5 }));
        assert_eq!(sut.confusion, [[1, 1, 0, 0, 0], [0; 5], [0, 0, 1, 0, 0], [0, 0, 0, 1, 1]]);
        let share = |count, of| Share { count, of };
        assert_eq!(sut.by_points, [share(1, 2), share(0, 0), share(1, 1), share(0, 1), share(0, 0), share(1, 1)]);
        assert_eq!(sut.by_rings.map(|ring| ring.of), [0, 0, 0, 0, 5]);
        assert_eq!(sut.large(), share(1, 2));
        assert_eq!(sut.withheld, share(1, 5));
        // The first of two classes of half: there is no ellipsoid, which is not the worst.
        assert_eq!(sut.worst_class(), Some((Rectangular, share(1, 2))));
        assert_eq!((sut.confident().right, sut.confident().kept), (share(3, 3), share(3, 5)));
        assert_eq!(sut.reliability.bins.iter().map(|bin| bin.count).sum::<usize>(), 4, "one made no claim");
    }

    #[test]
    fn errors_are_of_right_and_large_clusters() {
        let off = |centre_m, nees| Some(SolidError { centre_m, size: centre_m, nees });
        let mut all = [
            one(Conical, Conical, 50, 0.9),
            one(Conical, Conical, 51, 0.9),
            one(Conical, Conical, 52, 0.9),
            one(Conical, Conical, 49, 0.9),
            one(Conical, Rectangular, 60, 0.9),
        ];
        all[0].solid = off(0.01, Some(3.0));
        all[1].solid = off(0.02, Some(9.0));
        all[2].solid = off(0.04, None);
        all[3].solid = off(0.50, Some(0.0));
        all[4].solid = off(0.90, Some(99.0));
        let sut = Tally::of(&all);
        assert_eq!((sut.large_solids.count, sut.solids.count), (3, 4));
        assert_eq!(sut.large_solids.centre_m.unwrap()[0], 0.02);
        assert_eq!(sut.large_solids.size_per_cent.unwrap()[0], 2.0);
        assert_eq!(sut.large_solids.nees_per_dof, Some([2.0, 1.0]));
        assert_eq!(sut.large_solids.within_95, Share { count: 1, of: 3 });
        assert_eq!(Tally::of(&[]).solids, SolidErrors::default());
    }
}
