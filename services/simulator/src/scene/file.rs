use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use lidar::SensorModel;
use nalgebra::{Quaternion, UnitQuaternion};
use serde::Deserialize;

use super::check::{Bounds, Table};
use super::{Scene, SceneError};
use crate::ego::Ego;
use crate::field::FieldFile;
use crate::mesh::Mesh;
use crate::obstacle::{Body, Motion, Obstacle, Shape};

/// Spin that a scene may ask for, about each axis [deg/s]; see `cast` for what it bounds.
pub(crate) const SPIN_DPS: f64 = 360.0;
/// Speed that a scene may ask for, along each axis [m/s].
pub(crate) const SPEED_MPS: f64 = 1_000.0;
/// Spin of the sensor that a scene may ask for, about each axis [deg/s]: what a tumbling craft may have.
const EGO_SPIN_DPS: f64 = 60.0;
/// Farthest that anything may be [m].
pub(crate) const FAR_M: f64 = 10_000.0;

/// A scene file of `config/scenes/`, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Stem of a sensor file.
    pub sensor: String,
    /// Turns a second asked for; the sensor's own range, or half a percent beyond it (no motor is exact).
    /// The head then turns at the speed nearest above it at which a whole number of firing cycles make a turn.
    pub rotation_hz: f64,
    /// Standard deviation of a range [m], instead of the sensor file's.
    pub range_sigma_m: Option<f64>,
    /// Nearest and farthest surface that answers [m], instead of the sensor file's.
    pub reach_m: Option<[f64; 2]>,
    /// Share of echoes that are lost, 0 to 1.
    pub dropout: f64,
    /// Whether ranges and azimuths are rounded to what a data packet can carry.
    pub quantised: bool,
    /// Seed of everything random: fields, noise, dropouts.
    pub seed: u64,
    /// An obstacle that leaves the ball of this radius round the sensor [m] comes in again on its other side.
    pub horizon_m: f64,
    /// How the sensor itself moves; at rest, and the sweeps say nothing of it, where it is left out.
    pub ego: Option<EgoFile>,
    /// Solids, one by one.
    #[serde(default)]
    pub obstacle: Vec<ObstacleFile>,
    /// Random fields of solids.
    #[serde(default)]
    pub field: Vec<FieldFile>,
    /// Meshes, one by one.
    #[serde(default)]
    pub mesh: Vec<MeshFile>,
}

/// The sensor's own motion, as written; inertial frame, which is the sensor's own at time 0.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EgoFile {
    /// Velocity [m/s].
    pub velocity_mps: [f64; 3],
    /// Angular velocity [deg/s].
    pub spin_dps: [f64; 3],
}

/// One solid of a scene, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleFile {
    /// Which.
    pub shape: Shape,
    /// Full extents along its axes [m]; cylinder and cone: diameter, diameter, height.
    pub size_m: [f64; 3],
    /// Centre at time 0 [m], sensor frame.
    pub position_m: [f64; 3],
    /// Rotation from body to sensor frame at time 0, a quaternion; this or `attitude_deg`.
    pub attitude_wxyz: Option<[f64; 4]>,
    /// The same as roll, pitch and yaw [deg]: turned about x, then y, then z of the sensor frame.
    pub attitude_deg: Option<[f64; 3]>,
    /// Velocity [m/s], sensor frame.
    pub velocity_mps: [f64; 3],
    /// Angular velocity [deg/s], sensor frame.
    pub spin_dps: [f64; 3],
    /// Share of light that it sends back, 0 to 1.
    pub albedo: f64,
}

/// One mesh of a scene, as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshFile {
    /// OBJ file, relative to the scene file.
    pub path: String,
    /// Metres a unit of the file.
    pub unit_m: f64,
    /// Middle of its box at time 0 [m], sensor frame.
    pub position_m: [f64; 3],
    /// As for an obstacle.
    pub attitude_wxyz: Option<[f64; 4]>,
    /// As for an obstacle.
    pub attitude_deg: Option<[f64; 3]>,
    /// Velocity [m/s], sensor frame.
    pub velocity_mps: [f64; 3],
    /// Angular velocity [deg/s], sensor frame.
    pub spin_dps: [f64; 3],
    /// Share of light that it sends back, 0 to 1.
    pub albedo: f64,
}

impl SceneFile {
    /// Paths of the meshes that [`checked`](Self::checked) will ask for, as written.
    pub fn mesh_paths(&self) -> BTreeSet<&str> {
        self.mesh.iter().map(|mesh| mesh.path.as_str()).collect()
    }

