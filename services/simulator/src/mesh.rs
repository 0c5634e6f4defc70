//! Triangle meshes of spacecraft and asteroids, from OBJ text.
//!
//! parry3d's `TriMesh` and its bounding volume hierarchy are right for rays (unlike its cylinders and cones).
//! A mesh is a surface, not a solid: a sensor inside one sees its walls from within.

use nalgebra::Vector3;
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;

use crate::solids::{Meeting, Surface};

/// A mesh in metres, its origin in the middle of its box.
#[derive(Clone, Debug)]
pub struct Mesh {
    triangles: TriMesh,
    size_m: Vector3<f64>,
    radius_m: f64,
}

/// Why OBJ text is no mesh.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The text is no OBJ file.
    #[error("is no OBJ file: {0}")]
    Obj(#[from] tobj::LoadError),
    /// A vertex is NaN or infinite.
    #[error("has a vertex that is not finite, must have finite ones only")]
    NotFinite,
    /// There is nothing to see.
    #[error("has no faces, must have at least 1")]
    NoFaces,
    /// The triangles are no mesh.
    #[error("is no triangle mesh: {0}")]
    Triangles(#[from] parry3d::shape::TriMeshBuilderError),
}

impl Mesh {
    /// Reads OBJ text (all its bodies as one; materials ignored; polygons cut into triangles). `unit_m`: metres a unit.
    pub fn from_obj(text: &str, unit_m: f64) -> Result<Self, MeshError> {
        let options =
            tobj::LoadOptions { triangulate: true, ignore_lines: true, ignore_points: true, ..Default::default() };
        let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| Ok(Default::default()))?;

        let mut vertices: Vec<Vector3<f64>> = Vec::new();
        let mut faces: Vec<[u32; 3]> = Vec::new();
        for model in &models {
            let base = vertices.len() as u32;
            let (points, _) = model.mesh.positions.as_chunks::<3>();
            vertices.extend(points.iter().map(|&point| Vector3::from(point).cast::<f64>() * unit_m));
            let (corners, _) = model.mesh.indices.as_chunks::<3>();
            faces.extend(corners.iter().map(|corner| corner.map(|index| base + index)));
        }
        if faces.is_empty() {
            return Err(MeshError::NoFaces);
        }
        if vertices.iter().any(|vertex| !vertex.iter().all(|value| value.is_finite())) {
            return Err(MeshError::NotFinite);
        }

        let low = vertices.iter().fold(vertices[0], |low, vertex| low.inf(vertex));
        let high = vertices.iter().fold(vertices[0], |high, vertex| high.sup(vertex));
        let middle = (low + high) * 0.5;
        let centred: Vec<Vector3<f64>> = vertices.iter().map(|vertex| vertex - middle).collect();
        let radius_m = centred.iter().map(Vector3::norm).fold(0.0, f64::max);
        let triangles = TriMesh::new(centred.iter().map(to_parry).collect(), faces)?;
        Ok(Self { triangles, size_m: high - low, radius_m })
    }

    /// Full extents of its box [m].
    pub fn size_m(&self) -> Vector3<f64> {
        self.size_m
    }

    /// Radius of a ball round its origin that holds it [m].
    pub fn bounding_radius_m(&self) -> f64 {
        self.radius_m
    }
}

impl Surface for Mesh {
    fn meet(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Meeting> {
        // The ray starts for parry where it enters the bounding ball: single precision is then of the mesh's size,
        // not of its distance.
        let along = -origin.dot(direction);
        let reach = self.radius_m * 1.001;
        let aside_squared = (origin + direction * along).norm_squared();
        let half_chord_squared = reach * reach - aside_squared;
        if half_chord_squared < 0.0 {
            return None;
        }
        let half_chord = half_chord_squared.sqrt();
        let enter = (along - half_chord).max(0.0);
        let length = along + half_chord - enter;
        if length < 0.0 {
            return None;
        }
        let ray = Ray::new(to_parry(&(origin + direction * enter)), to_parry(direction));
        let hit = self.triangles.cast_local_ray_and_get_normal(&ray, length as f32, false)?;
        let normal = Vector3::new(hit.normal.x, hit.normal.y, hit.normal.z).cast();
        Some(Meeting { distance: enter + f64::from(hit.time_of_impact), normal })
    }
}

fn to_parry(vector: &Vector3<f64>) -> Vector {
    Vector::new(vector.x as f32, vector.y as f32, vector.z as f32)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::UnitSphere;

    use super::*;
    use crate::solids::UnitBox;

    const CUBE: &str = "v -1 -1 -1\nv -1 -1 1\nv -1 1 -1\nv -1 1 1\nv 1 -1 -1\nv 1 -1 1\nv 1 1 -1\nv 1 1 1\n\
                        f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n";

    #[test]
    fn a_cube_five_kilometres_away_is_met_to_a_hundredth_of_a_millimetre() {
        let cube = Mesh::from_obj(CUBE, 1.0).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut met = 0;
        for distance in [2.0, 50.0, 5_000.0] {
            for _ in 0..1_000 {
                let origin = Vector3::from(rng.sample::<[f64; 3], _>(UnitSphere)) * distance;
                let aim = Vector3::from_fn(|_, _| rng.random_range(-0.5..0.5));
                let direction = (aim - origin).normalize();
                let expected = UnitBox.meet(&origin, &direction).unwrap();
                let found = cube.meet(&origin, &direction).unwrap();
                assert!((found.distance - expected.distance).abs() < 1e-5, "at {distance} m");
                assert!(found.normal.cross(&expected.normal).norm() < 1e-5);
                assert_eq!(cube.meet(&origin, &-direction).is_some(), origin.amax() < 1.0);
                met += 1;
            }
        }
        assert_eq!(met, 3_000);
    }

    #[test]
    fn a_mesh_is_seen_from_within() {
        let cube = Mesh::from_obj(CUBE, 1.0).unwrap();
        let meeting = cube.meet(&Vector3::new(0.5, 0.0, 0.0), &Vector3::x()).unwrap();
        assert!((meeting.distance - 0.5).abs() < 1e-6);
    }
}
