use events::EventId;
use messages::{ClusterSummary, Detection, Hop, Part, Track, Verdict};
use runtime::page::Counts;
use zerocopy::FromZeros;

use super::*;
use crate::top::view::DetectionsView;

const MS: u64 = 1_000_000;

fn facts() -> Facts {
    Facts {
        instance: "sut".to_owned(),
        source: "scene.toml".to_owned(),
        paced: true,
        sectors: 2,
        deadline_ms: 100.0,
        stages: ["source", "clusterer", "recorder"].map(str::to_owned).to_vec(),
        supervisor_pid: 1,
    }
}

fn sut() -> Model {
    Model::new(facts())
}

/// Part of a sweep of two sectors that was due at 1 s and left the clusterer `latency_ms` later, having worked 2 ms.
fn trace(sweep: u64, sector: u32, sequence: u64, latency_ms: u64) -> Trace {
    let part = Part { ordinal: sweep * 2 + u64::from(sector), sweep, sector, sectors: 2, ..Part::default() };
    let due_ns = 1_000 * MS;
    let mut trace = Trace { part, due_ns, ..Trace::default() };
    trace.push(Hop {
        received_ns: due_ns - 9 * MS,
        started_ns: due_ns - 6 * MS,
        finished_ns: due_ns,
        ..Hop::default()
    });
    let finished_ns = due_ns + latency_ms * MS;
    trace.push(Hop { sequence, started_ns: finished_ns - 2 * MS, finished_ns, ..Hop::default() });
    trace
}

fn nothing() -> Box<Tracks> {
    Tracks::new_box_zeroed().unwrap()
}

fn sweep(sut: &mut Model, sweep: u64, latency_ms: u64) {
    let message = nothing();
    for sector in 0..2 {
        sut.part(&trace(sweep, sector, sweep * 2 + u64::from(sector), latency_ms), &message);
    }
}

fn look(at_ms: u64, counts: [Counts; 3]) -> Sample {
    let usage = |counts: Counts| {
        let lives = counts.incarnation > counts.settled_incarnation;
        lives.then_some(Usage { cpu_s: at_ms as f64 / 2e3, rss_bytes: 3 << 20, started_s: 1.0 })
    };
    Sample {
        at_ns: at_ms * MS,
        stages: counts.map(|counts| StageSample { counts, usage: usage(counts) }).to_vec(),
        supervisor: Some(Usage { started_s: 1.0, ..Usage::default() }),
        viewer: None,
    }
}

fn running() -> [Counts; 3] {
    [Counts { incarnation: 1, pid: 10, state: State::Running, ..Counts::default() }; 3]
}

fn what(sut: &Model) -> Vec<String> {
    sut.view().events.iter().map(|event| format!("{} {}", event.stage, event.what)).collect()
}

#[test]
fn percentiles_are_of_the_last_hundred_sweeps_and_misses_are_those_past_the_deadline() {
    let mut sut = sut();
    sweep(&mut sut, 0, 500);
    for number in 1..=100 {
        sweep(&mut sut, number, if number == 100 { 101 } else { 4 });
    }
    let latency = sut.view().latency;
    assert_eq!((latency.p50_ms, latency.p99_ms, latency.max_ms), (Some(4.0), Some(4.0), Some(101.0)));
    assert_eq!((latency.sweeps, latency.missed, latency.missed_in_all), (100, 1, 2));
    assert_eq!(latency.recent_ms.len(), 101);
}

#[test]
fn a_stage_works_on_a_sweep_in_all_its_parts_and_the_source_until_it_waits() {
    let mut sut = sut();
    sweep(&mut sut, 0, 5);
    let stages = sut.view().stages;
    // Nothing is known of a stage before the first look.
    assert_eq!(stages[1].busy_p50_ms, None);
    sut.sample(look(2_000, running()));
    let stages = sut.view().stages;
    assert_eq!((stages[0].busy_p50_ms, stages[1].busy_p50_ms, stages[2].busy_p50_ms), (Some(6.0), Some(4.0), None));
}

#[test]
fn a_sweep_that_was_seen_from_its_middle_on_is_no_miss() {
    let mut sut = sut();
    sut.part(&trace(7, 1, 15, 4), &nothing());
    let latency = sut.view().latency;
    assert_eq!((latency.sweeps, latency.missed_in_all), (1, 0));
}

