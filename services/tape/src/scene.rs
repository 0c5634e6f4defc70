//! Detections → `foxglove.SceneUpdate`: every obstacle as its solid.

use std::fmt::Write;

use foxglove::messages::SceneEntity;
use messages::{Detection, Detections, Solid};

use crate::colours::colour;
use crate::entities::{Entities, draw, draw_ball, paint, pose};
use crate::stamps::timestamp;

/// Diameter of the ball that stands for an obstacle without a solid [m].
pub const CENTROID_M: f64 = 0.1;
/// How opaque a solid is, 0 to 1: its returns are seen through it.
pub(crate) const OPACITY: f64 = 0.4;
/// Sweeps after which obstacles disappear when no newer ones come.
const LIFETIME_SWEEPS: u64 = 2;
/// Keys of what an entity says of its obstacle, in their order.
const KEYS: [&str; 4] = ["class", "posterior", "points", "range_m"];

/// Writes scene updates of detections. Keeps its memory.
pub struct Scenes {
    entities: Entities,
}

impl Default for Scenes {
    fn default() -> Self {
        Self { entities: Entities::new(&KEYS) }
    }
}

impl Scenes {
    /// Appends an update that replaces all obstacles before it by those of a whole sweep, given in order of key.
    ///
    /// Entity `obstacle-N` is that with the number N: a cube, a sphere (scaled to an ellipsoid), a cylinder (with a top
    /// scale of 0 for a cone), in the sensor frame and with full extents, or a small ball at the centroid where no
    /// solid was fitted. Its metadata: class, the class's posterior (none for unclassified), points, range_m.
    pub fn detections(&mut self, detections: &Detections, out: &mut Vec<u8>) {
        let header = &detections.header;
        let stamp = timestamp(header.sensor_time_ns);
        self.entities.begin(stamp);
        for (number, detection) in detections.detections.iter().enumerate() {
            let entity = self.entities.add(stamp, header.period_ns.saturating_mul(LIFETIME_SWEEPS));
            // Writing to a string cannot fail, here and below.
            let _ = write!(entity.id, "obstacle-{number}");
            describe(entity, detection);
            let solid = detection.solid_place().and_then(|place| detections.solids.get(place));
            show(entity, detection, solid);
        }
        self.entities.end(out);
    }
}

fn describe(entity: &mut SceneEntity, detection: &Detection) {
    for pair in &mut entity.metadata {
        let value = &mut pair.value;
        let _ = match pair.key.as_str() {
            "class" => value.write_str(detection.class.name()),
            "posterior" => match detection.class.solid_index() {
                Some(place) => write!(value, "{}", detection.posterior[place]),
                None => Ok(()),
            },
            "points" => write!(value, "{}", detection.summary.points),
            _ => write!(value, "{}", detection.summary.range_m()),
        };
    }
}

fn show(entity: &mut SceneEntity, detection: &Detection, solid: Option<&Solid>) {
    let rgb = colour(detection.class);
    match solid {
        Some(solid) => {
            let pose = pose(solid.centre_m, solid.attitude_wxyz);
            draw(entity, detection.class, pose, solid.size_m, paint(rgb, OPACITY));
        }
        None => draw_ball(entity, detection.summary.centroid_m, CENTROID_M, paint(rgb, 1.0)),
    }
}

#[cfg(test)]
mod tests {
    use foxglove::messages::scene_entity_deletion::Type;
    use foxglove::messages::{Quaternion, SceneUpdate, Vector3};
    use lidar::ObstacleClass;
    use messages::ClusterSummary;
    use prost::Message;
    use zerocopy::FromZeros;

    use super::*;
    use crate::stamps::duration;

