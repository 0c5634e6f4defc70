//! What scene updates are made of: entities whose memory is used again, bodies, poses.

use foxglove::messages::scene_entity_deletion::Type;
use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, KeyValuePair, Pose, Quaternion, SceneEntity, SceneEntityDeletion,
    SceneUpdate, SpherePrimitive, Timestamp, Vector3,
};
use lidar::ObstacleClass;
use prost::Message;

use crate::cloud::FRAME_ID;
use crate::stamps::duration;

/// Entities of updates that each replace all before them.
pub(crate) struct Entities {
    /// Keys of what an entity says of its obstacle, in their order.
    keys: &'static [&'static str],
    update: SceneUpdate,
    /// Entities that the latest update had no use for.
    spare: Vec<SceneEntity>,
}

impl Entities {
    pub(crate) fn new(keys: &'static [&'static str]) -> Self {
        Self { keys, update: SceneUpdate::default(), spare: Vec::new() }
    }

    /// Begins an update: all entities before it go.
    pub(crate) fn begin(&mut self, stamp: Timestamp) {
        let all = SceneEntityDeletion { timestamp: Some(stamp), r#type: Type::All as i32, id: String::new() };
        self.update.deletions.clear();
        self.update.deletions.push(all);
        self.spare.append(&mut self.update.entities);
    }

    /// Adds an entity that disappears after `lifetime_ns` (0: never): nothing is drawn, no name and no value is given.
    pub(crate) fn add(&mut self, stamp: Timestamp, lifetime_ns: u64) -> &mut SceneEntity {
        let mut entity = self.spare.pop().unwrap_or_else(|| {
            let pair = |key: &&str| KeyValuePair { key: (*key).into(), value: String::new() };
            let metadata = self.keys.iter().map(pair).collect();
            SceneEntity { frame_id: FRAME_ID.into(), metadata, ..SceneEntity::default() }
        });
        entity.timestamp = Some(stamp);
        entity.lifetime = Some(duration(lifetime_ns));
        entity.id.clear();
        entity.metadata.iter_mut().for_each(|pair| pair.value.clear());
        entity.cubes.clear();
        entity.spheres.clear();
        entity.cylinders.clear();
        entity.arrows.clear();
        entity.texts.clear();
        let place = self.update.entities.len();
        self.update.entities.push(entity);
        &mut self.update.entities[place]
    }

    /// Appends the update's bytes.
    pub(crate) fn end(&self, out: &mut Vec<u8>) {
        out.reserve(self.update.encoded_len());
        // Fails only where a buffer cannot grow; a vector does.
        let _ = self.update.encode(out);
    }
}

/// Draws a body of full extents: a cube, a sphere (scaled to an ellipsoid), a cylinder (with a top scale of 0 for a cone).
pub(crate) fn draw(entity: &mut SceneEntity, class: ObstacleClass, pose: Pose, size_m: [f32; 3], color: Color) {
    let (pose, size, color) = (Some(pose), Some(vector(size_m)), Some(color));
    let mut cylinder =
        |top_scale| entity.cylinders.push(CylinderPrimitive { pose, size, bottom_scale: 1.0, top_scale, color });
    match class {
        ObstacleClass::Ellipsoidal => entity.spheres.push(SpherePrimitive { pose, size, color }),
        ObstacleClass::Cylindrical => cylinder(1.0),
        ObstacleClass::Conical => cylinder(0.0),
        ObstacleClass::Rectangular | ObstacleClass::Unclassified => {
            entity.cubes.push(CubePrimitive { pose, size, color });
        }
    }
}

/// Draws the ball that stands for an obstacle of unknown extents.
pub(crate) fn draw_ball(entity: &mut SceneEntity, position_m: [f32; 3], diameter_m: f64, color: Color) {
    let pose = Some(pose(position_m, [1.0, 0.0, 0.0, 0.0]));
    let size = Some(Vector3 { x: diameter_m, y: diameter_m, z: diameter_m });
    entity.spheres.push(SpherePrimitive { pose, size, color: Some(color) });
}

/// A colour of 0 to 255 each, so opaque (0 to 1).
pub(crate) fn paint(rgb: [u8; 3], a: f64) -> Color {
    let [r, g, b] = rgb.map(|part| f64::from(part) / 255.0);
    Color { r, g, b, a }
}

pub(crate) fn pose(position_m: [f32; 3], attitude_wxyz: [f32; 4]) -> Pose {
    let [w, x, y, z] = attitude_wxyz.map(f64::from);
    Pose { position: Some(vector(position_m)), orientation: Some(Quaternion { x, y, z, w }) }
}

pub(crate) fn vector(of: [f32; 3]) -> Vector3 {
    let [x, y, z] = of.map(f64::from);
    Vector3 { x, y, z }
}
