//! The results for a terminal.

use std::fmt;

use lidar::ObstacleClass;

use super::classes::{AFTER, LEAST_RETURNS};
use super::consistency::Nees;
use super::errors::RETURNS;
use super::{RootMeanSquare, TrackEvaluation, UnknownTracks};
use crate::bars::table::{ends, percent, write_bars};

impl fmt::Display for TrackEvaluation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_bars(f, &self.bars())?;
        let scores = &self.scores;
        writeln!(f, "\n{} obstacles, {} tracks that were ever confirmed", scores.obstacles, scores.tracks)?;
        writeln!(f, "   returns  within      MOTA      IDF1    missed     false  switches     MOTP")?;
        for row in &scores.followed {
            let (clear, share) = (&row.clear, |value: Option<f64>| cell(value.map(|value| 100.0 * value), 2));
            writeln!(
                f,
                "{:>10}{:>8}{:>10}{:>10}{:>10}{:>10}{:>10}{:>9}",
                format!("{}+", row.least_returns),
                format!("{} m", row.match_m),
                share(clear.mota()),
                share(row.identity.idf1()),
                clear.missed,
                clear.false_tracks,
                clear.switches,
                cell(clear.motp_m(), 3),
            )?;
        }
        let share = |value: Option<f64>| cell(value.map(|value| 100.0 * value), 2);
        let hota = &scores.hota;
        writeln!(
            f,
            "HOTA {}: detection {}, association {}, localisation {}",
            share(hota.hota()),
            share(hota.detection()),
            share(hota.association()),
            share(hota.localisation())
        )?;
        self.say_hardest(f)?;
        writeln!(f, "\nroot mean square errors of confirmed tracks: position [m], velocity [m/s], of")?;
        for (row, &returns) in RETURNS.iter().enumerate() {
            let (position, velocity) = (scores.errors.position_m[row], scores.errors.velocity_mps[row]);
            let [position, velocity] = [position, velocity].map(|one| (cell(one.value(), 3), one.count));
            writeln!(f, "{:>14}{:>9}{:>9}{:>9}", ends(returns), position.0, velocity.0, velocity.1)?;
        }
        for (name, coasting) in
            [("coasting", scores.errors.coasting_m), ("of 50 and more", scores.errors.coasting_large_m)]
        {
            writeln!(f, "{name:>14}{:>9}{:>9}{:>9}", cell(coasting.value(), 3), "", coasting.count)?;
        }
        if let Some([median, ninth, most]) = scores.errors.large_quantiles_m() {
            writeln!(f, "50 and more: median {median:.3}, ninth decile {ninth:.3}, 99th percentile {most:.3} m")?;
        }
        writeln!(f, "by age, 20 returns and more: position [m], velocity [m/s], of")?;
        for age_s in [0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0] {
            let at = |list: &[RootMeanSquare]| list.get(self.sweeps_in(age_s)).copied().unwrap_or_default();
            let [position, velocity] =
                [&scores.errors.position_by_age_m, &scores.errors.velocity_by_age_mps].map(|l| at(l));
            let [position, velocity, of] =
                [cell(position.value(), 3), cell(velocity.value(), 3), velocity.count.to_string()];
            writeln!(f, "{:>14}{position:>9}{velocity:>9}{of:>9}", format!("{age_s} s"))?;
        }
        writeln!(f, "\nNEES: below, inside and above its 95 % bounds; mean a degree of freedom")?;
        let consistency = &scores.consistency;
        for (name, nees, freedom) in [
            ("both", consistency.state, 6.0),
            ("position", consistency.position, 3.0),
            ("velocity", consistency.velocity, 3.0),
        ] {
            write_nees(f, name, nees, freedom)?;
        }
        let confirming = &scores.confirming;
        if let Some([median, most]) = confirming.quantiles() {
            writeln!(
                f,
                "\nconfirmed after {median:.0} sweeps (95th percentile {most:.0}), of {}; never: {}",
                confirming.found(),
                confirming.never
            )?;
        }
        self.say_classes(f)?;
        if let Some([median, ninth]) = scores.bodies.size_per_cent() {
            writeln!(f, "\nextents off {median:.1} % (ninth decile {ninth:.1}), of {}", scores.bodies.sized.count)?;
        }
        if let Some([median, ninth, own]) = scores.bodies.spin_dps() {
            let known = percent(scores.bodies.spinning);
            writeln!(f, "spin off {median:.1} deg/s (ninth decile {ninth:.1}) of {own:.1}; {known} have one")?;
        }
        self.say_encounters(f)?;
        match self.time.ms {
            Some([median, most]) => writeln!(
                f,
                "\ntracker: {median:.3} ms a sweep (99th percentile {most:.3}), {:.0} tracks",
                self.time.tracks
            ),
            None => Ok(()),
        }
    }
}

impl TrackEvaluation {
    fn say_hardest(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nfollowed worst: scene and obstacle, class, extents [m], returns, distance [m]")?;
        writeln!(f, "{:>58}   sweeps   missed   tracks  off [m]", "")?;
        for one in &self.scores.hardest {
            let size = one.size_m.map(|extent| format!("{extent:.1}")).join(" x ");
            write!(f, "{:>6}/{:<4}{:>12}{size:>18}", one.scene, one.id, one.class.name())?;
            write!(f, "{:>8}{:>8.1}", one.returns, one.range_m)?;
            let off = cell(one.off_m.value(), 3);
            writeln!(f, "{:>11}{:>9}{:>9}{off:>9}", one.sweeps, one.missed, one.tracks)?;
        }
        Ok(())
    }

