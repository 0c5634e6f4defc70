//! Runs `encke` as its user does: real processes, real shared memory, an instance and a folder of its own each.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "each test file uses what it needs, and may panic")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use serde_json::Value;

static RUNS: AtomicU32 = AtomicU32::new(0);

/// One run of the chain, with a folder for its outputs.
pub struct Run {
    pub dir: tempfile::TempDir,
    pub instance: String,
    args: Vec<String>,
}

/// What a run left behind.
pub struct Finished {
    pub output: Output,
    pub report: Value,
    /// The detections' lines.
    pub detections: Vec<Value>,
    /// The same, as bytes.
    pub bytes: Vec<u8>,
    pub labels: String,
    pub tracks: String,
}

impl Run {
    /// A run with these arguments after `encke run`, writing detections and a report.
    pub fn new(args: &[&str]) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let number = RUNS.fetch_add(1, Ordering::Relaxed);
        let instance = format!("t{}-{number}", std::process::id());
        let mut args: Vec<String> = args.iter().map(|arg| (*arg).to_owned()).collect();
        for (flag, file) in [("--detections", "d.jsonl"), ("--report", "r.json")] {
            args.extend([flag.to_owned(), dir.path().join(file).display().to_string()]);
        }
        args.extend(["--instance".to_owned(), instance.clone()]);
        Self { dir, instance, args }
    }

    /// Also writes labels and tracks.
    pub fn with_all_rows(self) -> Self {
        self.with_file("--labels", "l.csv").with_file("--tracks", "t.jsonl")
    }

    /// Also writes another file into the run's folder.
    pub fn with_file(mut self, flag: &str, file: &str) -> Self {
        self.args.extend([flag.to_owned(), self.dir.path().join(file).display().to_string()]);
        self
    }

    /// Starts it.
    pub fn start(&self) -> Child {
        self.start_with(|encke| encke)
    }

    /// Starts it by another command that is made of its own.
    pub fn start_with(&self, wrap: impl FnOnce(Command) -> Command) -> Child {
        let mut command = encke();
        command.arg("run").args(&self.args);
        let mut command = wrap(command);
        command.current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Runs it to its end.
    pub fn finish(self) -> Finished {
        let child = self.start();
        self.collect(child)
    }

    /// Waits for its end and reads what it left.
    pub fn collect(self, child: Child) -> Finished {
        self.collect_and_keep(child).0
    }

    /// The same, and gives the folder with all that it wrote.
    pub fn collect_and_keep(self, mut child: Child) -> (Finished, tempfile::TempDir) {
        // A run that hangs is a failure, not a long test. Its output fits into the pipes.
        let mut looks = 0;
        while child.try_wait().unwrap().is_none() {
            looks += 1;
            if looks > 6_000 {
                child.kill().unwrap();
                panic!("the run did not end within 120 s: {}", text(&child.wait_with_output().unwrap().stderr));
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let output = child.wait_with_output().unwrap();
        let read = |file: &str| std::fs::read(self.dir.path().join(file)).unwrap_or_default();
        let bytes = read("d.jsonl");
        let lines = std::str::from_utf8(&bytes).unwrap().lines();
        let detections = lines.map(|line| serde_json::from_str(line).unwrap()).collect();
        let report = serde_json::from_slice(&read("r.json")).unwrap_or(Value::Null);
        let [labels, tracks] = ["l.csv", "t.jsonl"].map(|file| String::from_utf8(read(file)).unwrap());
        let left = leftovers(&self.instance);
        assert!(left.is_empty(), "left in shared memory or on disk: {left:?}");
        (Finished { output, report, detections, bytes, labels, tracks }, self.dir)
    }

    /// Waits until the source has sent so many sweeps.
    pub fn wait_for_sweeps(&self, sweeps: u64) {
        self.wait_for(|status| status["sweep"].as_u64().unwrap() >= sweeps);
    }

    /// Waits until the running chain's status is as wanted.
    pub fn wait_for(&self, wanted: impl Fn(&Value) -> bool) {
        for _ in 0..1_500 {
            if self.status().is_some_and(|status| wanted(&status)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("the chain did not get there in 30 s: {:?}", self.status());
    }

    /// The same, or until the run has ended by itself.
    pub fn wait_for_or_end(&self, child: &mut Child, wanted: impl Fn(&Value) -> bool) {
        for _ in 0..1_500 {
            let ended = child.try_wait().unwrap().is_some();
            if ended || self.status().is_some_and(|status| wanted(&status)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("the chain neither got there nor ended in 30 s: {:?}", self.status());
    }

    /// The running chain's status; none before it is up.
    pub fn status(&self) -> Option<Value> {
        let output = encke().args(["ctl", "status", "--json", "--instance", &self.instance]).output().unwrap();
        serde_json::from_slice(&output.stdout).ok()
    }

    /// Sweeps that the recorder has received in full; 0 before the chain is up.
    pub fn answered(&self) -> u64 {
        self.status()
            .map_or(0, |status| status["stages"][4]["received"].as_u64().unwrap() / status["sectors"].as_u64().unwrap())
    }

    /// Waits until so many more sweeps have come to the recorder.
    pub fn wait_for_more(&self, sweeps: u64) {
        let before = self.answered();
        self.wait_for(|_| self.answered() >= before + sweeps);
    }

    /// Puts a fault into it.
    pub fn inject(&self, args: &[&str]) {
        let output = encke().arg("inject").args(args).args(["--instance", &self.instance]).output().unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
    }

    /// Puts a fault into it as soon as it has the process that the fault is for.
    pub fn inject_when_up(&self, args: &[&str]) {
        let mut inject = encke();
        inject.arg("inject").args(args).args(["--instance", &self.instance]);
        for _ in 0..1_500 {
            if inject.output().unwrap().status.success() {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("no process for {args:?} in 30 s");
    }
}

impl Run {
    /// Commands it; what it answers.
    pub fn ctl(&self, args: &[&str]) -> String {
        let output = encke().arg("ctl").args(args).args(["--instance", &self.instance]).output().unwrap();
        assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
        text(&output.stdout)
    }

    /// The running chain's mode, once it is in effect.
    pub fn wait_for_mode(&self, mode: &str) {
        self.wait_for(|status| status["mode"] == mode && !status["mode_took_ms"].is_null());
    }

    /// What stands in the running chain's log so far.
    pub fn events(&self) -> Vec<Value> {
        let dir = transport::Instance::named(&self.instance).unwrap().dir().to_owned();
        let text = std::fs::read_to_string(dir.join("events.jsonl")).unwrap();
        // The last line may be under way.
        text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    }
}

impl Finished {
    /// Whether all rows of all sweeps are the same to the byte.
    pub fn has_rows_of(&self, other: &Self) -> bool {
        self.bytes == other.bytes && self.labels == other.labels && self.tracks == other.tracks
    }

    /// Asserts its exit code, showing what it said otherwise.
    pub fn expect_code(self, code: i32) -> Self {
        assert_eq!(self.output.status.code(), Some(code), "{}{}", self.stdout(), self.stderr());
        self
    }

    pub fn stdout(&self) -> String {
        text(&self.output.stdout)
    }

    pub fn stderr(&self) -> String {
        text(&self.output.stderr)
    }

    /// Whether the ledger says that every part has its place.
    pub fn is_closed(&self) -> bool {
        self.report["ledger"]["closed"] == true
    }

    /// A hop of the ledger, by the stage that reads.
    pub fn hop(&self, stage: &str) -> &Value {
        self.report["ledger"]["hops"].as_array().unwrap().iter().find(|hop| hop["stage"] == stage).unwrap()
    }

    /// Parts dropped or lost on any hop.
    pub fn missing(&self) -> u64 {
        let hops = self.report["ledger"]["hops"].as_array().unwrap().iter();
        hops.map(|hop| hop["lost"].as_u64().unwrap() + sum(&hop["dropped"])).sum()
    }

    /// Asserts that each sweep has a line or is named among what is missing.
    pub fn expect_every_sweep_accounted_for(&self) {
        let lines = self.sweeps();
        assert!(lines.windows(2).all(|pair| pair[0] < pair[1]), "sweep numbers go on rising");
        let gaps = self.report["ledger"]["gaps"].as_array().unwrap();
        let named = |sweep: u64| {
            let number = |gap: &Value, key: &str| gap[key].as_u64().unwrap();
            gaps.iter().any(|gap| (number(gap, "first_sweep")..=number(gap, "last_sweep")).contains(&sweep))
        };
        for sweep in 0..self.report["sweeps"].as_u64().unwrap() {
            assert!(named(sweep) || lines.binary_search(&sweep).is_ok(), "sweep {sweep}: {}", self.stdout());
        }
        let partial = self.detections.iter().filter(|line| line["complete"] != true).count() as u64;
        let hops = self.report["ledger"]["hops"].as_array().unwrap().iter();
        let rejected: u64 = hops.map(|hop| sum(&hop["rejected"])).sum();
        assert!(partial <= self.missing() + rejected, "{partial} partial sweeps: {}", self.stdout());
    }

    /// A process of the report.
    pub fn process(&self, stage: &str) -> &Value {
        self.report["processes"].as_array().unwrap().iter().find(|process| process["stage"] == stage).unwrap()
    }

    /// The sweeps that have a line, in the order of the file.
    pub fn sweeps(&self) -> Vec<u64> {
        self.detections.iter().map(|line| line["sweep"].as_u64().unwrap()).collect()
    }
}

/// The line of chain.toml that has the ladder of overload, and one without steps.
pub const LADDER: &str = r#"steps = ["fewer-starts", "paper-features", "clusters-only", "every-second-sweep"]"#;
pub const NO_LADDER: &str = "steps = []";

/// A copy of the shipped configuration with some lines of chain.toml changed.
pub fn chain_with(changes: &[(&str, &str)]) -> (tempfile::TempDir, String) {
    let dir = tempfile::tempdir().unwrap();
    let mut text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/config/chain.toml")).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from:?} stands in chain.toml");
        text = text.replace(from, to);
    }
    let path = dir.path().join("chain.toml");
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap().to_owned();
    (dir, path)
}

/// The sum of an object's numbers.
pub fn sum(object: &Value) -> u64 {
    object.as_object().unwrap().values().map(|value| value.as_u64().unwrap()).sum()
}

/// The executable under test.
pub fn encke() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_encke"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null());
    command
}

/// Kills a process of this test.
pub fn kill(pid: u64) {
    let pid = rustix::process::Pid::from_raw(pid as i32).unwrap();
    rustix::process::kill_process(pid, rustix::process::Signal::KILL).unwrap();
}

/// What an instance left in shared memory or on disk.
pub fn leftovers(instance: &str) -> Vec<String> {
    let instance = transport::Instance::named(instance).unwrap();
    let mut left = instance.shared_memory();
    left.extend(instance.dir().exists().then(|| instance.dir().display().to_string()));
    left
}

/// A file of the recorded data: in `$ENCKE_DATA`, or `../shared/data` beside the repository. None, with a word about
/// it, where the data are not there; with `ENCKE_DATA_REQUIRED` set that is a failure.
pub fn recorded(path: &str) -> Option<PathBuf> {
    let root = std::env::var_os("ENCKE_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let file = root.join(path);
    if file.exists() {
        return Some(file);
    }
    assert!(std::env::var_os("ENCKE_DATA_REQUIRED").is_none(), "{}: recorded data are required", file.display());
    eprintln!("skipped: {} is not there (set ENCKE_DATA to the folder of recorded data)", file.display());
    None
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}
