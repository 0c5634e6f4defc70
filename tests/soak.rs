//! Short forms of the soaks and campaigns whose long forms are commands: services/soak/README.md.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::sync::atomic::{AtomicU32, Ordering};

use serde_json::Value;

static SOAKS: AtomicU32 = AtomicU32::new(0);

/// Stages of the shipped chain.
const STAGES: [&str; 6] = ["source", "clusterer", "extractor", "classifier", "tracker", "recorder"];

/// A soak that has ended.
struct Soaked {
    dir: tempfile::TempDir,
    code: Option<i32>,
    verdict: Value,
    said: String,
}

/// Runs `encke soak` with these options, and a campaign where there is one.
fn soak(args: &[&str], campaign: Option<&str>) -> Soaked {
    let dir = tempfile::tempdir().unwrap();
    let number = SOAKS.fetch_add(1, Ordering::Relaxed);
    let instance = format!("s{}-{number}", std::process::id());
    let mut command = support::encke();
    command.arg("soak").args(args).args(["--instance", &instance, "--out"]).arg(dir.path().join("out"));
    if let Some(text) = campaign {
        let file = dir.path().join("campaign.toml");
        std::fs::write(&file, text).unwrap();
        command.arg("--faults").arg(file);
    }
    let output = command.output().unwrap();
    let left = support::leftovers(&instance);
    assert!(left.is_empty(), "left in shared memory or on disk: {left:?}");
    let verdict = std::fs::read(dir.path().join("out/verdict.json")).unwrap_or_default();
    Soaked {
        code: output.status.code(),
        verdict: serde_json::from_slice(&verdict).unwrap_or(Value::Null),
        said: support::text(&output.stdout) + &support::text(&output.stderr),
        dir,
    }
}

impl Soaked {
    /// Asserts that no bar was failed.
    fn expect_passed(self) -> Self {
        assert_eq!(self.code, Some(0), "{}", self.said);
        assert_eq!(self.verdict["passed"], true, "{}", self.said);
        let page = std::fs::read_to_string(self.dir.path().join("out/verdict.html")).unwrap();
        assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
        self
    }

    fn bar(&self, name: &str) -> &Value {
        let bars = self.verdict["bars"].as_array().unwrap();
        bars.iter()
            .find(|bar| bar["name"].as_str().unwrap().starts_with(name))
            .unwrap_or_else(|| panic!("{name}: {}", self.said))
    }
}

#[test]
fn a_chain_without_faults_holds_for_a_while() {
    let soaked = soak(&["--duration", "15s"], None).expect_passed();
    let overall = &soaked.verdict["availability"]["overall"];
    // 15 s at 10 Hz, give or take the sweep under way at both ends.
    let due = overall["due"].as_u64().unwrap();
    assert!((148..=152).contains(&due), "{overall}");
    assert_eq!((&overall["missing"], &overall["broken"]), (&0.into(), &0.into()), "{}", soaked.said);
    assert_eq!(soaked.bar("change of file descriptors")["passed"], true);
    let samples = std::fs::read_to_string(soaked.dir.path().join("out/samples.csv")).unwrap();
    assert!(samples.lines().count() >= 15 && samples.lines().all(|line| line.split(',').count() == 54), "{samples}");
    let events = std::fs::read_to_string(soaked.dir.path().join("out/events.jsonl")).unwrap();
    assert!(events.contains("run_began"), "{events}");
    assert!(soaked.verdict["observer"]["looks"].as_u64().unwrap() > 1_000);
}

#[test]
fn each_stage_killed_twice_at_start_up_too_is_detected_and_back_in_time() {
    let campaign = "kind = \"kills\"\ntimes = 2\nspacing_s = 1.5\nagain_share = 0.25\nagain_within_ms = 60.0\n";
    let soaked = soak(&["--seed", "3"], Some(campaign)).expect_passed();
    let rows = soaked.verdict["faults"].as_array().unwrap();
    for stage in STAGES {
        let kills: Vec<&Value> = rows.iter().filter(|row| row["stage"] == stage).collect();
        assert_eq!(kills.len(), 2, "{}", soaked.said);
        assert!(kills.iter().any(|kill| kill["fault"] == "kill, again at start-up"), "{kills:?}");
    }
    let planned = soaked.verdict["planned"].as_array().unwrap();
    assert_eq!(planned.len(), rows.len());
    for row in rows {
        let actions = row["action"].as_array().unwrap();
        assert!(actions.contains(&"stage_restarted".into()) && row["detected_ms"].is_number(), "{row}");
    }
    let matrix = std::fs::read_to_string(soaked.dir.path().join("out/matrix.md")).unwrap();
    assert!(STAGES.iter().all(|stage| matrix.contains(&format!("| kill, again at start-up | {stage} |"))), "{matrix}");
}

