//! A plot over the time of a soak: lines, a level, and where the faults were. By plotters.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;

/// Width and height [px]: what a phone shows half as large can still be read.
const SIZE: (u32, u32) = (560, 270);
const FONT: &str = "sans-serif";
/// Most faults that are drawn one by one.
const MOST_MARKS: usize = 400;

/// A line.
pub(super) struct Line {
    pub(super) name: String,
    pub(super) colour: &'static str,
    pub(super) points: Vec<(f64, f64)>,
}

/// A plot over time.
pub(super) struct Plot<'a> {
    /// What the upright axis is, with its unit.
    pub(super) says: &'a str,
    /// Seconds.
    pub(super) length_s: f64,
    pub(super) lines: Vec<Line>,
    /// A dashed line across.
    pub(super) level: Option<f64>,
    /// Moments of faults [s].
    pub(super) marks: &'a [f64],
    /// The axis begins at 0; else a little below the least.
    pub(super) from_zero: bool,
}

/// A line of numbers with round ticks.
#[derive(Clone)]
struct Axis {
    range: Range<f64>,
    step: f64,
}

impl Axis {
    fn new(range: Range<f64>, parts: f64) -> Self {
        let length = (range.end - range.start).max(1e-9);
        let decade = 10_f64.powf((length / parts).log10().floor());
        let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| length / (factor * decade) <= parts).unwrap_or(10.0);
        Self { range, step: factor * decade }
    }
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        limit.0 + (share.clamp(0.0, 1.0) * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            return Vec::new();
        }
        let first = (self.range.start / self.step).ceil();
        let ticks = (0..=20).map(|tick| (first + f64::from(tick)) * self.step);
        ticks.take_while(|tick| *tick <= self.range.end + self.step * 1e-9).collect()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

fn colour(hex: &str) -> RGBColor {
    let part = |place: usize| hex.get(place..place + 2).and_then(|part| u8::from_str_radix(part, 16).ok()).unwrap_or(0);
    RGBColor(part(1), part(3), part(5))
}

/// The unit of a time axis: its word and its length [s].
fn unit(length_s: f64) -> (&'static str, f64) {
    match length_s {
        s if s >= 3.0 * 3600.0 => ("time [h]", 3600.0),
        s if s >= 180.0 => ("time [min]", 60.0),
        _ => ("time [s]", 1.0),
    }
}

impl Plot<'_> {
    /// The picture, its key and the words below it.
    pub(super) fn figure(&self, caption: &str) -> String {
        let key: String = self.lines.iter().filter(|_| self.lines.len() > 1).fold(String::new(), |key, line| {
            key + &format!("<span><i style=\"background:{}\"></i>{}</span>", line.colour, super::escaped(&line.name))
        });
        format!("<figure><div class=\"key\">{key}</div>{}<figcaption>{caption}</figcaption></figure>", self.svg())
    }

    fn svg(&self) -> String {
        let mut picture = String::new();
        if self.draw(&mut picture).is_err() {
            return String::new();
        }
        picture
    }

    fn upright(&self) -> Range<f64> {
        let values = || self.lines.iter().flat_map(|line| &line.points).map(|point| point.1).chain(self.level);
        let most = values().fold(f64::NEG_INFINITY, f64::max);
        let least = values().fold(f64::INFINITY, f64::min);
        if !(most.is_finite() && least.is_finite()) {
            return 0.0..1.0;
        }
        if self.from_zero {
            return 0.0..(1.08 * most).max(1.0);
        }
        let room = (0.1 * (most - least)).max(0.02 * most.abs()).max(0.5);
        (least - room).max(0.0)..most + room
    }

    fn draw(&self, picture: &mut String) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
        let (words, second) = unit(self.length_s);
        let area = SVGBackend::with_string(picture, SIZE).into_drawing_area();
        let upright = self.upright();
        let across = 0.0..(self.length_s / second).max(1e-6);
        let mut chart = ChartBuilder::on(&area)
            .margin(6)
            .margin_right(14)
            .x_label_area_size(42)
            .y_label_area_size(62)
            .build_cartesian_2d(Axis::new(across.clone(), 7.0), Axis::new(upright.clone(), 5.0))?;
        let short = |value: &f64| super::tables::plain(*value);
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(colour("#DDDDDD"))
            .axis_style(colour("#999999"))
            .label_style((FONT, 15))
            .axis_desc_style((FONT, 15))
            .x_label_formatter(&short)
            .y_label_formatter(&short)
            .x_desc(words)
            .y_desc(self.says)
            .draw()?;
        let every = self.marks.len().div_ceil(MOST_MARKS).max(1);
        for mark in self.marks.iter().step_by(every) {
            let at = mark / second;
            chart.draw_series([PathElement::new(
                vec![(at, upright.start), (at, upright.end)],
                colour("#D55E00").mix(0.35).stroke_width(1),
            )])?;
        }
        if let Some(level) = self.level {
            let ends = [(across.start, level), (across.end, level)];
            chart.draw_series(DashedLineSeries::new(ends, 7, 5, colour("#444444").stroke_width(2)))?;
        }
        for line in &self.lines {
            let points = line.points.iter().map(|(t_s, value)| (t_s / second, *value));
            chart.draw_series(LineSeries::new(points, colour(line.colour).stroke_width(2)))?;
        }
        area.present()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_there_is_to_draw_is_a_picture() {
        let line = |points: Vec<(f64, f64)>| Line { name: "a".to_owned(), colour: "#0072B2", points };
        let cases = [vec![], vec![(0.0, 0.0)], vec![(0.0, f64::NAN), (1.0, 3.0)], vec![(0.0, 1e9), (9.0, 1e9)]];
        for points in cases {
            let marks = [0.5; 1000];
            let lines = vec![line(points)];
            let sut = Plot { says: "x", length_s: 10.0, lines, level: Some(5.0), marks: &marks, from_zero: false };
            let text = sut.figure("caption");
            assert!(text.contains("<svg") && text.contains("</svg>") && !text.contains("NaN"));
        }
    }
}
