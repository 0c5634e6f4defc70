//! Evidence of an obstacle, summed over the sweeps that see it.

use std::collections::BTreeMap;

use messages::MIN_FEATURE_POINTS;

use super::EvaluateError;
use super::judged::Judged;
use super::plan::EvaluationPlan;
use super::share::Share;
use super::witness::{Judges, Witness};
use crate::{Files, Reliability, View, parallel};

/// A posterior counts as at least this much: one sweep alone cannot rule a class out.
const LEAST_POSTERIOR: f64 = 1e-6;

/// What log posteriors summed over the sweeps of scenes in motion say of each obstacle whose cluster (its largest) has a
/// median of at least 5 points.
#[derive(Clone, Debug, PartialEq)]
pub struct Summed {
    /// One sweep at a time: right of the clusters of at least 5 points.
    pub single: Share,
    /// Obstacles right by the sum over the first sweep, the first two, and so on to all.
    pub after: Vec<Share>,
    /// Of the sum over all sweeps, made a posterior again.
    pub reliability: Reliability,
}

/// One obstacle through the sweeps of a scene.
struct Course {
    class: usize,
    /// Right, one sweep at a time.
    single: Share,
    /// The sum after each sweep.
    sums: Vec<[f64; 4]>,
}

impl Summed {
    /// Follows every scene of the plan, on all cores.
    pub(crate) fn measure(plan: &EvaluationPlan, read: Files<'_>, judges: Judges<'_>) -> Result<Self, EvaluateError> {
        let view = View::of(&plan.sweeps.scene);
        let scenes: Vec<u32> = (0..plan.sweeps.scenes).collect();
        let done = parallel::map(&scenes, |&number| -> Result<Vec<Course>, EvaluateError> {
            let mut witness = Witness::new(&view, read, judges)?;
            let sweeps = (0..plan.sweeps.sweeps).map(|sweep| witness.look(plan.moving_seed(number), sweep.into()));
            Ok(courses(&sweeps.collect::<Result<Vec<_>, _>>()?))
        });
        let mut courses = Vec::new();
        for scene in done {
            courses.extend(scene?);
        }
        Ok(Self::of(&courses, plan.sweeps.sweeps as usize))
    }

    fn of(courses: &[Course], sweeps: usize) -> Self {
        let mut single = Share::default();
        for course in courses {
            single.count += course.single.count;
            single.of += course.single.of;
        }
        let right = |course: &Course, sweep: usize| greatest(&course.sums[sweep]) == Some(course.class);
        Self {
            single,
            after: (0..sweeps).map(|sweep| Share::of(courses.iter().map(|course| right(course, sweep)))).collect(),
            reliability: Reliability::of(courses.iter().filter_map(|course| {
                let sum = course.sums.last()?;
                greatest(sum)?;
                Some((posterior(sum), course.class as u8))
            })),
        }
    }

    /// Obstacles right by the sum over all sweeps.
    pub fn all(&self) -> Share {
        self.after.last().copied().unwrap_or_default()
    }
}

/// The obstacles of one scene, in order of their identities.
fn courses(sweeps: &[Vec<Judged>]) -> Vec<Course> {
    // Of each obstacle its largest cluster in each sweep.
    let mut seen: BTreeMap<u16, Vec<Option<&Judged>>> = BTreeMap::new();
    for (place, sweep) in sweeps.iter().enumerate() {
        for one in sweep {
            let largest = &mut seen.entry(one.object).or_insert_with(|| vec![None; sweeps.len()])[place];
            if largest.is_none_or(|other| one.points > other.points) {
                *largest = Some(one);
            }
        }
    }
    seen.into_values().filter_map(course).collect()
}