#[test]
fn a_sweep_that_lacks_a_part_or_never_came_is_a_miss_and_one_that_passed_unseen_is_not() {
    let mut sut = sut();
    sweep(&mut sut, 0, 4);
    // Sector 0 of sweep 1 was lost further up: no gap in the numbers of this hop.
    sut.part(&trace(1, 1, 2, 4), &nothing());
    assert_eq!(sut.view().latency.missed_in_all, 1);
    // Nor was there one before sweep 4.
    sut.part(&trace(4, 0, 3, 4), &nothing());
    sut.part(&trace(4, 1, 4, 4), &nothing());
    assert_eq!(sut.view().latency.missed_in_all, 3);
    // Sweeps 5 to 8 passed unseen.
    sut.part(&trace(9, 0, 13, 4), &nothing());
    sut.part(&trace(9, 1, 14, 4), &nothing());
    let view = sut.view();
    assert_eq!(view.latency.missed_in_all, 3);
    assert_eq!(view.tap, TapView { parts: 7, missed: 8 });
}

#[test]
fn a_rejected_sweep_is_a_miss_unless_it_was_shed_on_purpose() {
    for (verdict, misses) in [(Verdict::RejectedStale, 1), (Verdict::RejectedShed, 0)] {
        let mut sut = sut();
        for sector in 0..2 {
            let mut trace = trace(0, sector, u64::from(sector), 4);
            trace.hops[1].verdict = verdict;
            sut.part(&trace, &nothing());
        }
        assert_eq!(sut.view().latency.missed_in_all, misses, "{verdict:?}");
    }
}

#[test]
fn without_pace_there_is_no_deadline_to_miss() {
    let mut sut = Model::new(Facts { paced: false, ..facts() });
    sweep(&mut sut, 0, 5_000);
    let latency = sut.view().latency;
    assert_eq!((latency.deadline_ms, latency.missed_in_all, latency.max_ms), (None, 0, Some(5_000.0)));
}

#[test]
fn rates_and_shares_are_over_the_last_two_seconds() {
    let mut sut = sut();
    for at_s in 1..=6 {
        let mut counts = running();
        counts[0].published = at_s * 20;
        counts[1].received = if at_s < 4 { 0 } else { (at_s - 4) * 40 };
        sut.sample(look(at_s * 1_000, counts));
    }
    let view = sut.view();
    assert_eq!((view.stages[0].parts_per_s, view.sweeps_per_s), (20.0, 10.0));
    assert_eq!(view.stages[1].parts_per_s, 40.0);
    assert_eq!(view.stages[1].process, ProcessView { cpu_pct: Some(50.0), rss_mib: Some(3.0) });
    assert_eq!((view.uptime_s, view.sweep), (Some(5.0), 60));
}

#[test]
fn a_queue_is_what_was_published_and_not_yet_expected() {
    let mut sut = sut();
    let mut counts = running();
    counts[0].published = 12;
    counts[1].next_sequence = 9;
    sut.sample(look(1_000, counts));
    let queues: Vec<Option<u64>> = sut.view().stages.iter().map(|stage| stage.queue).collect();
    assert_eq!(queues, [None, Some(3), Some(0)]);
}

fn event(id: EventId, stage: &str, at_ms: u64, text: &str) -> events::Event {
    let (time_ns, stage, text) = (at_ms * MS, stage.to_owned(), text.to_owned());
    let (name, severity) = (id.entry().name.to_owned(), id.severity());
    events::Event { number: 0, time_ns, utc_ns: 0, id: id as u32, name, severity, stage, sweep: 7, text, unsaid: 0 }
}

#[test]
fn a_dead_stage_is_seen_and_the_log_says_what_happened() {
    let mut sut = sut();
    sut.sample(look(1_000, running()));
    let mut counts = running();
    counts[1].settled_incarnation = 1;
    sut.sample(look(2_000, counts));
    assert_eq!(sut.view().stages[1].state, "died");
    sut.happened(&event(EventId::StageDied, "clusterer", 1_950, "process 10: signal 9"));
    sut.happened(&event(EventId::RunEnds, "chain", 1_960, ""));
    assert_eq!(what(&sut), ["clusterer stage died: process 10: signal 9", "chain run ends"]);
    let view = &sut.view().events[0];
    assert_eq!((view.at_s, view.sweep, view.grave), (0.95, 7, true), "the supervisor started at 1 s");
}

