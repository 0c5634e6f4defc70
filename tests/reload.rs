//! New parameters while the chain runs: validated by each stage, in use from the sweep named on, the old ones where they
//! do not hold.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::collections::BTreeMap;

use runtime::Plan;
use runtime::page::PageMap;
use support::{Finished, LADDER, NO_LADDER, Run};
use transport::Instance;

const SWEEPS: &str = "120";
const FROM_SWEEP: u64 = 60;
const BOX: [&str; 6] = ["--from", "config/scenes/box.toml", "--sweeps", SWEEPS, "--pace", "fast"];
/// The line that is changed, and what it becomes: no cluster is large enough for the paper's features.
const CHANGE: (&str, &str) = ("min_points = 5", "min_points = 100000");
/// What a chain needs to do everything at real time too, however late.
const PATIENT: [(&str, &str); 3] = [
    (LADDER, NO_LADDER),
    ("queue_sweeps = 4", "queue_sweeps = 40"),
    ("allowed_age_ms = 1000.0", "allowed_age_ms = 60000.0"),
];

/// The pages of a running chain, by stage.
fn pages(run: &Run) -> BTreeMap<String, PageMap> {
    let instance = Instance::named(&run.instance).unwrap();
    let plan = Plan::read(&instance).unwrap();
    let page = |stage: &str| PageMap::open(&Plan::page_path(&instance, stage)).unwrap();
    plan.stages().map(|stage| (stage.to_owned(), page(stage))).collect()
}

/// Does what the supervisor does on a reload: the plan anew, then the words on the pages.
fn reload(run: &Run, from_sweep: u64, (from, to): (&str, &str)) {
    let instance = Instance::named(&run.instance).unwrap();
    let mut plan = Plan::read(&instance).unwrap();
    let text = plan.parameters["clusterer"].replace(from, to);
    assert_ne!(text, plan.parameters["clusterer"]);
    let executive = plan.executive.clone();
    plan.replace_tables(BTreeMap::from([("clusterer".to_owned(), text)]), executive);
    plan.write(&instance).unwrap();
    for page in pages(run).values() {
        page.table_from_sweep.set(from_sweep);
        page.table_wanted.set(plan.generation);
    }
    let sent = pages(run)["source"].next_ordinal_out.get() / u64::from(plan.chain.sectors);
    assert!(sent < from_sweep, "the source is at sweep {sent} already");
}

/// A run that is slow enough to be met on its way, with new parameters on it.
fn reloaded(change: (&str, &str), then: impl FnOnce(&Run)) -> (Finished, BTreeMap<String, PageMap>) {
    let run = Run::new(&BOX);
    let child = run.start();
    run.wait_for_sweeps(1);
    run.inject(&["slow", "classifier", "--by", "20ms"]);
    reload(&run, FROM_SWEEP, change);
    // Mapped pages outlive their files.
    let pages = pages(&run);
    then(&run);
    (run.collect(child).expect_code(0), pages)
}

/// A run to its end with these lines of chain.toml, and one with the changed parameters from its first sweep on.
fn plain_and_changed(args: &[&str], lines: &[(&str, &str)]) -> [Finished; 2] {
    [false, true].map(|is_changed| {
        let (dir, chain) = support::chain_with(lines);
        let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/config/stages/clusterer.toml");
        let text = std::fs::read_to_string(shipped).unwrap();
        std::fs::create_dir(dir.path().join("stages")).unwrap();
        let text = if is_changed { text.replace(CHANGE.0, CHANGE.1) } else { text };
        std::fs::write(dir.path().join("stages/clusterer.toml"), text).unwrap();
        Run::new(&[args, &["--chain", &chain]].concat()).finish().expect_code(0)
    })
}

#[test]
fn new_parameters_count_from_the_sweep_named_on_whatever_dies_on_the_way() {
    let [plain, changed] = plain_and_changed(&BOX, &[]);
    let border = FROM_SWEEP as usize;
    assert_ne!(plain.detections[border..], changed.detections[border..]);
    let expected = [&plain.detections[..border], &changed.detections[border..]].concat();
    for killed in [None, Some("classifier"), Some("recorder")] {
        let (run, pages) = reloaded(CHANGE, |run| {
            let Some(stage) = killed else { return };
            // Some sweeps round the border are sent again.
            run.wait_for_sweeps(FROM_SWEEP + 2);
            run.inject(&["kill", stage]);
        });
        assert!(run.detections == expected, "{killed:?}");
        for (stage, page) in &pages {
            assert_eq!((page.table_active.get(), page.table_refused.get()), (1, 0), "{stage}");
        }
    }
}

#[test]
fn parameters_that_do_not_hold_change_nothing() {
    let plain = Run::new(&BOX).finish().expect_code(0);
    let (run, pages) = reloaded(("range_d_m = 1.0", "range_d_m = -1.0"), |_| ());
    assert!(run.bytes == plain.bytes);
    assert_eq!((pages["clusterer"].table_active.get(), pages["clusterer"].table_refused.get()), (0, 1));
    assert!(run.stderr().contains("the old ones stay in use"), "{}", run.stderr());
    assert!(run.is_closed());
}

#[test]
fn at_the_sensors_pace_no_sweep_is_missed_and_the_bytes_are_the_same() {
    let scene = ["--from", "config/scenes/single.toml", "--sweeps", "40"];
    let [plain, changed] = plain_and_changed(&[&scene[..], &["--pace", "fast"]].concat(), &PATIENT);
    let (_dir, chain) = support::chain_with(&PATIENT);
    let run = Run::new(&[&scene[..], &["--chain", &chain]].concat());
    let child = run.start();
    run.wait_for_sweeps(5);
    let border = pages(&run)["source"].next_ordinal_out.get() / 36 + 3;
    reload(&run, border, CHANGE);
    let pages = pages(&run);
    let run = run.collect(child).expect_code(0);
    assert_eq!((run.sweeps().len(), run.missing()), (40, 0), "{}", run.stdout());
    for (stage, page) in &pages {
        assert_eq!(page.table_active.get(), 1, "{stage}");
    }
    let border = border as usize;
    assert_ne!(plain.detections[border..], changed.detections[border..]);
    assert!(run.detections == [&plain.detections[..border], &changed.detections[border..]].concat());
}
