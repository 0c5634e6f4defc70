//! The stage as the shell sees it: detections in, tracks out.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use common::{PERIOD_NS, Played, Seen, ego, message, moving, params, part, seen_from, start_ns};
use lidar::ObstacleClass;
use messages::{Detections, EgoMotion, MAX_TRACKS, Message, Part, Step, TrackState, Tracks, Verdict};
use stage::Stage;
use tracker::{Params, Tracker};
use zerocopy::{FromZeros, IntoBytes};

fn assert_near(found: [f32; 3], expected: [f64; 3], most: f64) {
    for axis in 0..3 {
        let wrong = (f64::from(found[axis]) - expected[axis]).abs();
        assert!(wrong < most, "{found:?}, expected {expected:?}");
    }
}

// verifies TRA-001
#[test]
fn an_obstacle_is_where_it_is_at_the_end_of_the_sweep_and_moves_as_it_does() {
    let mut sut = Played::new(params());
    let (from, velocity) = ([8.0, -3.0, 0.5], [0.5, -0.4, 0.1]);
    for sweep in 0..30 {
        sut.sweep(&[moving(from, velocity, sweep)]);
    }
    let track = sut.only();
    assert_eq!((track.state, track.class), (TrackState::Confirmed, ObstacleClass::Ellipsoidal));
    assert_eq!((track.age_sweeps, track.last_seen_sweeps), (30, 0));
    assert_eq!(sut.output.table.time_ns, start_ns(30));
    assert_near(track.position_m, std::array::from_fn(|axis| from[axis] + velocity[axis] * 3.0), 0.01);
    assert_near(track.velocity_mps, velocity, 0.01);
    assert_near(track.size_m, [1.0; 3], 0.05);
    assert!(track.valid_until_ns > sut.output.table.time_ns);
    assert!(track.at(sut.output.table.time_ns, track.valid_until_ns + 1).is_err());
    assert_eq!(sut.keys(0), [0]);
}

// verifies TRA-015
#[test]
fn detections_are_passed_on_as_they_came() {
    let seen = [(3, Seen::at(5.0, 1.0, 0.0)), (9, Seen { fitted: false, ..Seen::at(-9.0, 1.0, 0.0) })];
    let input = message(0, EgoMotion::default(), &seen);
    let mut sut = Played::new(params());
    sut.send(&input);
    let output = &sut.output.detections;
    assert_eq!((output.header, &output.detections[..]), (input.header, &input.detections[..]));
    assert_eq!((&output.members[..], &output.solids[..]), (&input.members[..], &input.solids[..]));
}

// verifies TRA-013
#[test]
fn a_track_is_born_confirmed_coasts_and_ends_as_configured() {
    let mut params = params();
    params.lifecycle.lost_misses = 4;
    let mut sut = Played::new(params);
    let seen = [Seen::at(10.0, 5.0, 0.0)];
    let mut states = Vec::new();
    for seen_now in [true, true, true, false, false, true, false, false, false, false] {
        sut.sweep(if seen_now { &seen } else { &[] });
        states.extend(sut.states().first().copied());
    }
    use TrackState::{Coasting, Confirmed, Tentative};
    assert_eq!(states, [Tentative, Tentative, Confirmed, Coasting, Coasting, Confirmed, Coasting, Coasting, Coasting]);
    assert!(sut.output.table.tracks.is_empty());
}

#[test]
fn what_has_too_few_returns_begins_no_track_but_is_seen_as_one() {
    let mut sut = Played::new(params());
    let few = Seen { points: 4, fitted: false, ..Seen::at(10.0, 5.0, 0.0) };
    assert!(sut.sweep(&[few]).is_empty());
    for _ in 0..3 {
        sut.sweep(&[Seen { points: 5, ..few }]);
    }
    sut.sweep(&[few]);
    assert_eq!(sut.only().state, TrackState::Confirmed);
}