#[test]
fn what_happens_again_soon_is_one_event_with_a_larger_number() {
    let mut sut = sut();
    for place in 0..3 {
        sut.happened(&event(EventId::BudgetOverrun, "clusterer", 1_000 + place, &format!("no. {place}")));
    }
    sut.happened(&events::Event { unsaid: 9, ..event(EventId::PartsDropped, "recorder", 1_500, "3 parts") });
    assert_eq!(what(&sut), ["clusterer budget overrun: no. 2 (3 times)", "recorder parts dropped: 3 parts (10 times)"]);
    sut.happened(&event(EventId::BudgetOverrun, "clusterer", 60_000, "later"));
    sut.happened(&event(EventId::BudgetOverrun, "extractor", 60_000, "another"));
    // Deaths are told one by one.
    sut.happened(&event(EventId::StageDied, "clusterer", 60_001, "a"));
    sut.happened(&event(EventId::StageDied, "clusterer", 60_002, "b"));
    assert_eq!(what(&sut)[2..].len(), 4);
}

#[test]
fn the_step_in_force_is_the_sources() {
    let mut sut = sut();
    let mut counts = running();
    counts[0].step = 3;
    sut.sample(look(2_000, counts));
    assert_eq!(sut.view().step, "clusters-only");
}

#[test]
fn another_life_of_the_instance_counts_anew_and_remembers_what_happened() {
    let mut sut = sut();
    let mut counts = running();
    counts[1].lost = 5;
    sut.sample(look(1_000, counts));
    sut.note(Some("ended".to_owned()));
    sut.renew(facts());
    sut.sample(look(9_000, running()));
    let view = sut.view();
    assert_eq!((view.notice, view.tap), (None, TapView::default()));
    assert_eq!(what(&sut), ["chain the instance was started anew"]);
}

fn detection(key: u32, class: lidar::ObstacleClass, range_m: f32) -> Detection {
    let summary = ClusterSummary { key, points: 9, centroid_m: [range_m, 0.0, 0.0], ..ClusterSummary::default() };
    Detection { summary, class, posterior: [0.7, 0.1, 0.1, 0.1], ..Detection::default() }
}

#[test]
fn obstacles_are_numbered_by_key_and_shown_by_range_those_with_a_class_first() {
    use lidar::ObstacleClass::{Rectangular, Unclassified};
    let mut sut = sut();
    let mut message = nothing();
    message.detections.detections.push(detection(30, Unclassified, 1.0)).unwrap();
    message.detections.detections.push(detection(40, Rectangular, 9.0)).unwrap();
    sut.part(&trace(0, 0, 0, 4), &message);
    message.detections.detections.clear();
    message.detections.detections.push(detection(20, Rectangular, 5.0)).unwrap();
    sut.part(&trace(0, 1, 1, 4), &message);
    let DetectionsView { sweep, complete, rows, classes } = sut.view().detections;
    assert_eq!((sweep, complete), (Some(0), true));
    let shown: Vec<(usize, f32, Option<f32>)> = rows.iter().map(|row| (row.cluster, row.range_m, row.p)).collect();
    assert_eq!(shown, [(0, 5.0, Some(0.7)), (2, 9.0, Some(0.7)), (1, 1.0, None)]);
    assert_eq!(classes[0], ("rectangular", 2));
    assert_eq!(classes[4], ("unclassified", 1));
}

#[test]
fn tracks_that_are_not_known_any_more_are_not_shown_as_if_they_were() {
    let mut sut = sut();
    let mut message = nothing();
    message.table.time_ns = 1;
    message.table.tracks.push(Track::default()).unwrap();
    sut.part(&trace(0, 1, 1, 4), &message);
    // The table comes with the last part.
    sut.part(&trace(1, 0, 2, 4), &nothing());
    let view = sut.view().tracks;
    assert_eq!((view.sweep, view.known, view.rows.len()), (Some(0), true, 1));
    sut.part(&trace(1, 1, 3, 4), &nothing());
    let view = sut.view().tracks;
    assert_eq!((view.sweep, view.known, view.rows.len()), (Some(1), false, 0));
}
