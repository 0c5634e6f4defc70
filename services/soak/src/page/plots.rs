//! How it went over time.

use super::plot::{Line, Plot};
use crate::verdict::Verdict;

/// Colours that people with any eyes tell apart (Okabe and Ito).
const COLOURS: [&str; 8] = ["#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#8A8A8A", "#B8A800"];

pub(super) fn section(verdict: &Verdict) -> String {
    if !verdict.cycles.is_empty() {
        return starts(verdict);
    }
    let timeline = &verdict.timeline;
    if timeline.windows.len() < 2 && timeline.sample_t_s.len() < 2 {
        return String::new();
    }
    let marks: Vec<f64> = verdict.faults.iter().map(|fault| fault.t_s).collect();
    let plots = [
        latency(verdict, &marks),
        misses(verdict, &marks),
        memory(verdict, &marks),
        files(verdict, &marks),
        shared(verdict, &marks),
        restarts(verdict, &marks),
    ];
    let faults = if marks.is_empty() { "" } else { "<p class=\"faint\">Orange lines: faults.</p>" };
    format!("<h2>Over time</h2>{faults}<div class=\"plots\">{}</div>", plots.concat())
}

fn plot<'a>(verdict: &Verdict, says: &'a str, lines: Vec<Line>, marks: &'a [f64]) -> Plot<'a> {
    Plot { says, length_s: verdict.duration_s, lines, level: None, marks, from_zero: true }
}

fn line(name: &str, place: usize, points: Vec<(f64, f64)>) -> Line {
    Line { name: name.to_owned(), colour: COLOURS[place % COLOURS.len()], points }
}

/// Values of the windows at their middles, where there are any.
fn windows(verdict: &Verdict, of: impl Fn(&crate::WindowReport) -> Option<f64>) -> Vec<(f64, f64)> {
    let middle = verdict.timeline.window_s / 2.0;
    let windows = verdict.timeline.windows.iter();
    windows.filter_map(|window| Some(((window.t_s + middle).min(verdict.duration_s), of(window)?))).collect()
}

fn latency(verdict: &Verdict, marks: &[f64]) -> String {
    let lines = vec![
        line("longest", 6, windows(verdict, |window| window.max_ms)),
        line("p99", 1, windows(verdict, |window| window.p99_ms)),
        line("median", 0, windows(verdict, |window| window.p50_ms)),
    ];
    let width = super::span(verdict.timeline.window_s);
    plot(verdict, "latency [ms]", lines, marks)
        .figure(&format!("Last return of a sweep → last detection, by windows of {width}."))
}

fn misses(verdict: &Verdict, marks: &[f64]) -> String {
    let lines = vec![line("misses", 5, windows(verdict, |window| Some(window.misses as f64)))];
    plot(verdict, "sweeps missed", lines, marks).figure("Sweeps late, broken or not answered, by window.")
}

fn restarts(verdict: &Verdict, marks: &[f64]) -> String {
    let mut sum = 0.0;
    let mut lines = vec![line("restarts", 3, Vec::new())];
    for (t_s, restarts) in windows(verdict, |window| Some(window.restarts as f64)) {
        sum += restarts;
        lines[0].points.push((t_s, sum));
    }
    plot(verdict, "restarts", lines, marks).figure("Processes started in place of others, since the begin.")
}

fn by_process<'a, T: 'a>(
    verdict: &'a Verdict,
    of: impl Fn(&'a str) -> Option<&'a Vec<T>>,
    value: impl Fn(&T) -> Option<f64>,
) -> Vec<Line> {
    let lines = verdict.processes.iter().enumerate().filter_map(|(place, process)| {
        let values = of(&process.process)?;
        let points = verdict.timeline.sample_t_s.iter().zip(values);
        let points = points.filter_map(|(t_s, one)| Some((*t_s, value(one)?))).collect();
        Some(line(&process.process, place, points))
    });
    lines.collect()
}

fn memory(verdict: &Verdict, marks: &[f64]) -> String {
    let lines = by_process(verdict, |name| verdict.timeline.rss_kib.get(name), |kib| kib.map(|kib| kib / 1024.0));
    plot(verdict, "resident memory [MiB]", lines, marks).figure("Memory of each process.")
}

fn files(verdict: &Verdict, marks: &[f64]) -> String {
    let some = |files: &u64| (*files > 0).then_some(*files as f64);
    let lines = by_process(verdict, |name| verdict.timeline.files.get(name), some);
    plot(verdict, "file descriptors", lines, marks).figure("File descriptors of each process, the most at any look.")
}

fn shared(verdict: &Verdict, marks: &[f64]) -> String {
    let timeline = &verdict.timeline;
    let points = timeline.sample_t_s.iter().zip(&timeline.shared_kib);
    let points = points.map(|(t_s, kib)| (*t_s, *kib as f64 / 1024.0)).collect();
    let lines = vec![line("shared memory", 2, points)];
    plot(verdict, "shared memory [MiB]", lines, marks).figure("Memory that the chain's objects in /dev/shm take.")
}

/// Starts instead of time.
fn starts(verdict: &Verdict) -> String {
    let times = |of: fn(&crate::Cycle) -> Option<f64>| -> Vec<(f64, f64)> {
        let all = verdict.cycles.iter().enumerate();
        all.filter_map(|(number, cycle)| Some((number as f64 + 1.0, of(cycle)?))).collect()
    };
    let lines = vec![
        line("until all stages are up", 0, times(|of| of.ready_ms)),
        line("until all are gone", 1, times(|of| of.stop_ms)),
    ];
    let bound = verdict.bars.iter().find(|bar| bar.unit == "ms").map(|bar| bar.bound);
    let most = lines.iter().flat_map(|line| &line.points).map(|point| point.1).fold(0.0, f64::max);
    let plot = Plot {
        says: "time [ms]",
        // The axis counts starts.
        length_s: (verdict.cycles.len() as f64).min(179.0),
        lines: lines.into_iter().map(|line| scaled(line, verdict.cycles.len())).collect(),
        level: bound.filter(|bound| *bound < 4.0 * most),
        marks: &[],
        from_zero: true,
    };
    format!(
        "<h2>Start by start</h2><div class=\"plots\">{}</div>",
        plot.figure("Over the starts, from the first to the last.")
    )
}

/// Numbers of starts laid over the length of the axis.
fn scaled(mut line: Line, count: usize) -> Line {
    let factor = (count as f64).min(179.0) / (count as f64).max(1.0);
    line.points.iter_mut().for_each(|point| point.0 *= factor);
    line
}