    fn message(classes: &[(ObstacleClass, bool)]) -> Box<Detections> {
        let mut message = Detections::new_box_zeroed().unwrap();
        (message.header.sensor_time_ns, message.header.period_ns) = (7, 50_000_000);
        for &(class, solid) in classes {
            let summary = ClusterSummary { points: 9, centroid_m: [3.0, 4.0, 0.0], ..ClusterSummary::default() };
            let first_solid = message.solids.len() as u32;
            let posterior = [0.125, 0.25, 0.5, 0.75];
            let detection =
                Detection { summary, posterior, first_solid, solids: solid.into(), class, ..Detection::default() };
            message.detections.push(detection).unwrap();
            if solid {
                let attitude_wxyz = [0.5, -0.5, 0.5, -0.5];
                let solid =
                    Solid { centre_m: [1.0, 2.0, 3.0], attitude_wxyz, size_m: [4.0, 5.0, 6.0], ..Solid::default() };
                message.solids.push(solid).unwrap();
            }
        }
        message
    }

    fn update(sut: &mut Scenes, message: &Detections) -> SceneUpdate {
        let mut out = Vec::new();
        sut.detections(message, &mut out);
        SceneUpdate::decode(&out[..]).unwrap()
    }

    #[test]
    fn each_class_is_drawn_as_its_solid_with_pose_and_full_extents() {
        let all = ObstacleClass::ALL.map(|class| (class, class != ObstacleClass::Unclassified));
        let update = update(&mut Scenes::default(), &message(&all));
        let [cube, ball, cylinder, cone, loose] = &update.entities[..] else { panic!("{}", update.entities.len()) };
        let at = pose([1.0, 2.0, 3.0], [0.5, -0.5, 0.5, -0.5]);
        let place = Some(at);
        let size = Some(Vector3 { x: 4.0, y: 5.0, z: 6.0 });
        assert_eq!((cube.cubes[0].pose, cube.cubes[0].size), (place, size));
        assert_eq!((ball.spheres[0].pose, ball.spheres[0].size), (place, size));
        for (entity, top_scale) in [(cylinder, 1.0), (cone, 0.0)] {
            let drawn = &entity.cylinders[0];
            assert_eq!((drawn.pose, drawn.size), (place, size));
            assert_eq!((drawn.bottom_scale, drawn.top_scale), (1.0, top_scale));
        }
        assert_eq!(loose.spheres[0].pose, Some(pose([3.0, 4.0, 0.0], [1.0, 0.0, 0.0, 0.0])));
        assert_eq!(at.orientation, Some(Quaternion { w: 0.5, x: -0.5, y: 0.5, z: -0.5 }));
        let primitives = |entity: &SceneEntity| entity.cubes.len() + entity.spheres.len() + entity.cylinders.len();
        assert!(update.entities.iter().all(|entity| primitives(entity) == 1));
    }

    #[test]
    fn an_obstacle_says_its_class_posterior_points_and_range() {
        let both = [(ObstacleClass::Conical, true), (ObstacleClass::Unclassified, false)];
        let update = update(&mut Scenes::default(), &message(&both));
        let said = |entity: &SceneEntity| -> Vec<(String, String)> {
            entity.metadata.iter().map(|pair| (pair.key.clone(), pair.value.clone())).collect()
        };
        let pairs = |values: [&str; 4]| -> Vec<(String, String)> {
            KEYS.iter().zip(values).map(|(&key, value)| (key.into(), value.into())).collect()
        };
        assert_eq!(said(&update.entities[0]), pairs(["conical", "0.75", "9", "5"]));
        assert_eq!(said(&update.entities[1]), pairs(["unclassified", "", "9", "5"]));
        let ids: Vec<&str> = update.entities.iter().map(|entity| entity.id.as_str()).collect();
        assert_eq!(ids, ["obstacle-0", "obstacle-1"]);
    }

    #[test]
    fn an_update_replaces_all_before_it_and_nothing_of_them_is_left_in_memory() {
        let mut sut = Scenes::default();
        let many = update(&mut sut, &message(&[(ObstacleClass::Conical, true); 5]));
        assert_eq!(many.entities.len(), 5);
        let one = message(&[(ObstacleClass::Rectangular, true)]);
        let next = update(&mut sut, &one);
        assert_eq!(next, update(&mut Scenes::default(), &one));
        assert_eq!((next.deletions.len(), next.deletions[0].r#type), (1, Type::All as i32));
        assert_eq!(next.entities[0].lifetime, Some(duration(100_000_000)));
        assert!(update(&mut sut, &message(&[])).entities.is_empty());
    }
}
