//! The page's plots.

use std::fmt;

use plotters::prelude::*;

use super::classes::{AFTER, LEAST_RETURNS};
use super::{Nees, ProbabilityTable, RootMeanSquare, TrackEvaluation};
use crate::bars::charts::{self, Lines};
use crate::page::figure;
use crate::paper::charts::{FONT, INK, PALE, draw, rgb};
use crate::paper::svg::COLOURS;

/// Fewer samples than this make no point of a curve.
const LEAST_SAMPLES: u32 = 20;

pub(crate) fn write_plots(evaluation: &TrackEvaluation, page: &mut String) -> fmt::Result {
    page.push_str("<div class=\"side\">");
    page.push_str(&errors(evaluation));
    page.push_str("</div><h2>Whether covariances mean what they say</h2><div class=\"side\">");
    page.push_str(&consistency(evaluation));
    page.push_str("</div><h2>Whether probabilities do</h2><div class=\"side\">");
    let table = evaluation.encounters.table();
    page.push_str(&figure(
        &probabilities(&table),
        "Encounters: share that touched against the probability that was foreseen; lines are 95 % intervals, numbers how many. \
         On the dashed line a probability means what it says.",
    ));
    page.push_str(&figure(
        &charts::reliability(&evaluation.scores.classes.reliability()),
        "Classes after ten sweeps: share right against the greatest posterior of the track; lines are standard errors, areas \
         how many. On the dashed line a posterior means what it says.",
    ));
    page.push_str(&classes(evaluation));
    page.push_str("</div>");
    Ok(())
}

fn errors(evaluation: &TrackEvaluation) -> String {
    let errors = &evaluation.scores.errors;
    let curve = |list: &[RootMeanSquare]| -> Vec<(f64, f64)> {
        let enough = list.iter().enumerate().filter(|(_, one)| one.count >= LEAST_SAMPLES);
        enough.filter_map(|(age, one)| Some((age as f64 * evaluation.period_s, one.value()?))).collect()
    };
    let one = |list: &[RootMeanSquare], y_desc: &str, name: &str, levels: Vec<(&str, usize, f64)>, caption: &str| {
        let points = curve(list);
        // The first sweeps of a track know little of its velocity: they may leave the picture.
        let most =
            points.iter().skip(2).map(|point| point.1).chain(levels.iter().map(|level| level.2)).fold(0.01, f64::max);
        let points: Vec<_> = points.into_iter().filter(|point| point.1 <= 1.2 * most).collect();
        let end = points.last().map_or(1.0, |point| point.0.max(1.0));
        let plot = Lines {
            x_desc: "time since the track's birth [s]",
            y_desc,
            x: 0.0..end,
            y: 0.0..1.2 * most,
            digits: [0, 2],
            series: vec![(name, 0, points)],
            levels,
            legend: SeriesLabelPosition::UpperRight,
        };
        figure(&charts::lines(&plot), caption)
    };
    let target =
        |key: &str, name: &'static str, colour| evaluation.plan.bars.get(key).map(|&target| (name, colour, target));
    let position = target("position_rmse_m", "target from 50 returns", 3);
    let velocity =
        [target("velocity_1s_rmse_mps", "target at 1 s", 4), target("velocity_2s_rmse_mps", "target at 2 s", 3)];
    one(
        &errors.position_by_age_m,
        "position off [m]",
        "root mean square",
        position.into_iter().collect(),
        "Position, of tracks seen with at least 20 returns.",
    ) + &one(
        &errors.velocity_by_age_mps,
        "velocity off [m/s]",
        "root mean square",
        velocity.into_iter().flatten().collect(),
        "Velocity, of the same.",
    )
}

fn consistency(evaluation: &TrackEvaluation) -> String {
    let consistency = &evaluation.scores.consistency;
    let shares = |list: &[Nees], of: fn(&Nees) -> u32| -> Vec<(f64, f64)> {
        let enough = list.iter().enumerate().filter(|(_, one)| one.inside().of >= LEAST_SAMPLES);
        enough
            .map(|(place, one)| {
                let share = 100.0 * f64::from(of(one)) / f64::from(one.inside().of);
                (place as f64 * evaluation.period_s, share)
            })
            .collect()
    };
    let one = |list: &[Nees], x_desc: &str, caption: &str| {
        let inside = shares(list, |nees| nees.inside);
        let end = inside.last().map_or(1.0, |point| point.0.max(1.0));
        let plot = Lines {
            x_desc,
            y_desc: "[%]",
            x: 0.0..end,
            y: 0.0..104.0,
            digits: [0, 0],
            series: vec![
                ("inside the bounds", 1, inside),
                ("below: too wide", 3, shares(list, |nees| nees.below)),
                ("above: too sure", 0, shares(list, |nees| nees.above)),
            ],
            levels: vec![("95 %", 4, 95.0)],
            legend: SeriesLabelPosition::MiddleRight,
        };
        let plot = Lines { legend: beside(&plot), ..plot };
        figure(&charts::lines(&plot), caption)
    };
    one(
        &consistency.by_sweep,
        "time of the scene [s]",
        "NEES of position and velocity against its two-sided 95 % bounds (6 degrees of freedom), all scenes.",
    ) + &one(&consistency.by_age, "time since the track's birth [s]", "The same by the age of the track.")
}

