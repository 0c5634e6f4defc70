//! What `--record` keeps: lossless, in files that other readers open, whatever dies or fills up.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};
use serde_json::Value;
use support::Run;

const RAW_SWEEP: &str = "/encke/raw/sweep";

/// The sequence numbers of every topic's messages, up to the file's end or its tear; and whether it ends as it should.
fn read(file: &Path) -> (BTreeMap<String, Vec<u32>>, bool) {
    let bytes = std::fs::read(file).unwrap();
    let mut reader = LinearReader::new();
    let (mut at, mut channels, mut found) = (0, BTreeMap::new(), BTreeMap::<String, Vec<u32>>::new());
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let given = wanted.min(bytes.len() - at);
                reader.insert(wanted)[..given].copy_from_slice(&bytes[at..at + given]);
                reader.notify_read(given);
                at += given;
            }
            Ok(LinearReadEvent::Record { data, opcode }) => match mcap::parse_record(opcode, data).unwrap() {
                mcap::records::Record::Channel(channel) => _ = channels.insert(channel.id, channel.topic),
                mcap::records::Record::Message { header, .. } => {
                    found.entry(channels[&header.channel_id].clone()).or_default().push(header.sequence);
                }
                _ => {}
            },
            Err(_) => return (found, false),
        }
    }
    (found, true)
}

/// The recording's files, in the order of their names, which is that of time.
fn files(dir: &tempfile::TempDir) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "mcap")).collect();
    files.sort();
    files
}

/// Messages of each topic as the report counts them.
fn reported(report: &Value, what: &str) -> BTreeMap<String, u64> {
    let topics = report["recording"]["topics"].as_array().unwrap().iter();
    topics
        .map(|of| (of["topic"].as_str().unwrap().to_owned(), of[what].as_u64().unwrap_or(0)))
        .filter(|(_, messages)| *messages > 0)
        .collect()
}

fn recording(args: &[&str]) -> Run {
    Run::new(args).with_all_rows().with_file("--record", "run.mcap")
}

#[test]
fn a_recording_that_is_replayed_gives_the_same_bytes() {
    let from = |path: &str| support::recorded(path).map(|path| path.to_str().unwrap().to_owned());
    let sources = [
        Some("config/scenes/default.toml".to_owned()),
        Some("config/scenes/spacecraft.toml".to_owned()),
        from("hdl32e/monterey_hdl32e.pcap"),
        from("clouds/fast_gicp_251370668.pcd"),
        from("nuscenes/n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd.bin"),
    ];
    for source in sources.iter().flatten() {
        let args = ["--from", source, "--sweeps", "8", "--pace", "fast"];
        let run = recording(&args);
        let child = run.start();
        let (first, dir) = run.collect_and_keep(child);
        let first = first.expect_code(0);
        assert!(!first.bytes.is_empty(), "{source}");
        let file = dir.path().join("run.mcap");
        // Another number of sectors, so that the second recording is of sweeps that were cut otherwise.
        let again = ["--from", file.to_str().unwrap(), "--pace", "fast", "--sectors", "7"];
        let run = recording(&again);
        let child = run.start();
        let (second, dir) = run.collect_and_keep(child);
        let second = second.expect_code(0);
        assert!(second.has_rows_of(&first), "{source}");
        let file = dir.path().join("run.mcap");
        let third =
            Run::new(&["--from", file.to_str().unwrap(), "--pace", "fast"]).with_all_rows().finish().expect_code(0);
        assert!(third.has_rows_of(&first), "{source}, recorded twice");
    }
}

#[test]
fn another_reader_finds_as_many_messages_as_the_report_counts() {
    for pace in ["fast", "realtime"] {
        let run = recording(&["--sweeps", "12", "--pace", pace]);
        let child = run.start();
        let (finished, dir) = run.collect_and_keep(child);
        let finished = finished.expect_code(0);
        let (found, whole) = read(&dir.path().join("run.mcap"));
        assert!(whole);
        let found: BTreeMap<String, u64> = found.iter().map(|(topic, all)| (topic.clone(), all.len() as u64)).collect();
        assert_eq!(found, reported(&finished.report, "messages"));
        for topic in ["sweep", "clusters", "detections", "tracks", "truth", "raw/sweep", "raw/detections", "raw/tracks"]
        {
            // At real time the tape stands back behind everybody else, and counts what that costs.
            let topic = format!("/encke/{topic}");
            let lost = reported(&finished.report, "lost").get(&topic).copied().unwrap_or(0);
            assert_eq!(found[&topic] + lost, 12, "{topic}");
            assert!(lost == 0 || pace == "realtime", "{topic}");
        }
        assert!(found["/encke/status"] >= 1);
    }
}

