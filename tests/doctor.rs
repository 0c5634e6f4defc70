//! `encke doctor`, and a chain that asks the kernel for more than it may grant. Whether it is granted depends on who runs
//! the tests, so each holds either way.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use support::{Run, encke, text};

/// A chain file beside a copy of nothing: what it names is found in `./config`. `asks` says whether it asks for everything
/// that there is, a core that no machine has included.
fn chain(dir: &Path, asks: bool) -> PathBuf {
    let shipped = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("config/chain.toml")).unwrap();
    let path = dir.join("chain.toml");
    let written = if asks {
        let seat = |at: &str, seat: &str| format!("{at}\nrealtime = {seat}");
        let mut text = shipped
            .replacen("lock_memory = false", "lock_memory = true", 1)
            .replacen("prefault = false", "prefault = true\nsupervisor = { priority = 50 }", 1)
            .replacen("sweeps = 100", &seat("sweeps = 100", "{ priority = 20 }"), 1);
        for stage in ["clusterer", "extractor", "classifier", "tracker"] {
            let at = format!("parameters = \"stages/{stage}.toml\"");
            assert!(text.contains(&at));
            text = text.replacen(&at, &seat(&at, "{ priority = 40 }"), 1);
        }
        text + "realtime = { core = 1023 }\n"
    } else {
        shipped
    };
    fs::write(&path, written).unwrap();
    path
}

/// Examines the machine for a chain; the JSON and the exit code.
fn examine(chain: &Path) -> (Value, i32) {
    let output = encke().args(["doctor", "--json", "--chain"]).arg(chain).output().unwrap();
    let report = serde_json::from_slice(&output.stdout);
    (report.unwrap_or_else(|_| panic!("{}", text(&output.stderr))), output.status.code().unwrap())
}

fn checks(report: &Value) -> &Vec<Value> {
    report["checks"].as_array().unwrap()
}

#[test]
fn every_line_that_is_not_ok_has_a_remedy_and_only_a_failure_ends_in_1() {
    let dir = tempfile::tempdir().unwrap();
    for asks in [false, true] {
        let (report, code) = examine(&chain(dir.path(), asks));
        let states: Vec<&str> = checks(&report).iter().map(|check| check["state"].as_str().unwrap()).collect();
        assert_eq!(code, i32::from(states.contains(&"fail")), "{report}");
        assert_eq!(report["can_run"], code == 0);
        for check in checks(&report) {
            let is_ok = check["state"] == "ok";
            assert!(["ok", "warn", "fail"].contains(&check["state"].as_str().unwrap()), "{check}");
            assert!(!check["found"].as_str().unwrap().is_empty(), "{check}");
            assert_eq!(check["remedy"].is_null(), is_ok, "{check}");
        }
    }
}

#[test]
fn the_machine_is_looked_at_from_all_sides() {
    let dir = tempfile::tempdir().unwrap();
    let (report, _) = examine(&chain(dir.path(), false));
    let names: Vec<&str> = checks(&report).iter().map(|check| check["check"].as_str().unwrap()).collect();
    for name in [
        "chain",
        "kernel",
        "cores",
        "CPU quota",
        "processor",
        "frequency",
        "clocksource",
        "huge pages",
        "real-time",
        "RLIMIT_RTPRIO",
        "RLIMIT_MEMLOCK",
        "swap",
        "open files",
        "shared memory",
        "RemoveIPC",
        "instances",
        "left over",
        "noise",
        "schedstat",
    ] {
        assert!(names.contains(&name), "{name} is not among {names:?}");
    }
    let bill = report["shared_memory"].as_array().unwrap();
    assert_eq!(bill.len(), 6, "sweeps, truth, and what four stages write");
    for hop in bill {
        assert!(hop["touched_bytes"].as_u64() < hop["virtual_bytes"].as_u64(), "{hop}");
    }
}

#[test]
fn what_a_chain_asks_for_and_would_be_refused_is_explained() {
    let dir = tempfile::tempdir().unwrap();
    let (report, _) = examine(&chain(dir.path(), true));
    let asked: Vec<&Value> = checks(&report).iter().filter(|check| check["check"] == "chain.toml asks").collect();
    let core = asked.iter().find(|check| check["found"].as_str().unwrap().contains("core 1023")).unwrap();
    assert!(core["found"].as_str().unwrap().contains("recorder"), "{core}");
    assert!(core["remedy"].as_str().unwrap().contains("chain.toml"), "{core}");
    let (report, _) = examine(&chain(dir.path(), false));
    let asked = checks(&report).iter().find(|check| check["check"] == "chain.toml asks").unwrap();
    assert_eq!(asked["state"], "ok");
}