/// Where at the right a legend of four lines covers no curve, of percentages from 0 to 104; high up where there is no such
/// place.
fn beside(plot: &Lines<'_>) -> SeriesLabelPosition {
    // The plot's area and the legend's, as `charts::lines` draws them.
    const PER_CENT_PX: f64 = 288.0 / 104.0;
    const LEFT_PX: i32 = 286;
    const HEIGHT: f64 = 28.0;
    let from = plot.x.start + 0.6 * (plot.x.end - plot.x.start);
    let curves = || plot.series.iter().flat_map(|series| &series.2).filter(|point| point.0 > from);
    let is_free = |top: &f64| curves().all(|point| point.1 > top + 1.0 || point.1 < top - HEIGHT);
    let top = [92.0, 85.0, 75.0, 65.0, 55.0, 45.0, 35.0].into_iter().find(is_free).unwrap_or(92.0);
    SeriesLabelPosition::Coordinate(LEFT_PX, ((104.0 - top) * PER_CENT_PX) as i32)
}

fn classes(evaluation: &TrackEvaluation) -> String {
    let classes = &evaluation.scores.classes;
    let names = LEAST_RETURNS.map(|least| format!("{least} returns and more"));
    let colours = [0, 1, 3, 2];
    let series: Vec<charts::Series<'_>> = names
        .iter()
        .zip(colours)
        .zip(&classes.right)
        .map(|((name, colour), row)| {
            let points = AFTER.iter().zip(row).filter_map(|(&after, right)| Some((after as f64, right.per_cent()?)));
            (name.as_str(), colour, points.collect())
        })
        .collect();
    let least = series.iter().flat_map(|series| &series.2).map(|point| point.1).fold(95.0, f64::min);
    let target = evaluation.plan.bars.get("class_10_sweeps_per_cent");
    let plot = Lines {
        x_desc: "sweeps since the first with 5 returns",
        y_desc: "class right [%]",
        x: 1.0..10.0,
        y: (least - 3.0).max(0.0)..100.0,
        digits: [0, 0],
        series,
        levels: target.map(|&target| ("target from 5 returns", 4, target)).into_iter().collect(),
        legend: SeriesLabelPosition::LowerRight,
    };
    figure(&charts::lines(&plot), "Class of the track that lies on an obstacle.")
}

/// Share that happened against the probability that was predicted.
fn probabilities(table: &ProbabilityTable) -> String {
    draw((510, 350), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .margin_right(18)
            .x_label_area_size(46)
            .y_label_area_size(54)
            .build_cartesian_2d(0.0..1.02, 0.0..1.06)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(PALE)
            .label_style((FONT, 12))
            .axis_desc_style((FONT, 13))
            .x_label_formatter(&|value| format!("{value:.1}"))
            .y_label_formatter(&|value| format!("{value:.1}"))
            .x_desc("probability of a collision, mean of a bin")
            .y_desc("share that touched")
            .draw()?;
        chart.draw_series(DashedLineSeries::new([(0.0, 0.0), (1.0, 1.0)], 6, 5, INK.stroke_width(1)))?;
        let colour = rgb(COLOURS[0]);
        for bin in &table.bins {
            let (Some(x), Some(y), Some([low, high])) = (bin.predicted(), bin.share(), bin.interval()) else {
                continue;
            };
            chart.draw_series([PathElement::new(vec![(x, low), (x, high)], INK.stroke_width(1))])?;
            chart.draw_series([Circle::new((x, y), 4, colour.filled())])?;
            let style = TextStyle::from((FONT, 11).into_font()).color(&INK);
            chart.draw_series([EmptyElement::at((x, y)) + Text::new(bin.count.to_string(), (6, -6), style)])?;
        }
        Ok(())
    })
}
