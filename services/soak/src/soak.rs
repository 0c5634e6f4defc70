use std::fs;
use std::sync::Arc;

use runtime::clock;
use supervisor::Report;

use crate::bars::Bars;
use crate::campaign::{self, Campaign, Conductor, Cycle, ModeChanges, Step};
use crate::judge::Facts;
use crate::look::{Observer, SETTLE_S};
use crate::matrix::{Matrix, Row};
use crate::run::{Setup, leftovers};
use crate::session::{Session, interrupts};
use crate::statistics::Drift;
use crate::verdict::{Available, Bar, Grave, ObserverCost, SharedMemoryRecord, Timeline, Verdict};
use crate::{Injection, SoakError};

/// After the last fault of a campaign [s].
const QUIET_S: f64 = 5.0;

/// A soak to be run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// What to run, and where.
    pub setup: Setup,
    /// For how long, from the first sweep on [s]; none where the campaign has a length of its own.
    pub length_s: Option<f64>,
    /// What is done to it.
    pub campaign: Campaign,
    /// What it must show.
    pub bars: Bars,
    /// Of all that is random.
    pub seed: u64,
    /// Where sweeps come from, for people.
    pub source: String,
    /// It is recorded, too: further options of `encke run`.
    pub more: Vec<std::ffi::OsString>,
}

/// Runs the chain, does to it what is to be done, looks at everything, and says what that has shown.
///
/// # Errors
/// The chain does not come up, or a file of the soak cannot be written. What the chain does after that is in the verdict.
pub fn soak(settings: &Settings) -> Result<Verdict, SoakError> {
    fs::create_dir_all(&settings.setup.out).map_err(SoakError::file(&settings.setup.out))?;
    let base = Verdict {
        encke: env!("CARGO_PKG_VERSION").to_owned(),
        kind: settings.campaign.kind().to_owned(),
        source: settings.source.clone(),
        began_utc_s: clock::utc_ns() / 1_000_000_000,
        seed: settings.seed,
        ..Verdict::default()
    };
    let began_ns = clock::now_ns();
    let verdict = match &settings.campaign {
        Campaign::Cycles(file) => {
            let cycles = campaign::cycles(file, &settings.setup, settings.seed, &*interrupts()?, say)?;
            starts(base, settings.bars.cycles, file.times, cycles, clock::now_ns() - began_ns)
        }
        Campaign::KillAll(file) => {
            let cycles = campaign::kill_all(file, &settings.setup, settings.seed, &*interrupts()?, say)?;
            starts(base, settings.bars.kill_all, file.times, cycles, clock::now_ns() - began_ns)
        }
        Campaign::Nothing | Campaign::Faults(_) | Campaign::Kills(_) => watch(base, settings)?,
        Campaign::ModeChanges(file) => {
            let length_s = file.times as f64 * (file.pause_ms / 2e3 + 0.1);
            let mut session = Session::begin(&settings.setup, settings.more.clone(), length_s, interrupts()?)?;
            let instance = &settings.setup.instance;
            let mut changes = ModeChanges::new(file.clone(), instance, settings.seed, clock::now_ns())?;
            while session.goes_on() && !changes.is_done() {
                let (_, now_ns) = session.turn(false)?;
                changes.turn(session.observer.t_s(now_ns), now_ns);
            }
            let late = changes.took_too_long();
            let steps = std::mem::take(&mut changes.steps);
            let ended = Ended { steps, ..Ended::default() };
            finish(base, settings, session, ended, |facts, ended| modes(facts, ended, file.times, late))
        }
        Campaign::Day(file) => {
            let (session, steps, rows) = campaign::day(file, settings, interrupts()?)?;
            let ended = Ended { steps, rows, ..Ended::default() };
            let mut verdict = finish(base, settings, session, ended, |facts, _| facts.common());
            // What comes after the end of the chain.
            verdict.steps.extend(campaign::afterwards(file, settings, &verdict)?);
            let failed = verdict.steps.iter().filter(|step| !step.passed).count();
            let most = settings.bars.day.failures;
            verdict.bars.push(Bar::at_most("steps of the day that failed", Some(failed as f64), most as f64, ""));
            verdict.bars.push(Bar::none("steps of the day left out", file.step.len().abs_diff(verdict.steps.len())));
            verdict
        }
    };
    Ok(verdict.judge())
}

/// What was done to the chain, by the time it ends.
#[derive(Default)]
struct Ended {
    rows: Vec<Row>,
    planned: Vec<Injection>,
    steps: Vec<Step>,
    early: Option<String>,
}

