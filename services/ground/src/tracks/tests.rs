//! The whole evaluation on a few short scenes, with stand-ins for classifier and tracker that need no training.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use crate::{Judge, Sense};
use lidar::ObstacleClass;
use messages::{ClosestApproach, Descriptors, Detection, Detections, Part, Track, TrackState, Tracks, Verdict};

fn read(path: &str) -> std::io::Result<String> {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(path))
}

fn plan() -> TracksPlan {
    let mut plan: TracksPlan = toml::from_str(&read("evaluation/tracks.toml").unwrap()).unwrap();
    (plan.scenes, plan.sweeps) = (2, 14);
    (plan.encounters.count, plan.encounters.track_s) = (6, 0.5);
    (plan.cost.obstacles, plan.cost.sweeps) = (5, 3);
    plan
}

/// Every cluster with a fit is of the solid of least cost.
fn judge() -> Judge {
    Box::new(|input: &Descriptors, output: &mut Detections| {
        output.header = input.header;
        for (place, descriptor) in input.descriptors.iter().enumerate() {
            let mut detection = Detection { summary: descriptor.summary, ..Detection::default() };
            if let Some(fit) = descriptor.fit_place().map(|place| &input.fits[place]) {
                let costs = fit.solids.map(|solid| solid.cost());
                let best = (1..4).fold(0, |best, q| if costs[q] < costs[best] { q } else { best });
                detection.posterior = std::array::from_fn(|q| if q == best { 0.7 } else { 0.1 });
                detection.class = ObstacleClass::SOLIDS[best];
                detection.first_solid = output.solids.len() as u32;
                detection.solids = u32::from(output.solids.push(fit.solids[best].solid).is_ok());
            }
            assert_eq!(place, output.detections.len());
            let _ = output.detections.push(detection);
        }
        Verdict::Complete
    })
}

/// Follows what is nearest within a metre of where it was; velocity from two sweeps. `confirm` sweeps make it believed.
fn follower(confirm: u32) -> Follower {
    let mut last: BTreeMap<u64, ([f32; 3], u32)> = BTreeMap::new();
    let mut next_id = 1;
    Box::new(move |part: Part, input: &Detections, output: &mut Tracks| {
        output.detections.header = input.header;
        output.table.time_ns = part.sensor_time_ns + input.header.period_ns;
        let mut now = BTreeMap::new();
        for detection in input.detections.iter().filter(|one| one.summary.points >= 5) {
            let solid = detection.solid_place().and_then(|place| input.solids.get(place));
            let at_m = solid.map_or(detection.summary.centroid_m, |solid| solid.centre_m);
            let apart = |(_, (before, _)): &(&u64, &([f32; 3], u32))| {
                (0..3).map(|axis| (at_m[axis] - before[axis]).powi(2)).sum::<f32>()
            };
            let near = last.iter().filter(|one| apart(one) < 1.0).min_by(|a, b| apart(a).total_cmp(&apart(b)));
            let found = near.map(|(&id, &(before, seen))| (id, before, seen));
            let (id, before, seen) = found.unwrap_or_else(|| {
                next_id += 1;
                (next_id, at_m, 0)
            });
            last.remove(&id);
            now.insert(id, (at_m, seen + 1));
            let mut track = Track { id, position_m: at_m, class: detection.class, ..Track::default() };
            track.velocity_mps = std::array::from_fn(|axis| 10.0 * (at_m[axis] - before[axis]));
            for (place, variance) in [0, 6, 11, 15, 18, 20].into_iter().zip([0.01, 0.01, 0.01, 1.0, 1.0, 1.0]) {
                track.covariance[place] = variance;
            }
            (track.posterior, track.age_sweeps) = (detection.posterior, seen + 1);
            track.state = if seen + 1 >= confirm { TrackState::Confirmed } else { TrackState::Tentative };
            if let Some(solid) = solid {
                track.size_m = solid.size_m;
            }
            track.approach = ClosestApproach { distance_m: 1.0, collision_probability: 0.4, ..Default::default() };
            (track.first_key, track.keys) = (output.table.keys.len() as u32, 1);
            let _ = output.table.keys.push(detection.summary.key);
            let _ = output.table.tracks.push(track);
        }
        last = now;
        Verdict::Complete
    })
}

const DANGER: Danger = Danger { own_radius_m: 1.0, horizon_s: 20.0, alert: 0.5 };

fn evaluated(plan: &TracksPlan, followers: Followers<'_>) -> Result<TrackEvaluation, EvaluateError> {
    let looks = AtomicU64::new(0);
    let clock = || 1_000_000 * looks.fetch_add(1, Ordering::Relaxed);
    TrackEvaluation::measure(plan, DANGER, &read, &judge, followers, &clock, &mut |_| ())
}

fn note() -> TracksNote {
    let run = crate::RunNote { plan_file: "p<1>.toml".to_owned(), machine: "m".to_owned(), cores: 1, duration_s: 1.0 };
    TracksNote { classifier: "c".to_owned(), recording: None, run }
}

