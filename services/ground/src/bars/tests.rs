//! The whole evaluation on a few scenes, with a judge that needs no training: the solid of least cost.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use lidar::ObstacleClass;
use messages::{Descriptors, Detection, Detections, Verdict};

use super::*;

fn read(path: &str) -> std::io::Result<String> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config").join(path))?;
    // Solids, whatever the shipped chain describes by.
    Ok(text.replace("solids = false", "solids = true"))
}

fn plan() -> EvaluationPlan {
    let mut plan: EvaluationPlan = toml::from_str(&read("evaluation/reference.toml").unwrap()).unwrap();
    plan.scenes = 6;
    plan.variants.scenes = 2;
    plan.variants.dense_scenes = 1;
    plan.sweeps.scenes = 2;
    plan.sweeps.sweeps = 3;
    plan.fit.sweeps = 1;
    plan.fit.passes = 2;
    plan.budget.scenes = 1;
    plan.budget.evaluations = vec![500, 20_000];
    plan
}

/// Takes a cluster for the solid of least cost; every n-th of them it calls unclassified, with `withheld` = n.
fn least_cost(withheld: Option<usize>) -> Judge {
    Box::new(move |input: &Descriptors, output: &mut Detections| {
        for (place, descriptor) in input.descriptors.iter().enumerate() {
            let mut detection = Detection { summary: descriptor.summary, ..Detection::default() };
            let fit = descriptor.fit_place().filter(|_| withheld.is_none_or(|n| place % n > 0));
            if let Some(fit) = fit.map(|place| &input.fits[place]) {
                let costs = fit.solids.map(|solid| solid.cost());
                let best = (1..4).fold(0, |best, q| if costs[q] < costs[best] { q } else { best });
                let weights = costs.map(|cost| (-0.5 * (cost - costs[best])).exp());
                detection.posterior = weights.map(|weight| weight / weights.iter().sum::<f32>());
                detection.class = ObstacleClass::SOLIDS[best];
                detection.first_solid = output.solids.len() as u32;
                detection.solids = u32::from(output.solids.push(fit.solids[best].solid).is_ok());
            }
            let _ = output.detections.push(detection);
        }
        Verdict::Complete
    })
}

/// A clock that goes on by a millisecond with each look.
fn evaluated(plan: &EvaluationPlan, judges: Judges<'_>) -> Result<Evaluation, EvaluateError> {
    let looks = AtomicU64::new(0);
    let clock = || 1_000_000 * looks.fetch_add(1, Ordering::Relaxed);
    Evaluation::measure(plan, &read, judges, &clock, &mut |_| ())
}

#[test]
fn solids_of_least_cost_are_mostly_right_and_everything_is_counted() {
    let plan = plan();
    let sut = evaluated(&plan, &|| least_cost(None)).unwrap();
    assert_eq!(sut, evaluated(&plan, &|| least_cost(None)).unwrap(), "the same again");

    let tally = &sut.reference;
    let all = tally.all.of;
    assert!((120..240).contains(&all) && tally.small > 0, "{all}, {}", tally.small);
    assert_eq!(tally.confusion.iter().flatten().sum::<u32>(), all);
    assert_eq!(tally.by_points.iter().chain(&tally.by_rings).map(|row| row.of).sum::<u32>(), 2 * all);
    assert!(tally.all.per_cent().unwrap() > 80.0, "{:?}", tally.all);
    assert!(tally.large().per_cent().unwrap() > 95.0, "{:?}", tally.large());
    assert_eq!((tally.withheld.count, tally.confident().kept.of), (0, all));
    let [centre_m, _] = tally.large_solids.centre_m.unwrap();
    assert!(centre_m > 0.0 && centre_m < 0.1, "{centre_m}");
    assert!(tally.large_solids.within_95.per_cent().unwrap() > 50.0);
    for variant in [&sut.noisy, &sut.dropouts, &sut.flat, &sut.dense] {
        assert!(variant.all.of > 20 && variant.all != tally.all);
    }
    assert_eq!(sut.summed.after.len(), 3);
    assert!(sut.summed.all().of > 30 && sut.summed.single.of > 2 * sut.summed.all().of);
    // Two looks at the clock for each pass.
    assert!((sut.fit.median_ms.unwrap() * f64::from(sut.fit.fits) - 1.0).abs() < 1e-9);
    assert!(sut.budget[0].all.count < sut.budget[1].all.count, "{:?}", sut.budget);

    let said = sut.to_string();
    assert!(sut.bars().iter().all(|bar| said.contains(bar.key)));
}

#[test]
fn what_falls_short_is_named_and_what_has_no_target_is_not() {
    let mut plan = plan();
    plan.bars = [("accuracy_per_cent", 20.0), ("false_alarm_per_cent", 1.0)]
        .map(|(key, target)| (key.to_owned(), target))
        .into();
    let all_in = evaluated(&plan, &|| least_cost(None)).unwrap();
    assert!(all_in.short().is_empty(), "{:?}", all_in.short());
    let withheld = evaluated(&plan, &|| least_cost(Some(2))).unwrap();
    assert_eq!(withheld.short(), ["false_alarm_per_cent"]);
    assert!(withheld.reference.all.count < all_in.reference.all.count, "unclassified is wrong");
    assert_eq!(withheld.reference.all.of, all_in.reference.all.of);
    let silent = evaluated(&plan, &|| least_cost(Some(1))).unwrap();
    assert_eq!(silent.short(), ["accuracy_per_cent", "false_alarm_per_cent"]);
    assert_eq!(silent.summed.all().count, 0);
}

#[test]
fn a_classifier_that_does_not_take_its_input_is_an_error() {
    let rejects = || -> Judge { Box::new(|_, _| Verdict::RejectedMalformed) };
    let error = evaluated(&plan(), &rejects).unwrap_err().to_string();
    assert!(error.starts_with("classifier: "), "{error}");
    let drops = || -> Judge { Box::new(|_, _| Verdict::Complete) };
    assert!(matches!(evaluated(&plan(), &drops), Err(EvaluateError::Rejected(Verdict::Complete))));
}
