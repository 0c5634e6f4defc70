//! The results for a terminal.

use std::fmt;

use lidar::ObstacleClass;

use super::share::Share;
use super::tally::{POINTS, RINGS, SolidErrors};
use super::{Bar, Claims, Evaluation, Measure};

impl fmt::Display for Evaluation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_bars(f, &self.bars())?;
        let tally = &self.reference;
        writeln!(f, "\nverdicts, of at least 5 points; {} clusters have fewer", tally.small)?;
        writeln!(f, "{:>12}   Rec   Ell   Cyl   Con  none   right", "actual")?;
        for (row, class) in ObstacleClass::SOLIDS.into_iter().enumerate() {
            write!(f, "{:>12}", class.name())?;
            for count in tally.confusion[row] {
                write!(f, "{count:>6}")?;
            }
            writeln!(
                f,
                "{:>8}",
                percent(Share { count: tally.confusion[row][row], of: tally.confusion[row].iter().sum() })
            )?;
        }
        write_rows(f, "by points", POINTS.iter().zip(tally.by_points))?;
        write_rows(f, "by rings", RINGS.iter().zip(tally.by_rings))?;
        writeln!(f, "\nby least posterior: right, and coverage")?;
        for row in tally.thresholds {
            writeln!(f, "{:>12}{:>10}{:>10}", row.posterior, percent(row.right), percent(row.kept))?;
        }
        writeln!(f, "\nsolids whose class is right: errors as median (ninth decile)")?;
        write_solids(f, "50 and more", &tally.large_solids)?;
        write_solids(f, "5 and more", &tally.solids)?;
        let summed = &self.summed;
        writeln!(
            f,
            "\nsummed over sweeps: {} a sweep, {} after {} sweeps; calibration error of the sum {:.3}",
            percent(summed.single),
            percent(summed.all()),
            summed.after.len(),
            summed.reliability.expected_calibration_error(),
        )?;
        writeln!(
            f,
            "seen by {}: {} right of {}",
            self.plan.variants.dense_sensor,
            percent(self.dense.all),
            self.dense.all.of
        )?;
        if let (Some(median), Some(least)) = (self.fit.median_ms, self.fit.least_ms) {
            let passes = self.plan.fit.passes;
            writeln!(
                f,
                "a fit of the {} scene: {median:.2} ms, the least of {passes} passes {least:.2} ms",
                self.plan.fit.scene
            )?;
        }
        writeln!(f, "\nevaluations of a fit: right, right of at least 50 points, time of a fit")?;
        for point in &self.budget {
            let time = point.time.median_ms.map_or("none".to_owned(), |ms| format!("{ms:.2} ms"));
            writeln!(f, "{:>12}{:>10}{:>10}{time:>10}", point.evaluations, percent(point.all), percent(point.large))?;
        }
        self.claims.as_ref().map_or(Ok(()), |claims| write_claims(f, claims))
    }
}

/// The bars as rows.
pub(crate) fn write_bars(f: &mut fmt::Formatter<'_>, bars: &[Bar]) -> fmt::Result {
    writeln!(f, "{:<28}{:>11}{:>20}{:>7}", "bar", "target", "measured", "of")?;
    for bar in bars {
        let target = bar.target.map_or("-".to_owned(), |target| format!("{} {target}", bar.sense.sign()));
        writeln!(f, "{:<28}{target:>11}{:>20}{:>7}  {}", bar.key, value(bar), bar.measured.of, bar.standing())?;
    }
    Ok(())
}

/// A bar's value with its unit, as people read it.
pub(crate) fn value(bar: &Bar) -> String {
    let Some(value) = bar.measured.value else { return "nothing to measure".to_owned() };
    let least = match bar.unit {
        "%" => 2,
        _ if value.fract() == 0.0 => 0,
        _ => 4,
    };
    // A value just short of its target must not be rounded to it.
    let as_printed = |digits: &usize| {
        let value = format!("{value:.digits$}").parse().ok();
        let printed = Bar { measured: Measure { value, ..bar.measured }, ..bar.clone() };
        printed.standing() == bar.standing()
    };
    let digits = (least..9).find(as_printed).unwrap_or(least);
    let error = bar.measured.error.map_or(String::new(), |error| format!(" ± {error:.1}"));
    let gap = if bar.unit.is_empty() { "" } else { " " };
    format!("{value:.digits$}{error}{gap}{}", bar.unit)
}

/// A share as people read it.
pub(crate) fn percent(share: Share) -> String {
    share.per_cent().map_or("none".to_owned(), |value| format!("{value:.1} %"))
}

/// The name of a row of points or rings.
pub(crate) fn ends([least, most]: [u32; 2]) -> String {
    match most {
        u32::MAX => format!("{least} and more"),
        most if most == least => format!("{least}"),
        most => format!("{least} to {most}"),
    }
}

fn write_rows<'a>(
    f: &mut fmt::Formatter<'_>,
    name: &str,
    rows: impl Iterator<Item = (&'a [u32; 2], Share)>,
) -> fmt::Result {
    writeln!(f, "\n{name}")?;
    for (&row, right) in rows {
        writeln!(f, "{:>12}{:>10} of {}", ends(row), percent(right), right.of)?;
    }
    Ok(())
}

fn write_solids(f: &mut fmt::Formatter<'_>, name: &str, errors: &SolidErrors) -> fmt::Result {
    let (Some(centre), Some(size)) = (errors.centre_m, errors.size_per_cent) else {
        return writeln!(f, "{name:>12} points: none");
    };
    let cm = centre.map(|metres| 100.0 * metres);
    write!(f, "{name:>12} points: {}, centre {:.1} ({:.1}) cm, ", errors.count, cm[0], cm[1])?;
    write!(f, "extents {:.1} ({:.1}) %, ", size[0], size[1])?;
    if let Some([mean, median]) = errors.nees_per_dof {
        write!(f, "NEES a degree of freedom {mean:.2} (median {median:.2}), ")?;
    }
    writeln!(f, "{} within 95 %", percent(errors.within_95))
}

fn write_claims(f: &mut fmt::Formatter<'_>, claims: &Claims) -> fmt::Result {
    writeln!(f, "\nrecording: {} sweeps, {} clusters of at least 5 points", claims.sweeps, claims.unclassified.of)?;
    for (class, count) in ObstacleClass::ALL.into_iter().zip(claims.by_class) {
        writeln!(f, "{:>12}{count:>10}", class.name())?;
    }
    writeln!(f, "with fitted solids {}", percent(claims.fitted))?;
    writeln!(f, "posterior of at least 0.9 {}", percent(claims.confident))?;
    writeln!(f, "unclassified {}", percent(claims.unclassified))
}

#[cfg(test)]
mod tests {
    use super::super::{Sense, Standing};
    use super::*;

    #[test]
    fn a_value_just_short_of_its_target_is_not_rounded_to_it() {
        let bar = |unit, target, value| Bar {
            key: "",
            says: "",
            unit,
            sense: Sense::AtLeast,
            target: Some(target),
            measured: Measure { value: Some(value), error: None, of: 1 },
        };
        assert_eq!(value(&bar("%", 93.5, 93.4969)), "93.497 %");
        assert_eq!(value(&bar("%", 93.5, 93.5)), "93.50 %");
        assert_eq!(value(&bar("%", 93.5, 90.614)), "90.61 %");
        assert_eq!(value(&bar("", 3000.0, 6196.0)), "6196");
        assert_eq!(bar("%", 93.5, 93.4969).standing(), Standing::FallsShort);
    }
}