// verifies TRA-011
#[test]
fn an_obstacle_that_comes_out_from_behind_another_is_the_same_one() {
    let mut sut = Played::new(params());
    let near = Seen { size_m: [2.0; 3], points: 200, ..Seen::at(6.0, 0.0, 0.0) };
    let (from, velocity) = ([18.0, 4.0, 0.0], [0.0, -1.0, 0.0]);
    let (mut hidden, mut id) = (0, 0);
    for sweep in 0..80 {
        let far = moving(from, velocity, sweep);
        // What the nearer one covers is not seen.
        if far.centre_m[1].abs() < 2.0 {
            hidden += 1;
            sut.sweep(&[near]);
            assert_eq!(sut.states().iter().filter(|state| **state == TrackState::Coasting).count(), 1);
        } else {
            sut.sweep(&[near, far]);
        }
        assert_eq!(sut.output.table.tracks.len(), 2, "sweep {sweep}");
        let of_far = sut.output.table.tracks.iter().find(|track| track.position_m[0] > 10.0).unwrap();
        assert!(id == 0 || id == of_far.id);
        id = of_far.id;
    }
    assert!(hidden > params().lifecycle.lost_misses, "hidden for {hidden} sweeps");
}

// verifies TRA-010
#[test]
fn an_obstacle_that_drifts_across_the_seam_stays_the_same() {
    let mut sut = Played::new(params());
    let (from, velocity) = ([8.0, 1.5, 0.0], [0.0, -0.8, 0.0]);
    let mut seam = 0;
    for sweep in 0..40 {
        let mut seen = moving(from, velocity, sweep);
        if seen.centre_m[1].abs() < 0.5 {
            seam += 1;
            seen.seam = 1;
            seen.when = if seen.centre_m[1] < -0.45 { 0.02 } else { 0.9999 };
        }
        sut.sweep(&[seen]);
        assert_eq!(sut.only().age_sweeps, sweep as u32 + 1);
    }
    assert!(seam > 5);
    assert_near(sut.only().velocity_mps, velocity, 0.03);
}

// verifies TRA-018
#[test]
fn a_standing_obstacle_stands_for_a_sensor_that_moves_and_turns() {
    let (velocity, spin) = ([1.5, -0.5, 0.2], [0.02, 0.05, 0.3]);
    let place = [9.0, 6.0, 1.0];
    let mut sut = Played::new(params());
    for sweep in 0..60 {
        let seen = seen_from(place, sweep, velocity, spin);
        sut.send(&message(sweep, ego(sweep, velocity, spin), &[(0, seen)]));
    }
    let track = sut.only();
    // Relative to the sensor it goes the other way, along axes that turned by then.
    let turned = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::from(spin) * 6.0).inverse();
    let expected = turned * -nalgebra::Vector3::from(velocity);
    assert_near(track.velocity_mps, expected.into(), 0.02);
    let away = turned * (nalgebra::Vector3::from(place) - nalgebra::Vector3::from(velocity) * 6.0);
    assert_near(track.position_m, away.into(), 0.03);
}

#[test]
fn without_the_sensors_motion_what_is_tracked_is_relative() {
    let mut sut = Played::new(params());
    for sweep in 0..40 {
        let seen = seen_from([20.0, 3.0, 0.0], sweep, [1.0, 0.0, 0.0], [0.0; 3]);
        sut.send(&message(sweep, EgoMotion::default(), &[(0, seen)]));
    }
    assert_near(sut.only().velocity_mps, [-1.0, 0.0, 0.0], 0.02);
}

