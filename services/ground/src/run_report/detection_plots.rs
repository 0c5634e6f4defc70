//! What was detected: by class, and over time.

use super::figures::RunFigures;
use super::parts::{Times, WIDE, absent, bar, class_colour, count, key};
use super::plot::{Axis, Plot, Series, Shape};
use crate::page::{escaped, figure};

/// Classes in the order in which they stand.
const ORDER: [&str; 5] = ["rectangular", "ellipsoidal", "cylindrical", "conical", "unclassified"];

pub(crate) fn section(figures: &RunFigures) -> String {
    let heading = "<h2>Detections by class</h2>".to_owned();
    let Some(detections) = &figures.detections else {
        return heading + &absent("This report does not say what was detected.");
    };
    let all: u64 = detections.values().sum();
    if all == 0 {
        return heading + &absent("Nothing was detected.");
    }
    let most = detections.values().copied().max().unwrap_or(1).max(1);
    let mut text = heading + "<table class=\"plain\">";
    let known = ORDER.iter().copied().filter(|class| detections.contains_key(*class));
    let others = detections.keys().map(String::as_str).filter(|class| !ORDER.contains(class));
    let classes: Vec<&str> = known.chain(others).collect();
    for class in &classes {
        let number = detections.get(*class).copied().unwrap_or(0);
        text += &format!(
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{:.1} %</td></tr>",
            escaped(class),
            bar(420.0, &[(number as f64 / most as f64, class_colour(class))]),
            count(number),
            100.0 * number as f64 / all as f64
        );
    }
    text + "</table>" + &over_time(figures, &classes)
}

fn over_time(figures: &RunFigures, classes: &[&str]) -> String {
    let Some(timeline) = figures.timeline.as_ref().filter(|timeline| timeline.latency_ms.len() > 1) else {
        return String::new();
    };
    let times = Times::of(figures);
    // A mean over the answered sweeps: the number of sweeps in a bucket would show otherwise.
    let answered: Vec<(usize, f64)> = (timeline.latency_ms.iter().enumerate())
        .filter(|(_, bucket)| bucket.sweeps > 0)
        .map(|(place, bucket)| (place, bucket.sweeps as f64))
        .collect();
    if answered.len() < 2 {
        return String::new();
    }
    let x: Vec<f64> =
        answered.iter().map(|&(place, _)| times.at(timeline.latency_ms[place].t_s + timeline.bucket_s / 2.0)).collect();
    let along = |ys: &[f64]| x.iter().copied().zip(ys.iter().copied()).collect::<Vec<_>>();
    let mut below = vec![0.0; x.len()];
    let (mut series, mut entries) = (Vec::new(), Vec::new());
    for class in classes {
        let Some(counts) = timeline.detections.get(*class) else { continue };
        let mean = |&(place, sweeps): &(usize, f64)| counts.get(place).copied().unwrap_or(0) as f64 / sweeps;
        let above: Vec<f64> = answered.iter().zip(&below).map(|(bucket, below)| below + mean(bucket)).collect();
        let colour = class_colour(class);
        series.push(Series { colour, shape: Shape::Area(along(&below)), points: along(&above) });
        entries.push((colour, *class));
        below = above;
    }
    let plot = Plot {
        size: (WIDE.0, 250),
        x: times.axis(),
        y: Axis::from_zero("detections a sweep", below.iter().copied().fold(0.0, f64::max)),
        series,
        levels: Vec::new(),
        moments: times.moments(&timeline.events),
    };
    key(&entries, &[])
        + &figure(&plot.svg(), "Detections by class over time, one above the other: mean of the answered sweeps.")
}
