//! Latencies and counts against traces worked out by hand.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use std::collections::BTreeMap;

use common::{HandMade, settings, start, trace};
use lidar::ObstacleClass;
use messages::{ClusterSummary, Detection, Detections, Hop, Part, Trace, Verdict};
use proptest::prelude::*;
use recorder::{LatencySnapshot, Recorder, Settings, Snapshot};
use zerocopy::FromZeros;

const MS: u64 = 1_000_000;

fn snapshot(recorder: &Recorder) -> Snapshot {
    let mut snapshot = Snapshot::default();
    recorder.snapshot_into(&mut snapshot);
    snapshot
}

fn hop(free_ns: u64, received_ns: u64, started_ns: u64, finished_ns: u64) -> Hop {
    Hop { free_ns, received_ns, started_ns, finished_ns, ..Hop::default() }
}

/// A whole sweep that began at 0.9 s and was due at 1 s, with these hops.
fn swept(sweep: u64, hops: &[Hop]) -> Trace {
    let part = Part { ordinal: sweep, sweep, sectors: 1, ..Part::default() };
    let mut trace = Trace { part, due_ns: 1_000 * MS, sweep_start_ns: 900 * MS, ..Trace::default() };
    hops.iter().for_each(|&hop| trace.push(hop));
    trace
}

fn empty() -> Box<Detections> {
    let mut message = Detections::new_box_zeroed().unwrap();
    message.header.period_ns = 100 * MS;
    message.header.complete = 1;
    message
}

/// The one value of a distribution, which tells values apart to 0.1 % or half a microsecond.
fn check(latency: &LatencySnapshot, expected_ns: u64) {
    let [[value, 1]] = latency.values_ns[..] else { panic!("{latency:?} is not one value") };
    let error = value.abs_diff(expected_ns);
    assert!(error <= 512.max(expected_ns / 1_000), "{value} instead of {expected_ns}");
}

// verifies REC-011
#[test]
fn times_of_each_hop_are_those_worked_out_by_hand() {
    let mut recorder = start(settings()).unwrap();
    let hops = [
        hop(0, 900 * MS, 950 * MS, 1_002 * MS),            // sent 2 ms late, 52 ms of work
        hop(990 * MS, 1_003 * MS, 1_004 * MS, 1_010 * MS), // idle: 1 + 1 ms of transport, 6 of work
        hop(1_015 * MS, 1_017 * MS, 1_017 * MS, 1_020 * MS), // busy for 5 ms more, then 2 of transport, 3 of work
        hop(1_000 * MS, 1_020 * MS, 1_020 * MS, 1_027 * MS), // at once, 7 of work
    ];
    assert_eq!(recorder.accept(&swept(0, &hops), &empty()), Verdict::Complete);
    let found = snapshot(&recorder);
    check(&found.end_to_end, 27 * MS);
    check(&found.source_late, 2 * MS);
    assert!(found.stages[0].transport.values_ns.is_empty() && found.stages[0].queued.values_ns.is_empty());
    check(&found.stages[0].busy, 52 * MS);
    check(&found.end_to_end_corrected, 27 * MS);
    for (stage, [transport, queued, busy]) in found.stages[1..].iter().zip([[2, 0, 6], [2, 5, 3], [0, 0, 7]]) {
        check(&stage.transport, transport * MS);
        check(&stage.queued, queued * MS);
        check(&stage.busy, busy * MS);
    }
    let names: Vec<_> = found.stages.iter().map(|stage| stage.stage.as_str()).collect();
    assert_eq!(names, ["simulator", "clusterer", "extractor", "classifier"]);
}

fn with_clusters(clusters: &[(u32, u32, u32)]) -> Box<Detections> {
    let mut message = empty();
    for &(points, last_offset_ns, seam) in clusters {
        let first_member = message.members.len() as u32;
        let summary = ClusterSummary {
            key: first_member,
            first_member,
            points,
            last_offset_ns,
            seam,
            ..ClusterSummary::default()
        };
        message.detections.push(Detection { summary, ..Detection::default() }).unwrap();
        message.members.extend_from_slice(&(first_member..first_member + points).collect::<Vec<_>>()).unwrap();
    }
    message.header.recorded = message.members.len() as u32;
    message
}

