//! The slowest sweeps, each as the way of its last part through the stages.

use super::figures::{RunFigures, WorstHop, WorstSweep};
use super::latency_plots::deadline_ms;
use super::parts::{GREY, RED, WIDE, absent, colour, key, ms};
use super::plot::{Axis, plain};
use crate::page::{escaped, figure};

/// Sweeps that are drawn.
const SHOWN: usize = 10;
const LEFT: f64 = 250.0;
const RIGHT: f64 = 20.0;
const ROW: f64 = 34.0;
const TOP: f64 = 8.0;

pub(crate) fn section(figures: &RunFigures) -> String {
    let heading = "<h2>Slowest sweeps</h2>".to_owned();
    let Some(worst) = &figures.worst_sweeps else {
        return heading + &absent("This report does not name its slowest sweeps.");
    };
    let worst: Vec<&WorstSweep> = worst.iter().take(SHOWN).filter(|sweep| !sweep.hops.is_empty()).collect();
    let Some(first) = worst.first() else { return heading + &absent("No sweep was answered.") };
    let most = worst.iter().map(|sweep| sweep.end_to_end_ms).fold(0.0, f64::max);
    let deadline = deadline_ms(figures).filter(|deadline| *deadline < 3.0 * most);
    let axis = Axis::from_zero("", most.max(deadline.unwrap_or(0.0)) * 1.02);
    let scale = (f64::from(WIDE.0) - LEFT - RIGHT) / axis.range.end;
    let x = |ms: f64| LEFT + scale * if ms.is_finite() { ms.clamp(0.0, axis.range.end) } else { 0.0 };
    let foot = TOP + ROW * worst.len() as f64;
    let mut svg =
        format!("<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" role=\"img\" class=\"own\">", WIDE.0, foot + 42.0);
    for tick in &axis.ticks {
        let at = x(*tick);
        svg += &format!(
            "<path class=\"grid\" d=\"M{at:.1} {TOP}V{foot}\"/><text x=\"{at:.1}\" y=\"{:.0}\" text-anchor=\"middle\">{}</text>",
            foot + 16.0,
            plain(*tick)
        );
    }
    svg += &format!(
        "<text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"middle\">time since the last return was due [ms]</text>",
        (LEFT + f64::from(WIDE.0) - RIGHT) / 2.0,
        foot + 36.0
    );
    for (place, sweep) in worst.iter().enumerate() {
        svg += &row(sweep, TOP + ROW * place as f64, &x);
    }
    if let Some(deadline) = deadline {
        let at = x(deadline);
        svg += &format!(
            "<path d=\"M{at:.1} {TOP}V{foot}\" stroke=\"{RED}\" stroke-width=\"2\" stroke-dasharray=\"7 5\" fill=\"none\"/>"
        );
    }
    svg += "</svg>";
    let mut entries: Vec<(&str, &str)> =
        first.hops.iter().enumerate().map(|(place, hop)| (colour(place), hop.stage.as_str())).collect();
    entries.push((RED, "thin, below: other processes had the core for so long"));
    let dashed: Vec<_> = deadline.map(|_| (RED, "deadline")).into_iter().collect();
    let caption = "Full: a stage at work (the source: late). Pale: sent, and the stage not started yet. Grey: queued behind parts \
                   before. The cause is what took most of the time.";
    heading + &key(&entries, &dashed) + &figure(&svg, caption)
}

fn row(sweep: &WorstSweep, top: f64, x: &impl Fn(f64) -> f64) -> String {
    let step =
        if sweep.step.is_empty() || sweep.step == "nominal" { String::new() } else { format!(", {}", sweep.step) };
    let mut text = format!(
        "<text x=\"0\" y=\"{:.0}\"><tspan font-weight=\"600\">{}</tspan> · {} ms</text>\
         <text x=\"0\" y=\"{:.0}\" class=\"faint\">{}</text>",
        top + 13.0,
        sweep.sweep,
        ms(sweep.end_to_end_ms),
        top + 27.0,
        escaped(&format!("{}{step}", sweep.cause))
    );
    let mut block = |from: f64, to: f64, colour: &str, opacity: f64, y: f64, height: f64| {
        let (left, right) = (x(from), x(to));
        if right > left {
            text += &format!(
                "<rect x=\"{left:.1}\" y=\"{:.0}\" width=\"{:.1}\" height=\"{height}\" fill=\"{colour}\" \
                 fill-opacity=\"{opacity}\"/>",
                top + y,
                (right - left).max(0.6)
            );
        }
    };
    let mut sent = 0.0;
    for (place, hop) in sweep.hops.iter().enumerate() {
        let WorstHop { queued_ms, taken_ms, started_after_due_ms: started, finished_after_due_ms: finished, .. } = hop;
        let colour = colour(place);
        if place == 0 {
            block(0.0, *started, colour, 1.0, 4.0, 18.0);
        } else {
            block(sent, (sent + queued_ms).min(*started), GREY, 0.45, 8.0, 12.0);
            block(sent + queued_ms, *started, colour, 0.35, 8.0, 12.0);
        }
        block(started.max(sent), *finished, colour, 1.0, 4.0, 18.0);
        block(finished - taken_ms.min(finished - sent), *finished, RED, 1.0, 24.0, 3.0);
        sent = *finished;
    }
    text
}
