//! What Figs. 2, 3 and 6 show, before it is drawn.

use classifier::BINS;
use lidar::ObstacleClass;
use messages::TruthObject;
use simulator::Shape;

use super::Files;
use crate::sets::Set;
use crate::{Example, ObserveError, Observer, TrainPlan, View};

/// Returns that a sample scan has at least, so that it shows something.
const SCAN_POINTS: usize = 150;
/// Obstacles looked at for a scan with so many; then the one with most.
const SCAN_ATTEMPTS: u32 = 200;
/// Combinations in Fig. 3.
const COMBINATIONS: usize = 24;

/// All pictures.
#[derive(Clone, Debug)]
pub(crate) struct Pictures {
    /// Fig. 2: one of each class.
    pub(crate) scans: Vec<Scan>,
    /// Fig. 3.
    pub(crate) combinations: Combinations,
    /// Fig. 6.
    pub(crate) scene: Scene,
}

/// One obstacle seen alone.
#[derive(Clone, Debug)]
pub(crate) struct Scan {
    pub(crate) class: ObstacleClass,
    /// Which of the training obstacles it is.
    pub(crate) number: u32,
    pub(crate) truth: TruthObject,
    /// Returns of its cluster \[m\], sensor frame.
    pub(crate) points_m: Vec<[f32; 3]>,
}

/// The feature combinations that are most frequent, on the mean over classes.
#[derive(Clone, Debug)]
pub(crate) struct Combinations {
    /// Their indices, rising.
    pub(crate) index: Vec<usize>,
    /// For each class and combination: mean, first and last decile over the training examples \[%\].
    pub(crate) share: [Vec<[f64; 3]>; 4],
}

/// A cluttered scene of all shapes.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) objects: Vec<TruthObject>,
    pub(crate) clusters: Vec<SceneCluster>,
    /// Farthest training obstacles \[m\].
    pub(crate) ring_m: f64,
}

/// One cluster of the scene.
#[derive(Clone, Debug)]
pub(crate) struct SceneCluster {
    pub(crate) example: Example,
    /// Its returns \[m\], sensor frame.
    pub(crate) points_m: Vec<[f32; 3]>,
    /// What it is taken for; unclassified until judged.
    pub(crate) verdict: ObstacleClass,
}

impl Pictures {
    /// Looks at everything; verdicts come with [`Pictures::judged`].
    pub(crate) fn take(
        plan: &TrainPlan,
        scene_seed: u64,
        training: &[Example],
        read: Files<'_>,
    ) -> Result<Self, ObserveError> {
        let mut observer = Observer::new(&View::by_histogram(&plan.scene), &read)?;
        let seed = Set::Training.seed(plan.seed);
        let scans = Shape::ALL.into_iter().map(|shape| scan(&mut observer, seed, shape)).collect::<Result<_, _>>()?;
        observer.mixed(scene_seed)?;
        Ok(Self { scans, combinations: Combinations::of(training), scene: Scene::of(&observer) })
    }

    /// The same, with each described cluster's verdict.
    pub(crate) fn judged(mut self, verdict: impl Fn(&Example) -> ObstacleClass) -> Self {
        for cluster in self.scene.clusters.iter_mut().filter(|cluster| !cluster.example.bins.is_empty()) {
            cluster.verdict = verdict(&cluster.example);
        }
        self
    }
}

/// The first training obstacle of the shape with enough returns.
fn scan(observer: &mut Observer, seed: u64, shape: Shape) -> Result<Scan, ObserveError> {
    let mut best: Option<Scan> = None;
    for number in 0..SCAN_ATTEMPTS {
        observer.alone(seed, shape, number)?;
        let seen = observer.seen();
        let largest = seen.clusters.clusters.iter().max_by_key(|c| (c.summary.points, u32::MAX - c.summary.key));
        let (Some(largest), Some(&truth)) = (largest, seen.truth.objects.first()) else { continue };
        let points_m: Vec<[f32; 3]> =
            seen.clusters.returns[largest.summary.member_places()].iter().map(lidar::Return::position).collect();
        let enough = points_m.len() >= SCAN_POINTS;
        if best.as_ref().is_none_or(|best| points_m.len() > best.points_m.len()) {
            best = Some(Scan { class: shape.class(), number, truth, points_m });
        }
        if enough {
            break;
        }
    }
    best.ok_or_else(|| ObserveError::new("scene", "no obstacle has a cluster"))
}

impl Combinations {
    fn of(training: &[Example]) -> Self {
        let mut mean = vec![[0.0_f64; 4]; BINS];
        let mut count = [0.0_f64; 4];
        for example in training {
            let Some(class) = example.class.solid_index() else { continue };
            count[class] += 1.0;
            for bin in &example.bins {
                mean[bin.index as usize][class] += f64::from(bin.weight);
            }
        }
        let total = |bin: usize| (0..4).map(|class| mean[bin][class] / count[class].max(1.0)).sum::<f64>();
        let mut index: Vec<usize> = (0..BINS).collect();
        index.sort_by(|&p, &q| total(q).total_cmp(&total(p)).then(p.cmp(&q)));
        index.truncate(COMBINATIONS);
        index.sort_unstable();
        let share = std::array::from_fn(|class| index.iter().map(|&bin| spread(training, class, bin)).collect());
        Self { index, share }
    }
}

/// Mean, first and last decile of a combination's share in a class's examples \[%\].
fn spread(training: &[Example], class: usize, bin: usize) -> [f64; 3] {
    let weight = |example: &Example| {
        let found = example.bins.binary_search_by_key(&(bin as u32), |bin| bin.index);
        found.map_or(0.0, |place| 100.0 * f64::from(example.bins[place].weight))
    };
    let mut shares: Vec<f64> = training.iter().filter(|e| e.class.solid_index() == Some(class)).map(weight).collect();
    shares.sort_by(f64::total_cmp);
    let Some(last) = shares.len().checked_sub(1) else { return [0.0; 3] };
    [shares.iter().sum::<f64>() / shares.len() as f64, shares[last / 10], shares[last - last / 10]]
}

impl Scene {
    fn of(observer: &Observer) -> Self {
        let seen = observer.seen();
        let clusters =
            seen.clusters.clusters.iter().zip(seen.descriptors.descriptors.iter()).map(|(cluster, descriptor)| {
                let places = cluster.summary.member_places();
                // Obstacles keep their distance: a cluster is of one, and its first return says which.
                let owner = seen.truth.owners[cluster.summary.key as usize];
                let class = seen.truth.objects.get(usize::from(owner)).map_or(ObstacleClass::Unclassified, |o| o.class);
                let bins = seen.descriptors.bins[descriptor.bin_places()].to_vec();
                SceneCluster {
                    example: Example {
                        class,
                        points: cluster.summary.points,
                        range_m: cluster.summary.range_m(),
                        bins,
                    },
                    points_m: seen.clusters.returns[places].iter().map(lidar::Return::position).collect(),
                    verdict: ObstacleClass::Unclassified,
                }
            });
        Self { objects: seen.truth.objects.to_vec(), clusters: clusters.collect(), ring_m: observer.ring_m() }
    }

    /// Clusters judged, and those of them judged rightly.
    pub(crate) fn right(&self) -> (usize, usize) {
        let judged = self.clusters.iter().filter(|c| c.verdict != ObstacleClass::Unclassified);
        (judged.clone().count(), judged.filter(|c| c.verdict == c.example.class).count())
    }
}
