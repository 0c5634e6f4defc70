use std::collections::BTreeMap;

use clusterer::Clusterer;
use extractor::Extractor;
use lidar::{ObstacleClass, SensorFile};
use messages::{Bin, Clusters, Descriptor, Descriptors, MIN_FEATURE_POINTS, Message, Part, Sweep, Truth};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use simulator::{Scene, SceneFile, Shape, Simulator};
use stage::Stage;

use crate::few::leave_out_larger;

/// Obstacles drawn for one example before the distribution counts as one that cannot be seen.
const ATTEMPTS: u32 = 10_000;

/// Every sweep is whole.
const PART: Part = Part { ordinal: 0, sweep: 0, sector: 0, sectors: 1, sensor_time_ns: 0, step: 0, attempt: 0 };

/// One obstacle as the chain describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// What it truly is.
    pub class: ObstacleClass,
    /// Returns of its cluster.
    pub points: u32,
    /// Distance of their mean from the sensor [m].
    pub range_m: f32,
    /// Its histogram; empty for a cluster without features.
    pub bins: Vec<Bin>,
}

/// What an observer looks at, and how: files by their stems, and what is to be other than they say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct View {
    /// The scene.
    pub scene: String,
    /// The sensor; the scene's own if none.
    pub sensor: Option<String>,
    /// Standard deviation of a range [m].
    pub range_sigma_m: Option<f64>,
    /// Smallest and largest proportion of the obstacles' lesser extents, in all fields.
    pub proportion: Option<[f64; 2]>,
    /// Obstacles of each field.
    pub count: Option<usize>,
    /// The extractor's `neighbours`.
    pub neighbours: Option<u32>,
    /// The extractor's `spacing_deg`.
    pub spacing_deg: Option<f64>,
    /// Share of echoes that are lost.
    pub dropout: Option<f64>,
    /// What the extractor makes of a cluster.
    pub described: Described,
    /// The extractor's `fit.evaluations`.
    pub evaluations: Option<u64>,
    /// Larger clusters are left out.
    pub most_points: Option<u32>,
}

/// What an extractor makes of a cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Described {
    /// What its file of parameters says.
    #[default]
    AsConfigured,
    /// The paper's histogram alone.
    Histogram,
    /// Fitted solids alone.
    Solids,
}

impl View {
    /// A scene as its file has it.
    pub fn of(scene: &str) -> Self {
        Self { scene: scene.to_owned(), ..Self::default() }
    }

    /// The same, described by the paper's histogram.
    pub fn by_histogram(scene: &str) -> Self {
        Self { described: Described::Histogram, ..Self::of(scene) }
    }
}

/// Simulator, clusterer and extractor in a row, without processes: what the chain would make of a scene.
pub struct Observer {
    scene: SceneFile,
    sensor: SensorFile,
    alone: Simulator,
    clusterer: Clusterer,
    extractor: Extractor,
    most_points: Option<u32>,
    sweep: Box<Sweep>,
    truth: Box<Truth>,
    clusters: Box<Clusters>,
    descriptors: Box<Descriptors>,
}

/// One sweep's truth, and what the chain made of it.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// What is there.
    pub truth: &'a Truth,
    /// Its clusters.
    pub clusters: &'a Clusters,
    /// Their features, in the same order.
    pub descriptors: &'a Descriptors,
}

/// Why a scene cannot be observed: one line that names the file and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {cause}")]
pub struct ObserveError {
    /// The file, relative to the configuration.
    pub file: String,
    /// What is wrong.
    pub cause: String,
}

impl ObserveError {
    pub(crate) fn new(file: &str, cause: impl ToString) -> Self {
        Self { file: file.to_owned(), cause: cause.to_string().trim_end().to_owned() }
    }
}