fn watch(base: Verdict, settings: &Settings) -> Result<Verdict, SoakError> {
    let expected_s = settings.length_s.unwrap_or(match &settings.campaign {
        Campaign::Kills(file) => file.times as f64 * 5.0 * file.spacing_s,
        _ => 60.0,
    });
    let mut session = Session::begin(&settings.setup, settings.more.clone(), expected_s, interrupts()?)?;
    let list = match &settings.campaign {
        Campaign::Faults(campaign) => {
            let period_s = session.observer.availability.period_ns() as f64 / 1e9;
            let all = faults::schedule(campaign, settings.seed, expected_s);
            all.iter().map(|planned| Injection::of(planned, expected_s, period_s)).collect()
        }
        Campaign::Kills(file) => {
            let all = || session.observer.plan.stages().map(str::to_owned).collect();
            let stages: Vec<String> = file.stages.clone().unwrap_or_else(all);
            let period_s = session.observer.availability.period_ns() as f64 / 1e9;
            campaign::kills(file, &stages, settings.seed, period_s)
        }
        _ => Vec::new(),
    };
    let last_s = list.last().map_or(0.0, |last| last.at_s + last.lasts_s);
    let length_s = settings.length_s.unwrap_or(last_s + QUIET_S);
    let instance = settings.setup.instance.name();
    let mut conductor = Conductor::new(instance, list.clone(), settings.bars.settle_s);
    let mut now_ns = clock::now_ns();
    while session.goes_on() && session.observer.t_s(now_ns) < length_s {
        let looked;
        (looked, now_ns) = session.turn(conductor.supervisor_may_be_dead)?;
        conductor.turn(&looked, &mut session.observer, now_ns);
    }
    conductor.close(&session.observer, now_ns);
    let early = (session.observer.t_s(now_ns) < length_s).then(|| match session.ended {
        Some(status) => format!("the chain ended by itself: {status}"),
        None => "it was asked to".to_owned(),
    });
    let ended = Ended { rows: std::mem::take(&mut conductor.rows), planned: list, early, ..Ended::default() };
    let judge = |facts: &Facts<'_>, _: &Ended| match settings.campaign {
        Campaign::Faults(_) => facts.faults(),
        Campaign::Kills(_) => facts.kills(),
        _ => facts.no_faults(),
    };
    Ok(finish(base, settings, session, ended, judge))
}