// verifies REC-012
#[test]
fn an_obstacle_waits_from_its_own_last_return() {
    // The sweep began at 900 ms on the host's clock; its detections went out at 1,010 ms.
    let hops = [hop(0, 0, 0, 1_000 * MS), hop(0, 1_000 * MS, 1_000 * MS, 1_010 * MS)];
    let clusters = with_clusters(&[(5, 30_000_000, 0), (4, 10_000_000, 0), (9, 60_000_000, 1)]);
    let mut recorder = start(settings()).unwrap();
    recorder.accept(&swept(0, &hops), &clusters);
    let found = snapshot(&recorder);
    check(&found.obstacle, 80 * MS);
    check(&found.seam, 50 * MS);

    let mut unpaced = start(Settings { paced: false, deadline_ms: 1.0, ..settings() }).unwrap();
    unpaced.accept(&swept(0, &hops), &clusters);
    let found = snapshot(&unpaced);
    assert_eq!((found.obstacle.count(), found.seam.count(), found.deadline.misses), (0, 0, 0));
    assert_eq!(found.end_to_end.count(), 1);
}

// verifies REC-012
#[test]
fn an_obstacle_of_a_sector_waits_from_its_own_last_return_too() {
    // The second of four sectors was due 50 ms after the sweep's begin at 950 ms; an obstacle that the first one had
    // seen came with it.
    let mut part = swept(0, &[hop(0, 0, 0, 1_000 * MS), hop(0, 1_000 * MS, 1_000 * MS, 1_010 * MS)]);
    part.part = Part { ordinal: 1, sector: 1, sectors: 4, ..part.part };
    part.sweep_start_ns = 950 * MS;
    let mut recorder = start(settings()).unwrap();
    recorder.accept(&part, &with_clusters(&[(5, 20_000_000, 0)]));
    let found = snapshot(&recorder);
    check(&found.obstacle, 40 * MS);
    assert_eq!(found.end_to_end.count(), 0, "once a sweep, at its last part");
}

/// A sweep that begins at 1 s + 100 ms · sweep in sectors; the source is `late` ms late with each, the three stages work
/// for `busy` ms on each, one after the other.
fn sectored(sweep: u64, sectors: u32, late_ms: u64, busy_ms: u64) -> Vec<Trace> {
    let sweep_start_ns = 1_000 * MS + 100 * MS * sweep;
    let part = |sector: u32| {
        let ordinal = sweep * u64::from(sectors) + u64::from(sector);
        let due_ns = sweep_start_ns + 100 * MS * u64::from(sector + 1) / u64::from(sectors);
        let part = Part { ordinal, sweep, sector, sectors, ..Part::default() };
        let mut trace = Trace { part, due_ns, sweep_start_ns, ..Trace::default() };
        let mut sent_ns = due_ns + late_ms * MS;
        trace.push(hop(0, 0, sent_ns - MS, sent_ns));
        for stage in 1..4 {
            trace.push(Hop { stage, ..hop(0, sent_ns, sent_ns, sent_ns + busy_ms * MS) });
            sent_ns += busy_ms * MS;
        }
        trace
    };
    (0..sectors).map(part).collect()
}

#[test]
fn a_sweep_is_as_long_as_its_last_part_took_and_its_work_is_that_on_all_parts() {
    for sectors in [1, 4] {
        let mut recorder = start(settings()).unwrap();
        for trace in sectored(0, sectors, 1, 2) {
            recorder.accept(&trace, &empty());
        }
        let found = snapshot(&recorder);
        check(&found.end_to_end, 7 * MS);
        let parts = u64::from(sectors);
        for stage in &found.stages[1..] {
            check(&stage.busy, parts * 2 * MS);
            assert_eq!(stage.busy_part.count(), parts);
            assert_eq!((stage.transport.count(), stage.queued.count()), (parts, parts));
            check_all(&stage.busy_part, 2 * MS);
        }
        check(&found.stages[0].busy, parts * MS);
    }
}

