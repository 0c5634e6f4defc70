//! A recording as one page: what is in it, what is left out, and what cannot get into it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use lidar::ObstacleClass;
use messages::{Detections, Message, Sweep, Track, TrackState, TrackTable, Truth};
use support::{RUN, Rooms, Writer, file, recorded, scene, trace};
use tape::{About, Tape, TapeFile};
use viewer::{Limits, Recording, Selection, ViewError, Written, write_page};
use zerocopy::FromZeros;

fn page(recording: &mut Recording, selection: Selection, limits: Limits) -> (Written, String) {
    let mut out = Vec::new();
    let written = write_page(recording, selection, limits, &mut out).unwrap();
    (written, String::from_utf8(out).unwrap())
}

/// What stands in the element of this id.
fn element<'a>(page: &'a str, id: &str) -> Option<&'a str> {
    let (_, rest) = page.split_once(&format!("id=\"{id}\">"))?;
    rest.split_once("</script>").map(|(text, _)| text)
}

fn about_of(page: &str) -> serde_json::Value {
    serde_json::from_str(element(page, "about").unwrap()).unwrap()
}

#[test]
fn a_page_holds_every_sweep_and_names_no_place_in_the_world() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&file(&dir, "run.mcap", &recorded(4))).unwrap();
    assert!(recording.damage().is_empty(), "{:?}", recording.damage());
    let (written, page) = page(&mut recording, Selection::default(), Limits::default());
    assert_eq!((written.selected, written.kept), (4, 4));
    for place in 0..4 {
        let text = element(&page, &format!("sweep-{place}")).unwrap();
        let bytes = STANDARD.decode(text).unwrap();
        assert_eq!(bytes, recording.encoded(place, lidar::MAX_RETURNS).unwrap());
        assert!(bytes.len() < 60_000, "a sweep of the default scene takes {} bytes", bytes.len());
    }
    let row = &recording.rows()[1];
    assert!(row.returns > 5_000 && row.classes[1..].iter().sum::<u32>() > 20, "{row:?}");
    assert_eq!(row.latency_ns, Some(6_000_000 + 37 % 11 * 700_000));
    assert_eq!(about_of(&page)["deadline_ms"], 100.0);
    assert!(page.contains("default-src 'none'") && page.contains("connect-src 'none'"));
    for word in ["http://", "https://", "src=\"", "@import", "url("] {
        assert!(!page.contains(word), "{word}");
    }
}

#[test]
fn what_the_chain_s_tape_writes_is_shown() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("run.mcap");
    let settings = toml::from_str::<TapeFile>(include_str!("../../../config/tape.toml")).unwrap().checked().unwrap();
    let about = About { source: "default.toml".to_owned(), sensor: "hdl-32e".to_owned(), ..About::default() };
    let mut tape = Tape::start(settings, &path, about, None, 1).unwrap();
    let (mut simulator, mut rooms) = (scene(), Rooms::new());
    let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
    let mut table = TrackTable::new_box_zeroed().unwrap();
    let mut found = Vec::new();
    for number in 0..3 {
        sweep.clear();
        truth.clear();
        simulator.sweep(number, &mut sweep, &mut truth);
        rooms.process(number, &sweep);
        let trace = trace(number, 5_000_000 + number);
        tape.sweep(1, &trace, &sweep);
        tape.detections(1, &trace, &rooms.detections);
        table.clear();
        // Of the first sweep the tracker cannot answer.
        table.time_ns = number * 200_000_000;
        for (id, state) in [(7, TrackState::Confirmed), (9, TrackState::Coasting), (8, TrackState::Tentative)] {
            let position_m = [number as f32, 0.0, 0.0];
            table.tracks.push(Track { id, state, position_m, alert: u8::from(id == 9), ..Track::default() }).unwrap();
        }
        tape.tracks(1, &trace, &table);
        let tracks = (number > 0).then_some((2, 1));
        let detections = rooms.detections.detections.len() as u32;
        found.push((sweep.returns.len() as u32, detections, Some(5_000_000 + number), tracks));
    }
    tape.finish(1).unwrap();
    let mut recording = Recording::open(&path).unwrap();
    let rows = recording.rows().iter();
    let read: Vec<_> = rows.map(|row| (row.returns, row.classes.iter().sum(), row.latency_ns, row.tracks)).collect();
    assert_eq!(read, found);
    assert!(recording.damage().is_empty(), "{:?}", recording.damage());
    let (_, text) = page(&mut recording, Selection::default(), Limits::default());
    assert_eq!((&about_of(&text)["source"], &about_of(&text)["sensor"]), (&"default.toml".into(), &"hdl-32e".into()));
}