// verifies TRA-007
#[test]
fn pieces_of_an_obstacle_behind_a_post_are_one_track() {
    let mut sut = Played::new(params());
    let whole = Seen { size_m: [3.0, 3.0, 1.0], points: 300, ..Seen::at(10.0, 0.0, 0.0) };
    for _ in 0..10 {
        sut.sweep(&[whole]);
    }
    let id = sut.only().id;
    let piece = |y: f64| Seen { size_m: [0.8; 3], points: 90, ..Seen::at(9.7, y, 0.0) };
    for _ in 0..10 {
        sut.sweep(&[piece(1.0), piece(-1.0)]);
        assert_eq!((sut.only().id, sut.keys(0)), (id, &[0, 1][..]));
    }
    assert_near(sut.only().position_m, [10.0, 0.0, 0.0], 0.15);
}

// verifies TRA-007
#[test]
fn two_obstacles_that_pass_in_one_cluster_stay_two() {
    let mut sut = Played::new(params());
    let (left, right) = ([10.0, 2.5, 0.0], [10.0, -2.5, 0.0]);
    let (of_left, of_right) = ([0.0, -0.8, 0.0], [0.0, 0.8, 0.3]);
    let (mut merged, mut ids) = (0, Vec::new());
    for sweep in 0..60 {
        let (one, other) = (moving(left, of_left, sweep), moving(right, of_right, sweep));
        let apart = (one.centre_m[1] - other.centre_m[1]).abs();
        if apart < 1.8 {
            merged += 1;
            let middle = |axis: usize| (one.centre_m[axis] + other.centre_m[axis]) / 2.0;
            let both = Seen { points: 120, fitted: false, ..Seen::at(middle(0), middle(1), middle(2)) };
            sut.sweep(&[both]);
            // Both were seen, as the same cluster.
            assert_eq!((sut.keys(0), sut.keys(1)), (&[0][..], &[0][..]), "sweep {sweep}");
        } else {
            sut.sweep(&[one, other]);
        }
        ids.push(sut.output.table.tracks.iter().map(|track| track.id).collect::<Vec<_>>());
    }
    assert!(merged > 15);
    assert!(ids.iter().all(|now| *now == ids[0]), "{ids:?}");
    assert_near(sut.output.table.tracks[0].velocity_mps, of_left, 0.05);
}

// verifies TRA-008
#[test]
fn a_sweep_that_was_seen_in_part_charges_nobody() {
    let mut sut = Played::new(params());
    // Until its velocity is known well enough for what follows.
    for _ in 0..20 {
        sut.sweep(&[Seen::at(10.0, 5.0, 0.0)]);
    }
    let mut partly = message(0, EgoMotion::default(), &[]);
    partly.header.complete = 0;
    let unknown = Detections::new_box_zeroed().unwrap();
    for sweep in 0..20 {
        sut.send(if sweep % 2 == 0 { &partly } else { &unknown });
        assert_eq!(sut.only().state, TrackState::Coasting);
        assert_eq!(sut.output.table.time_ns, start_ns(sut.sweep));
    }
}

// verifies TRA-008
#[test]
fn sweeps_that_are_shed_under_overload_charge_nobody() {
    let mut sut = Played::new(params());
    for _ in 0..20 {
        sut.sweep(&[Seen::at(10.0, 5.0, 0.0)]);
    }
    for shed in 0..=params().lifecycle.lost_misses {
        // The clusterer sends it on with its header and no clusters; the sweeps between are dropped.
        let part = Part { step: Step::EverySecondSweep as u32, ..part(21 + 2 * u64::from(shed), 0, 1) };
        assert!(part.is_shed());
        sut.output.clear();
        sut.room.process(part, &message(part.sweep, EgoMotion::default(), &[]), &mut sut.output);
        assert_eq!(sut.only().state, TrackState::Coasting);
    }
}

// verifies TRA-019
#[test]
fn a_step_of_the_clock_begins_all_anew_with_new_numbers() {
    for step_ns in [10_000_000_000_i64, -10_000_000_000, -100_000_000] {
        let mut sut = Played::new(params());
        for _ in 0..5 {
            sut.sweep(&[Seen::at(10.0, 5.0, 0.0)]);
        }
        let id = sut.only().id;
        let input = message(5, EgoMotion::default(), &[(0, Seen::at(10.0, 5.0, 0.0))]);
        let stepped = Part { sensor_time_ns: start_ns(5).wrapping_add_signed(step_ns), ..part(5, 0, 1) };
        sut.output.clear();
        sut.room.process(stepped, &input, &mut sut.output);
        assert_eq!((sut.only().age_sweeps, sut.only().state), (1, TrackState::Tentative), "{step_ns}");
        assert!(sut.only().id > id);
    }
}

