//! The results for people: one page that needs nothing else.

use std::fmt::{self, Write};

use lidar::ObstacleClass;

use super::classes::{AFTER, LEAST_RETURNS};
use super::errors::RETURNS;
use super::page_plots::write_plots;
use super::table::cell;
use super::{TrackEvaluation, TracksNote};
use crate::Standing;
use crate::bars::page::{MORE_STYLE, write_bars};
use crate::bars::table::{ends, percent};
use crate::page::{document, escaped, figure};

impl TrackEvaluation {
    /// `tracks.html`: bars, tables and plots.
    pub fn to_html(&self, note: &TracksNote) -> String {
        let mut page = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_page(&mut page, note);
        document("Encke: tracks and their bars", MORE_STYLE, &page)
    }

    fn write_page(&self, page: &mut String, note: &TracksNote) -> fmt::Result {
        self.write_head(page, note)?;
        write_bars(page, &self.bars())?;
        self.write_followed(page)?;
        self.write_hardest(page)?;
        page.push_str("<h2>One scene</h2>");
        page.push_str(&figure(
            &self.trails.svg(),
            "The first scene from above, x to the right, y up, the sensor in the middle. Grey: obstacles, broad where they \
             have at least 5 returns, dotted where fewer. Coloured: tracks that are believed, with their numbers at the last \
             place. Red rings: an obstacle goes on under another number. Dashed rings: without a track at the end.",
        ));
        self.write_errors(page)?;
        write_plots(self, page)?;
        self.write_classes(page)?;
        self.write_encounters(page)
    }

    fn write_head(&self, page: &mut String, note: &TracksNote) -> fmt::Result {
        let (bars, short) = (self.bars(), self.short());
        let judged = bars.iter().filter(|bar| bar.standing() != Standing::NotJudged).count();
        let verdict = match &short[..] {
            [] => "Every bar holds.".to_owned(),
            short => format!("Short of their bars: <b>{}</b>.", short.join(", ")),
        };
        let plan = &self.plan;
        write!(
            page,
            "<h1>Tracks and their bars</h1>\
             <p class=\"note\">What <code>encke evaluate --tracks</code> measured on simulated scenes in motion that nothing \
             was tuned on: simulator, clusterer, extractor, classifier and tracker in a row, each as configured for the \
             chain.</p><p>{} of {judged} bars hold. {verdict}</p>\
             <dl><dt>Classifier</dt><dd>{}</dd><dt>Plan</dt><dd>{}, seed {}</dd>\
             <dt>Scenes</dt><dd>config/scenes/{}.toml: {} scenes of {} sweeps</dd>\
             <dt>Counting</dt><dd>an obstacle counts in a sweep in which it has at least 5 returns; with fewer it is neither \
             missed, nor is a track on it false. Tracks are those confirmed, seen in the sweep or propagated; one lies on an \
             obstacle when the centres are within {} m at the time of the tracks.</dd>\
             <dt>Run</dt><dd>Encke {}, {:.0} s on {} cores: {}</dd></dl>",
            judged - short.len(),
            escaped(&note.classifier),
            escaped(&note.run.plan_file),
            plan.seed,
            escaped(&plan.scene),
            plan.scenes,
            plan.sweeps,
            plan.match_m,
            env!("CARGO_PKG_VERSION"),
            note.run.duration_s,
            note.run.cores,
            escaped(&note.run.machine),
        )
    }

