//! What was detected: by class, and over time.

use std::ops::Range;

use super::figures::{RunFigures, Timeline};
use super::parts::{Times, WIDE, absent, bar, class_colour, count, key, steps};
use super::plot::{Axis, Plot};
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
    let groups = groups(timeline);
    if groups.len() < 2 {
        return String::new();
    }
    let begins: Vec<f64> = groups.iter().map(|group| times.at(timeline.latency_ms[group.start].t_s)).collect();
    let width = times.at(groups.last().map_or(1, Range::len) as f64 * timeline.bucket_s);
    let mut below = vec![0.0; begins.len()];
    let (mut series, mut entries) = (Vec::new(), Vec::new());
    for class in classes {
        let Some(counts) = timeline.detections.get(*class) else { continue };
        let mean = |group: &Range<usize>| {
            let sweeps: u64 = timeline.latency_ms[group.clone()].iter().map(|bucket| bucket.sweeps).sum();
            counts.iter().take(group.end).skip(group.start).sum::<u64>() as f64 / sweeps.max(1) as f64
        };
        let above: Vec<f64> = groups.iter().zip(&below).map(|(group, below)| below + mean(group)).collect();
        let colour = class_colour(class);
        series.extend(steps(&begins, width, &above, &below, colour));
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
        + &figure(
            &plot.svg(),
            "Detections by class over time, one above the other: means of at least ten answered sweeps.",
        )
}

/// Least answered sweeps of a group.
const GROUP: u64 = 10;

/// Neighbouring buckets, so many that a mean over their sweeps says something: a sweep's sectors may lie in two of them.
fn groups(timeline: &Timeline) -> Vec<Range<usize>> {
    let mut groups = Vec::new();
    let (mut start, mut sweeps) = (0, 0);
    for (place, bucket) in timeline.latency_ms.iter().enumerate() {
        let before = place.checked_sub(1).and_then(|before| timeline.latency_ms.get(before));
        if before.is_some_and(|before| bucket.t_s - before.t_s > 4.0 * timeline.bucket_s) {
            (start, sweeps) = (place, 0);
        }
        sweeps += bucket.sweeps;
        if sweeps >= GROUP {
            groups.push(start..place + 1);
            (start, sweeps) = (place + 1, 0);
        }
    }
    groups
}
