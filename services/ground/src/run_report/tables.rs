//! Processes and events as tables.

use super::figures::{Process, RunFigures};
use super::parts::{absent, colour, count, event_colour, maybe_ms};
use super::plot::plain;
use crate::page::escaped;

/// Events that are listed.
const EVENTS: usize = 60;

pub(crate) fn processes(figures: &RunFigures) -> String {
    let heading = "<h2>Processes</h2>".to_owned();
    let Some(processes) = figures.processes.as_ref().filter(|processes| !processes.is_empty()) else {
        return heading
            + &absent(match figures.read_from {
                Some(_) => "A recording does not say what the processes used.",
                None => "This report does not say what the processes used.",
            });
    };
    let mut text = heading
        + "<div class=\"wide\"><table><tr><th>process</th><th class=\"n\">pid</th><th class=\"n\">restarts</th>\
           <th class=\"n\">CPU [%]</th><th class=\"n\">memory [MiB]<br><small>after start, end, peak</small></th>\
           <th class=\"n\">waited for<br>a core [ms]</th><th class=\"n\">switches<br><small>own, forced</small></th>\
           <th class=\"n\">heap allocations a part<br><small>in process, round it</small></th></tr>";
    for (place, process) in processes.iter().enumerate() {
        text += &row(place, process);
    }
    text += "</table></div><p class=\"note\">CPU: 100 is one core. Sums over all lives of a process.</p>";
    if !figures.realtime_refused.is_empty() {
        let lines: String = figures.realtime_refused.iter().map(|line| format!("<li>{}</li>", escaped(line))).collect();
        text += &format!("<p>The kernel refused:</p><ul class=\"small\">{lines}</ul>");
    }
    text
}

fn row(place: usize, process: &Process) -> String {
    let mib = |kib: u64| format!("{:.1}", kib as f64 / 1024.0);
    let maybe = |number: Option<u64>| number.map_or("–".to_owned(), count);
    let heap = |number: Option<f64>| number.map_or("–".to_owned(), plain);
    format!(
        "<tr><td><span class=\"dot\" style=\"background:{}\"></span>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
         <td class=\"n\">{:.1}</td><td class=\"n\">{}, {}, {}</td><td class=\"n\">{}</td><td class=\"n\">{}, {}</td>\
         <td class=\"n\">{}, {}</td></tr>",
        colour(place),
        escaped(&process.stage),
        process.pid,
        process.restarts,
        process.cpu_pct,
        mib(process.rss_first_kib),
        mib(process.rss_last_kib),
        mib(process.rss_peak_kib),
        maybe_ms(process.run_delay_ms),
        maybe(process.voluntary_switches),
        maybe(process.involuntary_switches),
        heap(process.heap_allocations_per_sweep),
        heap(process.shell_heap_allocations_per_sweep),
    )
}

/// What happened: restarts and steps with the numbers that stand above the plots, then everything by name.
pub(crate) fn events(figures: &RunFigures) -> String {
    timeline(figures) + &by_name(figures)
}

fn by_name(figures: &RunFigures) -> String {
    let rows = figures.events.iter().filter(|(_, times)| **times > 0);
    let row = |(name, times): (&String, &u64)| {
        format!("<tr><td>{}</td><td class=\"n\">{}</td></tr>", escaped(name), count(*times))
    };
    let rows: String = rows.map(row).collect();
    if rows.is_empty() {
        return rows;
    }
    format!("<table><tr><th>event</th><th class=\"n\">times</th></tr>{rows}</table>")
}

fn timeline(figures: &RunFigures) -> String {
    let heading = "<h2>Events</h2>".to_owned();
    let Some(timeline) = &figures.timeline else {
        return heading + &absent("This report is of an older version: it has no list of events.");
    };
    if timeline.events.is_empty() {
        return heading + "<p>No stage was restarted, and no step of degradation was taken.</p>";
    }
    let mut text = heading + "<table><tr><th class=\"n\">no.</th><th class=\"n\">at [s]</th><th>what</th></tr>";
    for (number, event) in (1..).zip(&timeline.events).take(EVENTS) {
        text += &format!(
            "<tr><td class=\"n\"><span class=\"dot\" style=\"background:{}\"></span>{number}</td><td class=\"n\">{:.1}</td>\
             <td>{}: {}</td></tr>",
            event_colour(event),
            event.t_s,
            escaped(&event.kind),
            escaped(&event.what)
        );
    }
    text += "</table>";
    let more = timeline.event_count.saturating_sub(timeline.events.len().min(EVENTS) as u64);
    if more > 0 { text + &format!("<p>And {} more.</p>", count(more)) } else { text }
}
