//! Results do not depend on how many sectors a sweep travels as, and obstacles are out before the sweep ends.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use support::Run;

/// The same detections and labels to the byte, whatever the number of sectors.
fn assert_same_for_any_number_of_sectors(args: &[&str], sectors: &[u32]) {
    let run = |sectors: u32| {
        let sectors = sectors.to_string();
        let args = [args, &["--pace", "fast", "--sectors", &sectors]].concat();
        let run = Run::new(&args).with_all_rows().finish().expect_code(0);
        assert_eq!(run.missing(), 0);
        (run.bytes, run.labels, run.tracks)
    };
    let whole = run(1);
    assert!(!whole.0.is_empty() && !whole.1.is_empty());
    for &sectors in sectors {
        assert!(run(sectors) == whole, "{sectors} sectors: {args:?}");
    }
}

#[test]
fn a_scene_gives_the_same_bytes_for_any_number_of_sectors() {
    assert_same_for_any_number_of_sectors(&["--sweeps", "10"], &[4, 36, 90]);
    assert_same_for_any_number_of_sectors(&["--from", "config/scenes/spacecraft.toml", "--sweeps", "4"], &[7, 360]);
}

#[test]
fn a_real_capture_gives_the_same_bytes_for_any_number_of_sectors() {
    let Some(monterey) = support::recorded("hdl32e/monterey_hdl32e.pcap") else { return };
    assert_same_for_any_number_of_sectors(&["--from", monterey.to_str().unwrap(), "--sweeps", "6"], &[4, 36, 90]);
    let Some(veloview) = support::recorded("vlp16/veloview_vlp16.pcap") else { return };
    let args = ["--from", veloview.to_str().unwrap(), "--sensor", "vlp-16", "--sweeps", "6"];
    assert_same_for_any_number_of_sectors(&args, &[4, 36, 90]);
}

#[test]
fn clouds_that_cannot_be_cut_travel_in_their_last_sector() {
    for clouds in ["clouds", "nuscenes"] {
        let Some(folder) = support::recorded(clouds) else { return };
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<_> =
            files.filter(|file| file.extension().is_some_and(|end| end == "pcd" || end == "bin")).collect();
        files.sort();
        for file in files.iter().take(2) {
            assert_same_for_any_number_of_sectors(&["--from", file.to_str().unwrap()], &[36]);
        }
    }
}

#[test]
fn obstacles_are_out_long_before_whole_sweeps_would_let_them() {
    let run = |sectors: &str| {
        let args = ["--from", "config/scenes/reference.toml", "--sweeps", "30", "--sectors", sectors];
        let run = Run::new(&args).finish().expect_code(0);
        (run.report["obstacle_latency_ms"]["p50"].as_f64().unwrap(), run.report["deadline"].clone())
    };
    let ((whole_ms, _), (cut_ms, deadline)) = (run("1"), run("36"));
    // Half a period and the work on a whole sweep, against a window and the work on one obstacle.
    assert!(cut_ms < 0.5 * whole_ms, "{cut_ms} ms in sectors, {whole_ms} ms in whole sweeps: {deadline}");
}