impl Observer {
    /// Makes the chain for what `view` says, with the stages' own parameter files. `read` gives the text of a file by its
    /// path in the configuration.
    ///
    /// # Errors
    /// A file that cannot be read, or is refused by its room; a scene without a field.
    pub fn new(view: &View, read: &dyn Fn(&str) -> std::io::Result<String>) -> Result<Self, ObserveError> {
        let scene_path = format!("scenes/{}.toml", view.scene);
        let mut scene: SceneFile = parse(&scene_path, read)?;
        if let Some(sensor) = &view.sensor {
            sensor.clone_into(&mut scene.sensor);
        }
        scene.range_sigma_m = view.range_sigma_m.or(scene.range_sigma_m);
        scene.dropout = view.dropout.unwrap_or(scene.dropout);
        for field in &mut scene.field {
            field.proportion = view.proportion.unwrap_or(field.proportion);
            field.count = view.count.unwrap_or(field.count);
        }
        if scene.field.is_empty() {
            return Err(ObserveError::new(&scene_path, "field is missing, must be given once: it is drawn from"));
        }
        let sensor: SensorFile = parse(&format!("sensors/{}.toml", scene.sensor), read)?;
        let alone = Simulator::new(checked(scene.clone(), &sensor, &scene_path)?);
        let clusterer = init::<Clusterer>(read, |_| ())?;
        let extractor = init::<Extractor>(read, |params| {
            params.neighbours = view.neighbours.unwrap_or(params.neighbours);
            params.spacing_deg = view.spacing_deg.unwrap_or(params.spacing_deg);
            params.fit.evaluations = view.evaluations.unwrap_or(params.fit.evaluations);
            if view.described != Described::AsConfigured {
                params.histogram = view.described == Described::Histogram;
                params.solids = view.described == Described::Solids;
            }
        })?;
        Ok(Self {
            scene,
            sensor,
            alone,
            clusterer,
            extractor,
            most_points: view.most_points,
            sweep: zeroed()?,
            truth: zeroed()?,
            clusters: zeroed()?,
            descriptors: zeroed()?,
        })
    }

    /// One obstacle of the scene's first field, seen alone: its largest cluster. Drawn again until that has features.
    /// A function of `seed`, `shape` and `number` alone.
    ///
    /// # Errors
    /// A field whose obstacles are never seen.
    pub fn alone(&mut self, seed: u64, shape: Shape, number: u32) -> Result<Example, ObserveError> {
        let refused = |cause: String| ObserveError { file: "scene".to_owned(), cause };
        let stream = (shape as u64) << 32 | u64::from(number);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(stream);
        for _ in 0..ATTEMPTS {
            let obstacle = {
                let field = &self.alone.scene().fields()[0];
                let obstacle = field.draw(shape, &mut random);
                if !field.is_clear(&obstacle) {
                    continue;
                }
                obstacle
            };
            self.alone.show(vec![obstacle]).map_err(|error| refused(error.to_string()))?;
            // The noise of a sweep hangs on its number; at rest, nothing else does.
            self.alone.sweep(seed.rotate_left(32) ^ stream, &mut self.sweep, &mut self.truth);
            self.describe();
            let largest =
                self.descriptors.descriptors.iter().max_by_key(|d| (d.summary.points, u32::MAX - d.summary.key));
            if let Some(largest) = largest.filter(|d| d.bins > 0) {
                return Ok(self.example(largest, shape.class()));
            }
        }
        Err(refused(format!("none of {ATTEMPTS} obstacles was seen with {MIN_FEATURE_POINTS} returns")))
    }

    /// Every cluster of a cluttered scene of one shape: the scene's field with another seed. What shape a cluster is of
    /// needs no truth: they all are.
    ///
    /// # Errors
    /// A field that finds no room for its obstacles.
    pub fn cluttered(&mut self, seed: u64, shape: Shape) -> Result<Vec<Example>, ObserveError> {
        let mut scene = self.scene.clone();
        scene.seed = seed;
        for field in &mut scene.field {
            field.shapes = vec![shape];
        }
        let mut simulator = Simulator::new(checked(scene, &self.sensor, "scene")?);
        simulator.sweep(0, &mut self.sweep, &mut self.truth);
        self.describe();
        Ok(self.descriptors.descriptors.iter().map(|d| self.example(d, shape.class())).collect())
    }