/// All values of a distribution.
fn check_all(latency: &LatencySnapshot, expected_ns: u64) {
    let near = |&[value, _]: &[u64; 2]| value.abs_diff(expected_ns) <= 512.max(expected_ns / 1_000);
    assert!(latency.values_ns.iter().all(near), "{latency:?}");
}

#[test]
fn a_sweep_that_lacks_a_part_or_whose_part_was_rejected_has_no_latency_and_no_work() {
    for sectors in [1, 4] {
        for sector in 0..sectors as usize {
            let mut lacking = sectored(1, sectors, 1, 2);
            lacking.remove(sector);
            let mut rejected = sectored(1, sectors, 1, 2);
            rejected[sector].hops[2].verdict = Verdict::RejectedStale;
            for spoilt in [lacking, rejected] {
                let mut recorder = start(settings()).unwrap();
                let sweeps = [sectored(0, sectors, 1, 2), spoilt, sectored(2, sectors, 1, 2)];
                for trace in sweeps.iter().flatten() {
                    recorder.accept(trace, &empty());
                }
                let found = snapshot(&recorder);
                assert_eq!(found.end_to_end.count(), 2, "of {sectors} sectors {sector}");
                for stage in &found.stages[1..] {
                    assert_eq!(stage.busy.count(), 2);
                    check_all(&stage.busy, u64::from(sectors) * 2 * MS);
                }
            }
        }
    }
}

// verifies REC-016
#[test]
fn a_sweep_without_an_answer_waits_for_that_of_the_next_in_the_corrected_distribution() {
    for sectors in [1, 4] {
        let mut recorder = start(settings()).unwrap();
        // Sweeps 3 and 4 never came, 5 was rejected; 0 and 1 were before the first answer, 8 after the last.
        for (sweep, stale) in [(2, false), (5, true), (6, false), (8, true)] {
            for mut trace in sectored(sweep, sectors, 1, 3) {
                trace.hops[1].verdict = if stale { Verdict::RejectedStale } else { Verdict::Complete };
                recorder.accept(&trace, &empty());
            }
        }
        let found = snapshot(&recorder);
        let ms = |latency: &LatencySnapshot| -> Vec<(u64, u64)> {
            latency.values_ns.iter().map(|&[ns, count]| (ns / MS, count)).collect()
        };
        assert_eq!(ms(&found.end_to_end), [(10, 2)]);
        assert_eq!(ms(&found.end_to_end_corrected), [(10, 2), (110, 1), (210, 1), (310, 1)]);
        // The deadline's margin is that of the corrected one: 310 ms of 100 ms.
        assert!(found.margin_p999_pct().is_some_and(|margin| (margin + 210.0).abs() < 1.0));
    }
}

#[test]
fn without_pace_nobody_can_say_how_long_an_unanswered_sweep_waited() {
    let mut recorder = start(Settings { paced: false, ..settings() }).unwrap();
    for sweep in [0, 3] {
        recorder.accept(&sectored(sweep, 1, 0, 3)[0], &empty());
    }
    let found = snapshot(&recorder);
    assert_eq!((found.end_to_end.count(), found.end_to_end_corrected.count()), (2, 0));
    assert_eq!(found.margin_p999_pct(), None);
}

#[test]
fn a_gap_of_years_ends_as_an_hour_each() {
    let mut recorder = start(settings()).unwrap();
    for sweep in [0, 1_000_000_000_000] {
        let (mut trace, detections) = HandMade::interleaved(0, 100, 5, 10).whole();
        (trace.part.sweep, trace.part.ordinal) = (sweep, sweep);
        recorder.accept(&trace, &detections);
    }
    let found = snapshot(&recorder).end_to_end_corrected;
    assert_eq!(found.count(), 1_000_000_000_001);
    assert_eq!(found.beyond, 999_999_999_999 - 35_999);
}

