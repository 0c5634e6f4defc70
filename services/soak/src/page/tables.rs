//! What stands in tables.

use crate::matrix::Line;
use crate::statistics::Tally;
use crate::verdict::Verdict;

/// Rows of a long table that are shown.
const MOST_ROWS: usize = 400;

/// Text that may hold anything, as text of a page.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A number with as many digits as it needs.
pub(super) fn plain(value: f64) -> String {
    if !value.is_finite() {
        return if value.is_nan() { "–".to_owned() } else { "never".to_owned() };
    }
    let rounded = format!("{value:.3}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" || short.is_empty() { "0".to_owned() } else { short.to_owned() }
}

/// A count in groups of three digits.
pub(super) fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A table with a heading; nothing where there are no rows. Names that begin with a number sign are of numbers.
fn table(heading: &str, names: &[&str], rows: &[Vec<String>]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let class = |name: &str| if name.starts_with('#') { " class=\"n\"" } else { "" };
    let head: String =
        names.iter().map(|name| format!("<th{}>{}</th>", class(name), name.trim_start_matches('#'))).collect();
    let row = |row: &Vec<String>| -> String {
        let cells = names.iter().zip(row).map(|(name, cell)| format!("<td{}>{cell}</td>", class(name)));
        format!("<tr>{}</tr>", cells.collect::<String>())
    };
    let body: String = rows.iter().take(MOST_ROWS).map(row).collect();
    let more = rows.len().saturating_sub(MOST_ROWS);
    let more = if more > 0 { format!("<p>And {more} more.</p>") } else { String::new() };
    format!("<h2>{heading}</h2><div class=\"wide\"><table><tr>{head}</tr>{body}</table></div>{more}")
}

fn maybe(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), plain)
}

fn whole(value: Option<f64>) -> String {
    value.map_or("–".to_owned(), |value| format!("{value:.0}"))
}

pub(super) fn matrix(verdict: &Verdict) -> String {
    let pair_ms = |values: Option<[f64; 2]>| {
        values.map_or("–".to_owned(), |[middle, worst]| format!("{middle:.0} / {worst:.0}"))
    };
    let pair = |[middle, worst]: [u64; 2]| if worst == 0 { "0".to_owned() } else { format!("{middle} / {worst}") };
    let with =
        |number: usize, word: &str| if number > 0 { format!("<small>{number} {word}</small>") } else { String::new() };
    let row = |line: &Line| {
        let broken = line.broken.iter().map(|(name, times)| format!("<b>{} {times}×</b>", escaped(name)));
        let broken = broken.collect::<Vec<_>>().join(", ");
        vec![
            escaped(&line.fault),
            escaped(line.stage.as_deref().unwrap_or("–")),
            format!("{}{}", line.count, with(line.refused, "refused")),
            format!("{}{}", pair_ms(line.detected_ms), with(line.unseen, "unseen")),
            escaped(&line.action.join(", ")),
            format!("{}{}", pair_ms(line.output_again_ms), with(line.still_silent, "silent")),
            pair(line.missed_sweeps),
            pair(line.lost),
            pair(line.dropped),
            pair(line.rejected),
            if broken.is_empty() { "hold".to_owned() } else { broken },
        ]
    };
    let names = [
        "fault",
        "of",
        "#times",
        "#detected after [ms]",
        "action",
        "#output again after [ms]",
        "#sweeps missed",
        "#parts lost",
        "#dropped",
        "#rejected",
        "invariants",
    ];
    let rows: Vec<_> = verdict.matrix.lines.iter().map(row).collect();
    table("Survival matrix", &names, &rows)
        + if rows.is_empty() { "" } else { "<p class=\"faint\">Median / worst.</p>" }
}

pub(super) fn steps(verdict: &Verdict) -> String {
    // Of thousands of changes of mode those that failed are of interest.
    let many = verdict.steps.len() > MOST_ROWS;
    let steps = verdict.steps.iter().filter(|step| !many || !step.passed);
    let row = |step: &crate::Step| {
        let sign = if step.passed { "✓" } else { "<b>✗</b>" };
        vec![sign.to_owned(), plain(step.t_s), escaped(&step.name), whole(step.took_ms), escaped(&step.note)]
    };
    let rows: Vec<_> = steps.map(row).collect();
    table("Steps", &["", "#t [s]", "step", "#took [ms]", ""], &rows)
}

pub(super) fn cycles(verdict: &Verdict) -> String {
    let failed = verdict.cycles.iter().enumerate().filter(|(_, cycle)| cycle.failed.is_some());
    let row = |(number, cycle): (usize, &crate::Cycle)| {
        vec![
            (number + 1).to_string(),
            whole(cycle.ready_ms),
            cycle.exit_code.map_or("–".to_owned(), |code| code.to_string()),
            escaped(cycle.killed.as_deref().unwrap_or("")),
            escaped(cycle.failed.as_deref().unwrap_or("")),
        ]
    };
    let rows: Vec<_> = failed.map(row).collect();
    table("Starts that failed", &["#start", "#ready [ms]", "#exit code", "killed before", "what"], &rows)
}

