//! The report for people.

use std::fmt::Write;

use messages::Step;
use recorder::{Percentiles, TrackCounts, WorstHop, WorstSweep};

use crate::processes::beside::RecordingReport;
use crate::report::{LEAST_MARGIN_PCT, TraceReport};
use crate::{By, Report, SafeReport};

/// The summary of a run, a page of text.
pub fn summary(report: &Report) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_summary(&mut text, report);
    text
}

fn write_summary(text: &mut String, report: &Report) -> std::fmt::Result {
    writeln!(text, "encke {}  {}", report.encke, report.source)?;
    writeln!(
        text,
        "{} sweeps ({} complete, {} returns) in {:.1} s at {} pace; {}",
        report.sweeps,
        report.complete_sweeps,
        report.returns,
        report.duration_s,
        serde_word(&report.pace),
        report.machine
    )?;
    if !report.refused.is_empty() {
        let reasons: Vec<_> = report.refused.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
        writeln!(text, "returns refused: {}", reasons.join(", "))?;
    }
    write_ledger(text, report)?;
    write_latency(text, report)?;
    write_overload(text, report)?;
    write_processes(text, report)?;
    if let Some(line) = report.events.line() {
        writeln!(text, "\nevents      {line}")?;
    }
    write_machine(text, report)?;
    let classes: Vec<_> = report.detections.iter().map(|(class, count)| format!("{} {count}", class.name())).collect();
    writeln!(text, "\ndetections  {}", classes.join("  "))?;
    if let Some(TrackCounts { confirmed_max, confirmed_last, alerts }) = report.tracks {
        writeln!(text, "tracks      {confirmed_max} confirmed at most, {confirmed_last} at the end; {alerts} alerts")?;
    }
    if let Some(recording) = &report.recording {
        let RecordingReport { file, counts, restarts, .. } = recording;
        let mib = counts.bytes as f64 / f64::from(1 << 20);
        let messages: u64 = counts.topics.iter().map(|topic| topic.messages).sum();
        let (files, lost) = (counts.files, counts.lost());
        writeln!(
            text,
            "recording   {messages} messages, {lost} lost, in {files} files, {mib:.1} MiB, {restarts} restarts: {file}"
        )?;
    }
    write_modes(text, report)?;
    if let Some(reason) = &report.stopped {
        writeln!(text, "STOPPED: {reason}")?;
    }
    Ok(())
}

/// Modes and commands, where there were any.
fn write_modes(text: &mut String, report: &Report) -> std::fmt::Result {
    let (modes, commands) = (report.modes, report.commands);
    if modes.changes + modes.late + commands.accepted + commands.refused > 0 {
        writeln!(
            text,
            "mode        {} at the end; {} changes, {} late, {:.1} ms at most; {} commands, {} refused",
            report.mode.name(),
            modes.changes,
            modes.late,
            modes.took_max_ms,
            commands.accepted,
            commands.refused
        )?;
    }
    match &report.safe_entered {
        Some(SafeReport { by, reason, sweep }) => {
            let by = if *by == By::Command { "commanded" } else { "entered" };
            writeln!(text, "SAFE MODE {by} at sweep {sweep}: {reason}")
        }
        None => Ok(()),
    }
}

fn write_ledger(text: &mut String, report: &Report) -> std::fmt::Result {
    let state = if report.ledger.closed { "closed" } else { "OPEN" };
    writeln!(text, "\nledger {state}")?;
    writeln!(
        text,
        "  {:<12}{:>10}{:>10}{:>10}{:>10}{:>9}{:>6}{:>10}{:>6}",
        "hop to", "published", "received", "processed", "rejected", "dropped", "lost", "in flight", "open"
    )?;
    for hop in &report.ledger.hops {
        writeln!(
            text,
            "  {:<12}{:>10}{:>10}{:>10}{:>10}{:>9}{:>6}{:>10}{:>6}",
            hop.stage,
            hop.published,
            hop.received,
            hop.processed,
            hop.rejected.values().sum::<u64>(),
            hop.dropped.values().sum::<u64>(),
            hop.lost,
            hop.in_flight,
            hop.open
        )?;
    }
    for gap in &report.ledger.gaps {
        let sweeps = if gap.first_sweep == gap.last_sweep {
            format!("sweep {}", gap.first_sweep)
        } else {
            format!("sweeps {} to {}", gap.first_sweep, gap.last_sweep)
        };
        writeln!(text, "  {} {}: {} ({} parts)", gap.stage, gap.kind, sweeps, gap.parts)?;
    }
    Ok(())
}

fn write_latency(text: &mut String, report: &Report) -> std::fmt::Result {
    writeln!(text, "\nlatency [ms]            p50       p99     p99.9       max")?;
    let mut row = |name: &str, latency: &Percentiles| {
        let ms = |value: Option<f64>| value.map_or("-".to_owned(), |ms| format!("{ms:.3}"));
        writeln!(
            text,
            "  {name:<16}{:>10}{:>10}{:>10}{:>10}",
            ms(latency.p50),
            ms(latency.p99),
            ms(latency.p999),
            ms(latency.max)
        )
    };
    row("end to end", &report.latency_ms.end_to_end)?;
    if report.latency_ms.end_to_end_corrected.count > report.latency_ms.end_to_end.count {
        row("  corrected", &report.latency_ms.end_to_end_corrected)?;
    }
    row("obstacle", &report.obstacle_latency_ms)?;
    row("  on the seam", &report.seam_latency_ms)?;
    for hop in &report.ledger.hops {
        if let Some(stage) = report.latency_ms.stages.get(&hop.stage) {
            row(&format!("{} wait", hop.stage), &stage.transport)?;
            row(&format!("{} queue", hop.stage), &stage.queued)?;
            row(&format!("{} busy", hop.stage), &stage.busy)?;
        }
    }
    write_deadline(text, report)?;
    write_worst(text, report)
}