#[test]
fn what_passes_between_the_stages_is_kept_where_asked_for() {
    let (dir, chain) = support::chain_with(&[]);
    let shipped = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/config/tape.toml")).unwrap();
    let (from, to) = (r#""raw/detections"]"#, r#""raw/detections", "raw/clusters", "raw/descriptors"]"#);
    assert!(shipped.contains(from));
    std::fs::write(dir.path().join("tape.toml"), shipped.replace(from, to)).unwrap();
    let run = recording(&["--sweeps", "4", "--pace", "fast", "--sectors", "9", "--chain", &chain]);
    let child = run.start();
    let (finished, folder) = run.collect_and_keep(child);
    finished.expect_code(0);
    let (found, _) = read(&folder.path().join("run.mcap"));
    assert_eq!((found["/encke/raw/clusters"].len(), found["/encke/raw/descriptors"].len()), (36, 36));
}

#[test]
fn a_tape_that_dies_at_fast_pace_has_kept_every_sweep_and_changed_no_byte() {
    let args = ["--from", "config/scenes/box.toml", "--sweeps", "300", "--pace", "fast"];
    let plain = Run::new(&args).with_all_rows().finish().expect_code(0);
    let run = recording(&args);
    let mut child = run.start();
    run.wait_for_sweeps(5);
    run.inject(&["slow", "classifier", "--by", "5ms"]);
    let mut deaths = 0;
    for _ in 0..4 {
        let kill = ["inject", "kill", "tape", "--instance", &run.instance];
        deaths += u64::from(support::encke().args(kill).output().unwrap().status.success());
        let before = run.answered();
        run.wait_for_or_end(&mut child, |_| run.answered() >= before + 5);
    }
    let mut sweeps = Vec::new();
    let (finished, dir) = run.collect_and_keep(child);
    let finished = finished.expect_code(0);
    assert!(deaths >= 3, "{deaths} deaths are no test");
    assert_eq!(finished.report["recording"]["restarts"], deaths);
    assert!(finished.has_rows_of(&plain));
    for file in files(&dir) {
        sweeps.extend(read(&file).0.remove(RAW_SWEEP).unwrap_or_default());
    }
    sweeps.sort_unstable();
    sweeps.dedup();
    assert_eq!(sweeps, (0..300).collect::<Vec<u32>>());
    // And replayed as a folder the torn files are one recording again.
    let pattern = dir.path().join("*.mcap");
    let again =
        Run::new(&["--from", pattern.to_str().unwrap(), "--pace", "fast"]).with_all_rows().finish().expect_code(0);
    assert!(again.has_rows_of(&plain));
}

#[test]
fn a_recording_that_cannot_be_written_fails_by_itself_and_the_chain_goes_on() {
    let run = Run::new(&["--sweeps", "12", "--record", "/dev/full"]).finish().expect_code(1);
    assert!(run.is_closed());
    assert_eq!((run.missing(), run.sweeps().len()), (0, 12));
    assert!(
        run.report["recording"]["failure"].as_str().unwrap().contains("No space left"),
        "{}",
        run.report["recording"]
    );
    assert_eq!(reported(&run.report, "lost")[RAW_SWEEP], 12);
    assert!(run.stderr().contains("No space left"), "{}", run.stderr());
}

#[test]
fn a_tape_that_dies_at_real_time_counts_each_sweep_once_as_kept_or_lost() {
    let run = recording(&["--duration", "forever", "--from", "config/scenes/single.toml"]);
    let child = run.start();
    run.wait_for_sweeps(15);
    run.inject(&["kill", "tape"]);
    run.wait_for_more(15);
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    let (run, dir) = run.collect_and_keep(child);
    let run = run.expect_code(0);
    assert_eq!((run.missing(), run.report["recording"]["restarts"].as_u64()), (0, Some(1)));
    let (kept, lost) = (reported(&run.report, "messages"), reported(&run.report, "lost"));
    let lost = lost.get(RAW_SWEEP).copied().unwrap_or(0);
    assert_eq!(kept[RAW_SWEEP] + lost, run.report["sweeps"].as_u64().unwrap(), "{lost} lost");
    let found: usize = files(&dir).iter().map(|file| read(file).0.get(RAW_SWEEP).map_or(0, Vec::len)).sum();
    assert_eq!(found as u64, kept[RAW_SWEEP], "what a kill left in an open chunk is in no file");
}

#[test]
fn a_stopped_tape_costs_the_chain_nothing_and_names_what_it_lost() {
    let run = recording(&["--duration", "forever", "--from", "config/scenes/single.toml"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    run.inject(&["stop", "tape", "--for", "1500ms"]);
    run.wait_for_more(5);
    let stop = support::encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    let run = run.collect(child).expect_code(0);
    assert_eq!((run.missing(), run.report["deadline"]["misses"].as_u64()), (0, Some(0)), "{}", run.stdout());
    let (kept, lost) = (reported(&run.report, "messages"), reported(&run.report, "lost"));
    assert!(lost[RAW_SWEEP] >= 5, "a queue of four sweeps, and fifteen came: {lost:?}");
    assert_eq!(kept[RAW_SWEEP] + lost[RAW_SWEEP], run.report["sweeps"].as_u64().unwrap());
}