// verifies REC-017
#[test]
fn answered_sweeps_are_counted_by_their_step() {
    let mut recorder = start(settings()).unwrap();
    for (sweep, step) in [0, 0, 1, 1, 1, 4].into_iter().enumerate() {
        for mut trace in sectored(sweep as u64, 4, 0, 1) {
            trace.part.step = step;
            if sweep == 4 {
                trace.hops[1].verdict = Verdict::RejectedStale;
            }
            recorder.accept(&trace, &empty());
        }
    }
    let expected = [("nominal", 2), ("fewer-starts", 2), ("every-second-sweep", 1)];
    assert_eq!(snapshot(&recorder).steps, expected.map(|(step, sweeps)| (step.to_owned(), sweeps)).into());
}

#[test]
fn missing_parts_are_counted_between_the_first_and_the_last() {
    let mut recorder = start(settings()).unwrap();
    for trace in [sectored(3, 4, 0, 1), sectored(5, 4, 0, 1)].concat() {
        if trace.part.ordinal != 22 {
            recorder.accept(&trace, &empty());
        }
    }
    let found = snapshot(&recorder);
    assert_eq!((found.missing_parts, found.missing_sweeps), (5, 1));
}

// verifies REC-014
#[test]
fn sweeps_returns_classes_and_verdicts_are_counted() {
    let mut recorder = start(settings()).unwrap();
    for sweep in [3, 4, 7] {
        let (mut trace, mut detections) = HandMade::interleaved(sweep, 100, 5, 10).whole();
        if sweep == 4 {
            trace.hops[1].verdict = Verdict::PartialCells;
            detections.header.complete = 0;
        }
        recorder.accept(&trace, &detections);
    }
    let (mut trace, detections) = HandMade::interleaved(8, 100, 5, 10).whole();
    trace.hops[2].verdict = Verdict::RejectedMalformed;
    recorder.accept(&trace, &detections);
    let found = snapshot(&recorder);
    assert_eq!((found.parts, found.sweeps, found.complete_sweeps, found.missing_sweeps), (4, 4, 2, 2));
    assert_eq!((found.first_sweep, found.last_sweep), (Some(3), Some(8)));
    assert_eq!(found.returns, 4 * 90);
    assert_eq!(found.refused, BTreeMap::from([("too_near".to_owned(), 40)]));
    assert_eq!(found.detections, ObstacleClass::ALL.map(|class| (class, 4)).into());
    assert_eq!(found.stages[1].verdicts, BTreeMap::from([("partial_cells".to_owned(), 1)]));
    assert_eq!(found.stages[2].verdicts, BTreeMap::from([("malformed".to_owned(), 1)]));
    assert!(found.stages[0].verdicts.is_empty() && found.verdicts.is_empty());
}

#[test]
fn a_sweep_of_sectors_is_complete_only_with_all_of_them() {
    let mut recorder = start(settings()).unwrap();
    for sweep in 0..3 {
        for (trace, detections) in HandMade::interleaved(sweep, 100, 5, 10).sectors(4, |place| place as u32 % 4) {
            if (sweep, trace.part.sector) != (1, 2) {
                recorder.accept(&trace, &detections);
            }
        }
    }
    let found = snapshot(&recorder);
    assert_eq!((found.parts, found.sweeps, found.complete_sweeps, found.missing_sweeps), (11, 3, 2, 0));
    assert_eq!((found.end_to_end.count(), found.source_late.count(), found.missing_parts), (2, 11, 1));
}

#[test]
fn a_time_over_an_hour_counts_as_an_hour_and_is_said() {
    let hour = 3_600_000 * MS;
    let mut recorder = start(settings()).unwrap();
    recorder.accept(&swept(0, &[hop(0, 0, 0, 1_000 * MS + hour)]), &empty());
    assert_eq!(snapshot(&recorder).end_to_end.beyond, 0);
    recorder.accept(&swept(1, &[hop(0, 0, 0, u64::MAX)]), &empty());
    let found = snapshot(&recorder).end_to_end;
    assert_eq!((found.beyond, found.count(), found.values_ns.len()), (1, 2, 1));
}

