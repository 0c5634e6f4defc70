//! What a sweep's time went into, by stage.

use super::figures::{RunFigures, Spent, Timeline};
use super::parts::{BLUE, ORANGE, PINK, SKY, Times, WIDE, absent, colour, key, ms, steps};
use super::plot::{Axis, Plot};
use crate::page::{escaped, figure};

pub(crate) fn section(figures: &RunFigures) -> String {
    let heading = "<h2>Where the time goes</h2>".to_owned();
    let Some(timeline) = &figures.timeline else {
        return heading
            + &absent("This report is of an older version: it does not say what sweeps spent their time on.");
    };
    let sweeps: u64 = timeline.latency_ms.iter().map(|bucket| bucket.sweeps).sum();
    if sweeps == 0 || timeline.spent_ms.is_empty() {
        return heading + &absent("No sweep was answered: there is no time to divide.");
    }
    heading + &waterfall(timeline, sweeps) + &over_time(figures, timeline)
}

/// Mean over all answered sweeps of a value that is given by bucket.
fn mean(timeline: &Timeline, values: &[f64], sweeps: u64) -> f64 {
    let weighted = timeline.latency_ms.iter().zip(values).map(|(bucket, value)| bucket.sweeps as f64 * value);
    weighted.sum::<f64>() / sweeps as f64
}

const LEFT: f64 = 96.0;
const RIGHT: f64 = 70.0;
const ROW: f64 = 26.0;

/// The mean sweep: each stage's time begins where that of the one before ended.
fn waterfall(timeline: &Timeline, sweeps: u64) -> String {
    let kinds = |stage: &Spent| {
        [(&stage.late, PINK), (&stage.transport, SKY), (&stage.queued, ORANGE), (&stage.busy, BLUE)]
            .map(|(values, colour)| (mean(timeline, values, sweeps).max(0.0), colour))
    };
    let rows: Vec<_> = timeline.spent_ms.iter().take(16).map(|stage| (stage.stage.as_str(), kinds(stage))).collect();
    let all: f64 = rows.iter().flat_map(|row| row.1).map(|kind| kind.0).sum();
    let scale = (f64::from(WIDE.0) - LEFT - RIGHT) / all.max(1e-9);
    let height = ROW * rows.len() as f64 + 30.0;
    let mut svg = format!("<svg viewBox=\"0 0 {} {height}\" width=\"{}\" role=\"img\" class=\"own\">", WIDE.0, WIDE.0);
    let mut at = 0.0;
    for (place, (stage, kinds)) in rows.iter().enumerate() {
        let top = ROW * place as f64;
        let sum: f64 = kinds.iter().map(|kind| kind.0).sum();
        svg += &format!(
            "<text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"end\">{}</text>",
            LEFT - 8.0,
            top + 17.0,
            escaped(stage)
        );
        for (value, colour) in kinds.iter().filter(|kind| kind.0 > 0.0) {
            svg += &format!(
                "<rect x=\"{:.1}\" y=\"{:.0}\" width=\"{:.1}\" height=\"16\" fill=\"{colour}\"/>",
                LEFT + scale * at,
                top + 4.0,
                (scale * value).max(0.5)
            );
            at += value;
        }
        svg += &format!("<text x=\"{:.1}\" y=\"{:.0}\">{} ms</text>", LEFT + scale * at + 5.0, top + 17.0, ms(sum));
    }
    let foot = ROW * rows.len() as f64;
    svg += &format!(
        "<path class=\"axis\" d=\"M{LEFT} {foot:.0}H{:.0}\"/><text x=\"{LEFT}\" y=\"{:.0}\">due</text>\
         <text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"end\">answered after {} ms on average</text></svg>",
        LEFT + scale * all,
        foot + 18.0,
        LEFT + scale * all,
        foot + 18.0,
        ms(all)
    );
    let entries = [(PINK, "source late"), (SKY, "transport: sent until started"), (ORANGE, "queued"), (BLUE, "busy")];
    let caption = "The mean answered sweep, from when its last return was due until its last detection was sent: the way of its \
                   last part through the stages.";
    key(&entries, &[]) + &figure(&svg, caption)
}

fn over_time(figures: &RunFigures, timeline: &Timeline) -> String {
    let answered: Vec<usize> =
        (0..timeline.latency_ms.len()).filter(|&place| timeline.latency_ms[place].sweeps > 0).collect();
    if answered.len() < 2 {
        return String::new();
    }
    let times = Times::of(figures);
    let begins: Vec<f64> = answered.iter().map(|&place| times.at(timeline.latency_ms[place].t_s)).collect();
    let width = times.at(timeline.bucket_s);
    let mut below: Vec<f64> = vec![0.0; begins.len()];
    let mut series = Vec::new();
    for (place, stage) in timeline.spent_ms.iter().enumerate() {
        let all = [&stage.late, &stage.transport, &stage.queued, &stage.busy];
        let sum = |bucket: usize| all.iter().filter_map(|values| values.get(bucket)).sum::<f64>().max(0.0);
        let above: Vec<f64> = answered.iter().zip(&below).map(|(&bucket, below)| below + sum(bucket)).collect();
        series.extend(steps(&begins, width, &above, &below, colour(place)));
        below = above;
    }
    let plot = Plot {
        size: WIDE,
        x: times.axis(),
        y: Axis::from_zero("mean of a bucket [ms]", below.iter().copied().fold(0.0, f64::max)),
        series,
        levels: Vec::new(),
        moments: times.moments(&timeline.events),
    };
    let entries: Vec<_> =
        timeline.spent_ms.iter().enumerate().map(|(place, stage)| (colour(place), stage.stage.as_str())).collect();
    let caption = "The same over time, by stage: transport, queued and busy together; the source’s is how late it sent. The upper \
                   edge is the mean latency.";
    key(&entries, &[]) + &figure(&plot.svg(), caption)
}
