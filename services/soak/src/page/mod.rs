//! The verdict as one page that needs no script, font or address, and the matrix as Markdown.

mod markdown;
mod plot;
mod plots;
mod style;
mod tables;

pub use markdown::with_section;

use crate::verdict::{Bar, Verdict};
use tables::escaped;

impl Verdict {
    /// The page.
    pub fn to_html(&self) -> String {
        let body = [
            self.head(),
            self.tiles(),
            self.bars(),
            plots::section(self),
            tables::matrix(self),
            tables::steps(self),
            tables::cycles(self),
            tables::availability(self),
            tables::processes(self),
            tables::ledgers(self),
            tables::counts(self),
            tables::grave(self),
            tables::faults(self),
            self.foot(),
        ];
        style::document(&format!("Encke soak: {}", escaped(&self.kind)), &body.concat())
    }

    fn head(&self) -> String {
        let (class, sign, words) = match (self.passed, self.judged) {
            (true, true) => ("fine", "✓", "All bars hold.".to_owned()),
            (true, false) => {
                let open = self.bars.iter().filter(|bar| bar.passed.is_none()).count();
                ("fair", "!", format!("All bars hold that could be judged; {open} could not."))
            }
            (false, _) => {
                let failed = self.bars.iter().filter(|bar| bar.passed == Some(false)).map(|bar| escaped(&bar.name));
                ("bad", "✗", format!("Not reached: {}.", failed.collect::<Vec<_>>().join("; ")))
            }
        };
        let early =
            self.ended_early.as_ref().map_or(String::new(), |why| format!(" It ended early: {}.", escaped(why)));
        let mut rows = vec![
            ("What", escaped(&self.kind)),
            ("Source", escaped(&self.source)),
            ("Length", span(self.duration_s)),
            ("Seed", self.seed.to_string()),
            ("Began", utc(self.began_utc_s)),
        ];
        if !self.machine.is_empty() {
            rows.push(("Machine", escaped(&self.machine)));
        }
        if let Some(foreign) = self.foreign_pct {
            rows.push(("Load by others", format!("{foreign:.1} % of a core")));
        }
        rows.push(("Encke", escaped(&self.encke)));
        let rows: String = rows.iter().map(|(name, value)| format!("<dt>{name}</dt><dd>{value}</dd>")).collect();
        format!(
            "<h1>Soak: {}</h1><div class=\"verdict {class}\"><span class=\"sign\">{sign}</span> {words}{early}</div><dl>{rows}</dl>",
            escaped(&self.kind)
        )
    }

    fn tiles(&self) -> String {
        let pct = |value: Option<f64>| value.map_or("–".to_owned(), |pct| format!("{pct:.3} %"));
        let ms = |value: Option<f64>| value.map_or("–".to_owned(), |ms| format!("{ms:.1} ms"));
        let mut tiles = Vec::new();
        if let Some(available) = &self.availability {
            tiles.push(("sweeps due", tables::count(available.overall.due)));
            tiles.push(("answered in time", pct(available.overall_pct)));
            if !self.faults.is_empty() {
                tiles.push(("the same, away from injections", pct(available.after_injections_pct)));
                tiles.push(("faults", tables::count(self.faults.len() as u64)));
            }
            tiles.push(("longest row of misses", tables::count(available.longest_run)));
        }
        if let Some(drift) = &self.drift {
            tiles.push(("median latency, last third", ms(drift.p50_last_ms)));
            tiles.push(("p99, last third", ms(drift.p99_last_ms)));
        }
        if self.cycles.is_empty() {
            tiles.push(("restarts", tables::count(self.restarts)));
        } else {
            tiles.push(("starts", tables::count(self.cycles.len() as u64)));
        }
        let tile = |(words, value): &(&str, String)| format!("<div><b>{value}</b><span>{words}</span></div>");
        format!("<div class=\"tiles\">{}</div>", tiles.iter().map(tile).collect::<String>())
    }

    fn bars(&self) -> String {
        let row = |bar: &Bar| {
            let (class, sign) = match bar.passed {
                Some(true) => ("fine", "✓"),
                Some(false) => ("bad", "✗"),
                None => ("fair", "–"),
            };
            let value = bar.value.map_or("–".to_owned(), tables::plain);
            let note =
                if bar.note.is_empty() { String::new() } else { format!("<small>{}</small>", escaped(&bar.note)) };
            format!(
                "<tr class=\"{class}\"><td class=\"sign\">{sign}</td><td>{}{note}</td><td class=\"n\">{value} {}</td>\
                 <td class=\"n\">{} {}</td></tr>",
                escaped(&bar.name),
                escaped(&bar.unit),
                if bar.rule == "at least" { "≥" } else { "≤" },
                tables::plain(bar.bound),
            )
        };
        let rows: String = self.bars.iter().map(row).collect();
        format!(
            "<h2>Bars</h2><div class=\"wide\"><table class=\"bars\"><tr><th></th><th>what</th><th class=\"n\">value</th>\
             <th class=\"n\">bound</th></tr>{rows}</table></div>"
        )
    }

    fn foot(&self) -> String {
        let cost = &self.observer;
        let looks = match cost.looks {
            0 => String::new(),
            looks => format!(
                " The observer looked {} times, each {:.1} ms, and took {:.2} % of a core.",
                tables::count(looks),
                cost.every_ms,
                cost.cpu_pct
            ),
        };
        format!("<footer>Written by <code>encke soak</code>, Encke {}.{looks}</footer>", escaped(&self.encke))
    }
}

/// A length of time, for people.
pub(crate) fn span(length_s: f64) -> String {
    match length_s {
        s if s >= 7200.0 => format!("{:.2} h", s / 3600.0),
        s if s >= 180.0 => format!("{:.1} min", s / 60.0),
        s => format!("{s:.1} s"),
    }
}

/// A time of day from seconds since 1970, by the days of the Gregorian calendar (H. Hinnant's civil_from_days).
fn utc(seconds: u64) -> String {
    let (days, rest) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day_of_year = day - (365 * year + year / 4 - year / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let (day, month) =
        (day_of_year - (153 * shifted + 2) / 5 + 1, if shifted < 10 { shifted + 3 } else { shifted - 9 });
    let year = year + era * 400 + u64::from(month <= 2);
    format!("{year}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC", rest / 3600, rest / 60 % 60, rest % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_day_are_those_of_the_calendar() {
        assert_eq!(utc(0), "1970-01-01 00:00:00 UTC");
        assert_eq!(utc(951_826_154), "2000-02-29 12:09:14 UTC");
        assert_eq!(utc(1_735_689_599), "2024-12-31 23:59:59 UTC");
    }

    #[test]
    fn a_page_says_what_failed_and_escapes_what_it_shows() {
        let bars = vec![Bar::none("left <behind>", 2), Bar::at_most("growth", None, 1.0, "%")];
        let sut = Verdict { kind: "kills".to_owned(), bars, ..Verdict::default() }.judge();
        let page = sut.to_html();
        assert!(page.contains("Not reached: left &lt;behind&gt;.") && !page.contains("<behind>"));
        assert!(!page.contains("http") && !page.contains("<script"));
        let fine = Verdict { bars: vec![Bar::none("x", 0)], ..Verdict::default() }.judge().to_html();
        assert!(fine.contains("All bars hold.") && fine.contains("verdict fine"));
    }
}