#[test]
fn a_room_that_starts_later_gives_other_numbers() {
    let mut ids = Vec::new();
    for first in [0, 1, 7] {
        let mut sut = Played { sweep: first, ..Played::new(params()) };
        sut.sweep(&[Seen::at(10.0, 5.0, 0.0)]);
        ids.push(sut.only().id);
    }
    assert_eq!(ids, [1, MAX_TRACKS as u64 + 1, 7 * MAX_TRACKS as u64 + 1]);
}

// verifies TRA-024
#[test]
fn a_tracker_with_other_parameters_goes_on_where_the_one_before_it_stood() {
    let mut before = Tracker::init(params()).unwrap();
    let mut output = Tracks::new_box_zeroed().unwrap();
    let mut answer = |sut: &mut Tracker, sweep: u64| {
        output.clear();
        sut.process(part(sweep, 0, 1), &message(sweep, EgoMotion::default(), &crowd(sweep)), &mut output);
        output.table.tracks.iter().map(|track| (track.id, track.age_sweeps)).collect::<Vec<_>>()
    };
    for sweep in 0..10 {
        answer(&mut before, sweep);
    }
    let mut params = params();
    params.danger.own_radius_m = 50.0;
    let mut next = Tracker::init(params).unwrap();
    next.take_over(&before);
    let (mut one, mut other) = (answer(&mut before, 10), answer(&mut next, 10));
    // Another own radius is another order of danger.
    one.sort_unstable();
    other.sort_unstable();
    assert_eq!(one, other);
    assert!(other.iter().all(|(_, age)| *age == 11));
}

// verifies TRA-022
#[test]
fn what_comes_straight_at_the_craft_stands_first_and_is_an_alert() {
    let mut sut = Played::new(params());
    for sweep in 0..30 {
        let passing = moving([9.0, -8.0, 0.0], [0.0, 0.8, 0.0], sweep);
        let coming = moving([12.0, 0.6, 0.0], [-0.8, 0.0, 0.0], sweep);
        sut.sweep(&[passing, coming]);
    }
    let [first, second] = &sut.output.table.tracks[..] else { panic!("{:?}", sut.output.table.tracks) };
    assert!(first.position_m[1] > 0.0, "{first:?}");
    // 12 m off, 9.6 m by now, at 0.8 m/s: past the sensor after 12 s, half a metre beside it.
    assert!(first.approach.collision_probability > 0.99 && first.alert == 1, "{:?}", first.approach);
    assert!((first.approach.time_s - 12.0).abs() < 0.3, "{:?}", first.approach);
    assert!((first.approach.distance_m - 0.6).abs() < 0.1, "{:?}", first.approach);
    assert!(second.approach.collision_probability < 1e-3 && second.alert == 0, "{:?}", second.approach);
    assert!((second.approach.distance_m - 9.0).abs() < 0.1, "{:?}", second.approach);
}

/// Some obstacles in motion, by key: in the order in which the beam passes them.
fn crowd(sweep: u64) -> Vec<(u32, Seen)> {
    let mut all: Vec<Seen> = (0..24)
        .map(|place| {
            let angle = f64::from(place) * 0.9;
            let from = [angle.cos() * (5.0 + f64::from(place)), angle.sin() * (5.0 + f64::from(place)), 0.2];
            Seen { fitted: place % 5 != 0, ..moving(from, [0.3 * angle.sin(), 0.2, 0.05 * angle.cos()], sweep) }
        })
        .collect();
    all.sort_by(|a, b| a.when.total_cmp(&b.when));
    all.iter().enumerate().map(|(key, one)| (key as u32, *one)).collect()
}