#[test]
fn an_empty_distribution_has_no_percentiles() {
    let found = LatencySnapshot::default().percentiles();
    let json = serde_json::to_string(&found).unwrap();
    assert_eq!(json, r#"{"count":0,"p50":null,"p99":null,"p999":null,"max":null}"#);
}

#[test]
fn percentiles_are_the_values_of_their_rank() {
    let sut = LatencySnapshot { values_ns: (1..=1_000).map(|ms| [ms * MS, 10]).collect(), beyond: 0 };
    let found = sut.percentiles();
    assert_eq!((found.count, found.p50, found.p99), (10_000, Some(500.0), Some(990.0)));
    assert_eq!((found.p999, found.max), (Some(999.0), Some(1_000.0)));
    let one = LatencySnapshot { values_ns: vec![[0, 1]], beyond: 0 }.percentiles();
    assert_eq!((one.p50, one.max), (Some(0.0), Some(0.0)));
}

#[test]
fn a_snapshot_comes_back_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("snapshot.json");
    let mut recorder = start(settings()).unwrap();
    for sweep in 0..20 {
        let (trace, detections) = HandMade::interleaved(sweep, 100, 5, 10).whole();
        recorder.accept(&trace, &detections);
    }
    let written = snapshot(&recorder);
    written.write(&path).unwrap();
    assert_eq!(Snapshot::read(&path).unwrap(), written);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
    assert!(Snapshot::read(&folder.path().join("none")).unwrap_err().to_string().contains("none"));
    Snapshot { version: 9, ..written }.write(&path).unwrap();
    assert!(Snapshot::read(&path).unwrap_err().to_string().ends_with("has version 9, must be 5"));
    std::fs::write(&path, "{").unwrap();
    assert!(Snapshot::read(&path).unwrap_err().to_string().contains("is no snapshot"));
}

#[test]
fn snapshots_of_different_chains_do_not_merge() {
    let mut one = snapshot(&start(settings()).unwrap());
    let before = one.clone();
    let other = snapshot(&start(Settings { stages: vec!["replay".into()], ..settings() }).unwrap());
    assert!(one.merge(&other).is_err());
    assert_eq!(one, before);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    // verifies REC-015
    #[test]
    fn several_lives_merged_are_one_life(
        sweeps in prop::collection::vec((0_u64..3, 0_u64..200 * MS, 0_usize..4, 0_usize..12), 0..12),
        cuts in prop::collection::btree_set(0_usize..12, 0..3),
    ) {
        let mut number = 0;
        let mut parts = Vec::new();
        for (skipped, delay_ns, slow, verdict) in sweeps.clone() {
            let (mut trace, detections) = HandMade::interleaved(number + skipped, 60, 7, 10).whole();
            trace.hops[slow..4].iter_mut().for_each(|hop| hop.finished_ns += delay_ns);
            trace.hops[slow].verdict = Verdict::ALL.get(verdict).copied().unwrap_or_default();
            trace.part.step = verdict as u32 % 3;
            parts.push((trace, detections));
            number += skipped + 1;
        }
        let mut whole = start(settings()).unwrap();
        let mut life = start(settings()).unwrap();
        let mut merged = Snapshot::default();
        for (place, (trace, detections)) in parts.iter().enumerate() {
            if cuts.contains(&place) {
                merged.merge(&snapshot(&life)).unwrap();
                life = start(settings()).unwrap();
            }
            whole.accept(trace, detections);
            life.accept(trace, detections);
        }
        merged.merge(&snapshot(&life)).unwrap();
        prop_assert_eq!(merged, snapshot(&whole));
    }
}

#[test]
fn a_snapshot_into_used_memory_is_that_into_new_memory() {
    let mut used = Snapshot::default();
    let mut recorder = start(settings()).unwrap();
    for sweep in 0..3 {
        let (_, detections) = HandMade::interleaved(sweep, 100, 5, 10).whole();
        recorder.accept(&trace(Part { sweep, sectors: 1, ..Part::default() }), &detections);
        recorder.snapshot_into(&mut used);
    }
    assert_eq!(used, snapshot(&recorder));
    assert!(used.margin_p999_pct().is_some_and(|margin| (margin - 92.7).abs() < 0.1), "{:?}", used.margin_p999_pct());
}