#[test]
fn a_bar_that_is_not_reached_fails_the_soak() {
    // A kill costs a sweep or two, and here nothing is forgiven.
    let campaign = "kind = \"kills\"\ntimes = 1\nspacing_s = 1.0\nagain_share = 0.0\nagain_within_ms = 0.0\nstages = [\"clusterer\"]\n";
    let bars = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/config/soak.toml")).unwrap();
    let (dir, chain) = support::chain_with(&[]);
    let strict =
        bars.replace("settle_s = 1.0", "settle_s = 0.0").replace("availability_pct = 99.0", "availability_pct = 100.0");
    assert_ne!(strict, bars);
    std::fs::write(dir.path().join("soak.toml"), strict).unwrap();
    let soaked = soak(&["--chain", &chain], Some(campaign));
    assert_eq!(soaked.code, Some(1), "{}", soaked.said);
    assert_eq!(soaked.verdict["passed"], false);
    assert_eq!(soaked.bar("availability outside 0 s")["passed"], false, "{}", soaked.said);
    assert!(soaked.said.contains("bars not reached: availability outside 0 s"), "{}", soaked.said);
}

#[test]
fn starts_and_stops_leave_nothing_behind() {
    let soaked = soak(&[], Some("kind = \"cycles\"\ntimes = 5\nrun_ms = 200.0\n")).expect_passed();
    assert_eq!(soaked.verdict["cycles"].as_array().unwrap().len(), 5);
}

#[test]
fn after_a_death_of_all_processes_the_next_start_is_clean() {
    let soaked = soak(&[], Some("kind = \"kill-all\"\ntimes = 3\nwithin_ms = 600.0\n")).expect_passed();
    let cycles = soaked.verdict["cycles"].as_array().unwrap();
    assert!(cycles.len() == 3 && cycles.iter().all(|cycle| cycle["killed"].is_string()));
}

/// Steps that the day in the life begins and ends with; its long form is config/faults/day.toml.
const DAY: &str = r#"
kind = "day"
tape = "faults/day-tape.toml"
[[step]]
name = "nominal"
nominal_s = 4.0
[[step]]
name = "a command that there is not"
refused = ["ctl", "party"]
[[step]]
name = "pause"
ctl = ["pause"]
[[step]]
name = "go on"
ctl = ["resume"]
[[step]]
name = "the tables are read again"
ctl = ["reload"]
[[step]]
name = "the classifier is killed"
inject = ["kill", "classifier"]
[[step]]
name = "the recording is in more than one file"
rotated = 2
[[step]]
name = "shutdown"
shutdown = true
[[step]]
name = "its own recording, again"
replay = true
"#;

#[test]
fn a_short_day_ends_with_the_same_detections_from_its_own_recording() {
    // What a busy machine makes the ladder leave out cannot be compared.
    let (_dir, chain) = support::chain_with(&[(support::LADDER, support::NO_LADDER)]);
    let soaked = soak(&["--chain", &chain], Some(DAY)).expect_passed();
    let steps = soaked.verdict["steps"].as_array().unwrap();
    assert!(steps.len() == 9 && steps.iter().all(|step| step["passed"] == true), "{steps:?}");
    assert!(steps[8]["note"].as_str().unwrap().ends_with(" compared, 0 differ"), "{steps:?}");
}

#[test]
fn changes_of_mode_take_effect_and_none_is_stuck() {
    let campaign = "kind = \"mode-changes\"\ntimes = 20\npause_ms = 250.0\nstuck_ms = 5000.0\n\
                    commands = [\"resume\", \"pause\", \"safe\", \"degrade\"]\n";
    let soaked = soak(&[], Some(campaign));
    assert_eq!(soaked.verdict["steps"].as_array().unwrap().len(), 20, "{}", soaked.said);
    assert_eq!(soaked.bar("changes that failed or stuck")["passed"], true, "{}", soaked.said);
    assert_eq!(soaked.bar("ledgers not closed")["passed"], true, "{}", soaked.said);
}

#[test]
fn what_cannot_be_soaked_is_refused_before_anything_starts() {
    let refused = |args: &[&str], campaign: Option<&str>| {
        let soaked = soak(args, campaign);
        assert_eq!(soaked.code, Some(2), "{}", soaked.said);
        soaked.said
    };
    let cycles = "kind = \"cycles\"\ntimes = 5\nrun_ms = 200.0\n";
    assert!(refused(&["--duration", "9s"], Some(cycles)).contains("has its own: leave it out"));
    assert!(
        refused(&[], Some("[[script]]\nat_s = 1.0\nfault = \"kill\"\nstage = \"source\"\n")).contains("say how long")
    );
    assert!(refused(&[], Some("kind = \"cycles\"\ntimes = 5\n")).contains("run_ms"));
    assert!(refused(&["--duration", "9s"], Some("[[script]]\nat_s = 1.0\nfault = \"party\"\n")).contains("party"));
}
