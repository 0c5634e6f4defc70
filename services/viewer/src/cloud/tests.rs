use lidar::{ObstacleClass, Return};
use messages::{ClusterSummary, Detection};
use zerocopy::FromZeros;

use super::*;
use crate::columns::decode;

/// Eight returns on two rings by turns, one of them refused in the recording, and two clusters of three and one.
fn messages() -> (Box<Sweep>, Box<Detections>) {
    let mut sweep = Sweep::new_box_zeroed().unwrap();
    for place in 0..8u8 {
        let x = f32::from(place) * 1.2345;
        sweep.returns.push(Return { x, y: -x, z: 0.5, ring: place % 2, intensity: 200 + place, column: 0 }).unwrap();
        sweep.recorded_index.push(u32::from(place) + 10).unwrap();
    }
    let mut message = Detections::new_box_zeroed().unwrap();
    let summary = ClusterSummary { points: 3, rings: 2, centroid_m: [1.0, 2.0, 3.0], ..ClusterSummary::default() };
    let posterior = [0.1, 0.2, 0.6, 0.1];
    let class = ObstacleClass::Cylindrical;
    message.detections.push(Detection { summary, posterior, solids: 1, class, ..Detection::default() }).unwrap();
    let summary = ClusterSummary { points: 1, first_member: 3, ..ClusterSummary::default() };
    message.detections.push(Detection { summary, ..Detection::default() }).unwrap();
    for index in [10, 11, 13, 17] {
        message.members.push(index).unwrap();
    }
    let mut solid = Solid { centre_m: [4.0, 5.0, -6.0], size_m: [1.0, 1.0, 2.5], ..Solid::default() };
    solid.covariance[0] = 0.04;
    message.solids.push(solid).unwrap();
    (sweep, message)
}

fn both<'a>(sweep: &'a Sweep, detections: &'a Detections) -> Known<'a> {
    Known { sweep: Some(sweep), detections: Some(detections), ..Known::default() }
}

#[test]
fn what_is_embedded_decodes_to_the_same_returns_within_half_a_unit() {
    let (sweep, message) = messages();
    let back = decode(&encode(both(&sweep, &message), usize::MAX).unwrap());
    let order = [0, 2, 4, 6, 1, 3, 5, 7];
    for (at, place) in order.into_iter().enumerate() {
        let point = sweep.returns[place];
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let error = back[name][at] - f64::from(point.position()[axis]);
            assert!(error.abs() <= POINT_UNIT_M / 2.0 + 1e-6, "{name}: {error}");
        }
        assert_eq!(back["ring"][at], f64::from(point.ring));
        assert_eq!(back["intensity"][at], f64::from(point.intensity));
    }
    assert_eq!(back["cluster"], [0.0, -1.0, -1.0, -1.0, 0.0, 0.0, -1.0, 1.0]);
}

#[test]
fn clusters_and_solids_come_with_class_size_and_how_sure_they_are() {
    let (_, message) = messages();
    let back = decode(&encode(Known { detections: Some(&message), ..Known::default() }, usize::MAX).unwrap());
    assert!(!back.contains_key("x") && !back.contains_key("t_low"));
    assert_eq!(back["class"], [3.0, 0.0]);
    assert_eq!(back["points"], [3.0, 1.0]);
    assert!((back["p2"][0] - 0.6).abs() < 1e-9);
    assert_eq!(back["of"], [0.0]);
    assert_eq!([back["sx"][0], back["sz"][0], back["c"][0], back["qw"][0]], [4.0, -6.0, 2.5, 1.0]);
    assert!((back["sigma"][0] - 0.2).abs() < 1e-9);
}

#[test]
fn more_returns_than_wanted_are_thinned_evenly() {
    let (sweep, message) = messages();
    let back = decode(&encode(both(&sweep, &message), 3).unwrap());
    assert_eq!(back["intensity"], [200.0, 206.0, 205.0]);
    assert_eq!(back["points"], [3.0, 1.0], "clusters keep their own count");
}

#[test]
fn places_that_are_none_are_left_out() {
    let (sweep, mut message) = messages();
    message.detections[0].summary.first_member = u32::MAX;
    message.detections[0].first_solid = 7;
    let back = decode(&encode(both(&sweep, &message), usize::MAX).unwrap());
    assert!(back["of"].is_empty());
    assert_eq!(back["cluster"].iter().filter(|&&cluster| cluster >= 0.0).count(), 1);
}

#[test]
fn a_sweep_whose_tracks_are_known_to_be_none_is_told_from_one_whose_tracks_are_not_known() {
    let table = TrackTable::new_box_zeroed().unwrap();
    let known = Known { tracks: Some((&table, &Paths::default())), ..Known::default() };
    assert_eq!(decode(&encode(known, usize::MAX).unwrap())["t_low"], [0.0; 0]);
}
