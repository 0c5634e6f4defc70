//! A plot of layers, lines and dots over two axes, by plotters.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::paper::charts::{FONT, INK, PALE, draw, rgb};

/// One of the two axes.
pub(crate) struct Axis<'a> {
    /// What it is, with its unit.
    pub(crate) says: &'a str,
    /// Where it begins and ends.
    pub(crate) range: Range<f64>,
    /// Where numbers stand.
    pub(crate) ticks: Vec<f64>,
    /// Whether equal factors are equal distances.
    pub(crate) log: bool,
    /// The number's words.
    pub(crate) words: fn(f64) -> String,
}

/// Something drawn.
pub(crate) enum Shape {
    /// A line of this width.
    Line(u32),
    /// Dots of this radius.
    Dots(u32),
    /// The area between the points and those of the second list.
    Area(Vec<(f64, f64)>),
}

/// A series.
pub(crate) struct Series {
    pub(crate) colour: &'static str,
    pub(crate) shape: Shape,
    pub(crate) points: Vec<(f64, f64)>,
}

/// A plot.
pub(crate) struct Plot<'a> {
    /// Width and height [px].
    pub(crate) size: (u32, u32),
    pub(crate) x: Axis<'a>,
    pub(crate) y: Axis<'a>,
    /// Drawn in this order.
    pub(crate) series: Vec<Series>,
    /// Dashed lines across: words, colour, value.
    pub(crate) levels: Vec<(String, &'static str, f64)>,
    /// Dashed lines upwards: words above, colour, value.
    pub(crate) moments: Vec<(String, &'static str, f64)>,
}

impl<'a> Axis<'a> {
    /// From 0 to a little over `most`, or over 1 where that is less than nothing.
    pub(crate) fn from_zero(says: &'a str, most: f64) -> Self {
        let most = if most.is_finite() && most > 0.0 { most.min(1e15) } else { 1.0 };
        let (step, end) = (step(most, 5.0), 1.05 * most);
        let ticks = (0..=12).map(|tick| f64::from(tick) * step).take_while(|tick| *tick <= end).collect();
        Self { says, range: 0.0..end, ticks, log: false, words: plain }
    }

    /// Exactly from `range.start` to its end: time.
    pub(crate) fn between(says: &'a str, range: Range<f64>) -> Self {
        let length = (range.end - range.start).clamp(1e-3, 1e15);
        let step = step(length, 8.0);
        let first = (range.start / step).ceil();
        let ticks = (0..=20).map(|tick| (first + f64::from(tick)) * step).take_while(|tick| *tick <= range.end);
        Self { says, ticks: ticks.collect(), range: range.start..range.start + length, log: false, words: plain }
    }

    /// Decades round the values, with 1, 2 and 5 where there are few.
    pub(crate) fn log(says: &'a str, least: f64, most: f64) -> Self {
        let within = |value: f64| if value.is_finite() { value.clamp(1e-4, 1e9) } else { 1.0 };
        let (least, most) = (within(least.min(most)), within(least.max(most)));
        let (first, last) = (least.log10().floor() as i32, most.log10().ceil() as i32);
        let factors: &[f64] = if last - first > 4 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let all = (first - 1..=last).flat_map(|decade| factors.iter().map(move |factor| factor * 10_f64.powi(decade)));
        let all: Vec<f64> = all.collect();
        let start = all.iter().copied().rfind(|&tick| tick <= least * 0.999).unwrap_or(least);
        let end = all.iter().copied().find(|&tick| tick >= most * 1.15).unwrap_or(most * 2.0);
        let ticks = all.into_iter().filter(|tick| (start..=end).contains(tick)).collect();
        Self { says, range: start..end, ticks, log: true, words: plain }
    }

    /// The place of a value, held within the axis.
    fn at(&self, value: f64) -> f64 {
        let value = if value.is_nan() { self.range.start } else { value.clamp(self.range.start, self.range.end) };
        if self.log { value.log10() } else { value }
    }

    fn places(&self) -> Range<f64> {
        self.at(self.range.start)..self.at(self.range.end)
    }
}

/// 1, 2 or 5 times a power of ten, so that `length` has about `parts` steps.
fn step(length: f64, parts: f64) -> f64 {
    let decade = 10_f64.powf((length / parts).log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| length / (factor * decade) <= parts).unwrap_or(10.0);
    factor * decade
}

/// A number with as many digits as it needs.
pub(crate) fn plain(value: f64) -> String {
    let rounded = format!("{value:.3}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" || short.is_empty() { "0".to_owned() } else { short.to_owned() }
}

/// A line of numbers with ticks where they were asked for.
struct Ticked {
    range: Range<f64>,
    ticks: Vec<f64>,
}

impl Ranged for Ticked {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

/// Least distance of two moments' words [px].
const WORDS_APART: f64 = 19.0;
const LEFT: u32 = 64;

impl Plot<'_> {
    /// The picture as SVG.
    pub(crate) fn svg(&self) -> String {
        draw(self.size, |area| {
            let (xs, ys) = (self.x.places(), self.y.places());
            let ticks = |axis: &Axis<'_>| axis.ticks.iter().map(|&tick| axis.at(tick)).collect::<Vec<_>>();
            let mut chart = ChartBuilder::on(area)
                .margin(6)
                .margin_top(if self.moments.is_empty() { 8 } else { 20 })
                .margin_right(14)
                .x_label_area_size(46)
                .y_label_area_size(LEFT)
                .build_cartesian_2d(
                    Ticked { range: xs.clone(), ticks: ticks(&self.x) },
                    Ticked { range: ys.clone(), ticks: ticks(&self.y) },
                )?;
            let back = |axis: &Axis<'_>, place: f64| (axis.words)(if axis.log { 10_f64.powf(place) } else { place });
            chart
                .configure_mesh()
                .light_line_style(TRANSPARENT)
                .bold_line_style(PALE)
                .axis_style(rgb("#999999"))
                .label_style((FONT, 15))
                .axis_desc_style((FONT, 15))
                .x_label_formatter(&|place| back(&self.x, *place))
                .y_label_formatter(&|place| back(&self.y, *place))
                .x_desc(self.x.says)
                .y_desc(self.y.says)
                .draw()?;
            let at = |&(x, y): &(f64, f64)| (self.x.at(x), self.y.at(y));
            for series in &self.series {
                let colour = rgb(series.colour);
                let points: Vec<_> = series.points.iter().map(at).collect();
                match &series.shape {
                    Shape::Line(width) => {
                        chart.draw_series([PathElement::new(points, colour.stroke_width(*width))])?;
                    }
                    Shape::Dots(radius) => {
                        chart.draw_series(points.into_iter().map(|at| Circle::new(at, *radius, colour.filled())))?;
                    }
                    Shape::Area(below) => {
                        let outline = points.into_iter().chain(below.iter().rev().map(at)).collect::<Vec<_>>();
                        chart.draw_series([Polygon::new(outline, colour.mix(0.85).filled())])?;
                    }
                }
            }
            for (words, colour, level) in &self.levels {
                let (place, style) = (self.y.at(*level), rgb(colour).stroke_width(2));
                let ends = vec![(xs.start, place), (xs.end, place)];
                chart.draw_series([DashedPathElement::new(ends, 7, 5, style)])?;
                let text = TextStyle::from((FONT, 15).into_font()).color(&INK).pos(Pos::new(HPos::Right, VPos::Bottom));
                chart.draw_series([EmptyElement::at((xs.end, place)) + Text::new(words.clone(), (-4, -3), text)])?;
            }
            let px = (f64::from(self.size.0) - f64::from(LEFT) - 20.0) / (xs.end - xs.start);
            let mut free = f64::NEG_INFINITY;
            for (words, colour, moment) in &self.moments {
                let place = self.x.at(*moment);
                let ends = vec![(place, ys.start), (place, ys.end)];
                chart.draw_series([DashedPathElement::new(ends, 3, 3, rgb(colour).stroke_width(1))])?;
                if (place - free) * px >= WORDS_APART {
                    free = place;
                    let text =
                        TextStyle::from((FONT, 14).into_font()).color(&INK).pos(Pos::new(HPos::Center, VPos::Bottom));
                    chart.draw_series([EmptyElement::at((place, ys.end)) + Text::new(words.clone(), (0, -3), text)])?;
                }
            }
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few_whatever_the_values() {
        for most in [0.0, 1e-9, 0.3, 7.0, 99.0, 101.0, 1e12, f64::INFINITY, f64::NAN, -3.0] {
            let axis = Axis::from_zero("", most);
            assert!((2..=13).contains(&axis.ticks.len()), "{most}: {:?}", axis.ticks);
            assert!(axis.range.end.is_finite() && axis.range.end > 0.0);
        }
        assert_eq!(Axis::from_zero("", 99.0).ticks, [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]);
        assert_eq!(Axis::from_zero("", 200.0).range, 0.0..210.0);
        for (least, most) in [(0.0, 0.0), (2.9, 100.0), (1e-300, 1e300), (f64::NAN, f64::INFINITY), (5.0, 3.0)] {
            let axis = Axis::log("", least, most);
            assert!((1..=20).contains(&axis.ticks.len()), "{least} {most}: {:?}", axis.ticks);
            assert!(axis.range.start > 0.0 && axis.range.end > axis.range.start);
        }
    }

    #[test]
    fn numbers_have_the_digits_that_they_need() {
        assert_eq!([0.0, -0.0, 100.0, 0.5, 0.1 + 0.2].map(plain), ["0", "0", "100", "0.5", "0.3"]);
    }
}
