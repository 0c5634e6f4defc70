//! The trace file against the Trace Event Format, read as strictly as viewers read it.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use common::{Sut, settings, start};
use messages::{Detections, Hop, Part, Trace, Verdict};
use recorder::{Recorder, RecorderError, Settings, Snapshot, TraceCounts};
use serde_json::Value;
use stage::Sink;
use zerocopy::FromZeros;

const MS: u64 = 1_000_000;
/// Host time of sweep 0's begin: with nanoseconds that no double of µs holds exactly.
const BEGIN_NS: u64 = 8_123_456_789_012_347;

/// A slice as a viewer has it: start and end [ns], read through a double of µs, which may be a nanosecond short.
#[derive(Clone, Debug, PartialEq)]
struct Slice {
    name: String,
    start_ns: i64,
    end_ns: i64,
    pid: u64,
    tid: u64,
    args: Value,
}

/// A file's events, each checked for the keys and types of its phase.
#[derive(Default)]
struct Found {
    events: u64,
    processes: BTreeMap<u64, String>,
    threads: BTreeMap<(u64, u64), String>,
    slices: Vec<Slice>,
    /// By id: phase and the slice that encloses it.
    flows: BTreeMap<u64, Vec<(String, Slice)>>,
    /// Name, process, arguments.
    instants: Vec<(String, u64, Value)>,
    counters: Vec<f64>,
}

fn ns(value: &Value) -> i64 {
    (value.as_f64().unwrap() * 1_000.0) as i64
}

impl Found {
    fn read(path: &Path) -> Self {
        Self::of(&fs::read(path).unwrap())
    }

    fn of(bytes: &[u8]) -> Self {
        let events: Vec<serde_json::Map<String, Value>> = serde_json::from_slice(bytes).unwrap();
        let mut found = Self { events: events.len() as u64, ..Self::default() };
        let mut flows = Vec::new();
        for event in &events {
            let (name, phase) = (event["name"].as_str().unwrap().to_owned(), event["ph"].as_str().unwrap());
            let (pid, tid) = (event["pid"].as_u64().unwrap(), event["tid"].as_u64().unwrap());
            assert!(pid > 0 && pid <= u64::from(u32::MAX) && tid > 0 && tid <= u64::from(u32::MAX));
            let expected: &[&str] = match phase {
                "M" => &["args"],
                "X" => &["args", "dur", "ts"],
                "i" => &["args", "s", "ts"],
                "C" => &["args", "ts"],
                "s" | "t" => &["cat", "id", "ts"],
                "f" => &["bp", "cat", "id", "ts"],
                phase => panic!("phase {phase:?}"),
            };
            let own = |key: &&String| !["name", "ph", "pid", "tid"].contains(&key.as_str());
            let keys: BTreeSet<&str> = event.keys().filter(own).map(String::as_str).collect();
            assert_eq!(keys, expected.iter().copied().collect(), "{event:?}");
            if let Some(args) = event.get("args") {
                assert!(args.is_object());
            }
            match phase {
                "M" => match name.as_str() {
                    "process_name" => {
                        found.processes.insert(pid, event["args"]["name"].as_str().unwrap().to_owned());
                    }
                    "process_sort_index" => assert!(event["args"]["sort_index"].is_u64()),
                    "thread_name" => {
                        let thread = event["args"]["name"].as_str().unwrap().to_owned();
                        found.threads.insert((pid, tid), thread);
                    }
                    name => panic!("metadata {name}"),
                },
                "X" => {
                    let (start_ns, dur_ns) = (ns(&event["ts"]), ns(&event["dur"]));
                    assert!(dur_ns > 0);
                    let args = event["args"].clone();
                    found.slices.push(Slice { name, start_ns, end_ns: start_ns + dur_ns, pid, tid, args });
                }
                "i" => {
                    assert_eq!(event["s"], "p");
                    found.instants.push((name, pid, event["args"].clone()));
                }
                "C" => found.counters.push(event["args"]["ms"].as_f64().unwrap()),
                _ => {
                    assert_eq!((name.as_str(), &event["cat"]), ("sweep", &Value::from("sweep")));
                    assert!(phase != "f" || event["bp"] == "e");
                    flows.push((event["id"].as_u64().unwrap(), phase.to_owned(), ns(&event["ts"]), tid));
                }
            }
        }
        found.check();
        for (id, phase, at_ns, tid) in flows {
            let encloses = |slice: &&Slice| slice.tid == tid && slice.start_ns <= at_ns && at_ns < slice.end_ns;
            let enclosing: Vec<_> = found.slices.iter().filter(encloses).collect();
            assert_eq!(enclosing.len(), 1, "flow {id} {phase}");
            let enclosing = enclosing[0].clone();
            found.flows.entry(id).or_default().push((phase, enclosing));
        }
        found
    }

