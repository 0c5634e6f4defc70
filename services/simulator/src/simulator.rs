use messages::{Message, Sweep, SweepHeader, Truth, TruthObject};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use stage::{Next, Source, SourceError};

use crate::cast::{self, Hit, View};
use crate::ego::Ego;
use crate::obstacle::{Obstacle, Pose};
use crate::scene::{Scene, SceneError};
use crate::turn::Turn;

/// Random words set apart for each column: 64 lasers use some 200, rarely more.
const WORDS_PER_COLUMN: u128 = 4_096;

/// Makes sweeps of a scene. Sweep n is a function of the scene and n alone.
pub struct Simulator {
    scene: Scene,
    turn: Turn,
    /// What each firing meets, column by column, in the order of rings.
    hits: Vec<Hit>,
    next: u64,
}

impl Simulator {
    /// Prepares a checked scene; allocates everything that sweeps will need.
    pub fn new(scene: Scene) -> Self {
        let turn = Turn::new(scene.sensor(), scene.columns(), scene.is_quantised());
        let hits = vec![Hit::MISS; turn.columns().len() * turn.rings().len()];
        Self { scene, turn, hits, next: 0 }
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Shows these obstacles instead of the scene's own: for training on one at a time.
    ///
    /// # Errors
    /// More obstacles than a truth can hold, or one beyond the scene's horizon.
    pub fn show(&mut self, obstacles: Vec<Obstacle>) -> Result<(), SceneError> {
        self.scene.replace_obstacles(obstacles)
    }

    /// Duration of a sweep [ns]: a whole number of firing cycles, so a little under the period asked for.
    pub fn period_ns(&self) -> u64 {
        self.turn.period_ns()
    }

    /// The number of the sweep that [`Source::next`] gives next; a source that restarts goes on where it was.
    pub fn resume_at(&mut self, sweep: u64) {
        self.next = sweep;
    }

    /// Fills `sweep` and `truth` (whatever they held) with sweep `number`. Allocates nothing.
    ///
    /// Returns are in firing order; a firing that meets nothing, or whose echo is lost, gives none.
    pub fn sweep(&mut self, number: u64, sweep: &mut Sweep, truth: &mut Truth) {
        sweep.clear();
        truth.clear();
        let sensor_time_ns = number.saturating_mul(self.turn.period_ns());
        truth.sensor_time_ns = sensor_time_ns;
        self.turn.begin(number);

        self.cast_all(sensor_time_ns, truth);
        // The scene was checked against the capacity of both messages.
        let mut fits = sweep.rings.extend_from_slice(self.turn.rings()).is_ok();
        fits &= sweep.columns.extend_from_slice(self.turn.columns()).is_ok();
        fits &= self.receive_all(number, sweep, truth);
        debug_assert!(fits, "a checked scene fits its messages");

        sweep.header = SweepHeader {
            sensor_time_ns,
            period_ns: self.turn.period_ns(),
            recorded: sweep.returns.len() as u32,
            complete: 1,
            organised: 1,
            column_step_rad: self.turn.step_rad() as f32,
            range_sigma_m: self.scene.receiver().range_sigma_m as f32,
            reach_m: self.scene.receiver().reach_m[1] as f32,
            ego: self.scene.ego().map(|ego| ego.motion(sensor_time_ns as f64 * 1e-9)).unwrap_or_default(),
            ..SweepHeader::default()
        };
    }

    /// Fills `hits` with the nearest surface of each firing, and the truth with the obstacles.
    fn cast_all(&mut self, sensor_time_ns: u64, truth: &mut Truth) {
        let start_s = sensor_time_ns as f64 * 1e-9;
        let ego = self.scene.ego().copied().unwrap_or_default();
        let view = View { turn: &self.turn, ego: &ego, start_s };
        self.hits.fill(Hit::MISS);
        for (place, obstacle) in self.scene.obstacles().iter().enumerate() {
            let id = place as u16;
            let start = obstacle.motion.pose(start_s, self.scene.horizon_m());
            let window = cast::window(view, obstacle, &start);
            cast::cast(view, obstacle, &start, &window, id, &mut self.hits);
            let fits = truth.objects.push(truth_of(obstacle, &start, &ego, start_s, id)).is_ok();
            debug_assert!(fits, "a checked scene fits its truth");
        }
    }

    /// Turns hits into returns, in firing order. Whether all found room.
    fn receive_all(&self, number: u64, sweep: &mut Sweep, truth: &mut Truth) -> bool {
        let rings = self.turn.rings().len();
        let obstacles = self.scene.obstacles();
        // Seed → key, sweep → stream, column → place in the stream.
        let mut rng = ChaCha8Rng::seed_from_u64(self.scene.seed());
        rng.set_stream(number);
        let mut fits = true;
        for (column, hits) in self.hits.chunks_exact(rings).enumerate() {
            if hits.iter().all(|hit| hit.owner == messages::NO_OBJECT) {
                continue;
            }
            rng.set_word_pos(column as u128 * WORDS_PER_COLUMN);
            for &ring in self.turn.firing_order() {
                let hit = &hits[usize::from(ring)];
                let Some(obstacle) = obstacles.get(usize::from(hit.owner)) else { continue };
                let Some(echo) = self.scene.receiver().echo(hit, obstacle.albedo, &mut rng) else { continue };
                let position = self.turn.direction(column, usize::from(ring)) * echo.range_m;
                let [x, y, z] = position.cast::<f32>().into();
                let one = lidar::Return { x, y, z, column: column as u16, ring, intensity: echo.intensity };
                fits &= sweep.returns.push(one).is_ok() && truth.owners.push(hit.owner).is_ok();
                truth.objects[usize::from(hit.owner)].returns += 1;
            }
        }
        fits
    }
}

impl Source for Simulator {
    /// Sweep after sweep, without end.
    fn next(&mut self, sweep: &mut Sweep, truth: &mut Truth) -> Result<Next, SourceError> {
        self.sweep(self.next, sweep, truth);
        self.next += 1;
        Ok(Next::Sweep)
    }

    /// Every sweep can be made without those before it.
    fn skip(&mut self, sweeps: u64, _sweep: &mut Sweep, _truth: &mut Truth) -> Result<(), SourceError> {
        self.resume_at(self.next + sweeps);
        Ok(())
    }
}

fn truth_of(obstacle: &Obstacle, start: &Pose, ego: &Ego, start_s: f64, id: u16) -> TruthObject {
    let (velocity_mps, spin_radps) = (obstacle.motion.velocity_mps, obstacle.motion.spin_radps);
    let (seen, velocity_mps, spin_radps) = if ego.turns() {
        let turn = ego.to_sensor(start_s);
        (ego.seen(start, start_s), turn * velocity_mps, turn * spin_radps)
    } else {
        (start.clone(), velocity_mps, spin_radps)
    };
    let attitude = seen.attitude.cast::<f32>();
    TruthObject {
        centre_m: seen.position_m.cast::<f32>().into(),
        attitude_wxyz: [attitude.w, attitude.i, attitude.j, attitude.k],
        size_m: obstacle.body.size_m().cast::<f32>().into(),
        velocity_mps: velocity_mps.cast::<f32>().into(),
        spin_radps: spin_radps.cast::<f32>().into(),
        returns: 0,
        id,
        kind: obstacle.body.kind(),
        class: obstacle.body.class(),
    }
}