/// None for an obstacle of too few points.
fn course(sweeps: Vec<Option<&Judged>>) -> Option<Course> {
    let class = sweeps.iter().flatten().next()?.actual.solid_index()?;
    let mut points: Vec<u32> = sweeps.iter().map(|one| one.map_or(0, |one| one.points)).collect();
    points.sort_unstable();
    // The lower of two in the middle.
    let enough = MIN_FEATURE_POINTS as u32;
    if points[(points.len() - 1) / 2] < enough {
        return None;
    }
    let mut course = Course { class, single: Share::default(), sums: Vec::with_capacity(sweeps.len()) };
    let mut sum = [0.0; 4];
    for one in sweeps {
        if let Some(one) = one.filter(|one| one.points >= enough) {
            course.single.add(one.is_right());
            // A withheld verdict says nothing of the class.
            if one.confidence() > 0.0 {
                for (sum, posterior) in sum.iter_mut().zip(one.posterior) {
                    *sum += posterior.max(LEAST_POSTERIOR).ln();
                }
            }
        }
        course.sums.push(sum);
    }
    Some(course)
}

/// The class of the greatest sum, the first of equals; none where nothing was said.
fn greatest(sum: &[f64; 4]) -> Option<usize> {
    (*sum != [0.0; 4]).then(|| (1..4).fold(0, |most, q| if sum[q] > sum[most] { q } else { most }))
}

fn posterior(sum: &[f64; 4]) -> [f64; 4] {
    let most = sum.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let each = sum.map(|one| (one - most).exp());
    let all: f64 = each.iter().sum();
    each.map(|one| one / all)
}

#[cfg(test)]
mod tests {
    use lidar::ObstacleClass::{self, Conical, Cylindrical, Rectangular, Unclassified};

    use super::*;

    fn one(object: u16, points: u32, verdict: ObstacleClass, posterior: [f64; 4]) -> Judged {
        let actual = Conical;
        Judged { object, actual, points, rings: 3, fitted: true, verdict, posterior, solid: None }
    }

    #[test]
    fn a_few_doubtful_sweeps_outweigh_a_wrong_one() {
        let wrong = one(1, 9, Rectangular, [0.6, 0.0, 0.0, 0.4]);
        let right = one(1, 9, Conical, [0.3, 0.0, 0.0, 0.7]);
        let sut = Summed::of(&courses(&[vec![wrong], vec![right], vec![right]]), 3);
        assert_eq!(sut.single, Share { count: 2, of: 3 });
        assert_eq!(sut.after.iter().map(|share| share.count).collect::<Vec<_>>(), [0, 1, 1]);
        assert_eq!(sut.all(), Share { count: 1, of: 1 });
        // 0.6 · 0.3² to 0.4 · 0.7².
        let bin = sut.reliability.bins.iter().find(|bin| bin.count == 1).unwrap();
        assert!((bin.confidence - 0.196 / 0.25).abs() < 1e-9);
    }

    #[test]
    fn the_largest_cluster_speaks_and_small_or_withheld_ones_say_nothing() {
        let small = one(1, 4, Conical, [0.0, 0.0, 0.0, 1.0]);
        let part = one(1, 5, Rectangular, [1.0, 0.0, 0.0, 0.0]);
        let whole = one(1, 50, Cylindrical, [0.0, 0.0, 0.9, 0.1]);
        let withheld = one(1, 50, Unclassified, [0.0; 4]);
        let sut = Summed::of(&courses(&[vec![small], vec![part, whole], vec![withheld]]), 3);
        assert_eq!(sut.single, Share { count: 0, of: 2 });
        let found = courses(&[vec![small], vec![part, whole], vec![withheld]]);
        assert_eq!(found[0].sums[0], [0.0; 4]);
        assert_eq!(found[0].sums[1], found[0].sums[2]);
        assert_eq!(greatest(&found[0].sums[2]), Some(2));
        assert_eq!(sut.after[0], Share { count: 0, of: 1 }, "nothing said is not right");
    }

    #[test]
    fn an_obstacle_that_is_mostly_too_small_is_left_out() {
        let seen = one(1, 90, Conical, [0.0, 0.0, 0.0, 1.0]);
        let small = one(1, 4, Unclassified, [0.0; 4]);
        assert!(courses(&[vec![seen], vec![small], vec![]]).is_empty());
        assert!(courses(&[vec![seen], vec![small]]).is_empty(), "the lower of two in the middle");
        assert_eq!(courses(&[vec![seen], vec![small], vec![seen]]).len(), 1);
        assert!(Summed::of(&[], 2).all().per_cent().is_none());
    }
}