    fn write_followed(&self, page: &mut String) -> fmt::Result {
        let share = |value: Option<f64>| cell(value.map(|value| 100.0 * value), 2);
        let (scores, hota) = (&self.scores, &self.scores.hota);
        write!(
            page,
            "<h2>Who is followed</h2><p>{} obstacles, {} tracks that were ever confirmed. MOTA and MOTP after Bernardin and \
             Stiefelhagen (2008), IDF1 after Ristani (2016), HOTA after Luiten (2021) with a similarity of 1 − distance/{} \
             m: HOTA {}, of it detection {}, association {}, localisation {} [%].</p><div class=\"wide\"><table><tr>",
            scores.obstacles,
            scores.tracks,
            self.plan.zero_m,
            share(hota.hota()),
            share(hota.detection()),
            share(hota.association()),
            share(hota.localisation()),
        )?;
        let head = ["Returns", "Within", "MOTA [%]", "IDF1 [%]", "Of", "Missed", "False", "Switches", "MOTP [m]"];
        head.iter().try_for_each(|name| write!(page, "<th class=\"n\">{name}</th>"))?;
        page.push_str("</tr>");
        for row in &scores.followed {
            let clear = &row.clear;
            let cells = [
                format!("≥ {}", row.least_returns),
                format!("{} m", row.match_m),
                share(clear.mota()),
                share(row.identity.idf1()),
                clear.objects.to_string(),
                clear.missed.to_string(),
                clear.false_tracks.to_string(),
                clear.switches.to_string(),
                cell(clear.motp_m(), 3),
            ];
            write_row(page, &cells)?;
        }
        page.push_str("</table></div>");
        let confirming = &scores.confirming;
        if let Some([median, most]) = confirming.quantiles() {
            write!(
                page,
                "<p>From the first sweep with 5 returns to the first with a confirmed track: {median:.0} sweeps, 95th \
                 percentile {most:.0}, of {} obstacles. Never confirmed, with 5 returns in at least ten sweeps: {}.</p>",
                confirming.found(),
                confirming.never
            )?;
        }
        Ok(())
    }

    fn write_hardest(&self, page: &mut String) -> fmt::Result {
        page.push_str("<p>Followed worst:</p><div class=\"wide\"><table><tr>");
        let head =
            ["Scene", "Obstacle", "Class", "Extents [m]", "Returns", "Distance [m]", "Sweeps", "Missed", "Tracks"];
        head.iter().chain(&["Off [m]"]).try_for_each(|name| write!(page, "<th class=\"n\">{name}</th>"))?;
        page.push_str("</tr>");
        for one in &self.scores.hardest {
            let cells = [
                one.scene.to_string(),
                one.id.to_string(),
                one.class.name().to_owned(),
                one.size_m.map(|extent| format!("{extent:.1}")).join(" × "),
                one.returns.to_string(),
                format!("{:.1}", one.range_m),
                one.sweeps.to_string(),
                one.missed.to_string(),
                one.tracks.to_string(),
                cell(one.off_m.value(), 3),
            ];
            write_row(page, &cells)?;
        }
        page.push_str("</table></div>");
        Ok(())
    }

    fn write_errors(&self, page: &mut String) -> fmt::Result {
        let errors = &self.scores.errors;
        page.push_str(
            "<h2>How far off</h2><p>Root mean squares of the lengths of errors, of tracks seen in the sweep.</p>\
             <div class=\"wide\"><table><tr><th class=\"n\">Returns</th><th class=\"n\">Position [m]</th>\
             <th class=\"n\">Velocity [m/s]</th><th class=\"n\">Of</th></tr>",
        );
        for (row, &returns) in RETURNS.iter().enumerate() {
            let (position, velocity) = (errors.position_m[row], errors.velocity_mps[row]);
            let cells =
                [ends(returns), cell(position.value(), 3), cell(velocity.value(), 3), position.count.to_string()];
            write_row(page, &cells)?;
        }
        page.push_str("</table></div><p>");
        if let Some([median, ninth, most]) = errors.large_quantiles_m() {
            write!(
                page,
                "Position of at least 50 returns: median {median:.3}, ninth decile {ninth:.3}, 99th percentile {most:.3} m. "
            )?;
        }
        let (all, large) = (errors.coasting_m, errors.coasting_large_m);
        write!(page, "Propagated only: {} m, of {}; ", cell(all.value(), 3), all.count)?;
        write!(page, "with 50 returns and more {} m, of {}. ", cell(large.value(), 3), large.count)?;
        let bodies = &self.scores.bodies;
        if let Some([median, ninth]) = bodies.size_per_cent() {
            write!(page, "Extents off {median:.1} %, ninth decile {ninth:.1} %. ")?;
        }
        if let Some([median, ninth, own]) = bodies.spin_dps() {
            write!(
                page,
                "Spin off {median:.1} deg/s, ninth decile {ninth:.1}, where true spins have a median of {own:.1}; {} have one.",
                percent(bodies.spinning)
            )?;
        }
        page.push_str("</p>");
        Ok(())
    }

