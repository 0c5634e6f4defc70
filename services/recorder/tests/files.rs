//! What stands in the files, to the byte.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::fs;
use std::path::Path;

use common::{HandMade, Line, lines, rows, settings, settings_in, start};
use lidar::ObstacleClass;
use messages::{Detections, Solid, Trace, Verdict};
use proptest::prelude::*;
use recorder::{RecorderError, Settings};
use stage::Sink;

type Parts = Vec<(Trace, Box<Detections>)>;

/// Runs the recorder over `parts`; gives the bytes of both files.
fn record(parts: &Parts, change: impl FnOnce(Settings) -> Settings) -> (String, String) {
    let folder = tempfile::tempdir().unwrap();
    let settings = change(settings_in(folder.path()));
    let mut recorder = start(settings).unwrap();
    for (trace, detections) in parts {
        assert_eq!(recorder.accept(trace, detections), Verdict::Complete);
    }
    recorder.finish().unwrap();
    assert_eq!(recorder.settled(), parts.len() as u64);
    let read = |name| fs::read_to_string(folder.path().join(name)).unwrap();
    (read("detections.jsonl"), read("labels.csv"))
}

fn as_parts(sweeps: &[HandMade], sectors: u32) -> Parts {
    // Clusters close in any sector, so that a later sector brings smaller keys.
    sweeps.iter().flat_map(|sweep| sweep.sectors(sectors, |place| (place as u32 * 7 + 1) % sectors)).collect()
}

// verifies REC-001, REC-002
#[test]
fn a_short_run_gives_exactly_these_files() {
    let first = HandMade {
        sweep: 0,
        recorded: 5,
        clusters: vec![(vec![0, 3], ObstacleClass::Conical), (vec![1], ObstacleClass::Unclassified)],
    };
    let empty = HandMade { sweep: 1, recorded: 0, clusters: vec![] };
    let (detections, labels) = record(&vec![first.whole(), empty.whole()], |settings| settings);
    assert_eq!(
        detections,
        concat!(
            r#"{"sweep":0,"complete":true,"sensor_time_ns":0,"returns":3,"refused":{"too_near":2},"detections":["#,
            r#"{"cluster":0,"points":2,"class":"conical","posterior":{"rectangular":0.1,"ellipsoidal":0.2,"cylindrical":0.3,"conical":0.4},"#,
            r#""centroid_m":[0.0,-1.0,0.1],"centre_m":[0.0,0.25,-0.0],"size_m":[1.0,2.0,3.0],"attitude_wxyz":[0.6,0.8,0.0,0.0],"#,
            r#""centre_covariance_m2":[0.0,0.015625,0.03125,0.015625,0.140625,0.15625,0.03125,0.15625,0.265625],"#,
            r#""range_m":1.0049876,"rings":1},"#,
            r#"{"cluster":1,"points":1,"class":"unclassified","posterior":null,"#,
            r#""centroid_m":[0.33333334,-0.5,0.1],"centre_m":null,"size_m":null,"attitude_wxyz":null,"centre_covariance_m2":null,"#,
            r#""range_m":0.60918885,"rings":2}]}"#,
            "\n",
            r#"{"sweep":1,"complete":true,"sensor_time_ns":100000000,"returns":0,"refused":{},"detections":[]}"#,
            "\n"
        )
    );
    assert_eq!(labels, "sweep,return,cluster\n0,0,0\n0,1,1\n0,2,-1\n0,3,0\n0,4,-1\n");
}

// verifies REC-003
#[test]
fn any_number_of_sectors_and_any_queue_give_the_same_bytes() {
    let sweeps: Vec<_> = (0..5).map(|sweep| HandMade::interleaved(sweep, 3_000, 40, 9)).collect();
    let expected = record(&as_parts(&sweeps, 1), |settings| settings);
    for sectors in [1, 2, 4, 36] {
        for queue_parts in [1, 2, 64] {
            let found = record(&as_parts(&sweeps, sectors), |settings| Settings { queue_parts, ..settings });
            assert!(found == expected, "{sectors} sectors, {queue_parts} buffers");
        }
    }
}

