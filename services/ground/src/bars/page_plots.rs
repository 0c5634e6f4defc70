//! The page's plots.

use std::fmt;

use plotters::prelude::SeriesLabelPosition;

use super::charts::{self, Lines};
use super::tally::{POINTS, RINGS};
use super::{BudgetPoint, Evaluation, Share};
use crate::page::{escaped, figure as framed};

pub(crate) fn write_plots(evaluation: &Evaluation, page: &mut String) -> fmt::Result {
    page.push_str("<h2>What decides</h2><div class=\"side\">");
    write_shares(evaluation, page)?;
    page.push_str("</div><h2>What the posterior is worth</h2><div class=\"side\">");
    write_posterior(evaluation, page)?;
    page.push_str("</div><h2>Summed over sweeps</h2><div class=\"side\">");
    write_summed(evaluation, page)?;
    page.push_str("</div><h2>What a fit may cost</h2><div class=\"side\">");
    write_budget(evaluation, page)?;
    page.push_str("</div>");
    Ok(())
}

fn figure(page: &mut String, picture: &str, caption: &str) -> fmt::Result {
    page.push_str(&framed(picture, caption));
    Ok(())
}

fn write_shares(evaluation: &Evaluation, page: &mut String) -> fmt::Result {
    let tally = &evaluation.reference;
    let rows = |ends: &[[u32; 2]], shares: &[Share]| -> Vec<(String, Share)> {
        let named = ends.iter().map(|&[least, most]| match most {
            u32::MAX => format!("{least}+"),
            most if most == least => least.to_string(),
            most => format!("{least}–{most}"),
        });
        named.zip(shares.iter().copied()).collect()
    };
    let by_points = charts::shares("returns of the cluster", &rows(&POINTS, &tally.by_points));
    figure(page, &by_points, "By the number of returns. Lines are standard errors.")?;
    let by_rings = charts::shares("rings that the cluster is seen by", &rows(&RINGS, &tally.by_rings));
    figure(page, &by_rings, "By rings: one ring sees a line, and a line has no shape.")
}

fn write_posterior(evaluation: &Evaluation, page: &mut String) -> fmt::Result {
    let tally = &evaluation.reference;
    figure(
        page,
        &charts::reliability(&tally.reliability),
        &format!(
            "Share right against the greatest posterior; on the dashed line a posterior means what it says. A dot's area is its \
             share of all verdicts. Expected calibration error {:.3}, of 15 bins of equal width.",
            tally.reliability.expected_calibration_error()
        ),
    )?;
    let of = |pick: fn(&super::Threshold) -> Share| -> Vec<(f64, f64)> {
        tally.thresholds.iter().filter_map(|row| Some((row.posterior, pick(row).per_cent()?))).collect()
    };
    let plot = Lines {
        x_desc: "least posterior that is believed",
        y_desc: "[%]",
        x: 0.2..1.0,
        y: 0.0..101.0,
        digits: [1, 0],
        series: vec![("right of these", 0, of(|row| row.right)), ("of all clusters", 1, of(|row| row.kept))],
        levels: Vec::new(),
        legend: SeriesLabelPosition::LowerLeft,
    };
    figure(page, &charts::lines(&plot), "What is right, and what is left, when only sure verdicts are believed.")
}

fn write_summed(evaluation: &Evaluation, page: &mut String) -> fmt::Result {
    let (summed, plan) = (&evaluation.summed, &evaluation.plan);
    let points: Vec<(f64, f64)> =
        (1..).zip(&summed.after).filter_map(|(n, s)| Some((n.into(), s.per_cent()?))).collect();
    let single = summed.single.per_cent();
    let target = plan.bars.get("summed_accuracy_per_cent").copied();
    let levels = [("one sweep at a time", 4, single), ("target", 3, target)];
    let levels: Vec<_> = levels.into_iter().filter_map(|(name, colour, level)| Some((name, colour, level?))).collect();
    let least = points.iter().map(|point| point.1).chain(single).fold(100.0, f64::min);
    let plot = Lines {
        x_desc: "sweeps summed, at 10 Hz",
        y_desc: "obstacles right [%]",
        x: 1.0..f64::from(plan.sweeps.sweeps).max(2.0),
        y: floor_to(least, 5.0)..100.0,
        digits: [0, 0],
        series: vec![("log posteriors summed", 0, points)],
        levels,
        legend: SeriesLabelPosition::LowerRight,
    };
    figure(
        page,
        &charts::lines(&plot),
        &format!(
            "config/scenes/{}.toml: {} obstacles whose largest cluster has a median of at least 5 returns.",
            escaped(&plan.sweeps.scene),
            summed.all().of
        ),
    )?;
    figure(
        page,
        &charts::reliability(&summed.reliability),
        &format!(
            "Posterior from the sum over all sweeps. Expected calibration error {:.3}: sweeps of one obstacle are no \
             independent witnesses.",
            summed.reliability.expected_calibration_error()
        ),
    )
}

fn write_budget(evaluation: &Evaluation, page: &mut String) -> fmt::Result {
    let plan = &evaluation.plan;
    let of = |pick: fn(&BudgetPoint) -> Option<f64>| -> Vec<(f64, f64)> {
        let thousands = |point: &BudgetPoint| point.evaluations as f64 / 1_000.0;
        evaluation.budget.iter().filter_map(|point| Some((thousands(point), pick(point)?))).collect()
    };
    let (all, large) = (of(|point| point.all.per_cent()), of(|point| point.large.per_cent()));
    let ms = of(|point| point.time.median_ms);
    let most = plan.budget.evaluations.iter().max().map_or(1.0, |&most| most as f64 / 1_000.0);
    let least = all.iter().chain(&large).map(|point| point.1).fold(100.0, f64::min);
    let plot = Lines {
        x_desc: "residuals that a fit may evaluate [thousands]",
        y_desc: "right [%]",
        x: 0.0..1.03 * most,
        y: floor_to(least, 5.0)..100.0,
        digits: [0, 0],
        series: vec![("at least 50 points", 1, large), ("at least 5 points", 0, all)],
        levels: Vec::new(),
        legend: SeriesLabelPosition::LowerRight,
    };
    figure(page, &charts::lines(&plot), &format!("The first {} scenes of the distribution.", plan.budget.scenes))?;
    let target = plan.bars.get("fit_ms").map(|&target| ("target", 3, target));
    let slowest = ms.iter().map(|point| point.1).chain(target.map(|level| level.2)).fold(0.1, f64::max);
    let plot = Lines {
        x_desc: "residuals that a fit may evaluate [thousands]",
        y_desc: "time of a fit [ms]",
        x: 0.0..1.03 * most,
        y: 0.0..1.1 * slowest,
        digits: [0, 1],
        series: vec![("mean over fits, median of passes", 0, ms)],
        levels: target.into_iter().collect(),
        legend: SeriesLabelPosition::LowerRight,
    };
    let configured = evaluation.fit.median_ms.map_or("none".to_owned(), |ms| format!("{ms:.2} ms"));
    figure(
        page,
        &charts::lines(&plot),
        &format!(
            "config/scenes/{}.toml, one core, {} fits, {} passes; as configured: {configured}. Other work on the machine \
             makes it longer.",
            escaped(&plan.fit.scene),
            evaluation.fit.fits,
            plan.fit.passes
        ),
    )
}

/// The multiple of `step` below.
fn floor_to(value: f64, step: f64) -> f64 {
    (value / step - 0.2).floor().max(0.0) * step
}