fn write_deadline(text: &mut String, report: &Report) -> std::fmt::Result {
    let deadline = &report.deadline;
    write!(text, "deadline {} ms: {} misses", deadline.deadline_ms, deadline.misses)?;
    if let Some(margin) = deadline.margin_p999_pct {
        let short = if deadline.margin_ok == Some(true) { "" } else { "SHORT of " };
        write!(text, ", margin at p99.9 {margin:.0} % ({short}flight practice: {LEAST_MARGIN_PCT} %)")?;
    }
    writeln!(text)?;
    for (cause, misses) in &deadline.causes {
        writeln!(text, "  {misses} by {cause}")?;
    }
    if report.steps.keys().any(|step| step != Step::Nominal.name()) {
        let steps: Vec<_> = Step::ALL
            .iter()
            .filter_map(|step| Some(format!("{} {}", step.name(), report.steps.get(step.name())?)))
            .collect();
        writeln!(text, "sweeps by step: {}", steps.join(", "))?;
    }
    if let Some(TraceReport { events, lost, missing, .. }) = report.trace {
        writeln!(text, "trace: {events} events; {lost} parts lost, {missing} never came")?;
    }
    Ok(())
}

/// Sweeps shown as they came through the chain.
const WORST_SHOWN: usize = 3;

fn write_worst(text: &mut String, report: &Report) -> std::fmt::Result {
    if report.worst_sweeps.is_empty() {
        return Ok(());
    }
    writeln!(text, "\nslowest sweeps [ms]: queued + wake-up + cpu taken + busy, by stage")?;
    for WorstSweep { sweep, end_to_end_ms, cause, step, hops } in report.worst_sweeps.iter().take(WORST_SHOWN) {
        let step = if step == Step::Nominal.name() { String::new() } else { format!(" at {step}") };
        writeln!(text, "  {sweep}: {end_to_end_ms:.1} by {cause}{step}")?;
        let hop = |(place, hop): (usize, &WorstHop)| {
            let WorstHop { stage, queued_ms, wake_ms, taken_ms, busy_ms, finished_after_due_ms, .. } = hop;
            match place {
                0 => format!("{stage} late {:.1}", finished_after_due_ms.max(0.0)),
                _ => format!("{stage} {queued_ms:.1} + {wake_ms:.1} + {taken_ms:.1} + {busy_ms:.1}"),
            }
        };
        let hops: Vec<_> = hops.iter().enumerate().map(hop).collect();
        writeln!(text, "    {}", hops.join(" | "))?;
    }
    Ok(())
}

fn write_overload(text: &mut String, report: &Report) -> std::fmt::Result {
    let overload = &report.overload;
    for (stage, overruns) in overload.overruns.iter().filter(|(_, overruns)| **overruns > 0) {
        writeln!(text, "{stage} overran its budget on {overruns} sweeps")?;
    }
    for step in &overload.moves {
        writeln!(text, "overload: {} to {} at sweep {}: {}", step.from, step.to, step.sweep, step.reason)?;
    }
    let unnamed = overload.move_count - overload.moves.len() as u64;
    if unnamed > 0 { writeln!(text, "overload: {unnamed} more moves") } else { Ok(()) }
}

fn write_processes(text: &mut String, report: &Report) -> std::fmt::Result {
    writeln!(text, "\nprocess          pid  restarts  cpu [%]  rss peak [MiB]  allocations in process")?;
    for process in &report.processes {
        let allocations = process.heap_allocations_per_sweep.map_or("-".to_owned(), |count| format!("{count}"));
        writeln!(
            text,
            "  {:<12}{:>7}{:>8}{:>10.1}{:>16.1}{allocations:>24}",
            process.stage,
            process.pid,
            process.restarts,
            process.cpu_pct,
            process.rss_peak_kib as f64 / 1024.0
        )?;
    }
    Ok(())
}

/// What the machine did to the chain: one line, and one for each setting that was refused.
fn write_machine(text: &mut String, report: &Report) -> std::fmt::Result {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
    let (load, noise) = (&report.machine_load, &report.noise_ms);
    writeln!(
        text,
        "\nmachine     own {} %, other programs {} %, stolen {} % of a core; wakes late p50 {} p99.9 {} max {} ms",
        number(load.own_cpu_pct),
        number(load.foreign_cpu_pct),
        number(load.steal_pct),
        number(noise.p50),
        number(noise.p999),
        number(noise.max)
    )?;
    for line in &report.realtime_refused {
        writeln!(text, "  {line}")?;
    }
    Ok(())
}

fn serde_word(pace: &runtime::Pace) -> &'static str {
    match pace {
        runtime::Pace::Realtime => "real-time",
        runtime::Pace::Fast => "fast",
    }
}