    /// The scene as its file has it, fields of all their shapes, with this seed.
    ///
    /// # Errors
    /// A field that finds no room for its obstacles.
    pub fn mixed(&mut self, seed: u64) -> Result<(), ObserveError> {
        self.show(Some(seed), 0)
    }

    /// The same at its n-th sweep, 0 the first; without a seed, with the scene's own.
    ///
    /// # Errors
    /// A field that finds no room for its obstacles.
    pub fn show(&mut self, seed: Option<u64>, sweep: u64) -> Result<(), ObserveError> {
        let mut simulator = self.simulator(seed.unwrap_or(self.scene.seed))?;
        simulator.sweep(sweep, &mut self.sweep, &mut self.truth);
        self.describe();
        Ok(())
    }

    /// The scene with this seed, to be looked at sweep by sweep.
    ///
    /// # Errors
    /// A field that finds no room for its obstacles.
    pub fn simulator(&self, seed: u64) -> Result<Simulator, ObserveError> {
        let scene = SceneFile { seed, ..self.scene.clone() };
        Ok(Simulator::new(checked(scene, &self.sensor, "scene")?))
    }

    /// Whatever `fill` puts into an empty sweep and its truth, as the chain describes it.
    pub fn look<R>(&mut self, fill: impl FnOnce(&mut Sweep, &mut Truth) -> R) -> R {
        self.sweep.clear();
        self.truth.clear();
        let filled = fill(&mut self.sweep, &mut self.truth);
        self.describe();
        filled
    }

    /// Describes once more what was clustered last: to time it.
    pub fn extract(&mut self) {
        self.descriptors.clear();
        self.extractor.process(PART, &self.clusters, &mut self.descriptors);
    }

    /// The distribution's largest distance of an obstacle's centre from the spin axis [m].
    pub fn ring_m(&self) -> f64 {
        self.scene.field.iter().map(|field| field.ring_m[1]).fold(0.0, f64::max)
    }

    /// What was looked at last.
    pub fn seen(&self) -> Seen<'_> {
        Seen { truth: &self.truth, clusters: &self.clusters, descriptors: &self.descriptors }
    }

    fn describe(&mut self) {
        self.clusters.clear();
        self.clusterer.process(PART, &self.sweep, &mut self.clusters);
        if let Some(most_points) = self.most_points {
            leave_out_larger(&mut self.clusters, most_points);
        }
        self.extract();
    }

    fn example(&self, descriptor: &Descriptor, class: ObstacleClass) -> Example {
        let bins = self.descriptors.bins[descriptor.bin_places()].to_vec();
        let summary = descriptor.summary;
        Example { class, points: summary.points, range_m: summary.range_m(), bins }
    }
}

fn parse<T: serde::de::DeserializeOwned>(
    path: &str,
    read: &dyn Fn(&str) -> std::io::Result<String>,
) -> Result<T, ObserveError> {
    let text = read(path).map_err(|error| ObserveError::new(path, error))?;
    toml::from_str(&text).map_err(|error| ObserveError::new(path, error))
}

fn checked(scene: SceneFile, sensor: &SensorFile, path: &str) -> Result<Scene, ObserveError> {
    let model = sensor.clone().checked().map_err(|error| ObserveError::new(&scene.sensor, error))?;
    scene.checked(&model, &BTreeMap::new()).map_err(|error| ObserveError::new(path, error))
}

fn init<S: Stage>(
    read: &dyn Fn(&str) -> std::io::Result<String>,
    change: impl FnOnce(&mut S::Params),
) -> Result<S, ObserveError> {
    let path = format!("stages/{}.toml", S::NAME);
    let mut params = parse(&path, read)?;
    change(&mut params);
    S::init(params).map_err(|error| ObserveError::new(&path, error))
}

fn zeroed<M: Message>() -> Result<Box<M>, ObserveError> {
    M::new_box_zeroed().map_err(|_| ObserveError::new("messages", "no memory for a message"))
}
