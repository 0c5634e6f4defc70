//! The rules of ARCHITECTURE.md that no compiler checks.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Bottom to top: a crate of `shared/` may use only those before it.
const LAYERS: [&str; 7] = ["lidar", "messages", "stage", "events", "chain", "transport", "runtime"];
/// Rooms without IPC, clock, thread, file or log.
const PURE: [&str; 6] = ["simulator", "clusterer", "extractor", "classifier", "tracker", "faults"];
/// What a pure room must not depend on.
const IMPURE: [&str; 16] = [
    "chain",
    "transport",
    "runtime",
    "supervisor",
    "recorder",
    "replay",
    "ground",
    "iceoryx2",
    "memmap2",
    "rustix",
    "signal-hook",
    "crossbeam-channel",
    "tracing",
    "tracing-subscriber",
    "tempfile",
    "rayon",
];
/// Words that no pure room's code may hold.
const IMPURE_WORDS: [&str; 6] = ["std::fs", "std::net", "std::thread", "std::time", "std::process", "std::env"];
/// Where `unsafe` may stand.
const UNSAFE: [&str; 3] =
    ["shared/transport/src/outlet.rs", "shared/transport/src/wire.rs", "shared/runtime/src/page/map.rs"];
/// Where time may be read and threads may be started.
const CLOCK: &str = "shared/runtime/src/clock.rs";
const THREADS: [&str; 4] =
    ["services/supervisor/src", "services/recorder/src", "services/ground/src", "services/replay/src/live"];
/// Longest file of code, tests apart.
const MAX_LINES: usize = 500;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All source files of the product (not tests and benches), relative to the root, with their code: what stands before
/// their unit tests.
fn sources() -> Vec<(String, String)> {
    let mut files = Vec::new();
    for folder in ["services", "shared"] {
        collect(&root().join(folder), &mut files);
    }
    files.sort();
    let relative = |path: &PathBuf| path.strip_prefix(root()).unwrap().display().to_string();
    let code = |path: &PathBuf| {
        let text = fs::read_to_string(path).unwrap();
        text.split("#[cfg(test)]\nmod tests").next().unwrap().to_owned()
    };
    files.iter().map(|path| (relative(path), code(path))).collect()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() && !["target", "tests", "benches", "examples"].contains(&name) {
            collect(&path, files);
        } else if path.extension().is_some_and(|extension| extension == "rs") && name != "tests.rs" {
            files.push(path);
        }
    }
}

/// A code line, without comments and doc comments.
fn code_lines(code: &str) -> impl Iterator<Item = &str> {
    code.lines().filter(|line| !line.trim_start().starts_with("//"))
}

fn dependencies(manifest: &str) -> Vec<String> {
    let table: toml::Table = fs::read_to_string(root().join(manifest)).unwrap().parse().unwrap();
    table["dependencies"].as_table().unwrap().keys().cloned().collect()
}

#[test]
fn a_shared_crate_uses_only_those_below_it() {
    for (height, layer) in LAYERS.iter().enumerate() {
        for dependency in dependencies(&format!("shared/{layer}/Cargo.toml")) {
            assert!(!LAYERS[height..].contains(&dependency.as_str()), "{layer} uses {dependency}");
            assert!(!root().join("services").join(&dependency).exists(), "{layer} uses the service {dependency}");
        }
    }
}

#[test]
fn pure_rooms_depend_on_nothing_that_could_touch_the_world() {
    for room in PURE {
        for dependency in dependencies(&format!("services/{room}/Cargo.toml")) {
            assert!(!IMPURE.contains(&dependency.as_str()), "{room} uses {dependency}");
            assert!(!root().join("services").join(&dependency).exists(), "{room} uses the room {dependency}");
        }
    }
    for (path, code) in sources() {
        if PURE.iter().any(|room| path.starts_with(&format!("services/{room}/"))) {
            for line in code_lines(&code) {
                assert!(!IMPURE_WORDS.iter().any(|word| line.contains(word)), "{path}: {line}");
            }
        }
    }
}

#[test]
fn only_transport_names_iceoryx2() {
    for (path, code) in sources() {
        if !path.starts_with("shared/transport/") {
            assert!(!code_lines(&code).any(|line| line.contains("iceoryx2::")), "{path}");
        }
    }
}

#[test]
fn unsafe_stands_where_it_may_and_says_why() {
    let mut found = BTreeMap::new();
    for (path, code) in sources() {
        let count = code_lines(&code).filter(|line| line.contains("unsafe ")).count();
        if count > 0 {
            found.insert(path, count);
        }
    }
    let files: Vec<&str> = found.keys().map(String::as_str).collect();
    let mut allowed = UNSAFE.to_vec();
    allowed.sort_unstable();
    assert_eq!(files, allowed);
}

#[test]
fn time_is_read_in_one_file_and_threads_start_in_few_rooms() {
    for (path, code) in sources() {
        for line in code_lines(&code) {
            let reads = ["Instant::now", "SystemTime::now", "clock_gettime("].iter().any(|word| line.contains(word));
            assert!(!reads || path == CLOCK, "{path}: {line}");
            let starts = ["thread::spawn", "thread::Builder", "thread::scope", "thread::{"];
            let starts = starts.iter().any(|word| line.contains(word));
            assert!(!starts || THREADS.iter().any(|room| path.starts_with(room)), "{path}: {line}");
        }
    }
}

#[test]
fn no_file_outgrows_its_reader() {
    for (path, code) in sources() {
        let lines = code.lines().count();
        assert!(lines <= MAX_LINES, "{path} has {lines} lines: which room should part of it have been?");
    }
}

#[test]
fn every_service_has_its_note() {
    for entry in fs::read_dir(root().join("services")).unwrap() {
        let room = entry.unwrap().path();
        assert!(room.join("README.md").exists() || room.ends_with("encke"), "{}", room.display());
    }
}
