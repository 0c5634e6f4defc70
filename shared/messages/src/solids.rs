use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// Most clusters of a sweep that solids are fitted to, in order of their keys.
pub const MAX_FITS: usize = 2_048;

/// Parameters of a solid: centre, turn, size, three each.
pub const SOLID_PARAMETERS: usize = 9;

/// Numbers that describe a cluster's relief.
pub const RELIEF: usize = 58;

/// Pose and size of a solid, and how well they are known.
#[derive(Clone, Copy, Debug, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Solid {
    /// Middle of its box [m], sensor frame.
    pub centre_m: [f32; 3],
    /// Rotation from body to sensor frame, unit quaternion.
    pub attitude_wxyz: [f32; 4],
    /// Full extents along the body's axes [m]; cylinder and cone along z: diameter, diameter, height; a cone's apex is up.
    pub size_m: [f32; 3],
    /// Covariance of centre [m], turn [rad] (a small rotation after the attitude, about the sensor's axes) and size [m]:
    /// the upper triangle, row by row. About this body, of the truth: by ranges, by the rays that passed beside, by what may
    /// lie behind, by other minima. What none of these tells is as wide as the fit's beliefs: 5 m, π/√3.
    pub covariance: [f32; SOLID_PARAMETERS * (SOLID_PARAMETERS + 1) / 2],
}

impl Default for Solid {
    fn default() -> Self {
        Self { centre_m: [0.0; 3], attitude_wxyz: [1.0, 0.0, 0.0, 0.0], size_m: [0.0; 3], covariance: [0.0; 45] }
    }
}

impl Solid {
    /// Covariance of two parameters, in the order of [`Solid::covariance`]; 0 for one that is none.
    pub fn covariance_of(&self, one: usize, other: usize) -> f32 {
        let (row, column) = (one.min(other), one.max(other));
        if column >= SOLID_PARAMETERS {
            return 0.0;
        }
        self.covariance[row * SOLID_PARAMETERS - row * (row + 1) / 2 + column]
    }
}

/// How well one solid explains the rays of a cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct SolidFit {
    /// The best body found.
    pub solid: Solid,
    /// Sum of squared residuals of the hits, in standard deviations; beyond 4 a residual grows with its logarithm.
    pub hit_cost: f32,
    /// The same of the misses that the body is in the way of.
    pub miss_cost: f32,
    /// What the beliefs about size and proportion add.
    pub belief_cost: f32,
    /// ln of the determinant of the information matrix: how sharp the minimum is.
    pub ln_information: f32,
    /// Cost of the next best minimum less that of the best; at most 100, as where there was none.
    pub runner_up: f32,
    /// Hits farther than 3 standard deviations from the surface.
    pub strayed: u32,
    /// Misses that the body is in the way of.
    pub violated: u32,
}

impl SolidFit {
    /// All that the fit minimised.
    pub fn cost(&self) -> f32 {
        self.hit_cost + self.miss_cost + self.belief_cost
    }
}

/// The four solids fitted to one cluster.
#[derive(Clone, Copy, Debug, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub struct Fit {
    /// One for each of [`lidar::ObstacleClass::SOLIDS`].
    pub solids: [SolidFit; 4],
    /// Hits that were used.
    pub hits: u32,
    /// Misses that were used.
    pub misses: u32,
    /// Cells round the cluster with something nearer, behind which it may go on.
    pub nearer: u32,
    /// Residuals that were evaluated.
    pub evaluations: u32,
    /// Shape of the surface as seen from the sensor; see the extractor's note.
    pub relief: [f32; RELIEF],
}

impl Default for Fit {
    fn default() -> Self {
        let solids = [SolidFit::default(); 4];
        Self { solids, hits: 0, misses: 0, nearer: 0, evaluations: 0, relief: [0.0; RELIEF] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_triangle_holds_every_pair_once() {
        let solid = Solid { covariance: std::array::from_fn(|place| place as f32), ..Solid::default() };
        let mut seen = [false; 45];
        for row in 0..9 {
            for column in row..9 {
                let place = solid.covariance_of(row, column);
                assert_eq!(place, solid.covariance_of(column, row));
                assert!(!std::mem::replace(&mut seen[place as usize], true));
            }
        }
        assert!(seen.iter().all(|&one| one));
        assert_eq!(solid.covariance_of(3, 9), 0.0);
    }
}