#[test]
fn a_recording_without_tracks_is_shown_and_says_that_they_are_not_known() {
    let dir = tempfile::tempdir().unwrap();
    let recording = Recording::open(&file(&dir, "run.mcap", &recorded(2))).unwrap();
    assert!(recording.rows().iter().all(|row| row.tracks.is_none() && row.returns > 0));
}

#[test]
fn classes_have_the_colours_that_recordings_have_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&file(&dir, "run.mcap", &recorded(1))).unwrap();
    let (_, text) = page(&mut recording, Selection::default(), Limits::default());
    for (class, told) in ObstacleClass::ALL.iter().zip(about_of(&text)["classes"].as_array().unwrap()) {
        let [red, green, blue] = tape::colour(*class);
        assert_eq!(told["colour"], format!("#{red:02x}{green:02x}{blue:02x}"), "{}", class.name());
        assert_eq!(told["number"], *class as u8);
    }
    let [red, green, blue] = tape::ALERT;
    assert_eq!(about_of(&text)["alert"], format!("#{red:02x}{green:02x}{blue:02x}"));
}

#[test]
fn the_same_recording_gives_the_same_page() {
    let dir = tempfile::tempdir().unwrap();
    let path = file(&dir, "run.mcap", &recorded(2));
    let pages = [(); 2].map(|()| page(&mut Recording::open(&path).unwrap(), Selection::default(), Limits::default()).1);
    assert_eq!(pages[0], pages[1]);
}

#[test]
fn words_of_a_recording_stay_words() {
    let evil = "</script><script>alert(1)</script><!--";
    let mut writer = Writer::new(&[("source", evil), ("sensor", evil), ("deadline_ms", evil)], 1 << 16);
    let empty = Sweep::new_box_zeroed().unwrap();
    writer.sweep(0, &empty);
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&file(&dir, "<img src=x onerror=alert(1)>.mcap", &writer.finish())).unwrap();
    let (_, page) = page(&mut recording, Selection::default(), Limits::default());
    assert!(!page.contains("alert(1)</script>") && !page.contains("<img"));
    assert_eq!(page.matches("<script").count(), 4, "about, overview, one sweep, the script");
    let about = about_of(&page);
    assert_eq!((about["source"].as_str(), &about["deadline_ms"]), (Some(evil), &serde_json::Value::Null));
}

#[test]
fn sweeps_are_left_out_evenly_until_the_rest_fits() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&file(&dir, "run.mcap", &recorded(10))).unwrap();
    let (all, _) = page(&mut recording, Selection::default(), Limits::default());
    let limits = Limits { bytes: all.sweep_bytes * 2 / 5, ..Limits::default() };
    let (written, text) = page(&mut recording, Selection::default(), limits);
    assert!(written.sweep_bytes <= limits.bytes);
    assert_eq!((written.selected, written.kept), (10, 3));
    assert_eq!(about_of(&text)["kept"], serde_json::json!([0, 4, 8]));
    assert_eq!(about_of(&text)["selected"], 10);
    let (one, _) = page(&mut recording, Selection::default(), Limits { bytes: 1, ..limits });
    assert_eq!(one.kept, 1, "one always stays");
}

#[test]
fn a_selection_is_from_a_sweep_on_every_so_many() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&file(&dir, "run.mcap", &recorded(8))).unwrap();
    let (_, text) = page(&mut recording, Selection { first: 1, sweeps: 6, every: 2 }, Limits::default());
    assert_eq!(about_of(&text)["kept"], serde_json::json!([1, 3, 5]));
    let none = recording.select(Selection { first: 8, ..Selection::default() });
    assert!(matches!(none, Err(ViewError::NothingSelected { sweeps: 8, .. })));
}