// verifies REC-022
#[test]
fn the_timeline_says_when_sweeps_were_answered_missed_and_missing_and_what_they_spent_their_time_on() {
    let mut recorder = start(settings()).unwrap();
    // One sweep each tenth of a second from 1 s on; sweep 20 takes 300 ms, 30 to 34 never come, 40 is rejected.
    for sweep in (0..50).filter(|sweep| !(30..35).contains(sweep)) {
        let mut traces = sectored(sweep, 1, 1, 3);
        if sweep == 20 {
            traces[0].hops[3].finished_ns += 290 * MS;
        }
        if sweep == 40 {
            traces[0].hops[2].verdict = Verdict::RejectedStale;
        }
        recorder.accept(&traces[0], &with_clusters(&[(5, 0, 0), (6, 0, 0)]));
    }
    let found = snapshot(&recorder);
    let timeline = &found.timeline;
    assert_eq!((timeline.begin_ns, timeline.bucket_ns), (1_000 * MS, 250 * MS));
    let sum = |count: fn(&recorder::BucketSnapshot) -> u64| timeline.buckets.iter().map(count).sum::<u64>();
    assert_eq!(sum(|bucket| bucket.sweeps), found.end_to_end.count());
    assert_eq!((sum(|bucket| bucket.misses), found.deadline.misses), (2, 2));
    assert_eq!((sum(|bucket| bucket.missing), found.missing_sweeps), (5, 5));
    assert_eq!(sum(|bucket| bucket.detections.iter().sum()), 2 * 45);
    // Sweep 20 was due at 3.1 s and answered at 3.4 s; 36 was the first after the gap, due at 4.6 s.
    let at = |ns: u64| timeline.iter().find(|(begin_ns, _)| (*begin_ns..begin_ns + 250 * MS).contains(&ns)).unwrap().1;
    assert_eq!((at(3_400 * MS).max_ns, at(3_400 * MS).misses), (300 * MS, 1));
    assert_eq!(at(4_610 * MS).missing, 5);
    let median = at(1_110 * MS).quantile_ns(0.5).unwrap();
    assert!(median.abs_diff(10 * MS) <= 10 * MS / 32, "{median}");
    assert_eq!(at(3_400 * MS).quantile_ns(1.0), Some(300 * MS));
    let first = at(1_110 * MS);
    assert_eq!(first.source_late_ns, first.sweeps * MS);
    assert_eq!(first.spent_ns[1..], [[0, 0, first.sweeps * 3 * MS]; 3]);
}

#[test]
fn a_timeline_of_years_has_as_many_buckets_as_one_of_minutes() {
    let mut recorder = start(settings()).unwrap();
    for sweep in (0..40).map(|power| 1 << power) {
        recorder.accept(&sectored(sweep, 1, 1, 3)[0], &empty());
    }
    let found = snapshot(&recorder);
    assert!(found.timeline.buckets.len() <= 600);
    assert_eq!(found.timeline.buckets.iter().map(|bucket| bucket.sweeps).sum::<u64>(), 40);
}

#[test]
fn the_points_of_a_distribution_are_few_and_end_with_its_longest() {
    let sut = LatencySnapshot { values_ns: (1..=100_000).map(|us| [us * 1_000, 3]).collect(), beyond: 0 };
    let points = sut.points();
    assert!(points.len() < 150, "{}", points.len());
    assert_eq!(points.last(), Some(&[100 * MS, 300_000]));
    assert!(points.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] < pair[1][1]));
    // Between two points the share of longer values falls by 10 %, or by one value.
    let beyond = |point: &[u64; 2]| (300_000 - point[1]) as f64;
    assert!(points.windows(2).all(|pair| beyond(&pair[1]) >= 0.9 * beyond(&pair[0]) - 6.0));
    assert!(LatencySnapshot::default().points().is_empty());
}