#[test]
fn tracks_from_nearest_detections_are_mostly_right_and_everything_is_counted() {
    let plan = plan();
    let sut = evaluated(&plan, &|| follower(2)).unwrap();
    assert_eq!(sut, evaluated(&plan, &|| follower(2)).unwrap(), "the same again");

    let judged = sut.scores.judged();
    assert_eq!(judged.clear.matched + judged.clear.missed, judged.clear.objects);
    assert!(judged.clear.objects > 500, "{judged:?}");
    assert!(judged.clear.mota().unwrap() > 0.7 && judged.identity.idf1().unwrap() > 0.75, "{judged:?}");
    assert_eq!(sut.scores.followed.len(), 3 + plan.also_m.len());
    assert!(sut.scores.followed[1].clear.objects < judged.clear.objects, "fewer of more returns");
    let off_m = sut.scores.errors.position_m[3].value().unwrap();
    assert!(off_m > 0.01 && off_m < 0.5, "{off_m}");
    assert_eq!(sut.scores.consistency.by_sweep.len(), 14);
    assert_eq!(sut.scores.confirming.quantiles().unwrap()[0], 2.0);
    assert!(sut.scores.classes.last(5).of > 40 && sut.scores.classes.last(5).per_cent().unwrap() > 60.0);
    assert_eq!(sut.encounters.all.len(), 6);
    assert!(sut.encounters.tracked().count > 0);
    assert_eq!(sut.encounters.missed().count, sut.encounters.missed().of, "0.4 is less than 0.5");
    assert_eq!(sut.time.ms, Some([1.0, 1.0]));

    let said = sut.to_string();
    assert!(sut.bars().iter().all(|bar| said.contains(bar.key)));
    let page = sut.to_html(&note());
    assert!(page.matches("<svg").count() == 8 && page.contains("p&lt;1&gt;.toml"), "{}", page.matches("<svg").count());
    assert!(!page.contains("http") && !page.contains("<script"));
    let json: serde_json::Value = serde_json::from_str(&sut.to_json(&note())).unwrap();
    assert_eq!(json["followed"][0]["objects"], judged.clear.objects);
    assert_eq!(json["bars"].as_array().unwrap().len(), sut.bars().len());
}

#[test]
fn what_falls_short_is_named_and_a_later_confirmation_costs_accuracy() {
    let mut plan = plan();
    plan.encounters.count = 0;
    plan.bars = [("mota_per_cent", 70.0), ("confirm_sweeps", 3.0)].map(|(key, target)| (key.to_owned(), target)).into();
    let early = evaluated(&plan, &|| follower(2)).unwrap();
    assert!(early.short().is_empty(), "{early}");
    let late = evaluated(&plan, &|| follower(9)).unwrap();
    assert_eq!(late.short(), ["mota_per_cent", "confirm_sweeps"]);
    let silent = evaluated(&plan, &|| follower(99)).unwrap();
    assert_eq!(silent.scores.judged().clear.mota(), Some(0.0));
    assert!(silent.scores.classes.last(5).count > 0, "tentative tracks have a class");
    assert!(silent.bars().iter().any(|bar| bar.sense == Sense::AtMost && bar.measured.value.is_none()));
}

#[test]
fn a_tracker_without_tracks_or_foresight_is_an_error() {
    let rejects = || -> Follower { Box::new(|_, _, _| Verdict::RejectedMalformed) };
    let error = evaluated(&plan(), &rejects).unwrap_err().to_string();
    assert!(error.starts_with("tracker: "), "{error}");
    let silent = || -> Follower { Box::new(|_, _, _| Verdict::Complete) };
    assert!(matches!(evaluated(&plan(), &silent), Err(EvaluateError::Tracker(Verdict::Complete))));
    let mut far = plan();
    far.encounters.lead_s = 21.0;
    let error = evaluated(&far, &|| follower(2)).unwrap_err().to_string();
    assert_eq!(error, "encounters.lead_s is 21, must be at most the tracker's horizon, 20");
}

#[test]
fn a_recording_is_told_without_truth() {
    let observer = crate::Observer::new(&crate::View::of("reference-tumbling"), &read).unwrap();
    let mut source = observer.simulator(5).unwrap();
    let sut = UnknownTracks::measure(&mut source, 12, &plan(), &read, &judge, &|| follower(2)).unwrap();
    assert_eq!((sut.sweeps, sut.rejected), (12, 0));
    assert!(sut.confirmed > 10 && sut.covered.per_cent().unwrap() > 60.0, "{sut}");
    assert!(sut.changed.of > 50 && sut.changed.per_cent().unwrap() < 5.0, "{sut}");
    assert!(sut.to_html(&note()).contains("<svg") && sut.to_json(&note()).contains("\"sweeps\": 12"));
}