/// The table's bytes after each sweep, when its clusters come in parts; part `of` says in which each comes.
fn in_parts(sweeps: u64, sectors: u32, of: impl Fn(u64, u32) -> u32) -> Vec<Vec<u8>> {
    let mut room = Tracker::init(params()).unwrap();
    let mut output = Tracks::new_box_zeroed().unwrap();
    let mut tables = Vec::new();
    for sweep in 0..sweeps {
        let all = crowd(sweep);
        for sector in 0..sectors {
            let own: Vec<_> = all.iter().filter(|(key, _)| of(sweep, *key) == sector).copied().collect();
            output.clear();
            let input = message(sweep, EgoMotion::default(), &own);
            assert_eq!(room.process(part(sweep, sector, sectors), &input, &mut output), Verdict::Complete);
            assert_eq!(output.table.tracks.is_empty(), sector + 1 < sectors);
        }
        tables.push(bytes(&output));
    }
    tables
}

fn bytes(output: &Tracks) -> Vec<u8> {
    let table = &output.table;
    [table.time_ns.as_bytes(), table.tracks.item_bytes(), table.keys.item_bytes()].concat()
}

// verifies TRA-015
#[test]
fn tracks_are_the_same_in_any_number_of_sectors() {
    let whole = in_parts(12, 1, |_, _| 0);
    assert_eq!(in_parts(12, 4, |_, key| key / 6), whole);
    assert_eq!(in_parts(12, 24, |_, key| key), whole);
    // Clusters close when they close, not in order of their keys.
    assert_eq!(in_parts(12, 5, |sweep, key| (key * 7 + sweep as u32) % 5), whole);
}

// verifies TRA-016
#[test]
fn a_sweep_that_is_sent_again_is_answered_with_the_same_bytes() {
    let mut sut = Tracker::init(params()).unwrap();
    let mut output = Tracks::new_box_zeroed().unwrap();
    let mut answer = |sweep: u64, attempt: u32| {
        output.clear();
        let input = message(sweep, EgoMotion::default(), &crowd(sweep));
        sut.process(Part { attempt, ..part(sweep, 0, 1) }, &input, &mut output);
        bytes(&output)
    };
    let first: Vec<_> = (0..30).map(|sweep| answer(sweep, 0)).collect();
    for (attempt, from) in [(1, 29), (2, 20), (3, 15), (4, 25)] {
        for sweep in from..30 {
            assert_eq!(answer(sweep, attempt), first[sweep as usize], "sweep {sweep} from {from}");
        }
    }
}

// verifies TRA-016
#[test]
fn a_sweep_that_broke_off_and_is_sent_again_counts_once() {
    let mut sut = Tracker::init(params()).unwrap();
    let mut output = Tracks::new_box_zeroed().unwrap();
    let mut send = |sweep: u64, sector: u32, attempt: u32| {
        output.clear();
        let own: Vec<_> = crowd(sweep).into_iter().filter(|(key, _)| key / 12 == sector).collect();
        let input = message(sweep, EgoMotion::default(), &own);
        sut.process(Part { attempt, ..part(sweep, sector, 2) }, &input, &mut output);
        bytes(&output)
    };
    send(0, 0, 0);
    send(0, 1, 0);
    send(1, 0, 0);
    send(1, 0, 1);
    let again = send(1, 1, 1);
    assert_eq!(again, in_parts(2, 2, |_, key| key / 12)[1]);
}

