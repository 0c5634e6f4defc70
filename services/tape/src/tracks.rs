//! Tracks → `foxglove.SceneUpdate`: every track as its body, an arrow for its velocity, and words.

use std::fmt::Write;

use foxglove::messages::{ArrowPrimitive, Color, Pose, Quaternion, SceneEntity, TextPrimitive, Vector3};
use messages::{Track, TrackState, TrackTable};

use crate::colours::{ALERT, colour};
use crate::entities::{Entities, draw, draw_ball, paint, pose, vector};
use crate::scene::{CENTROID_M, OPACITY};
use crate::stamps::timestamp;

/// Time that an arrow spans [s]: its head is where the track is then, if both go on as they do.
pub const ARROW_S: f64 = 2.0;
/// Diameter of an arrow's shaft [m].
const SHAFT_M: f64 = 0.04;
/// Length and diameter of an arrow's head [m]; of a shorter arrow all is head.
const HEAD_M: f64 = 0.15;
/// Height of the words [pixels].
const TEXT_PX: f64 = 12.0;
/// How far the words stand above a body [m].
const ABOVE_M: f64 = 0.25;
/// How opaque bodies, and how opaque arrow and words of a state are, 0 to 1.
const TENTATIVE: (f64, f64) = (0.1, 0.35);
const CONFIRMED: (f64, f64) = (OPACITY, 1.0);
const COASTING: (f64, f64) = (0.2, 0.7);
/// Keys of what an entity says of its track, in their order.
const KEYS: [&str; 11] = [
    "state",
    "class",
    "posterior",
    "age_sweeps",
    "last_seen_sweeps",
    "speed_mps",
    "range_m",
    "alert",
    "approach_time_s",
    "approach_distance_m",
    "collision_probability",
];

/// Writes scene updates of tracks. Keeps its memory.
pub struct TrackScenes {
    entities: Entities,
}

impl Default for TrackScenes {
    fn default() -> Self {
        Self { entities: Entities::new(&KEYS) }
    }
}

impl TrackScenes {
    /// Appends an update that replaces all tracks before it; one that changes nothing where there is no table.
    ///
    /// Entity `track-N` is that with the number N: the body of its likeliest class in the sensor frame (a small ball
    /// where no solid was ever fitted), an arrow as long as the way of [`ARROW_S`], and its number, class and speed in
    /// words. It disappears when the track is no longer valid, or with the next update. A tentative track is faint, one
    /// that was not seen in this sweep fainter than others and called so, one on alert in a colour of its own and
    /// called so. Its metadata: state, class, the class's posterior (none for unclassified), age_sweeps,
    /// last_seen_sweeps, speed_mps, range_m, alert (0 or 1), and of the closest approach (none for a tentative track)
    /// approach_time_s, approach_distance_m, collision_probability.
    pub fn tracks(&mut self, table: &TrackTable, out: &mut Vec<u8>) {
        if table.time_ns == 0 {
            return;
        }
        let stamp = timestamp(table.time_ns);
        self.entities.begin(stamp);
        for track in &table.tracks {
            // A lifetime of 0 would be one without end.
            let lifetime_ns = track.valid_until_ns.saturating_sub(table.time_ns).max(1);
            let entity = self.entities.add(stamp, lifetime_ns);
            // Writing to a string cannot fail, here and below.
            let _ = write!(entity.id, "track-{}", track.id);
            describe(entity, track);
            show(entity, track);
        }
        self.entities.end(out);
    }
}

fn describe(entity: &mut SceneEntity, track: &Track) {
    let is_judged = track.state != TrackState::Tentative;
    let approach = &track.approach;
    for pair in &mut entity.metadata {
        let value = &mut pair.value;
        let _ = match pair.key.as_str() {
            "state" => value.write_str(track.state.name()),
            "class" => value.write_str(track.class.name()),
            "posterior" => match track.class.solid_index() {
                Some(place) => write!(value, "{}", track.posterior[place]),
                None => Ok(()),
            },
            "age_sweeps" => write!(value, "{}", track.age_sweeps),
            "last_seen_sweeps" => write!(value, "{}", track.last_seen_sweeps),
            "speed_mps" => write!(value, "{}", norm(track.velocity_mps)),
            "range_m" => write!(value, "{}", norm(track.position_m)),
            "alert" => write!(value, "{}", track.alert),
            "approach_time_s" if is_judged => write!(value, "{}", approach.time_s),
            "approach_distance_m" if is_judged => write!(value, "{}", approach.distance_m),
            "collision_probability" if is_judged => write!(value, "{}", approach.collision_probability),
            _ => Ok(()),
        };
    }
}