#[test]
fn what_the_recording_lost_of_a_sweep_is_not_made_up() {
    let mut writer = Writer::new(&RUN, 1 << 16);
    let (sweep, found) = (Sweep::new_box_zeroed().unwrap(), Detections::new_box_zeroed().unwrap());
    writer.sweep(3, &sweep);
    writer.detections(5, &trace(5, 2_000_000), &found);
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&file(&dir, "run.mcap", &writer.finish())).unwrap();
    let said: Vec<_> = recording.rows().iter().map(|row| (row.sweep, row.latency_ns)).collect();
    assert_eq!(said, [(3, None), (5, Some(2_000_000))]);
    assert_eq!(page(&mut recording, Selection::default(), Limits::default()).0.kept, 2);
}

#[test]
fn a_torn_file_gives_its_intact_part_and_says_where_it_breaks_off() {
    let whole = recorded(6);
    let dir = tempfile::tempdir().unwrap();
    for share in [0.3, 0.5, 0.9] {
        let cut = (whole.len() as f64 * share) as usize;
        let mut recording = Recording::open(&file(&dir, "torn.mcap", &whole[..cut])).unwrap();
        let rows = recording.rows().len();
        assert!((1..=6).contains(&rows), "{rows} at {share}");
        assert!(recording.damage()[0].starts_with(&format!("breaks off at byte {cut}")), "{:?}", recording.damage());
        let (_, text) = page(&mut recording, Selection::default(), Limits::default());
        assert_eq!(about_of(&text)["damage"].as_array().unwrap().len(), 1);
    }
}

#[test]
fn a_chunk_whose_sum_is_wrong_is_left_out_and_the_rest_is_there() {
    let mut bytes = recorded(6);
    let half = bytes.len() / 2;
    bytes[half] ^= 0xff;
    let dir = tempfile::tempdir().unwrap();
    let recording = Recording::open(&file(&dir, "run.mcap", &bytes)).unwrap();
    assert_eq!(recording.damage().len(), 1);
    assert!(recording.damage()[0].contains("is left out"), "{:?}", recording.damage());
    assert!((4..=6).contains(&recording.rows().len()));
}

#[test]
fn a_file_that_is_none_of_encke_s_is_refused_in_one_line_that_says_what_it_holds() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |bytes: &[u8]| Recording::open(&file(&dir, "x.mcap", bytes)).err().unwrap().to_string();
    assert!(refused(b"").contains("is no MCAP file"));
    assert!(refused(b"x,y,z\n1,2,3\n").contains("is no MCAP file"));
    let mut other = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let channel = other.add_channel(0, "/camera", "ros1", &std::collections::BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    other.write_to_known_channel(&header, b"?").unwrap();
    other.finish().unwrap();
    let said = refused(&other.into_inner().into_inner());
    assert!(said.contains("holds no sweeps of Encke's, only /camera"), "{said}");
    assert_eq!(said.lines().count(), 1);
    assert!(refused(&Writer::new(&RUN, 1 << 16).finish()).contains("no messages"));
}

#[test]
fn a_layout_of_another_encke_is_named() {
    let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema("encke.Sweep.1", "", &[]).unwrap();
    let channel = writer.add_channel(schema, "/encke/raw/sweep", "encke", &std::collections::BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    writer.write_to_known_channel(&header, b"").unwrap();
    writer.finish().unwrap();
    let dir = tempfile::tempdir().unwrap();
    let error = Recording::open(&file(&dir, "x.mcap", &writer.into_inner().into_inner())).err().unwrap();
    assert!(error.to_string().contains("/encke/raw/sweep is encke.Sweep.1, must be encke.Sweep.3"), "{error}");
}

#[test]
fn bytes_that_anybody_changed_are_survived() {
    let whole = recorded(2);
    let dir = tempfile::tempdir().unwrap();
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for _ in 0..150 {
        let mut bytes = whole.clone();
        for _ in 0..1 + random(4) {
            // The heads of records and chunks matter most: they stand at the start.
            let reach = if random(2) == 0 { 600 } else { bytes.len() };
            let at = random(reach);
            bytes[at] = random(256) as u8;
        }
        if let Ok(mut recording) = Recording::open(&file(&dir, "odd.mcap", &bytes)) {
            let mut out = Vec::new();
            write_page(&mut recording, Selection::default(), Limits::default(), &mut out).unwrap();
        }
    }
}
