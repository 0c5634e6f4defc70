//! Pieces that several sections of the page are made of.

use super::figures::{Event, RunFigures};
use super::plot::{Axis, Series, Shape};
use crate::page::escaped;

/// Colours that stay apart for the colour-blind (M. Okabe and K. Ito, Color Universal Design).
pub(crate) const BLUE: &str = "#0072B2";
pub(crate) const SKY: &str = "#56B4E9";
pub(crate) const GREEN: &str = "#009E73";
pub(crate) const YELLOW: &str = "#E3D52B";
pub(crate) const ORANGE: &str = "#E69F00";
pub(crate) const RED: &str = "#D55E00";
pub(crate) const PINK: &str = "#CC79A7";
pub(crate) const GREY: &str = "#8A8A8A";
pub(crate) const DARK: &str = "#444444";

/// Colours of processes and stages by position, the source first.
const BY_PLACE: [&str; 8] = [PINK, SKY, BLUE, ORANGE, GREEN, GREY, YELLOW, RED];

/// The colour at a place.
pub(crate) fn colour(place: usize) -> &'static str {
    BY_PLACE[place % BY_PLACE.len()]
}

/// The colour of a class.
pub(crate) fn class_colour(class: &str) -> &'static str {
    match class {
        "rectangular" => BLUE,
        "ellipsoidal" => ORANGE,
        "cylindrical" => GREEN,
        "conical" => PINK,
        _ => GREY,
    }
}

/// A whole plot's size [px].
pub(crate) const WIDE: (u32, u32) = (1040, 290);
/// Half a page's.
pub(crate) const HALF: (u32, u32) = (512, 270);

/// The words for colours, to stand above a plot. A dashed one is a line across or upwards.
pub(crate) fn key(entries: &[(&str, &str)], dashed: &[(&str, &str)]) -> String {
    let mut text = "<p class=\"key\">".to_owned();
    for (colour, words) in entries {
        text += &format!(
            "<span><svg width=\"14\" height=\"12\" aria-hidden=\"true\"><rect width=\"14\" height=\"12\" rx=\"2\" \
             fill=\"{colour}\"/></svg>{}</span>",
            escaped(words)
        );
    }
    for (colour, words) in dashed {
        text += &format!(
            "<span><svg width=\"22\" height=\"12\" aria-hidden=\"true\"><path d=\"M0 6H22\" stroke=\"{colour}\" \
             stroke-width=\"2\" stroke-dasharray=\"5 3\"/></svg>{}</span>",
            escaped(words)
        );
    }
    text + "</p>"
}

/// A section that cannot be shown, and why.
pub(crate) fn absent(why: &str) -> String {
    format!("<p class=\"absent\">{why}</p>")
}

/// The time axis of a run: its unit grows with its length.
pub(crate) struct Times {
    /// What a second is in the unit.
    scale: f64,
    says: &'static str,
    length: f64,
}

impl Times {
    /// Of a run.
    pub(crate) fn of(figures: &RunFigures) -> Self {
        let timeline = figures.timeline.as_ref();
        let sweeps = timeline.and_then(|line| Some(line.latency_ms.last()?.t_s + line.bucket_s));
        let samples = timeline.and_then(|line| Some(line.sample_t_s.last()? + line.sample_s));
        let known = [figures.duration_s, sweeps, samples].into_iter().flatten().filter(|s| s.is_finite());
        let length_s = known.fold(0.0, f64::max).clamp(0.1, 1e12);
        let (scale, says) = match length_s {
            s if s > 3.0 * 3600.0 => (1.0 / 3600.0, "time since the start [h]"),
            s if s > 600.0 => (1.0 / 60.0, "time since the start [min]"),
            _ => (1.0, "time since the start [s]"),
        };
        Self { scale, says, length: length_s * scale }
    }

    /// The axis.
    pub(crate) fn axis(&self) -> Axis<'static> {
        Axis::between(self.says, 0.0..self.length)
    }

    /// The place of a time [s].
    pub(crate) fn at(&self, t_s: f64) -> f64 {
        (t_s * self.scale).clamp(0.0, self.length)
    }

    /// The numbered events as lines upwards.
    pub(crate) fn moments(&self, events: &[Event]) -> Vec<(String, &'static str, f64)> {
        let moment = |(number, event): (usize, &Event)| (number.to_string(), event_colour(event), self.at(event.t_s));
        (1..).zip(events).map(moment).collect()
    }
}

pub(crate) fn event_colour(event: &Event) -> &'static str {
    if event.kind == "restart" { DARK } else { GREY }
}

/// What the lines upwards are, for the words above a plot.
pub(crate) fn moment_words(events: &[Event]) -> Vec<(&'static str, &'static str)> {
    let is_restart = |event: &Event| event.kind == "restart";
    let restarts = events.iter().any(is_restart).then_some((DARK, "restart, numbered as under Events"));
    let steps = events.iter().any(|event| !is_restart(event)).then_some((GREY, "step of the ladder of overload"));
    restarts.into_iter().chain(steps).collect()
}

/// Buckets as steps: from the begin of each to its end, for the area up to `above` over that up to `below`. A gap stays one.
pub(crate) fn steps(begins: &[f64], width: f64, above: &[f64], below: &[f64], colour: &'static str) -> Vec<Series> {
    let rows: Vec<(f64, f64)> = begins.iter().copied().zip(0_u32..).map(|(at, place)| (at, f64::from(place))).collect();
    let area = |piece: Vec<(f64, f64)>| {
        let mut edges = (Vec::new(), Vec::new());
        for (number, &(begin, place)) in piece.iter().enumerate() {
            let end = piece.get(number + 1).map_or(begin + width, |next| next.0);
            let value = |values: &[f64]| values.get(place as usize).copied().unwrap_or(0.0);
            for at in [begin, end] {
                edges.0.push((at, value(above)));
                edges.1.push((at, value(below)));
            }
        }
        Series { colour, points: edges.0, shape: Shape::Area(edges.1) }
    };
    pieces(rows).into_iter().map(area).collect()
}

/// Cuts a line where points are missing: where the distance is more than four times the usual one.
pub(crate) fn pieces(points: Vec<(f64, f64)>) -> Vec<Vec<(f64, f64)>> {
    let mut steps: Vec<f64> = points.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    for point in points {
        match pieces.last_mut().and_then(|piece| Some((piece.last()?.0, piece))) {
            Some((before, piece)) if point.0 - before <= 4.0 * usual => piece.push(point),
            _ => pieces.push(vec![point]),
        }
    }
    pieces
}

/// A share as a bar in a row of a table: lengths [0 to 1 of the whole] with their colours. What is there shows.
pub(crate) fn bar(width_px: f64, shares: &[(f64, &str)]) -> String {
    let mut left = 0.0;
    let mut text = format!("<svg class=\"bar\" width=\"{width_px}\" height=\"14\" viewBox=\"0 0 {width_px} 14\">");
    for &(share, colour) in shares.iter().filter(|(share, _)| *share > 0.0) {
        let width = (share.min(1.0) * width_px).max(2.0).min(width_px - left);
        text += &format!("<rect x=\"{left:.1}\" y=\"1\" width=\"{width:.1}\" height=\"12\" fill=\"{colour}\"/>");
        left += width;
    }
    text + "</svg>"
}

/// Milliseconds with as many digits as they are worth.
pub(crate) fn ms(value: f64) -> String {
    match value.abs() {
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        v if v >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// The same, with a dash for nothing.
pub(crate) fn maybe_ms(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), ms)
}

/// A count with thin spaces between thousands.
pub(crate) fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}
