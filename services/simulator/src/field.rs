//! Random obstacles: a distribution to draw one from, and a field of many that keep their distance.
//!
//! Sizes and attitudes follow the reference distribution: the largest half extent log-uniform, the others that times a
//! uniform proportion, which axis is largest at random; attitude uniform on SO(3); centre uniform over the area of a
//! ring and over a height.

use messages::MAX_TRUTH_OBJECTS;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::seq::SliceRandom;
use rand::{Rng, RngExt};
use rand_distr::{StandardNormal, UnitSphere};
use serde::Deserialize;

use crate::obstacle::{Body, Motion, Obstacle, Shape};
use crate::scene::{Bounds, FAR_M, SPEED_MPS, SPIN_DPS, SceneError, Table};

/// Places tried for an obstacle before a field counts as full.
const ATTEMPTS: usize = 1_000;

/// A random field of a scene, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldFile {
    /// Shapes to choose from, each as likely as the others.
    pub shapes: Vec<Shape>,
    /// Number of obstacles.
    pub count: usize,
    /// Smallest and largest of the largest half extent [m]; log-uniform between.
    pub half_extent_m: [f64; 2],
    /// Smallest and largest of the other extents as a share of the largest; uniform between.
    pub proportion: [f64; 2],
    /// Horizontal distance of centres at time 0 [m]: inner and outer radius; uniform over the area between.
    pub ring_m: [f64; 2],
    /// Most height of a centre above or below the sensor at time 0 [m]; uniform.
    pub half_height_m: f64,
    /// Least distance between bounding balls at time 0 [m].
    pub spacing_m: f64,
    /// Least distance of a bounding ball from the sensor [m], on the whole of its straight path.
    pub clear_m: f64,
    /// Mean velocity [m/s], sensor frame.
    pub velocity_mps: [f64; 3],
    /// Standard deviation of each component of the velocity [m/s].
    pub velocity_sigma_mps: [f64; 3],
    /// Slowest and fastest spin [deg/s]; uniform between, about an axis uniform on the sphere.
    pub spin_dps: [f64; 2],
    /// Darkest and brightest albedo; uniform between.
    pub albedo: [f64; 2],
}

/// A checked distribution of obstacles.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    shapes: Vec<Shape>,
    count: usize,
    half_extent_m: [f64; 2],
    proportion: [f64; 2],
    ring_m: [f64; 2],
    half_height_m: f64,
    spacing_m: f64,
    clear_m: f64,
    velocity_mps: Vector3<f64>,
    velocity_sigma_mps: Vector3<f64>,
    spin_radps: [f64; 2],
    albedo: [f64; 2],
}

impl FieldFile {
    /// The distribution that this table describes, for centres within `horizon_m` of the sensor.
    pub(crate) fn checked_in(self, table: Table, horizon_m: f64) -> Result<Field, SceneError> {
        if self.shapes.is_empty() {
            return Err(SceneError::Shapes(table.to_string()));
        }
        table.within("count", self.count as f64, Bounds::Closed(1.0, MAX_TRUTH_OBJECTS as f64))?;
        let farthest_m = self.ring_m[1].hypot(self.half_height_m);
        let field = Field {
            shapes: self.shapes,
            count: self.count,
            half_extent_m: table.range("half_extent_m", self.half_extent_m, Bounds::Above(0.0, FAR_M))?,
            proportion: table.range("proportion", self.proportion, Bounds::Above(0.0, 1.0))?,
            ring_m: table.range("ring_m", self.ring_m, Bounds::Closed(0.0, FAR_M))?,
            half_height_m: table.within("half_height_m", self.half_height_m, Bounds::Closed(0.0, FAR_M))?,
            spacing_m: table.within("spacing_m", self.spacing_m, Bounds::Closed(0.0, FAR_M))?,
            clear_m: table.within("clear_m", self.clear_m, Bounds::Closed(0.0, FAR_M))?,
            velocity_mps: table.vector("velocity_mps", self.velocity_mps, Bounds::Closed(-SPEED_MPS, SPEED_MPS))?,
            velocity_sigma_mps: table.vector(
                "velocity_sigma_mps",
                self.velocity_sigma_mps,
                Bounds::Closed(0.0, SPEED_MPS / 10.0),
            )?,
            spin_radps: table.range("spin_dps", self.spin_dps, Bounds::Closed(0.0, SPIN_DPS))?.map(f64::to_radians),
            albedo: table.range("albedo", self.albedo, Bounds::Above(0.0, 1.0))?,
        };
        let expected = format_args!("such that the field lies within horizon_m, {horizon_m}").to_string();
        table.number("ring_m[1]", self.ring_m[1], farthest_m < horizon_m, expected)?;
        Ok(field)
    }
}