// verifies REC-004
#[test]
fn a_sweep_that_lacks_a_sector_is_written_as_incomplete() {
    let sweeps: Vec<_> = (0..3).map(|sweep| HandMade::interleaved(sweep, 400, 8, 4)).collect();
    let mut parts = as_parts(&sweeps, 4);
    let (_, lost) = parts.remove(6);
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = start(settings_in(folder.path())).unwrap();
    for (trace, detections) in &parts {
        assert_eq!(recorder.accept(trace, detections), Verdict::Complete);
    }
    recorder.finish().unwrap();
    let lines = lines(&folder.path().join("detections.jsonl"));
    let states: Vec<_> = lines.iter().map(|line| (line.sweep, line.complete, line.missing_sectors)).collect();
    assert_eq!(states, [(0, true, None), (1, false, Some(1)), (2, true, None)]);
    let rows = rows(&folder.path().join("labels.csv"));
    let torn: Vec<_> = rows.iter().filter(|(sweep, ..)| *sweep == 1).collect();
    assert!(torn.iter().all(|(.., cluster)| *cluster >= 0), "what is not known to be refused has no row");
    assert_eq!(torn.len(), sweeps[1].accepted() as usize - lost.members.len());
}

// verifies REC-004
#[test]
fn a_part_that_a_stage_rejected_gives_a_line_that_says_so() {
    let (mut trace, mut detections) = HandMade::interleaved(0, 100, 4, 10).whole();
    trace.hops[1].verdict = Verdict::RejectedIncomplete;
    detections.detections.clear();
    detections.members.clear();
    detections.solids.clear();
    let (text, labels) = record(&vec![(trace, detections)], |settings| settings);
    let line: Line = serde_json::from_str(&text).unwrap();
    assert_eq!((line.complete, line.rejected_sectors, line.detections.len()), (false, Some(1), 0));
    assert_eq!(labels, "sweep,return,cluster\n");
}

// verifies REC-005
#[test]
fn a_message_that_contradicts_itself_is_rejected_and_leaves_no_line() {
    let spoil: [fn(&mut Detections); 12] = [
        |d| d.detections[1].summary.points = u32::MAX,
        |d| d.detections[1].summary.first_member = u32::MAX,
        |d| d.detections[1].summary.points = 0,
        |d| d.members[3] = d.header.recorded,
        |d| d.members.truncate(d.members.len() - 1),
        |d| d.header.recorded += 1,
        |d| d.detections.truncate(3),
        |d| d.detections[1].solids = 2,
        |d| d.detections[1].solids = 0,
        |d| d.detections[1].first_solid = u32::MAX,
        |d| d.detections[1].first_solid = 0,
        |d| d.solids.truncate(d.solids.len() - 1),
    ];
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = start(settings_in(folder.path())).unwrap();
    for spoil in spoil {
        let (trace, mut detections) = HandMade::interleaved(0, 100, 4, 10).whole();
        spoil(&mut detections);
        assert_eq!(recorder.accept(&trace, &detections), Verdict::RejectedMalformed);
    }
    recorder.finish().unwrap();
    assert_eq!(recorder.settled(), 0);
    assert!(lines(&folder.path().join("detections.jsonl")).is_empty());
}

// verifies REC-010
#[test]
fn a_path_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for bad in [folder.path().join("none/x"), folder.path().to_owned()] {
        let error = start(Settings { detections: Some(bad.clone()), ..settings() }).err().unwrap();
        assert!(matches!(error, RecorderError::Create { .. }));
        assert!(error.to_string().contains(&*bad.to_string_lossy()), "{error}");
    }
    fs::write(folder.path().join("a"), "").unwrap();
    fs::hard_link(folder.path().join("a"), folder.path().join("b")).unwrap();
    let at = |name| Some(folder.path().join(name));
    let same = start(Settings { detections: at("a"), labels: at("b"), ..settings() });
    assert!(matches!(same.err(), Some(RecorderError::SameFile(_))));
}

#[test]
fn a_new_run_empties_the_files_of_an_old_one() {
    let folder = tempfile::tempdir().unwrap();
    for sweeps in [3, 1] {
        let mut recorder = start(settings_in(folder.path())).unwrap();
        for sweep in 0..sweeps {
            let (trace, detections) = HandMade::interleaved(sweep, 50, 4, 10).whole();
            recorder.accept(&trace, &detections);
        }
        recorder.finish().unwrap();
        assert_eq!(lines(&folder.path().join("detections.jsonl")).len(), sweeps as usize);
    }
}

