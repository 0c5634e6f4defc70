//! The file of tracks beside that of detections.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod common;

use std::fs;
use std::path::Path;

use common::{HandMade, settings_in, start};
use messages::{MAX_TRACKS, Trace, Track, TrackState, Tracks, Verdict};
use recorder::{Settings, Snapshot, TrackCounts};
use serde_json::Value;
use stage::Sink;
use zerocopy::FromZeros;

const CLUSTERS: u32 = 5;

/// A sweep in three sectors, with two tracks in its last.
fn tracked(sweep: u64) -> Vec<(Trace, Box<Tracks>)> {
    let parts = HandMade::interleaved(sweep, 60, CLUSTERS, 10).sectors(3, |cluster| (cluster % 3) as u32);
    let with_table = |(trace, detections): (Trace, Box<_>)| {
        let mut message = Tracks::new_box_zeroed().unwrap();
        message.detections.copy_from(&detections);
        if trace.part.is_last() {
            message.table.time_ns = 100_000_000 * (sweep + 1);
            let split = Track { id: 1 + sweep, keys: 2, state: TrackState::Confirmed, ..Track::default() };
            message.table.tracks.push(split).unwrap();
            message.table.tracks.push(Track { id: 9, first_key: 2, keys: 1, ..Track::default() }).unwrap();
            // The cluster at a place begins with the return of that number.
            message.table.keys.extend_from_slice(&[1, 4, 2]).unwrap();
        }
        (trace, message)
    };
    parts.into_iter().map(with_table).collect()
}

fn settings(folder: &Path) -> Settings {
    Settings { tracks: Some(folder.join("tracks.jsonl")), ..settings_in(folder) }
}

/// Records sweeps, and gives the bytes of all three files.
fn record(settings: Settings, sweeps: std::ops::Range<u64>) -> [Vec<u8>; 3] {
    let files = [&settings.tracks, &settings.detections, &settings.labels].map(|path| path.clone().unwrap());
    let mut recorder = start(settings).unwrap();
    for (trace, message) in sweeps.flat_map(tracked) {
        assert_eq!(Sink::accept(&mut *recorder, &trace, &message), Verdict::Complete);
    }
    recorder.finish().unwrap();
    files.map(|path| fs::read(path).unwrap())
}

fn lines(bytes: &[u8]) -> Vec<Value> {
    bytes
        .split(|&byte| byte == b'\n')
        .filter(|line| !line.is_empty())
        .map(|line| serde_json::from_slice(line).unwrap())
        .collect()
}

// verifies REC-026
#[test]
fn each_sweep_has_a_line_of_tracks_that_names_the_clusters_of_its_detections() {
    let folder = tempfile::tempdir().unwrap();
    let [tracks, detections, _] = record(settings(folder.path()), 0..3);
    let (tracks, detections) = (lines(&tracks), lines(&detections));
    assert_eq!((tracks.len(), detections.len()), (3, 3));
    for (sweep, (line, detected)) in tracks.iter().zip(&detections).enumerate() {
        assert_eq!((&line["sweep"], &detected["sweep"]), (&sweep.into(), &sweep.into()));
        assert_eq!(line["time_ns"], 100_000_000 * (sweep as u64 + 1));
        let rows = line["tracks"].as_array().unwrap();
        assert_eq!(rows.len(), 2);
        assert_eq!((&rows[0]["track"], &rows[0]["state"]), (&(1 + sweep).into(), &"confirmed".into()));
        assert_eq!(rows[0]["clusters"], serde_json::json!([1, 4]));
        assert_eq!((&rows[1]["clusters"], &rows[1]["closest_approach"]), (&serde_json::json!([2]), &Value::Null));
    }
}

