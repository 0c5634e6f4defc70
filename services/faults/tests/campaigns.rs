//! The shipped campaigns.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeSet;

use faults::{Campaign, Fault, schedule};

fn shipped() -> Vec<(String, Campaign)> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/faults");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    // Those of a kind are the soak's.
    files.retain(|path| {
        !std::fs::read_to_string(path)
            .unwrap()
            .lines()
            .any(|line| line.starts_with("kind =") || line.starts_with("topics ="))
    });
    let read = |path: &std::path::PathBuf| {
        let campaign = Campaign::parse(&std::fs::read_to_string(path).unwrap());
        (path.file_stem().unwrap().to_str().unwrap().to_owned(), campaign.unwrap_or_else(|e| panic!("{path:?}: {e}")))
    };
    files.iter().map(read).collect()
}

// verifies FLT-003
#[test]
fn every_shipped_campaign_holds_and_has_faults_to_put() {
    let names: Vec<String> = shipped().into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["crash", "lidar", "random", "resources", "sensor-data"]);
    for (name, campaign) in shipped() {
        assert!(schedule(&campaign, 1, 3_600.0).len() >= 7, "{name}");
    }
}

// verifies FLT-003
#[test]
fn the_random_campaign_has_what_is_survived_and_nothing_that_ends_a_run() {
    let (_, random) = shipped().into_iter().find(|(name, _)| name == "random").unwrap();
    let list = schedule(&random, 1, 360_000.0);
    assert!((5_700..6_300).contains(&list.len()), "one a minute: {} in 100 h", list.len());
    let drawn: BTreeSet<Fault> = list.iter().map(|planned| planned.fault).collect();
    for fault in [Fault::Swallow, Fault::KillSupervisor, Fault::KillAll, Fault::SharedMemoryLost, Fault::DiskFull] {
        assert!(!drawn.contains(&fault), "{}", fault.name());
    }
    for fault in [Fault::Kill, Fault::Stop, Fault::Panic, Fault::Deadlock, Fault::Dust, Fault::ClockStepped] {
        assert!(drawn.contains(&fault), "{}", fault.name());
    }
}
