//! A small spinning lidar in a room with walls, boxes, balls and dust.

use std::f64::consts::{PI, TAU};

use lidar::{Column, Return, Ring};
use messages::Sweep;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use zerocopy::FromZeros;

/// How a sweep is made; the default is a plain one.
#[derive(Clone, Debug)]
pub(crate) struct Scanner {
    pub(crate) rings: usize,
    pub(crate) columns: usize,
    /// +1 or −1.
    pub(crate) sense: f64,
    /// Azimuth of the first column [rad].
    pub(crate) start_rad: f64,
    /// What part of a turn is seen.
    pub(crate) turns: f64,
    /// Whether the head turns on while a column fires.
    pub(crate) turning: bool,
    /// Measured azimuths stray by up to this many columns.
    pub(crate) jitter: f64,
    /// Part of the columns that is not received.
    pub(crate) missing: f64,
    /// Part of the firings without an echo.
    pub(crate) dropout: f64,
    /// Part of the firings that hit dust nearer than `dust_m`.
    pub(crate) dust: f64,
    pub(crate) dust_m: f64,
    /// Range noise, uniform within ± this [m].
    pub(crate) noise_m: f64,
    /// Whether the rings are spread unevenly, and how far lasers look sideways [rad].
    pub(crate) uneven: bool,
    pub(crate) sideways_rad: f64,
    /// Half the sides of the room [m]; none: open space.
    pub(crate) walls_m: Option<[f64; 3]>,
    pub(crate) obstacles: usize,
    pub(crate) seed: u64,
}

impl Default for Scanner {
    fn default() -> Self {
        Self {
            rings: 16,
            columns: 180,
            sense: 1.0,
            start_rad: -PI,
            turns: 1.0,
            turning: true,
            jitter: 0.0,
            missing: 0.0,
            dropout: 0.02,
            dust: 0.0,
            dust_m: 3.0,
            noise_m: 0.02,
            uneven: false,
            sideways_rad: 0.0,
            walls_m: Some([9.0, 14.0, 4.0]),
            obstacles: 25,
            seed: 1,
        }
    }
}

type Point = [f64; 3];

enum Obstacle {
    Ball(Point, f64),
    Block([Point; 2]),
}

impl Obstacle {
    /// Where a ray from the origin meets it first [m].
    fn range_m(&self, ray: Point) -> Option<f64> {
        match self {
            Self::Ball(centre, radius) => {
                let along: f64 = (0..3).map(|i| centre[i] * ray[i]).sum();
                let root = along * along - centre.iter().map(|c| c * c).sum::<f64>() + radius * radius;
                Some(along - root.max(0.0).sqrt()).filter(|&range| root > 0.0 && range > 0.0)
            }
            Self::Block(corners) => {
                let (near, far) = slab_m(corners, ray);
                (near > 0.0 && near <= far).then_some(near)
            }
        }
    }
}

/// Where a ray enters and leaves a block [m].
fn slab_m(corners: &[Point; 2], ray: Point) -> (f64, f64) {
    (0..3).fold((f64::NEG_INFINITY, f64::INFINITY), |(near, far), i| {
        let (a, b) = (corners[0][i] / ray[i], corners[1][i] / ray[i]);
        (near.max(a.min(b)), far.min(a.max(b)))
    })
}

impl Scanner {
    fn obstacles(&self, random: &mut ChaCha8Rng) -> Vec<Obstacle> {
        let obstacle = |_| {
            let (azimuth, range) = (random.random_range(-PI..PI), random.random_range(1.5..12.0_f64));
            let size = random.random_range(0.1..0.9);
            let centre = [range * azimuth.cos(), range * azimuth.sin(), random.random_range(-1.5..1.5)];
            match random.random_bool(0.5) {
                true => Obstacle::Ball(centre, size),
                false => Obstacle::Block([centre.map(|c| c - size), centre.map(|c| c + size)]),
            }
        };
        (0..self.obstacles).map(obstacle).collect()
    }

    /// The sweep, and nothing random but by its seed.
    pub(crate) fn sweep(&self) -> Box<Sweep> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let obstacles = self.obstacles(&mut random);
        let mut sweep = Sweep::new_box_zeroed().unwrap();
        let step_rad = self.turns * TAU / self.columns as f64;
        let firing_ns = 1_000 * u64::from(self.turning);
        let column_ns = 1_000 * self.rings as u64;
        let mut elevations: Vec<f64> = (0..self.rings)
            .map(|ring| match self.uneven {
                true => random.random_range(-0.5..0.5),
                false => -0.4 + 0.6 * ring as f64 / self.rings as f64,
            })
            .collect();
        elevations.sort_by(f64::total_cmp);
        let sideways: Vec<f64> = (0..self.rings).map(|_| self.sideways_rad * random.random_range(-1.0..1.0)).collect();
        for (ring, &elevation) in elevations.iter().enumerate() {
            // The order of firing is not that of elevation.
            let offset_ns = (ring * 7 % self.rings) as u32 * firing_ns as u32;
            sweep.rings.push(Ring { elevation_rad: elevation as f32, offset_ns }).unwrap();
        }
        for column in 0..self.columns {
            let azimuth = self.start_rad + self.sense * step_rad * column as f64;
            let measured = azimuth + self.jitter * step_rad * random.random_range(-1.0..1.0);
            let valid = u32::from(!random.random_bool(self.missing));
            let azimuth_rad = if valid == 1 { wrapped(measured) } else { f32::NAN };
            let offset_ns = (column as u64 * column_ns) as u32;
            sweep.columns.push(Column { azimuth_rad, offset_ns, valid }).unwrap();
            for ring in 0..self.rings {
                let turned = step_rad * f64::from(sweep.rings[ring].offset_ns) / column_ns as f64;
                let azimuth = measured + self.sense * turned + sideways[ring];
                let ray = direction(azimuth, elevations[ring]);
                let walls = self.walls_m.map(|sides| slab_m(&[sides.map(|s| -s), sides], ray).1);
                let dust = random.random_bool(self.dust).then(|| random.random_range(0.01..self.dust_m));
                let echo = obstacles.iter().filter_map(|o| o.range_m(ray)).chain(walls).chain(dust);
                let Some(range) = echo.min_by(f64::total_cmp) else { continue };
                let range = range + self.noise_m * random.random_range(-1.0..1.0);
                if valid == 0 || random.random_bool(self.dropout) {
                    continue;
                }
                let [x, y, z] = ray.map(|r| (r * range) as f32);
                let (column, ring) = (column as u16, ring as u8);
                sweep.returns.push(Return { x, y, z, column, ring, intensity: 7 }).unwrap();
            }
        }
        sweep.header.recorded = sweep.returns.len() as u32;
        sweep.header.period_ns = (self.columns as f64 * column_ns as f64 / self.turns) as u64;
        sweep.header.complete = u32::from(self.turns == 1.0);
        sweep.header.organised = 1;
        sweep.header.column_step_rad = step_rad as f32;
        sweep
    }
}

fn direction(azimuth: f64, elevation: f64) -> Point {
    [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()]
}

fn wrapped(azimuth: f64) -> f32 {
    let azimuth_rad = ((azimuth + PI).rem_euclid(TAU) - PI) as f32;
    if azimuth_rad < std::f32::consts::PI { azimuth_rad } else { -std::f32::consts::PI }
}