// verifies REC-027
#[test]
fn confirmed_tracks_and_alerts_are_counted_through_all_lives() {
    let table = |sweep: u64, states: &[TrackState], on_alert: u8| {
        let (trace, mut message) = tracked(sweep).pop().unwrap();
        message.table.tracks.clear();
        for (id, &state) in (0..).zip(states) {
            message
                .table
                .tracks
                .push(Track { id, state, alert: u8::from(id == 0) & on_alert, ..Track::default() })
                .unwrap();
        }
        message.table.keys.clear();
        (trace, message)
    };
    let life = |tables: &[(Trace, Box<Tracks>)]| {
        let mut recorder = start(common::settings()).unwrap();
        for (trace, message) in tables {
            assert_eq!(Sink::accept(&mut *recorder, trace, message), Verdict::Complete);
        }
        let mut found = Snapshot::default();
        recorder.snapshot_into(&mut found);
        found
    };
    use TrackState::{Coasting, Confirmed, Tentative};
    let mut found = life(&[]);
    assert_eq!(found.tracks, None);
    found = life(&[
        table(0, &[Tentative, Confirmed], 0),
        table(1, &[Confirmed, Coasting, Confirmed, Tentative], 1),
        table(2, &[Confirmed, Tentative], 1),
    ]);
    assert_eq!(found.tracks, Some(TrackCounts { confirmed_max: 3, confirmed_last: 1, alerts: 1 }));
    found.merge(&life(&[table(3, &[Confirmed, Confirmed], 1)])).unwrap();
    found.merge(&life(&[])).unwrap();
    assert_eq!(found.tracks, Some(TrackCounts { confirmed_max: 3, confirmed_last: 2, alerts: 2 }));
}

// verifies REC-006
#[test]
fn wherever_the_files_were_torn_they_are_gone_on_with_to_the_same_bytes() {
    let whole = tempfile::tempdir().unwrap();
    let [tracks, detections, labels] = record(settings(whole.path()), 0..4);
    let [earlier, earlier_detections, earlier_labels] = {
        let folder = tempfile::tempdir().unwrap();
        record(settings(folder.path()), 0..2)
    };
    let second = |bytes: &[u8]| 1 + bytes.iter().position(|&byte| byte == b'\n').unwrap();
    // Killed while it wrote the second sweep: labels are whole, the line of tracks anywhere, detections have one sweep.
    let begin = second(&earlier);
    for length in (begin..=earlier.len()).step_by(37).chain([earlier.len() - 1, earlier.len()]) {
        let folder = tempfile::tempdir().unwrap();
        let of = Settings { resume: true, in_order_from: Some(0), ..settings(folder.path()) };
        fs::write(of.tracks.as_ref().unwrap(), &earlier[..length]).unwrap();
        fs::write(of.detections.as_ref().unwrap(), &earlier_detections[..second(&earlier_detections)]).unwrap();
        fs::write(of.labels.as_ref().unwrap(), &earlier_labels).unwrap();
        assert_eq!(record(of, 1..4), [tracks.clone(), detections.clone(), labels.clone()], "{length}");
    }
}

// verifies REC-005
#[test]
fn tracks_whose_clusters_are_out_of_place_are_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let spoil: [fn(&mut Tracks); 3] = [
        |message| message.table.tracks[1].first_key = 1,
        |message| message.table.tracks[1].keys = u32::MAX,
        |message| message.table.keys.truncate(2),
    ];
    let mut recorder = start(settings(folder.path())).unwrap();
    for spoil in spoil {
        let (trace, mut message) = tracked(0).remove(2);
        spoil(&mut message);
        assert_eq!(Sink::accept(&mut *recorder, &trace, &message), Verdict::RejectedMalformed);
    }
    recorder.finish().unwrap();
}

#[test]
fn as_many_tracks_as_there_can_be_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let of = settings(folder.path());
    let path = of.tracks.clone().unwrap();
    let mut recorder = start(of).unwrap();
    let (trace, detections) = HandMade::interleaved(0, 60, CLUSTERS, 10).whole();
    let mut message = Tracks::new_box_zeroed().unwrap();
    message.detections.copy_from(&detections);
    message.table.time_ns = 1;
    for id in 0..MAX_TRACKS as u64 {
        message.table.tracks.push(Track { id, ..Track::default() }).unwrap();
    }
    assert_eq!(Sink::accept(&mut *recorder, &trace, &message), Verdict::Complete);
    recorder.finish().unwrap();
    assert_eq!(lines(&fs::read(path).unwrap())[0]["tracks"].as_array().unwrap().len(), MAX_TRACKS);
}
