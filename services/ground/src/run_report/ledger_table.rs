//! The ledger: what every hop made of the parts that were sent to it; and misses by cause.

use super::figures::{Hop, RunFigures};
use super::parts::{BLUE, GREY, ORANGE, PINK, RED, SKY, YELLOW, absent, bar, count, key};
use crate::page::escaped;

const KINDS: [(&str, &str); 6] = [
    (BLUE, "processed"),
    (YELLOW, "rejected"),
    (ORANGE, "dropped"),
    (RED, "lost"),
    (SKY, "in flight"),
    (PINK, "in no category"),
];
/// Gaps that are shown by name.
const GAPS: usize = 20;

pub(crate) fn section(figures: &RunFigures) -> String {
    let heading = "<h2>Ledger</h2>".to_owned();
    let Some(ledger) = &figures.ledger else {
        let Some(recording) = &figures.read_from else { return heading + &absent("This report has no ledger.") };
        return heading + &statuses(recording);
    };
    let most = ledger.hops.iter().map(|hop| hop.published).max().unwrap_or(0).max(1) as f64;
    let mut text = heading + &key(&KINDS, &[]);
    text += "<div class=\"wide\"><table><tr><th>hop to</th><th>parts published by the stage before</th>\
             <th class=\"n\">published</th><th class=\"n\">received</th><th class=\"n\">processed</th><th>rejected</th>\
             <th>dropped</th><th class=\"n\">lost</th><th class=\"n\">in flight</th><th class=\"n\">open</th></tr>";
    for hop in &ledger.hops {
        text += &row(hop, most);
    }
    text += "</table></div>";
    let state = if ledger.closed {
        "closed: on every hop each part published stands in exactly one category"
    } else {
        "<b>OPEN</b>: some parts stand in no category, or in two"
    };
    text += &format!(
        "<p class=\"note\">The ledger is {state}. A sweep travels as {}.</p>",
        if figures.sectors > 1 { format!("{} parts", figures.sectors) } else { "one part".to_owned() }
    );
    if !ledger.gaps.is_empty() {
        let gap = |gap: &super::figures::Gap| {
            let sweeps = if gap.first_sweep == gap.last_sweep {
                format!("sweep {}", gap.first_sweep)
            } else {
                format!("sweeps {} to {}", gap.first_sweep, gap.last_sweep)
            };
            format!("<li>{} {}: {sweeps}, {} parts</li>", escaped(&gap.stage), escaped(&gap.kind), count(gap.parts))
        };
        let gaps: String = ledger.gaps.iter().take(GAPS).map(gap).collect();
        let more = ledger.gaps.len().saturating_sub(GAPS);
        let more = if more > 0 { format!("<li>and {more} more</li>") } else { String::new() };
        text += &format!("<p>What is missing, by name:</p><ul class=\"small\">{gaps}{more}</ul>");
    }
    text
}

fn row(hop: &Hop, most: f64) -> String {
    let sum = |parts: &std::collections::BTreeMap<String, u64>| parts.values().sum::<u64>();
    let numbers = [hop.processed, sum(&hop.rejected), sum(&hop.dropped), hop.lost, hop.in_flight, hop.open];
    let shares: Vec<_> = numbers.iter().zip(KINDS).map(|(number, kind)| (*number as f64 / most, kind.0)).collect();
    let reasons = |parts: &std::collections::BTreeMap<String, u64>| {
        let some: Vec<_> = parts
            .iter()
            .filter(|(_, number)| **number > 0)
            .map(|(reason, number)| format!("{} {}", count(*number), escaped(reason)))
            .collect();
        if some.is_empty() { "0".to_owned() } else { some.join(", ") }
    };
    let n = |number: u64| format!("<td class=\"n\">{}</td>", count(number));
    format!(
        "<tr><td>{}</td><td>{}</td>{}{}{}<td>{}</td><td>{}</td>{}{}{}</tr>",
        escaped(&hop.stage),
        bar(240.0, &shares),
        n(hop.published),
        n(hop.received),
        n(hop.processed),
        reasons(&hop.rejected),
        reasons(&hop.dropped),
        n(hop.lost),
        n(hop.in_flight),
        n(hop.open)
    )
}

/// What a recording has in the ledger's place.
fn statuses(recording: &super::figures::Recording) -> String {
    if recording.stages.is_empty() {
        return absent("A recording has no ledger, and this one holds no status of the chain.");
    }
    let mut text = "<p>A recording has no ledger. Its last status of the chain says:</p><table><tr><th>stage</th>\
                    <th class=\"n\">parts received</th><th class=\"n\">parts published</th><th class=\"n\">restarts</th></tr>"
        .to_owned();
    for stage in &recording.stages {
        text += &format!(
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            escaped(&stage.stage),
            count(stage.received),
            count(stage.published),
            count(stage.restarts)
        );
    }
    text + "</table>"
}

/// Misses of the deadline, by cause.
pub(crate) fn misses(figures: &RunFigures) -> String {
    let heading = "<h2>Deadline misses by cause</h2>".to_owned();
    if figures.pace == "fast" {
        return heading
            + &absent("At pace <code>fast</code> nothing is due at any time: there are no deadlines to miss.");
    }
    let Some(deadline) = &figures.deadline else {
        return heading
            + &absent(match figures.read_from {
                Some(_) => "The recording does not say what deadline the run had.",
                None => "This report says nothing of deadlines.",
            });
    };
    if deadline.misses == 0 {
        return heading
            + &format!(
                "<p class=\"good\">✓ None: all {} sweeps were answered within {} ms of their last return.</p>",
                count(figures.sweeps),
                super::plot::plain(deadline.deadline_ms)
            );
    }
    let mut causes: Vec<_> = deadline.causes.iter().collect();
    causes.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
    let most = causes.first().map_or(1, |cause| *cause.1).max(1) as f64;
    let kinds = [
        (BLUE, "late or rejected"),
        (GREY, "other processes had the core"),
        (ORANGE, "dropped or lost"),
        (RED, "restart"),
    ];
    let mut text = heading + &key(&kinds, &[]) + "<table class=\"plain\">";
    for (cause, number) in causes {
        let colour = if cause.ends_with("dropped") || cause.ends_with("lost") { ORANGE } else { BLUE };
        let colour = if cause.ends_with("restart") { RED } else { colour };
        let colour = if cause.ends_with("cpu taken") { GREY } else { colour };
        text += &format!(
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{:.1} %</td></tr>",
            escaped(cause),
            bar(420.0, &[(*number as f64 / most, colour)]),
            count(*number),
            100.0 * *number as f64 / deadline.misses as f64
        );
    }
    text + &format!(
        "</table><p class=\"note\">Each of the {} misses has one cause: the stage and the kind of delay that took most of the \
         time between due and answer; sweeps dropped or lost count by the hop that missed them first.</p>",
        count(deadline.misses)
    )
}