pub(super) fn availability(verdict: &Verdict) -> String {
    let Some(of) = &verdict.availability else { return String::new() };
    let row = |name: &str, tally: &Tally, pct: Option<f64>| {
        let Tally { due, in_time, late, broken, missing } = *tally;
        let mut row = vec![name.to_owned()];
        row.extend([due, in_time, late, broken, missing].map(count));
        row.push(maybe(pct));
        row
    };
    let mut rows = vec![row("all sweeps", &of.overall, of.overall_pct)];
    if !verdict.faults.is_empty() {
        rows.push(row("outside the time after injections", &of.after_injections, of.after_injections_pct));
        rows.push(row("outside faults and the time after them", &of.outside_faults, of.outside_faults_pct));
    }
    table("Availability", &["", "#due", "#in time", "#late", "#broken", "#not answered", "#in time [%]"], &rows)
}

pub(super) fn processes(verdict: &Verdict) -> String {
    let row = |of: &crate::ProcessRecord| {
        let steady = |steady: Option<crate::Steady>| {
            steady.map_or("–".to_owned(), |of| format!("{} → {} ({})", of.first, of.last, of.most))
        };
        let growth = of.memory_kib;
        let interval = growth.and_then(|growth| growth.per_hour.interval);
        vec![
            escaped(&of.process),
            of.lives.to_string(),
            format!("{:.0}", of.longest_s),
            growth.map_or("–".to_owned(), |of| format!("{:.0} → {:.0}", of.first, of.last)),
            maybe(growth.map(|growth| growth.growth_pct)),
            maybe(growth.map(|growth| growth.per_hour.slope)),
            interval.map_or("–".to_owned(), |[low, high]| format!("{} to {}", plain(low), plain(high))),
            growth.map_or("–".to_owned(), |of| {
                format!("{:.0} of {}", of.per_hour.effective_points, of.per_hour.points)
            }),
            steady(of.files),
            steady(of.threads),
        ]
    };
    let names = [
        "process",
        "#lives",
        "#longest [s]",
        "#memory [KiB]",
        "#growth [%]",
        "#slope [KiB/h]",
        "#95 % interval",
        "#independent points",
        "#its own [KiB]",
        "#slope [KiB/h]",
        "#files (most)",
        "#threads (most)",
    ];
    table("Processes, in their longest life", &names, &verdict.processes.iter().map(row).collect::<Vec<_>>())
}

pub(super) fn ledgers(verdict: &Verdict) -> String {
    let hops = verdict.ledgers.iter().flat_map(|ledger| &ledger.hops);
    let row = |hop: &supervisor::HopReport| {
        let sum = |of: &std::collections::BTreeMap<String, u64>| of.values().sum::<u64>();
        let numbers = [
            hop.published,
            hop.received,
            hop.processed,
            sum(&hop.rejected),
            sum(&hop.dropped),
            hop.lost,
            hop.in_flight,
            hop.open,
        ];
        [vec![escaped(&hop.stage)], numbers.map(count).to_vec()].concat()
    };
    let names =
        ["hop to", "#published", "#received", "#processed", "#rejected", "#dropped", "#lost", "#in flight", "#open"];
    table("Ledger", &names, &hops.map(row).collect::<Vec<_>>())
}

pub(super) fn counts(verdict: &Verdict) -> String {
    let rows = |of: &std::collections::BTreeMap<String, u64>| -> Vec<Vec<String>> {
        of.iter().map(|(name, number)| vec![escaped(name), count(*number)]).collect()
    };
    table("Misses by cause", &["cause", "#sweeps"], &rows(&verdict.misses))
        + &table("Events", &["event", "#times"], &rows(&verdict.events))
}

pub(super) fn grave(verdict: &Verdict) -> String {
    let rows: Vec<_> = verdict
        .grave
        .iter()
        .map(|event| vec![plain(event.t_s), escaped(&event.name), escaped(&event.stage), escaped(&event.text)])
        .collect();
    folded("Grave events", table("Grave events", &["#t [s]", "event", "about", "what"], &rows))
}

pub(super) fn faults(verdict: &Verdict) -> String {
    let row = |row: &crate::Row| {
        let broken = row.invariants.broken().join(", ");
        vec![
            plain(row.t_s),
            escaped(&row.words),
            whole(row.detected_ms),
            whole(row.output_again_ms),
            row.missed_sweeps.to_string(),
            row.lost.to_string(),
            escaped(row.refused.as_deref().unwrap_or(if broken.is_empty() { "" } else { &broken })),
        ]
    };
    let names = ["#t [s]", "inject", "#detected [ms]", "#output again [ms]", "#sweeps missed", "#lost", "what failed"];
    folded("Every fault", table("Every fault", &names, &verdict.faults.iter().map(row).collect::<Vec<_>>()))
}

/// A long table that is shown when it is asked for.
fn folded(title: &str, table: String) -> String {
    if table.is_empty() { table } else { format!("<details><summary>{title}</summary>{table}</details>") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_as_people_read_them() {
        assert_eq!([0.0, -0.0, 100.0, 0.5, 1234.5678].map(plain), ["0", "0", "100", "0.5", "1234.568"]);
        assert_eq!(plain(f64::INFINITY), "never");
        assert_eq!([0, 999, 1_000, 1_234_567].map(count), ["0", "999", "1\u{202f}000", "1\u{202f}234\u{202f}567"]);
    }
}
