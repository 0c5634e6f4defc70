//! Latency: its distribution, and how it went over time.

use super::figures::{LatencyBucket, Percentiles, Points, RunFigures};
use super::parts::{
    BLUE, DARK, GREEN, ORANGE, PINK, RED, SKY, Times, WIDE, absent, count, key, maybe_ms, moment_words, ms, pieces,
};
use super::plot::{Axis, Plot, Series, Shape, plain};
use crate::page::figure;

pub(crate) fn section(figures: &RunFigures) -> String {
    format!("<h2>Latency</h2>{}{}{}", table(figures), distribution(figures), over_time(figures))
}

/// The deadline [ms], where there is one.
pub(crate) fn deadline_ms(figures: &RunFigures) -> Option<f64> {
    let deadline = figures.deadline.as_ref().filter(|_| figures.pace != "fast")?;
    (deadline.deadline_ms.is_finite() && deadline.deadline_ms > 0.0).then_some(deadline.deadline_ms)
}

fn table(figures: &RunFigures) -> String {
    let mut text =
        "<div class=\"wide\"><table><tr><th>Latency [ms]</th><th class=\"n\">count</th><th class=\"n\">p50</th>\
                    <th class=\"n\">p99</th><th class=\"n\">p99.9</th><th class=\"n\">max</th><th>from → to</th></tr>"
            .to_owned();
    let latency = &figures.latency_ms;
    let corrected = latency.end_to_end_corrected.filter(|corrected| corrected.count > latency.end_to_end.count);
    let sweep = "last return of a sweep → its last detection sent";
    let obstacle = "last return of an obstacle → its detection sent";
    let rows: [(&str, Option<Percentiles>, &str); 4] = [
        ("end to end", Some(latency.end_to_end), sweep),
        ("corrected", corrected, "the same; a sweep without an answer waits for the next one’s"),
        ("obstacle", figures.obstacle_latency_ms, obstacle),
        ("obstacle on the seam", figures.seam_latency_ms, "the same, of those that the 0° azimuth cuts"),
    ];
    for (name, values, says) in rows {
        let Some(values) = values.filter(|values| values.count > 0) else { continue };
        text += &format!("<tr><td>{name}</td><td class=\"n\">{}</td>", count(values.count));
        for value in [values.p50, values.p99, values.p999, values.max] {
            text += &format!("<td class=\"n\">{}</td>", maybe_ms(value));
        }
        text += &format!("<td>{says}</td></tr>");
    }
    if text.ends_with("</th></tr>") { String::new() } else { text + "</table></div>" }
}

/// Share of longer ones against latency: (1 / share, latency).
fn curve(points: &Points) -> Vec<(f64, f64)> {
    let Some(&(longest, all)) = points.last().filter(|last| last.1 > 0) else { return Vec::new() };
    let share = |at_most: u64| all as f64 / (all.saturating_sub(at_most)) as f64;
    let mut curve: Vec<_> =
        points.iter().filter(|point| point.1 < all).map(|&(ms, at_most)| (share(at_most), ms)).collect();
    if let Some(&(ms, _)) = points.first() {
        curve.insert(0, (1.0, ms));
    }
    curve.push((all as f64, longest));
    curve
}

fn percentile_words(one_over_share: f64) -> String {
    plain((100.0 - 100.0 / one_over_share).clamp(0.0, 100.0))
}