    fn write_classes(&self, page: &mut String) -> fmt::Result {
        let classes = &self.scores.classes;
        page.push_str(
            "<h2>What they are</h2><p>Sweeps are counted from an obstacle's first with 5 returns; returns are its median \
             over the ten sweeps from there. Without a track it is wrong.</p><div class=\"wide\"><table><tr>\
             <th class=\"n\">Returns</th>",
        );
        AFTER.iter().try_for_each(|after| write!(page, "<th class=\"n\">after {after} [%]</th>"))?;
        page.push_str("<th class=\"n\">Of</th></tr>");
        for (least, row) in LEAST_RETURNS.iter().zip(&classes.right) {
            let shares = row.iter().map(|right| percent(*right));
            let cells: Vec<String> =
                [format!("≥ {least}")].into_iter().chain(shares).chain([row[0].of.to_string()]).collect();
            write_row(page, &cells)?;
        }
        page.push_str("</table></div><table><tr><th>actual</th>");
        for class in ObstacleClass::ALL {
            write!(page, "<th class=\"n\">{}</th>", class.name())?;
        }
        page.push_str("</tr>");
        for (class, row) in ObstacleClass::SOLIDS.into_iter().zip(classes.confusion) {
            let counts = row.iter().map(u32::to_string);
            let cells: Vec<String> = [class.name().to_owned()].into_iter().chain(counts).collect();
            write_row(page, &cells)?;
        }
        page.push_str(
            "</table><p class=\"note\">After ten sweeps; the last column also holds those without a track.</p>",
        );
        Ok(())
    }

    fn write_encounters(&self, page: &mut String) -> fmt::Result {
        let (encounters, plan) = (&self.encounters, &self.plan.encounters);
        let (danger, table) = (&encounters.danger, encounters.table());
        let (missed, centres, alerts) = (encounters.missed(), encounters.missed_centres(), encounters.false_alerts());
        write!(
            page,
            "<h2>What comes near</h2><p>{} obstacles on straight courses past the sensor, tumbling, looked at for {} s and \
             judged {} s before their closest approach. Own radius {} m, horizon {} s, warned of from a probability of {}. \
             Contact is of the true surface with the own ball. With a track: {} of those with at least 5 returns. \
             Calibration error {}, Brier score {}.</p><p>Of those with at least 20 returns: contacts not warned of {} of {}; \
             centres that come within the own radius not warned of {} of {}; warned of and passing by {} of {}.",
            encounters.all.len(),
            plan.track_s,
            plan.lead_s,
            danger.own_radius_m,
            danger.horizon_s,
            danger.alert,
            percent(encounters.tracked()),
            cell(table.expected_calibration_error(), 4),
            cell(table.brier(), 4),
            missed.count,
            missed.of,
            centres.count,
            centres.of,
            alerts.count,
            alerts.of,
        )?;
        if let Some(([median, ninth], within)) = encounters.distance_errors() {
            write!(
                page,
                " Closest distance of the centre off {median:.3} m, ninth decile {ninth:.3} m; {} within the 95 % that is \
                 claimed.",
                percent(within)
            )?;
        }
        page.push_str("</p>");
        Ok(())
    }
}

pub(crate) fn write_row(page: &mut String, cells: &[String]) -> fmt::Result {
    page.push_str("<tr>");
    cells.iter().try_for_each(|cell| write!(page, "<td class=\"n\">{cell}</td>"))?;
    page.push_str("</tr>");
    Ok(())
}