impl Field {
    /// The shapes that the field is made of.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// One obstacle of this distribution, wherever it comes to lie: see [`is_clear`](Self::is_clear).
    pub fn draw(&self, shape: Shape, rng: &mut impl Rng) -> Obstacle {
        let body = Body::Solid { shape, size_m: self.draw_size_m(shape, rng) };
        let axis = Vector3::from(rng.sample::<[f64; 3], _>(UnitSphere));
        let spin_radps = axis * uniform(self.spin_radps, rng);
        let gust = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let motion = Motion {
            position_m: self.draw_position_m(rng),
            attitude: draw_attitude(rng),
            velocity_mps: self.velocity_mps + gust.component_mul(&self.velocity_sigma_mps),
            spin_radps,
        };
        Obstacle { body, motion, albedo: uniform(self.albedo, rng) }
    }

    /// Whether an obstacle keeps `clear_m` from the sensor on the whole of its straight path.
    pub fn is_clear(&self, obstacle: &Obstacle) -> bool {
        obstacle.motion.closest_approach_m() >= obstacle.body.bounding_radius_m() + self.clear_m
    }

    /// Adds the field's obstacles to those there, largest first (small ones find room between large ones).
    pub(crate) fn place(
        &self,
        table: Table,
        mut rng: impl Rng,
        obstacles: &mut Vec<Obstacle>,
    ) -> Result<(), SceneError> {
        let mut drawn: Vec<Obstacle> = (0..self.count)
            .map(|_| {
                let shape = self.shapes[rng.random_range(0..self.shapes.len())];
                self.draw(shape, &mut rng)
            })
            .collect();
        drawn.sort_by(|a, b| b.body.bounding_radius_m().total_cmp(&a.body.bounding_radius_m()));

        for (placed, mut obstacle) in drawn.into_iter().enumerate() {
            let mut attempts = 0;
            while !(self.is_clear(&obstacle) && self.is_apart(&obstacle, obstacles)) {
                attempts += 1;
                if attempts > ATTEMPTS {
                    return Err(SceneError::Crowded { table: table.to_string(), count: self.count, placed });
                }
                obstacle.motion.position_m = self.draw_position_m(&mut rng);
            }
            obstacles.push(obstacle);
        }
        Ok(())
    }

    fn is_apart(&self, obstacle: &Obstacle, others: &[Obstacle]) -> bool {
        others.iter().all(|other| {
            let gap = (obstacle.motion.position_m - other.motion.position_m).norm()
                - obstacle.body.bounding_radius_m()
                - other.body.bounding_radius_m();
            gap >= self.spacing_m
        })
    }

    fn draw_size_m(&self, shape: Shape, rng: &mut impl Rng) -> Vector3<f64> {
        let [low, high] = self.half_extent_m;
        let largest_m = 2.0 * uniform([low.ln(), high.ln()], rng).exp();
        let mut shares = [1.0, uniform(self.proportion, rng), uniform(self.proportion, rng)];
        if shape.is_round() {
            let mut pair = [1.0, shares[1]];
            pair.shuffle(rng);
            shares = [pair[0], pair[0], pair[1]];
        } else {
            shares.shuffle(rng);
        }
        Vector3::from(shares) * largest_m
    }

    fn draw_position_m(&self, rng: &mut impl Rng) -> Vector3<f64> {
        let [inner, outer] = self.ring_m;
        let radius = uniform([inner * inner, outer * outer], rng).sqrt();
        let azimuth = uniform([0.0, std::f64::consts::TAU], rng);
        let height = uniform([-self.half_height_m, self.half_height_m], rng);
        Vector3::new(radius * azimuth.cos(), radius * azimuth.sin(), height)
    }
}

/// Uniform between both ends; the one value where they are equal.
fn uniform([low, high]: [f64; 2], rng: &mut impl Rng) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Uniform on SO(3): a normal vector of four components has no preferred direction.
fn draw_attitude(rng: &mut impl Rng) -> UnitQuaternion<f64> {
    let [w, x, y, z] = std::array::from_fn(|_| rng.sample::<f64, _>(StandardNormal));
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}