/// Ends the chain and puts together what it has shown.
fn finish(
    base: Verdict,
    settings: &Settings,
    mut session: Session<'_>,
    ended: Ended,
    judge: impl Fn(&Facts<'_>, &Ended) -> Vec<Bar>,
) -> Verdict {
    let end_ns = clock::now_ns();
    let cpu_pct = session.observer.own_cpu_pct(end_ns);
    let status = session.stop();
    let reports = session.run.reports();
    let adoptions = session.run.adoptions();
    let mut observer = session.observer;
    let length_s = observer.t_s(end_ns);
    let settle_s = (length_s / 3.0).min(300.0);
    let records = std::mem::take(&mut observer.records);
    let processes: Vec<_> = records.into_iter().map(|record| record.report(settle_s)).collect();
    let shared = SharedMemoryRecord {
        objects: observer.shared_files.steady(settle_s),
        length_kib: observer.shared_length.steady(settle_s),
        touched_kib: observer.shared.growth(SETTLE_S),
    };
    let windows = || observer.windows.iter().map(|(begin_ns, window)| (begin_ns as f64 / 1e9, window));
    let drift = Drift::of(windows());
    let available = available(&observer);
    let foreign_pct = reports.last().and_then(foreign_pct);
    let left = leftovers(&settings.setup.instance);
    let (events, events_skipped) = observer.events();
    let facts = Facts {
        bars: &settings.bars,
        available: &available,
        drift: &drift,
        processes: &processes,
        shared: &shared,
        restarts: observer.restarts,
        rows: &ended.rows,
        reports: &reports,
        // A supervisor that died on purpose leaves no report.
        ends: 1,
        exit_code: status.and_then(|status| status.code()),
        leftovers: &left,
        fell: observer.pages.fell,
        over_budget: observer.over_budget,
        foreign_pct,
        events_skipped,
    };
    let bars = judge(&facts, &ended);
    let mut misses = std::collections::BTreeMap::new();
    for (cause, count) in reports.iter().flat_map(|report| &report.deadline.causes) {
        *misses.entry(cause.clone()).or_default() += count;
    }
    let grave = observer.grave.iter().map(|event| Grave {
        t_s: observer.t_s(event.time_ns),
        name: event.name.clone(),
        stage: event.stage.clone(),
        text: event.text.clone(),
    });
    Verdict {
        machine: reports.last().map_or(String::new(), |report| report.machine.clone()),
        duration_s: length_s,
        ended_early: ended.early,
        bars,
        availability: Some(available),
        drift: Some(drift),
        shared_memory: shared,
        restarts: observer.restarts,
        adoptions,
        events: events.clone(),
        events_skipped,
        grave: grave.collect(),
        misses,
        ledgers: reports.iter().map(|report| report.ledger.clone()).collect(),
        foreign_pct,
        matrix: Matrix::of(&ended.rows),
        observer: ObserverCost {
            cpu_pct: (cpu_pct * 1e3).round() / 1e3,
            looks: observer.looks,
            every_ms: (length_s * 1e6 / observer.looks.max(1) as f64).round() / 1e3,
        },
        timeline: timeline(&observer, &processes.iter().map(|of| of.process.clone()).collect::<Vec<_>>()),
        processes,
        faults: ended.rows,
        planned: ended.planned,
        steps: ended.steps,
        ..base
    }
}

fn available(observer: &Observer<'_>) -> Available {
    let of = &observer.availability;
    Available {
        overall: of.overall,
        overall_pct: of.overall.availability_pct(),
        after_injections: of.outside_first,
        after_injections_pct: of.outside_first.availability_pct(),
        outside_faults: of.outside_second,
        outside_faults_pct: of.outside_second.availability_pct(),
        longest_run: of.longest_run,
        stale: observer.stale,
    }
}

fn foreign_pct(report: &Report) -> Option<f64> {
    let load = &report.machine_load;
    Some(load.foreign_cpu_pct? + load.steal_pct.unwrap_or(0.0))
}

fn timeline(observer: &Observer<'_>, names: &[String]) -> Timeline {
    let windows = observer.windows.iter().map(|(begin_ns, window)| window.report(begin_ns as f64 / 1e9));
    let mut timeline = Timeline {
        windows: windows.collect(),
        window_s: observer.windows.width_ns() as f64 / 1e9,
        ..Timeline::default()
    };
    for (begin_ns, sampled) in observer.samples.iter().filter(|(_, sampled)| sampled.looks > 0) {
        timeline.sample_t_s.push(begin_ns as f64 / 1e9);
        timeline.shared_kib.push(sampled.shared_kib);
        for (place, name) in names.iter().enumerate() {
            let seen = sampled.seen[place];
            let mean = (seen > 0).then(|| (sampled.rss_kib[place] as f64 / seen as f64).round());
            timeline.rss_kib.entry(name.clone()).or_default().push(mean);
            timeline.files.entry(name.clone()).or_default().push(sampled.files[place]);
            timeline.threads.entry(name.clone()).or_default().push(sampled.threads[place]);
        }
    }
    timeline
}

fn modes(facts: &Facts<'_>, ended: &Ended, times: usize, late: u64) -> Vec<Bar> {
    let failed: Vec<_> = ended.steps.iter().filter(|step| !step.passed).collect();
    let note = failed.first().map_or(String::new(), |step| format!("the first: {}: {}", step.name, step.note));
    let mut all = facts.common();
    let bars = &facts.bars.mode_changes;
    all.push(
        Bar::at_most("changes that failed or stuck", Some(failed.len() as f64), bars.failures as f64, "").noting(note),
    );
    all.push(Bar::none("changes that took more than two sweeps", late as usize));
    all.push(Bar::none("changes not made", times.saturating_sub(ended.steps.len())));
    all
}

fn starts(base: Verdict, bars: crate::bars::StartBars, times: usize, cycles: Vec<Cycle>, took_ns: u64) -> Verdict {
    let failed: Vec<_> = cycles.iter().filter_map(|cycle| cycle.failed.as_deref()).collect();
    let slowest = cycles
        .iter()
        .filter_map(|cycle| cycle.ready_ms)
        .fold(None, |most: Option<f64>, ms| Some(most.map_or(ms, |most| most.max(ms))));
    let note = failed.first().map_or(String::new(), |why| format!("the first: {why}"));
    let bars = vec![
        Bar::at_most("starts that failed", Some(failed.len() as f64), bars.failures as f64, "").noting(note),
        Bar::at_most("longest until all stages are up", slowest, bars.ready_ms, "ms"),
        Bar::none("starts left out", times.saturating_sub(cycles.len())),
    ];
    Verdict { duration_s: took_ns as f64 / 1e9, bars, cycles, ..base }
}

/// A line on stderr for each hundredth cycle, and for each that failed.
fn say(number: usize, cycle: &Cycle) {
    if let Some(failed) = &cycle.failed {
        eprintln!("start {}: {failed}", number + 1);
    } else if (number + 1).is_multiple_of(100) {
        eprintln!("{} starts", number + 1);
    }
}

/// So that both campaigns and sessions share it.
pub(crate) type Interrupted = Arc<std::sync::atomic::AtomicBool>;