    fn say_classes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let classes = &self.scores.classes;
        write!(f, "\nclass right after sweeps")?;
        AFTER.iter().try_for_each(|after| write!(f, "{after:>9}"))?;
        writeln!(f, "       of")?;
        for (least, row) in LEAST_RETURNS.iter().zip(&classes.right) {
            write!(f, "{:>24}", format!("{least} returns and more"))?;
            row.iter().try_for_each(|right| write!(f, "{:>9}", percent(*right)))?;
            writeln!(f, "{:>9}", row[0].of)?;
        }
        writeln!(f, "{:>12}   Rec   Ell   Cyl   Con  none", "actual")?;
        for (class, row) in ObstacleClass::SOLIDS.into_iter().zip(classes.confusion) {
            write!(f, "{:>12}", class.name())?;
            row.iter().try_for_each(|count| write!(f, "{count:>6}"))?;
            writeln!(f)?;
        }
        Ok(())
    }

    fn say_encounters(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (encounters, plan) = (&self.encounters, &self.plan.encounters);
        let danger = &encounters.danger;
        writeln!(
            f,
            "\nencounters, {} s before the closest approach: own radius {} m, horizon {} s, warned of from {}",
            plan.lead_s, danger.own_radius_m, danger.horizon_s, danger.alert
        )?;
        writeln!(f, "with a track {} of {}", percent(encounters.tracked()), encounters.tracked().of)?;
        writeln!(f, " probability  predicted  happened   95 % interval     of")?;
        let table = encounters.table();
        for (place, bin) in table.bins.iter().enumerate() {
            let [low, high] = bin.interval().map_or([None; 2], |ends| ends.map(Some));
            writeln!(
                f,
                "{:>12}{:>11}{:>10}{:>8} to {:>5}{:>7}",
                format!("{:.1}", place as f64 / table.bins.len() as f64),
                cell(bin.predicted(), 3),
                cell(bin.share(), 3),
                cell(low, 3),
                cell(high, 3),
                bin.count
            )?;
        }
        writeln!(
            f,
            "calibration error {}, Brier score {}",
            cell(table.expected_calibration_error(), 4),
            cell(table.brier(), 4)
        )?;
        let (missed, centres, alerts) = (encounters.missed(), encounters.missed_centres(), encounters.false_alerts());
        writeln!(f, "20 returns and more: contacts not warned of {} of {}", missed.count, missed.of)?;
        writeln!(f, "  centres within the own radius not warned of {} of {}", centres.count, centres.of)?;
        writeln!(f, "  warned of and passing by {} of {}", alerts.count, alerts.of)?;
        if let Some(([median, ninth], within)) = encounters.distance_errors() {
            let within = percent(within);
            writeln!(f, "  closest distance off {median:.3} m (ninth decile {ninth:.3}), {within} within 95 %")?;
        }
        Ok(())
    }
}

impl fmt::Display for UnknownTracks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let six = |values: Option<[f64; 6]>, digits: usize| match values {
            Some(values) => values.map(|value| format!("{value:.digits$}")).join(", "),
            None => "none".to_owned(),
        };
        let row = |f: &mut fmt::Formatter<'_>, name: &str, value: String| writeln!(f, "{name:<44}{value}");
        row(f, "sweeps (rejected)", format!("{} ({})", self.sweeps, self.rejected))?;
        row(f, "tracks ever confirmed, never confirmed", format!("{}, {}", self.confirmed, self.unconfirmed))?;
        row(f, "length [sweeps] p10 p25 p50 p75 p90 most", six(self.length_sweeps, 0))?;
        row(f, "believed a sweep, median", cell(self.believed, 0))?;
        row(f, "of these measured in the sweep", percent(self.seen))?;
        row(f, "speed [m/s] p10 p25 p50 p75 p90 p99", six(self.speed_mps, 3))?;
        row(f, "speed [m/s], at least 50 points", six(self.large_speed_mps, 3))?;
        let (born, sweeps) = self.births;
        let rate = |count: u32| cell((sweeps > 0).then(|| f64::from(count) / sweeps as f64), 3);
        row(f, "births a sweep after the first 30", rate(born))?;
        row(f, "of these confirmed", rate(self.confirmed_births))?;
        row(f, "clusters of 5 points on a believed track", percent(self.covered))?;
        let changed = format!("{} ({} of {})", percent(self.changed), self.changed.count, self.changed.of);
        row(f, "number changed between nearest clusters", changed)
    }
}

/// A number, or that there is none.
pub(crate) fn cell(value: Option<f64>, digits: usize) -> String {
    value.map_or("none".to_owned(), |value| format!("{value:.digits$}"))
}

fn write_nees(f: &mut fmt::Formatter<'_>, name: &str, nees: Nees, freedom: f64) -> fmt::Result {
    let all = nees.inside().of;
    let share = |count| percent(crate::Share { count, of: all });
    writeln!(
        f,
        "{name:>12}{:>9}{:>9}{:>9}{:>9}",
        share(nees.below),
        share(nees.inside),
        share(nees.above),
        cell(nees.mean().map(|mean| mean / freedom), 2)
    )
}