    /// Every process and thread has a name, a thread is of one process, and nothing on it overlaps.
    fn check(&self) {
        let mut threads: BTreeMap<u64, Vec<&Slice>> = BTreeMap::new();
        for slice in &self.slices {
            assert!(self.processes.contains_key(&slice.pid) && self.threads.contains_key(&(slice.pid, slice.tid)));
            threads.entry(slice.tid).or_default().push(slice);
        }
        for slices in threads.values_mut() {
            slices.sort_by_key(|slice| slice.start_ns);
            for pair in slices.windows(2) {
                assert!(pair[0].end_ns <= pair[1].start_ns && pair[0].pid == pair[1].pid, "{pair:?}");
            }
        }
    }

    fn names(&self, pid: u64) -> Vec<&str> {
        self.slices.iter().filter(|slice| slice.pid == pid).map(|slice| slice.name.as_str()).collect()
    }
}

/// Sweep after sweep in sectors, 100 ms each; the clusterer and those behind it need `busy_ns` for a part.
struct Chain {
    sectors: u32,
    busy_ns: u64,
    free_ns: [u64; 4],
    incarnation: u32,
    step: u32,
}

impl Chain {
    fn new(sectors: u32, busy_ns: u64) -> Self {
        Self { sectors, busy_ns, free_ns: [0; 4], incarnation: 1, step: 0 }
    }

    fn part(&mut self, sweep: u64, sector: u32) -> Trace {
        let sectors = u64::from(self.sectors);
        let ordinal = sweep * sectors + u64::from(sector);
        let sweep_start_ns = BEGIN_NS + 100 * MS * sweep;
        let due_ns = sweep_start_ns + 100 * MS * u64::from(sector + 1) / sectors;
        let part = Part { ordinal, sweep, sector, sectors: self.sectors, step: self.step, ..Part::default() };
        let mut trace = Trace { part, due_ns, sweep_start_ns, ..Trace::default() };
        let mut sent_ns = due_ns + 10_001;
        let received_ns = due_ns - 100 * MS / sectors;
        trace.push(Hop { received_ns, started_ns: received_ns, finished_ns: sent_ns, ..Hop::default() });
        for stage in 1..4_u16 {
            let free_ns = self.free_ns[usize::from(stage)];
            let received_ns = sent_ns.max(free_ns) + 20_011;
            let started_ns = received_ns + 1_013;
            let finished_ns = started_ns + self.busy_ns;
            let incarnation = if stage == 1 { self.incarnation } else { 1 };
            let hop = Hop { free_ns, received_ns, started_ns, finished_ns, incarnation, stage, ..Hop::default() };
            trace.push(Hop { taken_busy_ns: 1_500, ..hop });
            self.free_ns[usize::from(stage)] = finished_ns + 307;
            sent_ns = finished_ns;
        }
        trace
    }

    fn sweep(&mut self, sweep: u64) -> Vec<Trace> {
        (0..self.sectors).map(|sector| self.part(sweep, sector)).collect()
    }
}

fn message() -> Box<Detections> {
    let mut message = Detections::new_box_zeroed().unwrap();
    message.header.period_ns = 100 * MS;
    message
}

fn accept(recorder: &mut Sut, traces: &[Trace]) {
    let message = message();
    for trace in traces {
        assert_eq!(recorder.accept(trace, &message), Verdict::Complete);
    }
}

fn counts(recorder: &Recorder) -> TraceCounts {
    let mut snapshot = Snapshot::default();
    recorder.snapshot_into(&mut snapshot);
    snapshot.trace.unwrap()
}

