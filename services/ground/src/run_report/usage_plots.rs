//! Processes and machine over time.

use super::figures::{Process, ProcessTimeline, RunFigures, Timeline};
use super::parts::{BLUE, GREY, HALF, ORANGE, RED, Times, WIDE, absent, colour, key, maybe_ms, pieces, steps};
use super::plot::{Axis, Plot, Series, Shape, plain};
use crate::page::figure;

pub(crate) fn section(figures: &RunFigures) -> String {
    let heading = "<h2>Processor and memory</h2>".to_owned();
    let Some(timeline) = figures.timeline.as_ref().filter(|timeline| !timeline.processes.is_empty()) else {
        return heading
            + &absent(match figures.read_from {
                Some(_) => "A recording does not say what the processes used.",
                None => "This report is of an older version: it has no timeline of the processes.",
            });
    };
    if timeline.sample_t_s.len() < 2 {
        return heading + &absent("The run was over before the processes had been looked at twice.");
    }
    let named = named(figures, timeline);
    heading
        + &cpu(figures, timeline, &named)
        + "<div class=\"side\">"
        + &memory(figures, timeline, &named)
        + &machine(figures, timeline)
        + "</div>"
}

/// The processes in the order of the chain, with a colour each.
fn named<'a>(figures: &'a RunFigures, timeline: &'a Timeline) -> Vec<(&'a str, &'static str, &'a ProcessTimeline)> {
    let order = figures.processes.iter().flatten().map(|process: &Process| process.stage.as_str());
    let mut names: Vec<&str> = order.filter(|name| timeline.processes.contains_key(*name)).collect();
    let others = timeline.processes.keys().map(String::as_str).filter(|name| !names.contains(name));
    names.extend(others.collect::<Vec<_>>());
    let line = |(place, name)| Some((name, colour(place), timeline.processes.get(name)?));
    names.into_iter().enumerate().filter_map(line).collect()
}

/// Cores of the machine, where its name says so.
fn cores(figures: &RunFigures) -> Option<f64> {
    let (number, rest) = figures.machine.split_once(' ')?;
    rest.starts_with("core").then(|| number.parse().ok()).flatten().filter(|cores| (1.0..=4096.0).contains(cores))
}

fn cpu(figures: &RunFigures, timeline: &Timeline, named: &[(&str, &'static str, &ProcessTimeline)]) -> String {
    let times = Times::of(figures);
    let begins: Vec<f64> = timeline.sample_t_s.iter().map(|t_s| times.at(*t_s)).collect();
    let width = times.at(timeline.sample_s);
    let mut below = vec![0.0; begins.len()];
    let mut series = Vec::new();
    for (_, colour, process) in named {
        let above: Vec<f64> = (below.iter().enumerate())
            .map(|(place, below)| below + process.cpu_pct.get(place).copied().unwrap_or(0.0).max(0.0))
            .collect();
        series.extend(steps(&begins, width, &above, &below, colour));
        below = above;
    }
    let cores = cores(figures);
    let most = below.iter().copied().chain(cores.map(|cores| 100.0 * cores)).fold(0.0, f64::max);
    let words = |cores: f64| if cores == 1.0 { "the one core".to_owned() } else { format!("all {cores} cores") };
    let plot = Plot {
        size: WIDE,
        x: times.axis(),
        y: Axis::from_zero("CPU [% of a core]", most),
        series,
        levels: cores.map(|cores| (words(cores), GREY, 100.0 * cores)).into_iter().collect(),
        moments: times.moments(&timeline.events),
    };
    let entries: Vec<_> = named.iter().map(|(name, colour, _)| (*colour, *name)).collect();
    let caption = "Processor time of each process, one above the other.";
    key(&entries, &[]) + &figure(&plot.svg(), caption)
}

fn memory(figures: &RunFigures, timeline: &Timeline, named: &[(&str, &'static str, &ProcessTimeline)]) -> String {
    let times = Times::of(figures);
    let mib = |process: &ProcessTimeline| -> Vec<(f64, f64)> {
        let at = timeline.sample_t_s.iter().map(|t_s| times.at(t_s + timeline.sample_s / 2.0));
        at.zip(&process.rss_kib).filter(|(_, kib)| **kib > 0).map(|(at, kib)| (at, *kib as f64 / 1024.0)).collect()
    };
    let series: Vec<Series> = named
        .iter()
        .map(|(_, colour, process)| Series { colour, shape: Shape::Line(2), points: mib(process) })
        .collect();
    let most = series.iter().flat_map(|series| &series.points).map(|point| point.1).fold(0.0, f64::max);
    let plot = Plot {
        size: HALF,
        x: times.axis(),
        y: Axis::from_zero("resident memory [MiB]", most),
        series,
        levels: Vec::new(),
        moments: Vec::new(),
    };
    let entries: Vec<_> = named.iter().map(|(name, colour, _)| (*colour, *name)).collect();
    format!("<div>{}{}</div>", key(&entries, &[]), figure(&plot.svg(), "Memory of each process."))
}

fn machine(figures: &RunFigures, timeline: &Timeline) -> String {
    let times = Times::of(figures);
    let machine = &timeline.machine;
    let of = |values: &[Option<f64>]| -> Vec<(f64, f64)> {
        let at = timeline.sample_t_s.iter().map(|t_s| times.at(t_s + timeline.sample_s / 2.0));
        at.zip(values).filter_map(|(at, value)| Some((at, (*value)?))).collect()
    };
    let lines = [
        ("this chain", BLUE, of(&machine.own_cpu_pct)),
        ("other programs", ORANGE, of(&machine.foreign_cpu_pct)),
        ("stolen by the hypervisor", RED, of(&machine.steal_pct)),
    ];
    let lines: Vec<_> = lines.into_iter().filter(|line| line.2.len() > 1).collect();
    if lines.is_empty() {
        return absent("The machine’s load was not measured.");
    }
    let most = lines.iter().flat_map(|line| &line.2).map(|point| point.1);
    let cores = cores(figures).map(|cores| 100.0 * cores);
    let most = most.chain(cores).fold(0.0, f64::max);
    let mut series = Vec::new();
    for (_, colour, points) in &lines {
        series.extend(pieces(points.clone()).into_iter().map(|points| Series {
            colour,
            shape: Shape::Line(2),
            points,
        }));
    }
    let plot = Plot {
        size: HALF,
        x: times.axis(),
        y: Axis::from_zero("CPU [% of a core]", most),
        series,
        levels: Vec::new(),
        moments: Vec::new(),
    };
    let entries: Vec<_> = lines.iter().map(|(name, colour, _)| (*colour, *name)).collect();
    let latest = machine
        .wake_late_max_ms
        .iter()
        .copied()
        .fold(None, |most: Option<f64>, ms| Some(most.map_or(ms, |most| most.max(ms))));
    let noise = figures.noise_ms.filter(|noise| noise.count > 0).map_or(String::new(), |noise| {
        format!(
            " A thread that waits for the time woke {} ms late at the median, {} ms at p99.9, {} ms at most.",
            maybe_ms(noise.p50),
            maybe_ms(noise.p999),
            maybe_ms(noise.max.or(latest))
        )
    });
    let all = cores.map_or(String::new(), |cores| format!(" All cores are {} %.", plain(cores)));
    let caption = format!("Who had the cores.{all}{noise}");
    format!("<div>{}{}</div>", key(&entries, &[]), figure(&plot.svg(), &caption))
}