// verifies TRA-017
#[test]
fn a_message_that_contradicts_itself_is_rejected_and_the_next_one_is_not() {
    let mut sut = Played::new(params());
    let seen = [(0, Seen::at(10.0, 5.0, 0.0)), (1, Seen::at(-10.0, 5.0, 0.0))];
    let spoils: [fn(&mut Detections); 4] = [
        |m| m.detections[1].summary.first_member = 1,
        |m| m.detections[0].summary.centroid_m[0] = f32::NAN,
        |m| m.solids[0].covariance[3] = f32::INFINITY,
        |m| m.solids.truncate(1),
    ];
    for spoil in spoils {
        let mut input = message(sut.sweep, EgoMotion::default(), &seen);
        spoil(&mut input);
        sut.send(&input);
        assert_eq!(sut.verdict, Verdict::RejectedMalformed);
        assert!(sut.output.detections.detections.is_empty() && sut.output.table.tracks.is_empty());
    }
    sut.send(&message(sut.sweep, EgoMotion::default(), &seen));
    assert_eq!((sut.verdict, sut.output.table.tracks.len()), (Verdict::Complete, 2));
}

// verifies TRA-017
#[test]
fn odd_numbers_that_a_message_may_hold_make_no_odd_tracks() {
    let mut sut = Played::new(params());
    let seen = [(0, Seen::at(10.0, 5.0, 0.0)), (1, Seen::at(-10.0, 5.0, 0.0))];
    let odd: [fn(&mut Detections); 8] = [
        |m| m.solids[0].covariance = [0.0; 45],
        |m| m.solids[0].covariance = [1e12; 45],
        |m| m.solids[0].covariance = [-1.0; 45],
        |m| m.solids[0].centre_m = [1e6, -1e6, 1e6],
        |m| m.solids[0].size_m = [0.0; 3],
        |m| m.solids[0].attitude_wxyz = [0.0; 4],
        |m| m.detections[0].summary.centroid_m = [0.0; 3],
        |m| m.header.ego = EgoMotion { known: 1, position_m: [f64::NAN; 3], ..EgoMotion::default() },
    ];
    for sweep in 0..400_usize {
        let mut input = message(sut.sweep, EgoMotion::default(), &seen);
        odd[sweep * 7 % 8](&mut input);
        sut.send(&input);
        assert_eq!(sut.verdict, Verdict::Complete);
        for track in &sut.output.table.tracks {
            let numbers =
                [&track.position_m[..], &track.velocity_mps, &track.covariance, &track.size_m, &track.posterior];
            assert!(numbers.into_iter().flatten().all(|number| number.is_finite()), "{track:?}");
            assert!((0..6).all(|axis| track.covariance_of(axis, axis) > 0.0), "{track:?}");
        }
    }
}

// verifies TRA-017
#[test]
fn more_obstacles_than_can_be_tracked_are_told_of() {
    let mut sut = Played::new(params());
    let many: Vec<Seen> = (0..MAX_TRACKS + 5)
        .map(|place| Seen {
            points: 5,
            fitted: false,
            ..Seen::at(10.0 + 6.0 * (place / 40) as f64, 6.0 * (place % 40) as f64, 0.0)
        })
        .collect();
    sut.sweep(&many[..MAX_TRACKS]);
    assert_eq!(sut.verdict, Verdict::Complete);
    sut.sweep(&many);
    assert_eq!((sut.verdict, sut.output.table.tracks.len()), (Verdict::PartialTracks, MAX_TRACKS));
}

#[test]
fn parameters_out_of_range_are_refused() {
    let mut params: Params = params();
    params.association.gate = f64::NAN;
    let refused = Tracker::init(params).unwrap_err().to_string();
    assert_eq!(refused, "association.gate is NaN, must be 1 to 1000");
}

#[test]
fn a_stand_in_passes_detections_on_without_a_table() {
    let input = message(0, EgoMotion::default(), &[(0, Seen::at(10.0, 5.0, 0.0))]);
    let mut output = Tracks::new_box_zeroed().unwrap();
    Tracker::pass_by(&input, &mut output);
    assert_eq!((output.detections.detections.len(), output.table.time_ns), (1, 0));
    assert_eq!(output.detections.header.period_ns, PERIOD_NS);
}