fn distribution(figures: &RunFigures) -> String {
    let Some(histograms) = &figures.latency_histogram_ms else {
        return absent("This report is of an older version: it has percentiles and no distributions to draw.");
    };
    let corrected = histograms.end_to_end_corrected != histograms.end_to_end;
    let curves = [
        ("obstacle on the seam", PINK, curve(&histograms.seam), 1),
        ("obstacle", GREEN, curve(&histograms.obstacle), 2),
        ("end to end, corrected", ORANGE, if corrected { curve(&histograms.end_to_end_corrected) } else { vec![] }, 2),
        ("end to end", BLUE, curve(&histograms.end_to_end), 3),
    ];
    let curves: Vec<_> = curves.into_iter().filter(|curve| curve.2.len() > 1).collect();
    if curves.is_empty() {
        return absent("No sweep was answered: there is no latency to draw.");
    }
    let all = || curves.iter().flat_map(|curve| &curve.2).map(|point| point.1);
    let deadline = deadline_ms(figures);
    let most = all().chain(deadline).fold(0.01, f64::max);
    let least = all().filter(|ms| *ms > 0.0).chain(deadline).fold(most, f64::min);
    let ends = curves.iter().filter_map(|curve| curve.2.last()).map(|point| point.0);
    let far = ends.fold(10.0, f64::max).min(1e12);
    let decades: Vec<f64> = (0..=12).map(|power| 10_f64.powi(power)).take_while(|tick| *tick <= far * 1.01).collect();
    let x = Axis {
        says: "percentile of the sweeps or obstacles [%]",
        range: 1.0..far,
        ticks: [1.0, 2.0].into_iter().chain(decades.into_iter().skip(1)).collect(),
        log: true,
        words: percentile_words,
    };
    let series = curves.iter().map(|(_, colour, points, width)| Series {
        colour,
        shape: Shape::Line(*width),
        points: points.clone(),
    });
    let plot = Plot {
        size: (WIDE.0, 330),
        x,
        y: Axis::log("latency [ms]", least.max(most * 1e-5), most),
        series: series.collect(),
        levels: deadline.map(|at| (format!("deadline {} ms", plain(at)), RED, at)).into_iter().collect(),
        moments: Vec::new(),
    };
    let mut entries: Vec<(&str, &str)> = curves.iter().map(|(name, colour, ..)| (*colour, *name)).collect();
    entries.reverse();
    let dashed: Vec<_> = deadline.map(|_| (RED, "deadline")).into_iter().collect();
    let caption = "How long the given share of all waited at most; each mark to the right is ten times rarer. The line ends at \
                   the longest of all.";
    key(&entries, &dashed) + &figure(&plot.svg(), caption)
}

fn over_time(figures: &RunFigures) -> String {
    let heading = "<h3>Over time</h3>";
    let Some(timeline) = &figures.timeline else {
        return heading.to_owned() + &absent("This report is of an older version: it has no timeline.");
    };
    if timeline.latency_ms.iter().all(|bucket| bucket.sweeps == 0) {
        return heading.to_owned() + &absent("No sweep was answered: there is no latency to draw.");
    }
    let times = Times::of(figures);
    let of = |value: fn(&LatencyBucket) -> Option<f64>| -> Vec<(f64, f64)> {
        let middle = |bucket: &LatencyBucket| times.at(bucket.t_s + timeline.bucket_s / 2.0);
        timeline.latency_ms.iter().filter_map(|bucket| Some((middle(bucket), value(bucket)?))).collect()
    };
    let (p50, p99, max) = (of(|bucket| bucket.p50), of(|bucket| bucket.p99), of(|bucket| bucket.max));
    let deadline = deadline_ms(figures);
    let most = max.iter().map(|point| point.1).chain(deadline).fold(0.01, f64::max);
    let least = p50.iter().map(|point| point.1).filter(|ms| *ms > 0.0).chain(deadline).fold(most, f64::min);
    let mut series: Vec<Series> = Vec::new();
    for (colour, points, width) in [(SKY, p99, 1), (BLUE, p50, 2)] {
        let lines = pieces(points).into_iter();
        series.extend(lines.map(|points| match points.len() {
            1 => Series { colour, shape: Shape::Dots(width), points },
            _ => Series { colour, shape: Shape::Line(width), points },
        }));
    }
    series.push(Series { colour: DARK, shape: Shape::Dots(2), points: max });
    let y = Axis::log("end to end [ms]", least.max(most * 1e-5), most);
    let missed = timeline.latency_ms.iter().filter(|bucket| bucket.misses + bucket.missing > 0);
    let missed: Vec<_> = missed.map(|bucket| (times.at(bucket.t_s + timeline.bucket_s / 2.0), y.range.start)).collect();
    let any_missed = !missed.is_empty();
    series.push(Series { colour: RED, shape: Shape::Dots(4), points: missed });
    let plot = Plot {
        size: WIDE,
        x: times.axis(),
        y,
        series,
        levels: deadline.map(|at| (format!("deadline {} ms", plain(at)), RED, at)).into_iter().collect(),
        moments: times.moments(&timeline.events),
    };
    let mut entries = vec![(BLUE, "p50"), (SKY, "p99"), (DARK, "longest")];
    if any_missed {
        entries.push((RED, "on the axis: sweeps missed their deadline or never came"));
    }
    let mut dashed: Vec<(&str, &str)> = deadline.map(|_| (RED, "deadline")).into_iter().collect();
    dashed.extend(moment_words(&timeline.events));
    let caption = format!(
        "Buckets of {} s; sweeps count when they were answered. Median and p99 are within 3 %, the longest is exact: {} ms.",
        plain(timeline.bucket_s),
        ms(figures.latency_ms.end_to_end.max.unwrap_or(0.0))
    );
    heading.to_owned() + &key(&entries, &dashed) + &figure(&plot.svg(), &caption)
}