fn check_read_back(folder: &Path, message: &Detections) {
    let lines = lines(&folder.join("detections.jsonl"));
    let [line] = &lines[..] else { panic!("{} lines", lines.len()) };
    assert_eq!(line.returns, u64::from(message.header.accepted()));
    assert_eq!(line.refused.values().sum::<u64>() + line.returns, u64::from(message.header.recorded));
    assert_eq!(line.detections.len(), message.detections.len());
    for (place, (row, detection)) in line.detections.iter().zip(&message.detections).enumerate() {
        assert_eq!((row.cluster, row.points, row.rings), (place, detection.summary.points, detection.summary.rings));
        assert_eq!(row.class, detection.class);
        assert_eq!(row.centroid_m.map(f32::to_bits), detection.summary.centroid_m.map(f32::to_bits));
        assert_eq!(row.range_m.to_bits(), detection.summary.range_m().to_bits());
        let solid = detection.solid_place().map(|place| message.solids[place]);
        assert_eq!(row.centre_m, solid.map(|solid| solid.centre_m));
        assert_eq!(row.size_m, solid.map(|solid| solid.size_m));
        assert_eq!(row.attitude_wxyz, solid.map(|solid| solid.attitude_wxyz));
        let covariance = |solid: Solid| std::array::from_fn(|place| solid.covariance_of(place / 3, place % 3));
        assert_eq!(row.centre_covariance_m2, solid.map(covariance));
        match (&row.posterior, detection.class.solid_index()) {
            (None, None) => {}
            (Some(posterior), Some(_)) => {
                let found = ObstacleClass::SOLIDS.map(|class| posterior[class.name()].to_bits());
                assert_eq!(found, detection.posterior.map(f32::to_bits));
            }
            (posterior, _) => panic!("{:?} with posterior {posterior:?}", detection.class),
        }
    }
    let rows = rows(&folder.join("labels.csv"));
    let indices: Vec<u32> = rows.iter().map(|&(_, index, _)| index).collect();
    assert_eq!(indices, (0..message.header.recorded).collect::<Vec<_>>());
    for (cluster, detection) in message.detections.iter().enumerate() {
        let labelled: Vec<u32> =
            rows.iter().filter(|&&(.., label)| label == cluster as i64).map(|&(_, index, _)| index).collect();
        assert_eq!(labelled, message.members[detection.summary.member_places()]);
    }
    let refused = rows.iter().filter(|&&(.., label)| label == -1).count();
    assert_eq!(refused as u32, message.header.recorded - message.header.accepted());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    // verifies REC-001, REC-002
    #[test]
    fn what_is_read_back_is_what_the_message_said(
        labels in prop::collection::vec(0_usize..12, 0..120),
        values in prop::collection::vec((any::<u32>(), any::<u32>(), 0_usize..5), 12),
    ) {
        // Label 0 is refused; the others are clusters, in order of their first return.
        let mut clusters: Vec<Vec<u32>> = vec![Vec::new(); 12];
        labels.iter().enumerate().for_each(|(index, &label)| clusters[label].push(index as u32));
        let mut clusters: Vec<_> = clusters.drain(1..).filter(|members| !members.is_empty()).collect();
        clusters.sort();
        let clusters = clusters.into_iter().zip(&values).map(|(members, value)| (members, ObstacleClass::ALL[value.2]));
        let sweep = HandMade { sweep: 3, recorded: labels.len() as u32, clusters: clusters.collect() };
        let (trace, mut message) = sweep.whole();
        let finite = |bits: u32| Some(f32::from_bits(bits)).filter(|value| value.is_finite()).unwrap_or(-0.0);
        for (detection, &(one, other, _)) in message.detections.iter_mut().zip(&values) {
            detection.summary.centroid_m = [finite(one) / 1e20, finite(other) / 1e20, 0.1 + 0.2];
            detection.posterior[0] = finite(other);
        }
        let folder = tempfile::tempdir().unwrap();
        let mut recorder = start(settings_in(folder.path())).unwrap();
        prop_assert_eq!(recorder.accept(&trace, &message), Verdict::Complete);
        recorder.finish().unwrap();
        check_read_back(folder.path(), &message);
    }
}