#[test]
fn a_chain_that_asks_for_more_than_it_is_granted_runs_to_its_end_and_warns_once_of_each_setting() {
    let dir = tempfile::tempdir().unwrap();
    let path = chain(dir.path(), true);
    let chain = path.display().to_string();
    let done = Run::new(&["--chain", &chain, "--sweeps", "20", "--pace", "fast"]).finish().expect_code(0);
    assert!(done.is_closed());
    assert_eq!(done.sweeps(), (0..20).collect::<Vec<_>>());
    let refused: Vec<&str> =
        done.report["realtime_refused"].as_array().unwrap().iter().map(|line| line.as_str().unwrap()).collect();
    let stderr = done.stderr();
    for (setting, certain) in [("core 1023", true), ("real-time priority", false), ("lock_memory", false)] {
        let said = stderr.lines().filter(|line| line.contains(setting) && line.contains("refused for")).count();
        let reported = refused.iter().filter(|line| line.starts_with(setting)).count();
        assert_eq!(said, reported, "{setting}: {stderr}");
        assert!(said <= 1 && (said == 1 || !certain), "{setting}: {stderr}");
    }
    // The doctor foresees what happens.
    let (report, _) = examine(&path);
    let foreseen =
        checks(&report).iter().filter(|check| check["check"] == "chain.toml asks" && check["state"] == "warn");
    assert_eq!(foreseen.count(), refused.len(), "{refused:?}");
}

#[test]
fn a_chain_that_asks_for_nothing_is_refused_nothing_and_reports_the_kernels_figures() {
    let done = Run::new(&["--sweeps", "15"]).finish().expect_code(0);
    assert!(done.report["realtime_refused"].as_array().unwrap().is_empty());
    assert!(!done.stderr().contains("refused for"), "{}", done.stderr());
    let load = &done.report["machine_load"];
    for share in ["own_cpu_pct", "foreign_cpu_pct", "steal_pct"] {
        assert!(load[share].as_f64().unwrap() >= 0.0, "{load}");
    }
    assert!(done.report["noise_ms"]["count"].as_u64().unwrap() > 10);
    for stage in ["source", "clusterer", "extractor", "classifier", "tracker", "recorder", "supervisor"] {
        let process = done.process(stage);
        assert!(process["voluntary_switches"].as_u64().unwrap() > 0, "{process}");
        assert!(process["run_delay_ms"].is_null() || process["run_delay_ms"].as_f64().unwrap() >= 0.0, "{process}");
    }
}

#[test]
fn an_instance_left_by_a_dead_run_is_named_and_left_to_the_next() {
    // A folder of its own, so that no other run can tidy it up meanwhile.
    let dir = tempfile::Builder::new().prefix("d").tempdir_in("/tmp").unwrap();
    let left = dir.path().join("encke/dead-run");
    let private = |path: &Path| fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(0o700)).unwrap();
    fs::create_dir_all(&left).unwrap();
    private(&dir.path().join("encke"));
    private(&left);
    let output = encke().args(["doctor", "--json"]).env("XDG_RUNTIME_DIR", dir.path()).output().unwrap();
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let check = checks(&report).iter().find(|check| check["check"] == "left over").unwrap();
    assert!(check["found"].as_str().unwrap().contains("dead-run"), "{check}");
    assert!(left.exists(), "a doctor changes nothing");
    // A folder that others may enter is no place for instances.
    fs::set_permissions(dir.path().join("encke"), std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let output = encke().args(["doctor", "--json"]).env("XDG_RUNTIME_DIR", dir.path()).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stdout));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let check = checks(&report).iter().find(|check| check["check"] == "instances").unwrap();
    assert_eq!(check["state"], "fail");
}

#[test]
fn a_chain_that_cannot_be_read_is_refused_and_one_that_cannot_be_built_fails() {
    let dir = tempfile::tempdir().unwrap();
    let path = chain(dir.path(), false);
    let shipped = fs::read_to_string(&path).unwrap();
    fs::write(&path, shipped.replacen("prefault = false", "prefault = false\nsupervisor = { priority = 100 }", 1))
        .unwrap();
    let output = encke().args(["doctor", "--chain"]).arg(&path).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("realtime.priority is 100"), "{}", text(&output.stderr));
    fs::write(&path, shipped.replacen(r#"name = "extractor""#, r#"name = "extraktor""#, 1)).unwrap();
    let (report, code) = examine(&path);
    assert_eq!(code, 1);
    assert!(checks(&report)[0]["found"].as_str().unwrap().contains("extraktor"), "{report}");
}