fn in_folder(folder: &tempfile::TempDir) -> (PathBuf, Settings) {
    let path = folder.path().join("trace.json");
    (path.clone(), Settings { trace: Some(path), ..settings() })
}

/// What these parts make of a file.
fn recorded(traces: &[Trace]) -> Found {
    let folder = tempfile::tempdir().unwrap();
    let (path, settings) = in_folder(&folder);
    let mut recorder = start(settings).unwrap();
    accept(&mut recorder, traces);
    recorder.finish().unwrap();
    let found = Found::read(&path);
    let TraceCounts { events, lost, failed } = counts(&recorder);
    assert_eq!((events, lost, failed), (found.events, 0, false));
    found
}

// verifies REC-019
#[test]
fn every_part_has_its_slices_in_each_stage_and_every_sweep_a_flow_through_them() {
    for sectors in [1, 4, 36] {
        let mut chain = Chain::new(sectors, 300_007);
        let traces: Vec<Trace> = (0..5).flat_map(|sweep| chain.sweep(sweep)).collect();
        let found = recorded(&traces);
        let processes: Vec<_> = found.processes.iter().map(|(pid, name)| (*pid, name.as_str())).collect();
        let expected = [(1, "simulator"), (2, "clusterer"), (3, "extractor"), (4, "classifier"), (5, "recorder")];
        assert_eq!(processes, expected);
        let parts = 5 * sectors as usize;
        assert_eq!(found.names(1), vec!["make"; parts]);
        for pid in 2..5 {
            assert_eq!(found.names(pid), ["wake-up", "process"].repeat(parts));
        }
        assert_eq!(found.flows.keys().copied().collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
        for (&sweep, flow) in &found.flows {
            let phases: Vec<_> = flow.iter().map(|(phase, slice)| (phase.as_str(), slice.pid)).collect();
            assert_eq!(phases, [("s", 1), ("t", 2), ("t", 3), ("f", 4)]);
            for (place, (_, slice)) in flow.iter().enumerate() {
                assert_eq!(slice.name, if place == 0 { "make" } else { "process" });
                assert_eq!(
                    (slice.args["sweep"].as_u64(), slice.args["sector"].as_u64()),
                    (Some(sweep), Some(u64::from(sectors) - 1))
                );
            }
        }
        let latency_ms = |counter: &f64| (counter - 0.973).abs() < 0.002;
        assert!(found.counters.len() == 5 && found.counters.iter().all(latency_ms), "{:?}", found.counters);
        assert!(found.instants.is_empty());
    }
}

// verifies REC-019
#[test]
fn a_slice_is_where_the_trace_says_to_the_nanosecond() {
    let mut chain = Chain::new(1, 300_007);
    let mut traces = chain.sweep(0);
    traces[0].part.step = 1;
    traces[0].hops[2].verdict = Verdict::PartialFits;
    let folder = tempfile::tempdir().unwrap();
    let (path, settings) = in_folder(&folder);
    let mut recorder = start(settings).unwrap();
    accept(&mut recorder, &traces);
    recorder.finish().unwrap();
    let text = fs::read_to_string(path).unwrap();
    // Sent 100,010,001 ns after the sweep's begin at 8,123,456,789,012,347 ns; each stage began 21,024 ns after that and
    // took 300,007 ns. A nanosecond of it is kept free.
    let expected = concat!(
        r#"{"name":"process","ph":"X","ts":8123456889364.403,"dur":300.006,"pid":3,"tid":3,"#,
        r#""args":{"sweep":0,"sector":0,"verdict":"partial_fits","step":"fewer-starts","taken_ms":0.001}}"#
    );
    let line = text.lines().find(|line| line.contains("partial_fits")).unwrap();
    assert_eq!(line.trim_end_matches(','), expected);
}

// verifies REC-019
#[test]
fn parts_that_wait_together_stand_side_by_side_in_the_queue() {
    // Each part needs 40 ms in three stages, and 36 come in 100 ms.
    let mut chain = Chain::new(36, 40 * MS);
    let traces: Vec<Trace> = (0..2).flat_map(|sweep| chain.sweep(sweep)).collect();
    let found = recorded(&traces);
    let queued = found.slices.iter().filter(|slice| slice.pid == 2 && slice.name == "queued");
    let lanes: BTreeSet<u64> = queued.clone().map(|slice| slice.tid).collect();
    assert_eq!(queued.count(), 71, "all but the first");
    assert_eq!(lanes.len(), 32, "further ones follow one another in the last");
    assert_eq!(found.threads[&(2, 200)], "queue 1");
    assert_eq!(found.names(3).iter().filter(|name| **name == "queued").count(), 0, "the next ones keep up");
    let misses: Vec<_> = found.instants.iter().map(|(name, pid, args)| (name.as_str(), *pid, &args["cause"])).collect();
    let cause = Value::from("clusterer compute");
    assert_eq!(misses, [("deadline miss", 5, &cause), ("deadline miss", 5, &cause)]);
}

// verifies REC-019
#[test]
fn restarts_steps_and_missing_parts_are_instants() {
    let mut chain = Chain::new(2, MS);
    let mut traces = chain.sweep(0);
    chain.step = 2;
    traces.extend(chain.sweep(1));
    chain.incarnation = 2;
    traces.extend(chain.sweep(3));
    let found = recorded(&traces);
    let instants: Vec<_> =
        found.instants.iter().map(|(name, pid, args)| (name.as_str(), *pid, args.to_string())).collect();
    let expected = [
        ("step", 1, r#"{"from":"nominal","to":"paper-features"}"#),
        ("missing", 5, r#"{"first_ordinal":4,"parts":2}"#),
        ("restart", 2, r#"{"incarnation":2}"#),
    ];
    assert_eq!(instants, expected.map(|(name, pid, args)| (name, pid, args.to_owned())));
}

#[test]
fn times_that_contradict_each_other_still_make_a_valid_file() {
    let mut traces = Chain::new(1, MS).sweep(0);
    traces.push(traces[0]);
    let mut backwards = traces[0];
    backwards.hops[1] = Hop { finished_ns: 5, ..backwards.hops[1] };
    traces.push(backwards);
    let mut endless = traces[0];
    endless.hops[1].finished_ns = u64::MAX / 2_048;
    traces.extend([endless, traces[0], Trace::default()]);
    let mut recorder = start(Settings { trace: Some("/dev/null".into()), ..settings() }).unwrap();
    accept(&mut recorder, &traces);
    recorder.finish().unwrap();
    let _ = recorded(&traces[..3]);
}

// verifies REC-020
#[test]
fn a_file_torn_at_any_byte_is_valid_again_after_the_next_life() {
    let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
    let (path, settings) = in_folder(&folder);
    let one_stage = Settings { stages: vec!["replay".into(), "clusterer".into()], ..settings };
    let run = |settings: Settings, sweeps: std::ops::Range<u64>| {
        let mut chain = Chain::new(1, MS);
        let mut recorder = start(settings).unwrap();
        for sweep in sweeps {
            let mut traces = chain.sweep(sweep);
            traces[0].hop_count = 2;
            accept(&mut recorder, &traces);
        }
        recorder.finish().unwrap();
        counts(&recorder).events
    };
    let all = run(one_stage.clone(), 0..3);
    let whole = fs::read(&path).unwrap();
    assert_eq!(Found::of(&whole).events, all);
    for length in 0..=whole.len() {
        fs::write(&path, &whole[..length]).unwrap();
        let events = run(Settings { resume: true, ..one_stage.clone() }, 7..9);
        let found = Found::read(&path);
        assert_eq!(found.flows.keys().rev().take(2).copied().collect::<Vec<_>>(), [8, 7], "torn after {length} bytes");
        let kept = found.events - events;
        // What was there: whole lines, and what of the last one is an event by itself.
        let lines = whole[..length].split(|&byte| byte == b'\n');
        let is_event = |line: &&[u8]| {
            serde_json::from_slice::<Value>(line.strip_suffix(b",").unwrap_or(line))
                .is_ok_and(|value| value.is_object())
        };
        assert_eq!(kept, lines.filter(is_event).count() as u64, "torn after {length} bytes");
        let restarts = found.instants.iter().filter(|(name, ..)| name == "restart").count() as u64;
        assert_eq!(restarts, u64::from(kept > 0), "the recorder's own");
    }
}

// verifies REC-010
#[test]
fn a_file_of_somebody_else_is_no_trace_to_go_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let (path, settings) = in_folder(&folder);
    for text in ["notes\n", "[\n{\"name\":\"process_name\"\n}\nnotes\nnotes\nnotes", "[]", "{\"traceEvents\":[]}"] {
        fs::write(&path, text).unwrap();
        let error = start(Settings { resume: true, ..settings.clone() }).err().unwrap();
        assert!(matches!(error, RecorderError::Foreign { .. }), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
    }
    let same = Settings { detections: Some(path.clone()), ..settings };
    assert!(matches!(start(same).err().unwrap(), RecorderError::SameFile(_)));
}

/// A named pipe that nobody reads yet, and a recorder that writes its trace there.
fn into_pipe(folder: &tempfile::TempDir, lossless: bool) -> (PathBuf, Settings) {
    let (path, settings) = in_folder(folder);
    let mode = rustix::fs::Mode::from_raw_mode(0o600);
    rustix::fs::mkfifoat(rustix::fs::CWD, &path, mode).unwrap();
    (path, Settings { lossless, ..settings })
}

// verifies REC-021
#[test]
fn a_trace_that_nobody_reads_costs_events_and_neither_parts_nor_time() {
    let folder = tempfile::tempdir().unwrap();
    let (path, settings) = into_pipe(&folder, false);
    let mut recorder = start(settings).unwrap();
    let mut chain = Chain::new(36, 10_000);
    // 1,024 wait, some are with the writer, which waits in opening the pipe.
    let traces: Vec<Trace> = (0..60).flat_map(|sweep| chain.sweep(sweep)).collect();
    accept(&mut recorder, &traces);
    let lost = counts(&recorder).lost;
    assert!((60 * 36 - 1_024 - 200..=60 * 36 - 1_024).contains(&lost), "{lost}");
    let text = reader(path);
    recorder.finish().unwrap();
    let found = Found::of(text.join().unwrap().as_bytes());
    assert_eq!(found.names(1).len() as u64, 60 * 36 - lost, "each part is in the file or counted");
    assert_eq!(counts(&recorder).events, found.events);
}

// verifies REC-021
#[test]
fn a_lossless_recorder_waits_for_its_trace() {
    let folder = tempfile::tempdir().unwrap();
    let (path, settings) = into_pipe(&folder, true);
    let mut recorder = start(settings).unwrap();
    let text = reader(path);
    let mut chain = Chain::new(36, 10_000);
    let traces: Vec<Trace> = (0..60).flat_map(|sweep| chain.sweep(sweep)).collect();
    accept(&mut recorder, &traces);
    recorder.finish().unwrap();
    assert_eq!(Found::of(text.join().unwrap().as_bytes()).names(1).len(), 60 * 36);
    assert_eq!(counts(&recorder).lost, 0);
}

fn reader(path: PathBuf) -> std::thread::JoinHandle<String> {
    let read = move || {
        let mut text = String::new();
        fs::File::open(path).unwrap().read_to_string(&mut text).unwrap();
        text
    };
    std::thread::Builder::new().spawn(read).unwrap()
}

// verifies REC-008
#[test]
fn a_full_disk_costs_the_trace_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let detections = folder.path().join("detections.jsonl");
    let full = Settings { trace: Some("/dev/full".into()), detections: Some(detections.clone()), ..settings() };
    let mut recorder = start(full).unwrap();
    accept(&mut recorder, &(0..3).flat_map(|sweep| Chain::new(1, MS).sweep(sweep)).collect::<Vec<_>>());
    let error = recorder.finish().unwrap_err().to_string();
    assert!(error.contains("/dev/full") && error.contains("3 parts lost"), "{error}");
    assert_eq!(counts(&recorder), TraceCounts { events: 0, lost: 3, failed: true });
    assert_eq!(fs::read_to_string(detections).unwrap().lines().count(), 3);
}
