//! The results for people: one page that needs nothing else.

use std::fmt::{self, Write};

use lidar::ObstacleClass;

use super::page_plots::write_plots;
use super::table::{percent, value};
use super::{Bar, Claims, Evaluation, EvaluationNote, Share, SolidErrors, Standing, Tally};
use crate::page::{document, escaped};

/// Beyond what the paper's page has: a bar that falls short is marked by more than its colour.
pub(crate) const MORE_STYLE: &str = "td.short{background:#f7d9d6;font-weight:700}td.ok{background:#dfeedd}.side figure{margin:6px 0 14px;max-width:510px}";

impl Evaluation {
    /// `evaluate.html`: bars, tables and plots.
    pub fn to_html(&self, note: &EvaluationNote) -> String {
        let mut page = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_page(&mut page, note);
        document("Encke: the classifier and its bars", MORE_STYLE, &page)
    }

    fn write_page(&self, page: &mut String, note: &EvaluationNote) -> fmt::Result {
        self.write_head(page, note)?;
        write_bars(page, &self.bars())?;
        write_matrix(page, &self.reference)?;
        write_plots(self, page)?;
        self.write_variants(page)?;
        self.write_solids(page)?;
        self.claims.as_ref().map_or(Ok(()), |claims| write_claims(page, claims, note))
    }

    fn write_head(&self, page: &mut String, note: &EvaluationNote) -> fmt::Result {
        let (bars, short) = (self.bars(), self.short());
        let judged = bars.iter().filter(|bar| bar.standing() != Standing::NotJudged).count();
        let verdict = match &short[..] {
            [] => "Every bar holds.".to_owned(),
            short => format!("Short of their bars: <b>{}</b>.", short.join(", ")),
        };
        let plan = &self.plan;
        write!(
            page,
            "<h1>The classifier and its bars</h1>\
             <p class=\"note\">What <code>encke evaluate</code> measured on simulated scenes that nothing was trained on: \
             simulator, clusterer, extractor and classifier in a row, each as configured for the chain.</p>\
             <p>{} of {judged} bars hold. {verdict}</p>\
             <dl><dt>Classifier</dt><dd>{}</dd><dt>Plan</dt><dd>{}, seed {}</dd>\
             <dt>Distribution</dt><dd>config/scenes/{}.toml: {} scenes of one sweep, {} clusters of at least 5 points \
             and {} of fewer, which are left out</dd>\
             <dt>Counting</dt><dd>a cluster is of the class of the obstacle that most of its returns lie on; unclassified \
             counts as wrong; ± is one standard error</dd>\
             <dt>Run</dt><dd>Encke {}, {:.0} s on {} cores: {}</dd></dl>",
            judged - short.len(),
            escaped(&note.classifier),
            escaped(&note.run.plan_file),
            plan.seed,
            escaped(&plan.scene),
            plan.scenes,
            self.reference.all.of,
            self.reference.small,
            env!("CARGO_PKG_VERSION"),
            note.run.duration_s,
            note.run.cores,
            escaped(&note.run.machine),
        )
    }

    fn write_variants(&self, page: &mut String) -> fmt::Result {
        let variants = &self.plan.variants;
        let [flattest, _] = variants.proportion;
        page.push_str(
            "<h2>One thing changed</h2><p>The first of the same scenes, so that rows differ by what is named; of clusters \
             of at least 5 points.</p><div class=\"wide\"><table><tr><th>Scenes</th><th class=\"n\">Clusters</th>\
             <th class=\"n\">Right</th><th class=\"n\">Right, at least 50 points</th><th>Worst class</th>\
             <th class=\"n\">Posterior ≥ 0.9</th><th class=\"n\">Right of these</th>\
             <th class=\"n\">Calibration error</th></tr>",
        );
        for (name, tally) in [
            ("as they are".to_owned(), &self.reference),
            (format!("noise of {} cm", 100.0 * variants.range_sigma_m), &self.noisy),
            (format!("{} % of echoes lost", 100.0 * variants.dropout), &self.dropouts),
            (format!("lesser extents down to {flattest} of the largest"), &self.flat),
            (format!("seen by {}", escaped(&variants.dense_sensor)), &self.dense),
        ] {
            let worst = tally
                .worst_class()
                .map_or(String::new(), |(class, right)| format!("{}, {}", class.name(), percent(right)));
            write!(
                page,
                "<tr><td>{name}</td><td class=\"n\">{}</td><td class=\"n\"><b class=\"k\">{}</b> ± {:.1}</td>\
                 <td class=\"n\">{}</td><td style=\"white-space:nowrap\">{worst}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
                 <td class=\"n\">{:.3}</td></tr>",
                tally.all.of,
                percent(tally.all),
                tally.all.standard_error_per_cent().unwrap_or(0.0),
                percent(tally.large()),
                percent(tally.confident().kept),
                percent(tally.confident().right),
                tally.reliability.expected_calibration_error(),
            )?;
        }
        page.push_str("</table></div>");
        Ok(())
    }