    /// The scene that this file describes, seen by `sensor`. `mesh_texts`: path as written → OBJ text.
    ///
    /// Obstacles are numbered in the order obstacle, mesh, field; a scene without any is a scene of empty sweeps.
    pub fn checked(self, sensor: &SensorModel, mesh_texts: &BTreeMap<String, String>) -> Result<Scene, SceneError> {
        let mut scene = Scene::without_obstacles(&self, sensor)?;
        let mut obstacles = Vec::new();
        for (index, file) in self.obstacle.into_iter().enumerate() {
            obstacles.push(file.checked(Table { name: "obstacle", index })?);
        }
        for (index, file) in self.mesh.into_iter().enumerate() {
            obstacles.push(file.checked(Table { name: "mesh", index }, mesh_texts)?);
        }
        for (index, file) in self.field.into_iter().enumerate() {
            let table = Table { name: "field", index };
            let field = file.checked_in(table, self.horizon_m)?;
            field.place(table, scene.field_rng(index), &mut obstacles)?;
            scene.fields.push(field);
        }
        scene.ego = self.ego.map(EgoFile::checked).transpose()?;
        if let Some(ego) = &scene.ego {
            // A scene's obstacles move relative to the sensor's place.
            obstacles.iter_mut().for_each(|obstacle| obstacle.motion.velocity_mps -= ego.velocity_mps);
        }
        scene.replace_obstacles(obstacles)?;
        Ok(scene)
    }
}

impl EgoFile {
    fn checked(self) -> Result<Ego, SceneError> {
        let table = Table::SCENE;
        let spin_dps = table.vector("ego.spin_dps", self.spin_dps, Bounds::Closed(-EGO_SPIN_DPS, EGO_SPIN_DPS))?;
        Ok(Ego {
            velocity_mps: table.vector("ego.velocity_mps", self.velocity_mps, Bounds::Closed(-SPEED_MPS, SPEED_MPS))?,
            spin_radps: spin_dps.map(f64::to_radians),
        })
    }
}

impl ObstacleFile {
    fn checked(self, table: Table) -> Result<Obstacle, SceneError> {
        let size_m = table.vector("size_m", self.size_m, Bounds::Above(0.0, FAR_M))?;
        if self.shape.is_round() {
            let expected = "equal to size_m[0], the diameter";
            table.number("size_m[1]", size_m.y, size_m.x == size_m.y, expected)?;
        }
        let body = Body::Solid { shape: self.shape, size_m };
        let attitude = attitude(table, self.attitude_wxyz, self.attitude_deg)?;
        let motion = motion(table, self.position_m, attitude, self.velocity_mps, self.spin_dps)?;
        Ok(Obstacle { body, motion, albedo: albedo(table, self.albedo)? })
    }
}

impl MeshFile {
    fn checked(self, table: Table, mesh_texts: &BTreeMap<String, String>) -> Result<Obstacle, SceneError> {
        let unit_m = table.within("unit_m", self.unit_m, Bounds::Above(0.0, FAR_M))?;
        let Some(text) = mesh_texts.get(&self.path) else {
            return Err(SceneError::MeshMissing { table: table.to_string(), path: self.path });
        };
        let mesh = match Mesh::from_obj(text, unit_m) {
            Ok(mesh) => mesh,
            Err(cause) => return Err(SceneError::Mesh { table: table.to_string(), path: self.path, cause }),
        };
        let attitude = attitude(table, self.attitude_wxyz, self.attitude_deg)?;
        let motion = motion(table, self.position_m, attitude, self.velocity_mps, self.spin_dps)?;
        Ok(Obstacle { body: Body::Mesh(Arc::new(mesh)), motion, albedo: albedo(table, self.albedo)? })
    }
}

fn motion(
    table: Table,
    position_m: [f64; 3],
    attitude: UnitQuaternion<f64>,
    velocity_mps: [f64; 3],
    spin_dps: [f64; 3],
) -> Result<Motion, SceneError> {
    Ok(Motion {
        position_m: table.vector("position_m", position_m, Bounds::Closed(-FAR_M, FAR_M))?,
        attitude,
        velocity_mps: table.vector("velocity_mps", velocity_mps, Bounds::Closed(-SPEED_MPS, SPEED_MPS))?,
        spin_radps: table.vector("spin_dps", spin_dps, Bounds::Closed(-SPIN_DPS, SPIN_DPS))?.map(f64::to_radians),
    })
}

fn attitude(table: Table, wxyz: Option<[f64; 4]>, deg: Option<[f64; 3]>) -> Result<UnitQuaternion<f64>, SceneError> {
    let refused = |found| Err(SceneError::Attitude { table: table.to_string(), found });
    match (wxyz, deg) {
        (Some(_), Some(_)) => refused("both"),
        (None, None) => refused("none"),
        (Some([w, x, y, z]), None) => match UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9) {
            Some(attitude) if attitude.coords.iter().all(|value| value.is_finite()) => Ok(attitude),
            _ => refused("an attitude_wxyz that is no rotation"),
        },
        (None, Some(deg)) => {
            let [roll, pitch, yaw] =
                table.vector("attitude_deg", deg, Bounds::Closed(-360.0, 360.0))?.map(f64::to_radians).into();
            Ok(UnitQuaternion::from_euler_angles(roll, pitch, yaw))
        }
    }
}

fn albedo(table: Table, albedo: f64) -> Result<f64, SceneError> {
    table.within("albedo", albedo, Bounds::Above(0.0, 1.0))
}
