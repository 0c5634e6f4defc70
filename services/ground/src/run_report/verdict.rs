//! How the run went, in words and in a few large numbers.

use super::figures::RunFigures;
use super::latency_plots::deadline_ms;
use super::parts::{count, maybe_ms};
use super::plot::plain;
use crate::page::escaped;

pub(crate) fn section(figures: &RunFigures) -> String {
    format!("<div class=\"verdict {}\">{}</div>{}", class(figures), words(figures), tiles(figures))
}

/// Parts that never came to the stage that should have had them.
fn missing(figures: &RunFigures) -> Option<u64> {
    let hops = &figures.ledger.as_ref()?.hops;
    Some(hops.iter().map(|hop| hop.lost + hop.dropped.values().sum::<u64>()).sum())
}

fn class(figures: &RunFigures) -> &'static str {
    let verdict = figures.verdict.as_ref();
    let open = figures.ledger.as_ref().is_some_and(|ledger| !ledger.closed);
    if open || verdict.is_some_and(|verdict| verdict.failed.is_some()) || figures.stopped.is_some() {
        return "bad";
    }
    let misses = figures.deadline.as_ref().map_or(0, |deadline| deadline.misses);
    if misses + missing(figures).unwrap_or(0) > 0 {
        return "fair";
    }
    // Without a ledger and a deadline nothing can be said to be well.
    if figures.ledger.is_none() && figures.deadline.is_none() { "unknown" } else { "fine" }
}

fn words(figures: &RunFigures) -> String {
    let sign = match class(figures) {
        "bad" => "✗",
        "fair" => "!",
        "unknown" => "?",
        _ => "✓",
    };
    let mut says = vec![format!("<span class=\"sign\">{sign}</span>")];
    match &figures.ledger {
        Some(ledger) if ledger.closed => says.push("The ledger is closed: every part has its place.".to_owned()),
        Some(_) => says.push("<b>The ledger is OPEN</b>: parts are in no category, or in two.".to_owned()),
        None if figures.read_from.is_some() => says.push("Figures worked out from a recording.".to_owned()),
        None => says.push("The report has no ledger.".to_owned()),
    }
    match missing(figures) {
        Some(0) => says.push("Nothing was dropped or lost.".to_owned()),
        Some(parts) => says.push(format!("{} parts were dropped or lost, each by name or number.", count(parts))),
        None => {}
    }
    says.push(deadline(figures));
    match &figures.verdict {
        Some(verdict) => match (&verdict.failed, &verdict.failed_strict) {
            (Some(why), _) => says.push(format!("The command failed with exit code 1: {}.", escaped(why))),
            (None, Some(why)) => {
                says.push(format!("Exit code 0; with <code>--strict</code> it would have been 1: {}.", escaped(why)));
            }
            (None, None) => says.push("Exit code 0, with <code>--strict</code> as well.".to_owned()),
        },
        None if figures.read_from.is_none() => {
            says.push("The report is of an older version and does not say how the command ended.".to_owned());
        }
        None => {}
    }
    if let Some(why) = figures.stopped.as_ref().filter(|_| figures.verdict.is_none()) {
        says.push(format!("It was stopped: {}.", escaped(why)));
    }
    if let Some(torn) = figures.read_from.as_ref().and_then(|recording| recording.torn.as_ref()) {
        says.push(format!("The file is not whole: {}.", escaped(torn)));
    }
    says.join(" ")
}

fn deadline(figures: &RunFigures) -> String {
    if figures.pace == "fast" {
        return "The run was as fast as it goes, without deadlines.".to_owned();
    }
    let (Some(deadline), Some(limit_ms)) = (&figures.deadline, deadline_ms(figures)) else {
        return match figures.read_from {
            Some(_) => "It does not say what deadline the run had.".to_owned(),
            None => "Nothing is said of deadlines.".to_owned(),
        };
    };
    let limit = plain(limit_ms);
    let share = deadline.margin_p999_pct.map_or(String::new(), |margin| {
        let enough = match deadline.margin_ok {
            Some(true) => "; flight practice asks for 30 %",
            Some(false) => "; that is short of flight practice, 30 %",
            None => "",
        };
        if margin >= 0.0 {
            format!(" At p99.9, {margin:.0} % of it are left{enough}.")
        } else {
            format!(" At p99.9 it is exceeded by {:.0} %{enough}.", -margin)
        }
    });
    let worst =
        deadline.causes.iter().max_by_key(|cause| cause.1).map_or(String::new(), |(cause, number)| {
            format!(", {} of them by <b>{}</b>", count(*number), escaped(cause))
        });
    match deadline.misses {
        0 => format!("No sweep missed the deadline of {limit} ms.{share}"),
        misses => format!(
            "{} of {} sweeps missed the deadline of {limit} ms{worst}.{share}",
            count(misses),
            count(figures.sweeps)
        ),
    }
}

fn tiles(figures: &RunFigures) -> String {
    let latency = &figures.latency_ms.end_to_end;
    let restarts = figures.processes.as_ref().map(|processes| processes.iter().map(|process| process.restarts).sum());
    let number = |value: Option<u64>| value.map_or("–".to_owned(), count);
    let misses = figures.deadline.as_ref().filter(|_| figures.pace != "fast").map(|deadline| deadline.misses);
    let tiles = [
        ("sweeps", count(figures.sweeps)),
        ("median latency [ms]", maybe_ms(latency.p50)),
        ("p99.9 [ms]", maybe_ms(latency.p999)),
        ("longest [ms]", maybe_ms(latency.max)),
        ("deadline misses", number(misses)),
        ("parts dropped or lost", number(missing(figures))),
        ("restarts", number(restarts)),
        ("detections", number(figures.detections.as_ref().map(|classes| classes.values().sum()))),
    ];
    let tile = |(words, value): &(&str, String)| format!("<div><b>{value}</b><span>{words}</span></div>");
    format!("<div class=\"tiles\">{}</div>", tiles.iter().map(tile).collect::<String>())
}