fn show(entity: &mut SceneEntity, track: &Track) {
    let rgb = if track.alert != 0 { ALERT } else { colour(track.class) };
    let (body, sign) = match track.state {
        TrackState::Tentative => TENTATIVE,
        TrackState::Confirmed => CONFIRMED,
        TrackState::Coasting => COASTING,
    };
    let largest_m = track.size_m.into_iter().fold(0.0, f32::max);
    if largest_m > 0.0 {
        let pose = pose(track.position_m, track.attitude_wxyz);
        draw(entity, track.class, pose, track.size_m, paint(rgb, body));
    } else {
        draw_ball(entity, track.position_m, CENTROID_M, paint(rgb, sign));
    }
    entity.arrows.extend(arrow(track, paint(rgb, sign)));
    entity.texts.push(words(track, f64::from(largest_m) / 2.0 + ABOVE_M, paint(rgb, sign)));
}

/// None where it stands still: nothing says whither.
fn arrow(track: &Track, color: Color) -> Option<ArrowPrimitive> {
    let [x, y, z] = track.velocity_mps.map(f64::from);
    let speed_mps = (x * x + y * y + z * z).sqrt();
    let length_m = speed_mps * ARROW_S;
    let head_length = length_m.min(HEAD_M);
    (speed_mps > 0.0).then(|| ArrowPrimitive {
        pose: Some(Pose {
            position: Some(vector(track.position_m)),
            orientation: Some(along([x, y, z].map(|part| part / speed_mps))),
        }),
        shaft_length: length_m - head_length,
        shaft_diameter: SHAFT_M,
        head_length,
        head_diameter: HEAD_M,
        color: Some(color),
    })
}

/// The shortest turn from +x to a unit vector; half a turn about z where that is −x.
fn along([x, y, z]: [f64; 3]) -> Quaternion {
    let w = 1.0 + x;
    let norm = (w * w + y * y + z * z).sqrt();
    if norm == 0.0 {
        return Quaternion { x: 0.0, y: 0.0, z: 1.0, w: 0.0 };
    }
    Quaternion { x: 0.0, y: -z / norm, z: y / norm, w: w / norm }
}

fn words(track: &Track, above_m: f64, color: Color) -> TextPrimitive {
    let mut text = format!("#{} {} {:.2} m/s", track.id, track.class.name(), norm(track.velocity_mps));
    if track.state != TrackState::Confirmed {
        let _ = write!(text, " {}", track.state.name());
    }
    if track.alert != 0 {
        let approach = &track.approach;
        let _ = write!(text, " ALERT p {:.3} in {:.1} s", approach.collision_probability, approach.time_s);
    }
    let Vector3 { x, y, z } = vector(track.position_m);
    let position = Some(Vector3 { x, y, z: z + above_m });
    let orientation = Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 });
    let pose = Some(Pose { position, orientation });
    TextPrimitive { pose, billboard: true, font_size: TEXT_PX, scale_invariant: true, color: Some(color), text }
}

fn norm([x, y, z]: [f32; 3]) -> f32 {
    (x * x + y * y + z * z).sqrt()
}

#[cfg(test)]
mod tests {
    use foxglove::messages::SceneUpdate;
    use lidar::ObstacleClass;
    use messages::ClosestApproach;
    use prost::Message;
    use zerocopy::FromZeros;

    use super::*;
    use crate::stamps::duration;

    const TIME_NS: u64 = 5_100_000_000;

    fn track(id: u64, state: TrackState) -> Track {
        Track {
            id,
            state,
            class: ObstacleClass::Conical,
            posterior: [0.0, 0.125, 0.125, 0.75],
            position_m: [3.0, 4.0, 0.0],
            velocity_mps: [0.0, 0.5, 0.0],
            size_m: [1.0, 1.0, 2.5],
            attitude_wxyz: [0.5, -0.5, 0.5, -0.5],
            valid_until_ns: TIME_NS + 300_000_000,
            age_sweeps: 9,
            last_seen_sweeps: 2,
            approach: ClosestApproach {
                time_s: 3.5,
                distance_m: 1.25,
                distance_sigma_m: 0.5,
                collision_probability: 0.125,
            },
            ..Track::default()
        }
    }

    fn update(sut: &mut TrackScenes, tracks: &[Track]) -> SceneUpdate {
        let mut table = TrackTable::new_box_zeroed().unwrap();
        table.time_ns = TIME_NS;
        table.tracks.extend_from_slice(tracks).unwrap();
        let mut out = Vec::new();
        sut.tracks(&table, &mut out);
        SceneUpdate::decode(&out[..]).unwrap()
    }

    /// Entity of one track alone.
    fn drawn(track: Track) -> SceneEntity {
        update(&mut TrackScenes::default(), &[track]).entities.remove(0)
    }

    /// +x turned by a quaternion.
    fn ahead(q: Quaternion) -> [f64; 3] {
        let Quaternion { x, y, z, w } = q;
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
    }

