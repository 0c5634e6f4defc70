//! Figs. 3 and 7, by plotters.

use lidar::ObstacleClass;
use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;

use super::pictures::Combinations;
use super::svg::COLOURS;
use super::{Converged, published};

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

pub(crate) const FONT: &str = "sans-serif";
pub(crate) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
pub(crate) const PALE: RGBColor = RGBColor(0xdd, 0xdd, 0xdd);

/// Fig. 3: share of the most frequent combinations in each class; a bar is the mean, a line goes from the first to the
/// last decile.
pub(crate) fn combinations(combinations: &Combinations) -> String {
    draw((1040, 900), |area| {
        // The last panel has the axis' words below.
        let (upper, last) = area.split_vertically(645);
        let panels = upper.split_evenly((3, 1)).into_iter().chain([last]);
        let count = combinations.index.len();
        let most = combinations.share.iter().flatten().map(|[_, _, last]| *last).fold(1.0, f64::max);
        for (class, panel) in panels.enumerate() {
            let name = ObstacleClass::SOLIDS[class].name();
            let mut chart = ChartBuilder::on(&panel)
                .margin(6)
                .margin_right(16)
                .x_label_area_size(if class == 3 { 62 } else { 22 })
                .y_label_area_size(58)
                .caption(name, (FONT, 15).into_font().color(&INK))
                .build_cartesian_2d((0..count.saturating_sub(1)).into_segmented(), 0.0..1.05 * most)?;
            chart
                .configure_mesh()
                .disable_x_mesh()
                .light_line_style(TRANSPARENT)
                .bold_line_style(PALE)
                .x_labels(count)
                .y_labels(4)
                .label_style((FONT, 12))
                .axis_desc_style((FONT, 13))
                .x_label_formatter(&|place| match place {
                    SegmentValue::CenterOf(place) => {
                        combinations.index.get(*place).map_or(String::new(), usize::to_string)
                    }
                    _ => String::new(),
                })
                .y_label_formatter(&|share| format!("{share:.0}"))
                .x_desc(if class == 3 { "feature combination, index of 0 to 1727" } else { "" })
                .y_desc("share [%]")
                .draw()?;
            let colour = rgb(COLOURS[class]);
            for (place, &[mean, first, last]) in combinations.share[class].iter().enumerate() {
                let (left, right) = (SegmentValue::Exact(place), SegmentValue::Exact(place + 1));
                let mut bar = Rectangle::new([(left, 0.0), (right, mean)], colour.mix(0.6).filled());
                bar.set_margin(0, 0, 6, 6);
                chart.draw_series([bar])?;
                let centre = || SegmentValue::CenterOf(place);
                chart
                    .draw_series([PathElement::new(vec![(centre(), first), (centre(), last)], INK.stroke_width(1))])?;
            }
        }
        Ok(())
    })
}

/// Fig. 7: accuracy against the size of the training set.
pub(crate) fn convergence(points: &[Converged]) -> String {
    let line =
        |value: fn(&Converged) -> f64| points.iter().map(move |p| (p.examples as f64, value(p))).collect::<Vec<_>>();
    let few = points.first().map_or(1.0, |point| point.examples as f64);
    let many = points.last().map_or(2.0, |point| point.examples as f64).max(few + 1.0);
    draw((1040, 460), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(10)
            .margin_right(24)
            .x_label_area_size(48)
            .y_label_area_size(58)
            .build_cartesian_2d((few..many * 1.02).log_scale(), 0.0..100.0)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(PALE)
            .label_style((FONT, 13))
            .axis_desc_style((FONT, 14))
            .x_label_formatter(&|size| format!("{size:.0}"))
            .y_label_formatter(&|share| format!("{share:.0}"))
            .x_desc("training examples of each class")
            .y_desc("mean of the classes' shares right [%]")
            .draw()?;
        let series = [
            ("SVM, its own training examples", line(|p| p.svm_training.mean_per_cent()), rgb(COLOURS[4])),
            ("SVM, cluttered scenes", line(|p| p.svm.mean_per_cent()), rgb(COLOURS[0])),
            ("Naive Bayes, cluttered scenes", line(|p| p.naive_bayes.mean_per_cent()), rgb(COLOURS[1])),
        ];
        for (name, values, colour) in series {
            let style = colour.stroke_width(2);
            chart.draw_series(PointSeries::of_element(
                values.iter().copied(),
                4,
                colour.filled(),
                &|c, size, style| EmptyElement::at(c) + Circle::new((0, 0), size, style),
            ))?;
            chart
                .draw_series(LineSeries::new(values, style))?
                .label(name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 22, y)], style));
        }
        for (name, level, colour) in [
            ("paper, SVM (mean of Table II)", published::mean(&published::SVM), rgb(COLOURS[0])),
            ("paper, Naive Bayes (mean of Table I)", published::mean(&published::NAIVE_BAYES), rgb(COLOURS[1])),
        ] {
            let style = colour.stroke_width(1);
            chart
                .draw_series(DashedLineSeries::new([(few, level), (many * 1.02, level)], 6, 5, style))?
                .label(name)
                .legend(move |(x, y)| DashedPathElement::new(vec![(x, y), (x + 22, y)], 6, 5, style));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.9))
            .border_style(PALE)
            .label_font((FONT, 13))
            .margin(10)
            .legend_area_size(30)
            .draw()
    })
}

pub(crate) fn draw(size: (u32, u32), picture: impl FnOnce(&Area<'_>) -> Drawn) -> String {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        // A backend that writes to a string has nothing to fail with.
        let drawn = picture(&area).and_then(|()| area.present());
        debug_assert!(drawn.is_ok(), "{drawn:?}");
    }
    // Inside a page an SVG needs no namespace, and the page names no address.
    svg.replacen(r#" xmlns="http://www.w3.org/2000/svg""#, r#" role="img""#, 1)
}

pub(crate) fn rgb(colour: &str) -> RGBColor {
    let part = |from: usize| colour.get(from..from + 2).and_then(|hex| u8::from_str_radix(hex, 16).ok()).unwrap_or(0);
    RGBColor(part(1), part(3), part(5))
}
