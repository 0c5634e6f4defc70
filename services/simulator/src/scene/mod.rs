//! Scenes: as written in `config/scenes/*.toml` → as checked.

mod check;
mod error;
mod file;

use lidar::{MAX_COLUMNS, MAX_RETURNS, SensorModel};
use messages::MAX_TRUTH_OBJECTS;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

pub(crate) use check::{Bounds, Table};
pub use error::SceneError;
pub use file::{EgoFile, MeshFile, ObstacleFile, SceneFile};
pub(crate) use file::{FAR_M, SPEED_MPS, SPIN_DPS};

use crate::ego::Ego;
use crate::field::Field;
use crate::obstacle::Obstacle;
use crate::receiver::{MOST_COUNTS, Receiver};

/// How far a motor may be off the sensor's range of speeds. A HDL-32E of 1,084 columns turns at 20.01 Hz.
const MOTOR_TOLERANCE: f64 = 1.0 / 200.0;

/// A checked scene: obstacles, and the sensor that looks at them.
#[derive(Clone, Debug)]
pub struct Scene {
    sensor: SensorModel,
    columns: usize,
    receiver: Receiver,
    seed: u64,
    horizon_m: f64,
    ego: Option<Ego>,
    fields: Vec<Field>,
    obstacles: Vec<Obstacle>,
}

impl Scene {
    fn without_obstacles(file: &SceneFile, sensor: &SensorModel) -> Result<Self, SceneError> {
        if file.sensor != sensor.name() {
            return Err(SceneError::Sensor { named: file.sensor.clone(), given: sensor.name().to_owned() });
        }
        let scene = Table::SCENE;
        let [slow, fast] = sensor.rotation_hz();
        let speeds = Bounds::Closed(slow - slow * MOTOR_TOLERANCE, fast + fast * MOTOR_TOLERANCE);
        let rotation_hz = scene.within("rotation_hz", file.rotation_hz, speeds)?;
        let columns = sensor.columns_per_turn(rotation_hz);
        let rings = sensor.rings().len();
        if columns == 0 || columns > MAX_COLUMNS || columns * rings > MAX_RETURNS {
            return Err(SceneError::Capacity { columns, rings });
        }

        let quantum_m = file.quantised.then(|| sensor.quantum_m());
        let farthest_m = quantum_m.map_or(FAR_M, |quantum_m| MOST_COUNTS * quantum_m);
        let sigma_m = file.range_sigma_m.unwrap_or(sensor.range_sigma_m());
        let reach_m = file.reach_m.unwrap_or(sensor.reach_m());
        let receiver = Receiver {
            range_sigma_m: scene.within("range_sigma_m", sigma_m, Bounds::Closed(0.0, 10.0))?,
            dropout: scene.within("dropout", file.dropout, Bounds::Closed(0.0, 1.0))?,
            reach_m: scene.range("reach_m", reach_m, Bounds::Closed(0.0, farthest_m))?,
            quantum_m,
        };
        Ok(Self {
            sensor: sensor.clone(),
            columns,
            receiver,
            seed: file.seed,
            horizon_m: scene.within("horizon_m", file.horizon_m, Bounds::Above(0.0, FAR_M))?,
            ego: None,
            fields: Vec::new(),
            obstacles: Vec::new(),
        })
    }

    /// Takes these obstacles for the scene's, if a truth can hold them and all start within the horizon.
    pub(crate) fn replace_obstacles(&mut self, obstacles: Vec<Obstacle>) -> Result<(), SceneError> {
        if obstacles.len() > MAX_TRUTH_OBJECTS {
            return Err(SceneError::Obstacles(obstacles.len()));
        }
        for obstacle in &obstacles {
            let distance_m = obstacle.motion.position_m.norm();
            let expected = format_args!("more than {distance_m}, the distance of an obstacle at time 0").to_string();
            Table::SCENE.number("horizon_m", self.horizon_m, distance_m < self.horizon_m, expected)?;
        }
        self.obstacles = obstacles;
        Ok(())
    }

    /// The random numbers of a field. Streams count down from the last, those of sweeps up from 0.
    fn field_rng(&self, index: usize) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(u64::MAX - index as u64);
        rng
    }

    /// The sensor.
    pub fn sensor(&self) -> &SensorModel {
        &self.sensor
    }

    /// Firing cycles of a turn.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Whether ranges and azimuths are rounded to what a data packet can carry.
    pub fn is_quantised(&self) -> bool {
        self.receiver.quantum_m.is_some()
    }

    /// The obstacles; an obstacle's place is its `id` in the truth.
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// The distributions that the scene's fields were drawn from.
    pub fn fields(&self) -> &[Field] {
        &self.fields
    }

    /// How the sensor itself moves, where the scene says so.
    pub fn ego(&self) -> Option<&Ego> {
        self.ego.as_ref()
    }

    /// Radius of the ball that obstacles leave and enter [m].
    pub fn horizon_m(&self) -> f64 {
        self.horizon_m
    }

    /// Seed of everything random.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    pub(crate) fn receiver(&self) -> &Receiver {
        &self.receiver
    }
}