    #[test]
    fn a_track_is_its_body_where_it_is_at_the_tables_time() {
        let entity = drawn(track(7, TrackState::Confirmed));
        assert_eq!((entity.id.as_str(), entity.frame_id.as_str()), ("track-7", "lidar"));
        assert_eq!((entity.timestamp, entity.lifetime), (Some(timestamp(TIME_NS)), Some(duration(300_000_000))));
        let body = &entity.cylinders[0];
        assert_eq!(body.pose, Some(pose([3.0, 4.0, 0.0], [0.5, -0.5, 0.5, -0.5])));
        assert_eq!((body.size, body.top_scale), (Some(vector([1.0, 1.0, 2.5])), 0.0));
        let bare = drawn(Track { size_m: [0.0; 3], ..track(7, TrackState::Confirmed) });
        assert_eq!(bare.spheres[0].size, Some(Vector3 { x: CENTROID_M, y: CENTROID_M, z: CENTROID_M }));
        assert!(bare.cylinders.is_empty());
    }

    #[test]
    fn one_that_is_not_valid_any_more_disappears_at_once_and_not_never() {
        let entity = drawn(Track { valid_until_ns: 0, ..track(1, TrackState::Coasting) });
        assert_eq!(entity.lifetime, Some(duration(1)));
    }

    #[test]
    fn an_arrow_ends_where_the_track_is_after_its_time_whatever_the_direction() {
        let ways = [[0.0, 0.5, 0.0], [-0.3, 0.0, 0.0], [0.2, 0.0, 0.0], [0.1, -0.2, 0.3], [-1.0, 1e-4, 1e-4]];
        for velocity_mps in ways {
            let arrow = &drawn(Track { velocity_mps, ..track(1, TrackState::Confirmed) }).arrows[0];
            let length_m = arrow.shaft_length + arrow.head_length;
            let pose = arrow.pose.unwrap();
            assert_eq!(pose.position, Some(vector([3.0, 4.0, 0.0])));
            for (ahead, speed) in ahead(pose.orientation.unwrap()).into_iter().zip(velocity_mps) {
                assert!((ahead * length_m - f64::from(speed) * ARROW_S).abs() < 1e-6, "{velocity_mps:?}");
            }
        }
        for velocity_mps in [[0.0; 3], [f32::NAN, 0.0, 0.0]] {
            assert!(drawn(Track { velocity_mps, ..track(1, TrackState::Confirmed) }).arrows.is_empty());
        }
    }

    #[test]
    fn a_track_says_what_it_is_and_how_near_it_comes() {
        let said = |state| -> Vec<(String, String)> {
            drawn(track(7, state)).metadata.into_iter().map(|pair| (pair.key, pair.value)).collect()
        };
        let pairs = |values: [&str; 11]| -> Vec<(String, String)> {
            KEYS.iter().zip(values).map(|(&key, value)| (key.into(), value.into())).collect()
        };
        let coasting = ["coasting", "conical", "0.75", "9", "2", "0.5", "5", "0", "3.5", "1.25", "0.125"];
        assert_eq!(said(TrackState::Coasting), pairs(coasting));
        let tentative = ["tentative", "conical", "0.75", "9", "2", "0.5", "5", "0", "", "", ""];
        assert_eq!(said(TrackState::Tentative), pairs(tentative));
    }

    #[test]
    fn states_and_alerts_are_told_apart_by_words_and_by_how_they_are_drawn() {
        let text = |entity: &SceneEntity| entity.texts[0].text.clone();
        let opacity = |entity: &SceneEntity| entity.cylinders[0].color.unwrap().a;
        let [tentative, coasting, confirmed] =
            [TrackState::Tentative, TrackState::Coasting, TrackState::Confirmed].map(|state| drawn(track(7, state)));
        assert_eq!(text(&confirmed), "#7 conical 0.50 m/s");
        assert_eq!(text(&coasting), "#7 conical 0.50 m/s coasting");
        assert_eq!(text(&tentative), "#7 conical 0.50 m/s tentative");
        assert!(opacity(&tentative) < opacity(&coasting) && opacity(&coasting) < opacity(&confirmed));
        let alert = drawn(Track { alert: 1, ..track(7, TrackState::Confirmed) });
        assert_eq!(text(&alert), "#7 conical 0.50 m/s ALERT p 0.125 in 3.5 s");
        assert_eq!(alert.cylinders[0].color, Some(paint(ALERT, OPACITY)));
        assert_eq!(alert.arrows[0].color, Some(paint(ALERT, 1.0)));
    }

    #[test]
    fn an_update_replaces_all_before_it_and_none_is_made_up_where_there_is_no_table() {
        let mut sut = TrackScenes::default();
        let many = update(&mut sut, &[track(1, TrackState::Confirmed), track(2, TrackState::Tentative)]);
        assert_eq!((many.deletions.len(), many.entities.len()), (1, 2));
        let one = [Track { size_m: [0.0; 3], velocity_mps: [0.0; 3], ..track(3, TrackState::Coasting) }];
        assert_eq!(update(&mut sut, &one), update(&mut TrackScenes::default(), &one));
        let mut out = Vec::new();
        sut.tracks(&TrackTable::new_box_zeroed().unwrap(), &mut out);
        assert!(out.is_empty());
    }
}
