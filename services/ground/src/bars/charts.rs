//! Plots of the page, by plotters.

use std::ops::Range;

use plotters::element::DashedPathElement;
use plotters::prelude::*;

use super::share::Share;
use crate::Reliability;
use crate::paper::charts::{FONT, INK, PALE, draw, rgb};
use crate::paper::svg::COLOURS;

/// Half a page wide.
const SIZE: (u32, u32) = (510, 350);

/// Bars of shares right with their standard errors; above each how many it is of.
pub(crate) fn shares(x_desc: &str, rows: &[(String, Share)]) -> String {
    draw(SIZE, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .x_label_area_size(46)
            .y_label_area_size(54)
            .build_cartesian_2d((0..rows.len().saturating_sub(1)).into_segmented(), 0.0..112.0)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(PALE)
            .x_labels(rows.len())
            .label_style((FONT, 12))
            .axis_desc_style((FONT, 13))
            .x_label_formatter(&|place| match place {
                SegmentValue::CenterOf(place) => rows.get(*place).map_or(String::new(), |row| row.0.clone()),
                _ => String::new(),
            })
            .y_label_formatter(&|share| if *share > 100.5 { String::new() } else { format!("{share:.0}") })
            .x_desc(x_desc)
            .y_desc("right [%]")
            .draw()?;
        for (place, (_, right)) in rows.iter().enumerate() {
            let (Some(share), Some(error)) = (right.per_cent(), right.standard_error_per_cent()) else { continue };
            let (left, end) = (SegmentValue::Exact(place), SegmentValue::Exact(place + 1));
            let mut bar = Rectangle::new([(left, 0.0), (end, share)], rgb(COLOURS[1]).mix(0.55).filled());
            bar.set_margin(0, 0, 7, 7);
            chart.draw_series([bar])?;
            let centre = || SegmentValue::CenterOf(place);
            let ends = vec![(centre(), share - error), (centre(), (share + error).min(100.0))];
            chart.draw_series([PathElement::new(ends, INK.stroke_width(1))])?;
            let style = |size| TextStyle::from((FONT, size).into_font()).color(&INK).pos(CENTRED);
            let above = (centre(), share + error);
            chart.draw_series([EmptyElement::at(above)
                + Text::new(format!("{share:.1} %"), (0, -19), style(12))
                + Text::new(format!("of {}", right.of), (0, -7), style(11))])?;
        }
        Ok(())
    })
}

const CENTRED: plotters::style::text_anchor::Pos = plotters::style::text_anchor::Pos {
    h_pos: plotters::style::text_anchor::HPos::Center,
    v_pos: plotters::style::text_anchor::VPos::Center,
};

/// Share right against posterior; a dot's area is how many verdicts it stands for.
pub(crate) fn reliability(table: &Reliability) -> String {
    draw(SIZE, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .margin_right(18)
            .x_label_area_size(46)
            .y_label_area_size(54)
            .build_cartesian_2d(20.0..102.0, 0.0..104.0)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(PALE)
            .label_style((FONT, 12))
            .axis_desc_style((FONT, 13))
            .x_label_formatter(&|value| format!("{value:.0}"))
            .y_label_formatter(&|value| format!("{value:.0}"))
            .x_desc("greatest posterior, mean of a bin [%]")
            .y_desc("right [%]")
            .draw()?;
        chart.draw_series(DashedLineSeries::new([(20.0, 20.0), (100.0, 100.0)], 6, 5, INK.stroke_width(1)))?;
        let all: usize = table.bins.iter().map(|bin| bin.count).sum();
        let colour = rgb(COLOURS[0]);
        for bin in table.bins.iter().filter(|bin| bin.count > 0) {
            let (x, y) = (100.0 * bin.confidence, 100.0 * bin.accuracy);
            let error = 100.0 * (bin.accuracy * (1.0 - bin.accuracy) / bin.count as f64).sqrt();
            let ends = vec![(x, (y - error).max(0.0)), (x, (y + error).min(100.0))];
            chart.draw_series([PathElement::new(ends, INK.stroke_width(1))])?;
            let radius = (22.0 * (bin.count as f64 / all.max(1) as f64).sqrt()).max(2.0);
            chart.draw_series([Circle::new((x, y), radius as i32, colour.mix(0.5).filled())])?;
            chart.draw_series([Circle::new((x, y), 2, colour.filled())])?;
        }
        Ok(())
    })
}

/// One line: name, place in [`COLOURS`], points.
pub(crate) type Series<'a> = (&'a str, usize, Vec<(f64, f64)>);

/// A plot of lines.
pub(crate) struct Lines<'a> {
    pub(crate) x_desc: &'a str,
    pub(crate) y_desc: &'a str,
    pub(crate) x: Range<f64>,
    pub(crate) y: Range<f64>,
    /// Digits of the labels at x and y.
    pub(crate) digits: [usize; 2],
    pub(crate) series: Vec<Series<'a>>,
    /// Dashed lines across: name, place in [`COLOURS`], value.
    pub(crate) levels: Vec<(&'a str, usize, f64)>,
    pub(crate) legend: SeriesLabelPosition,
}

/// Lines with a dot at each point.
pub(crate) fn lines(plot: &Lines<'_>) -> String {
    draw(SIZE, |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .margin_right(18)
            .x_label_area_size(46)
            .y_label_area_size(54)
            .build_cartesian_2d(plot.x.clone(), plot.y.clone())?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(PALE)
            .x_labels(8)
            .label_style((FONT, 12))
            .axis_desc_style((FONT, 13))
            .x_label_formatter(&|value| format!("{value:.*}", plot.digits[0]))
            .y_label_formatter(&|value| format!("{value:.*}", plot.digits[1]))
            .x_desc(plot.x_desc)
            .y_desc(plot.y_desc)
            .draw()?;
        for &(name, colour, level) in &plot.levels {
            let style = rgb(COLOURS[colour]).stroke_width(1);
            chart
                .draw_series(DashedLineSeries::new([(plot.x.start, level), (plot.x.end, level)], 6, 5, style))?
                .label(name)
                .legend(move |(x, y)| DashedPathElement::new(vec![(x, y), (x + 22, y)], 6, 5, style));
        }
        for (name, colour, points) in &plot.series {
            let colour = rgb(COLOURS[*colour]);
            let style = colour.stroke_width(2);
            chart.draw_series(points.iter().map(|&at| Circle::new(at, 3, colour.filled())))?;
            chart
                .draw_series(LineSeries::new(points.iter().copied(), style))?
                .label(*name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 22, y)], style));
        }
        chart
            .configure_series_labels()
            .position(plot.legend.clone())
            .background_style(WHITE.mix(0.9))
            .border_style(PALE)
            .label_font((FONT, 12))
            .margin(8)
            .legend_area_size(28)
            .draw()
    })
}