    fn write_solids(&self, page: &mut String) -> fmt::Result {
        page.push_str(
            "<h2>Fitted solids</h2><p>Solids of detections whose class is right, against the true ones. The error of the \
             extents is the mean of the three relative errors, found and true extents each sorted. The squared error of the \
             centre by its covariance (NEES), a degree of freedom, is 1 on average and 0.79 at the median where errors are \
             as normal as the covariance says.</p><div class=\"wide\"><table><tr><th>Clusters</th>\
             <th class=\"n\">Solids</th><th class=\"n\">Centre off [cm]<br><small>median, ninth decile</small></th>\
             <th class=\"n\">Extents off [%]<br><small>median, ninth decile</small></th>\
             <th class=\"n\">NEES<br><small>mean, median</small></th>\
             <th class=\"n\">Within the 95 % ellipsoid</th></tr>",
        );
        for (name, errors) in
            [("at least 50 points", &self.reference.large_solids), ("at least 5 points", &self.reference.solids)]
        {
            write_errors(page, name, errors)?;
        }
        page.push_str("</table></div>");
        Ok(())
    }
}

/// The bars as a table with a heading.
pub(crate) fn write_bars(page: &mut String, bars: &[Bar]) -> fmt::Result {
    page.push_str(
        "<h2>Bars</h2><div class=\"wide\"><table><tr><th>What</th><th>Key</th><th class=\"n\">Target</th>\
         <th class=\"n\">Measured</th><th class=\"n\">Of</th><th>Stands</th></tr>",
    );
    for bar in bars {
        let style = match bar.standing() {
            Standing::Holds => "ok",
            Standing::FallsShort => "short",
            Standing::NotJudged => "",
        };
        write!(
            page,
            "<tr><td>{}</td><td><code>{}</code></td><td class=\"n\">{}</td><td class=\"n\"><b class=\"k\">{}</b></td>\
             <td class=\"n\">{}</td><td class=\"{style}\">{}</td></tr>",
            bar.says,
            bar.key,
            target(bar),
            value(bar),
            bar.measured.of,
            bar.standing(),
        )?;
    }
    page.push_str("</table></div>");
    Ok(())
}

fn target(bar: &Bar) -> String {
    let gap = if bar.unit.is_empty() { "" } else { " " };
    bar.target.map_or(String::new(), |target| format!("{} {target}{gap}{}", bar.sense.sign(), bar.unit))
}

fn write_errors(page: &mut String, name: &str, errors: &SolidErrors) -> fmt::Result {
    let both = |values: Option<[f64; 2]>, scale: f64, digits: usize| match values {
        Some([one, other]) => format!("{:.digits$}, {:.digits$}", scale * one, scale * other),
        None => "none".to_owned(),
    };
    write!(
        page,
        "<tr><td>{name}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
         <td class=\"n\">{}</td></tr>",
        errors.count,
        both(errors.centre_m, 100.0, 1),
        both(errors.size_per_cent, 1.0, 1),
        both(errors.nees_per_dof, 1.0, 2),
        percent(errors.within_95),
    )
}

fn write_matrix(page: &mut String, tally: &Tally) -> fmt::Result {
    page.push_str("<h2>Verdicts</h2><table><tr><th>actual</th>");
    for class in ObstacleClass::ALL {
        write!(page, "<th>{}</th>", class.name())?;
    }
    page.push_str("<th class=\"n\">clusters</th></tr>");
    for (row, counts) in tally.confusion.iter().enumerate() {
        let all = counts.iter().sum();
        write!(page, "<tr><th>{}</th>", ObstacleClass::SOLIDS[row].name())?;
        for &count in counts {
            let share = Share { count, of: all }.per_cent().unwrap_or(0.0);
            write!(
                page,
                "<td class=\"n\" style=\"background:rgba(35,89,168,{:.2})\"><b class=\"k\">{share:.1}</b><br>\
                 <small>{count}</small></td>",
                0.0045 * share
            )?;
        }
        write!(page, "<td class=\"n\">{all}</td></tr>")?;
    }
    page.push_str(
        "</table><p class=\"note\">Row: actual class; columns: verdicts; shares of the row [%], counts below. Clusters of \
         at least 5 points of the distribution.</p>",
    );
    Ok(())
}

fn write_claims(page: &mut String, claims: &Claims, note: &EvaluationNote) -> fmt::Result {
    let name = note.recording.as_deref().unwrap_or_default();
    write!(
        page,
        "<h2>A recording</h2><p>{}: {} sweeps, {} clusters of at least 5 points. Nothing is known of their truth: this is \
         how much is claimed, not how much is right.</p><table><tr>",
        escaped(name),
        claims.sweeps,
        claims.unclassified.of,
    )?;
    for class in ObstacleClass::ALL {
        write!(page, "<th class=\"n\">{}</th>", class.name())?;
    }
    page.push_str("</tr><tr>");
    for count in claims.by_class {
        write!(page, "<td class=\"n\">{count}</td>")?;
    }
    write!(
        page,
        "</tr></table><p>Posterior of at least 0.9: {}. Unclassified: {}. With fitted solids: {}.</p>",
        percent(claims.confident),
        percent(claims.unclassified),
        percent(claims.fitted),
    )
}
