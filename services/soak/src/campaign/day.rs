//! The day in the life: one chain, from its start to the replay of its own recording, with a verdict on each step.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use chain::{Mode, SUPERVISOR};
use runtime::page::{PageView, State};
use runtime::{Plan, clock};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::DayFile;
use super::conduct::said;
use super::file::StepFile;
use crate::matrix::{Baseline, Open, Row};
use crate::run::encke;
use crate::session::Session;
use crate::soak::{Interrupted, Settings};
use crate::verdict::Verdict;
use crate::{Injection, SoakError};

/// How long a fault is watched, at least [s].
const FAULT_S: f64 = 3.0;
/// How long a command may take to take effect [ns].
const EFFECT_NS: u64 = 2_000_000_000;
/// Share of the comparable sweeps that must be in the replay: what the tape lost is counted in its own report.
const LEAST_COMPARED: f64 = 0.9;

/// One step, and what came of it.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Step {
    /// What it was.
    pub name: String,
    /// When [s].
    pub t_s: f64,
    /// How long it took until it was in effect [ms]; null where that is not measured.
    pub took_ms: Option<f64>,
    /// Whether it came out as it should.
    pub passed: bool,
    /// More, or what did not.
    pub note: String,
}

/// What came of a step: how long it took, and what there is to say; or what failed.
type Outcome = Result<(Option<f64>, String), String>;

/// Files of the day in the soak's folder.
fn recording(out: &Path) -> PathBuf {
    out.join("day.mcap")
}

fn detections(out: &Path) -> PathBuf {
    out.join("day.jsonl")
}

/// Runs the steps of a running chain, up to the one that ends it.
pub(crate) fn day<'a>(
    file: &DayFile,
    settings: &'a Settings,
    interrupted: Interrupted,
) -> Result<(Session<'a>, Vec<Step>, Vec<Row>), SoakError> {
    let out = &settings.setup.out;
    let mut more = settings.more.clone();
    more.extend([OsString::from("--record"), recording(out).into(), "--detections".into(), detections(out).into()]);
    let nominal_s: f64 = file.step.iter().filter_map(|step| step.nominal_s).sum();
    let mut session = Session::begin(&settings.setup, more, nominal_s + 3.0 * file.step.len() as f64, interrupted)?;
    let (mut steps, mut rows) = (Vec::new(), Vec::new());
    for step in file.step.iter().take_while(|step| !step.shutdown) {
        if !session.goes_on() {
            break;
        }
        let t_s = session.observer.t_s(clock::now_ns());
        let outcome = take(step, settings, &mut session, &mut rows)?;
        steps.push(told(step, t_s, outcome));
    }
    Ok((session, steps, rows))
}

fn told(step: &StepFile, t_s: f64, outcome: Outcome) -> Step {
    let (took_ms, passed, note) = match outcome {
        Ok((took_ms, note)) => (took_ms, true, note),
        Err(why) => (None, false, why),
    };
    Step { name: step.name.clone(), t_s, took_ms, passed, note }
}

fn take(
    step: &StepFile,
    settings: &Settings,
    session: &mut Session<'_>,
    rows: &mut Vec<Row>,
) -> Result<Outcome, SoakError> {
    if let Some(seconds) = step.nominal_s {
        return nominal(seconds, session);
    }
    if let Some(words) = &step.ctl {
        return command(words, settings, session);
    }
    if let Some(words) = &step.refused {
        let words = words.iter().map(String::as_str).chain(["--instance", settings.setup.instance.name()]);
        let (accepted, said) = ask(words, session)?;
        return Ok(if accepted { Err("it was carried out".to_owned()) } else { Ok((None, said)) });
    }
    if let Some(words) = &step.inject {
        let row = inject(words, settings, session)?;
        let most_ms = settings.bars.kills.output_again_ms;
        let outcome = match (&row.refused, row.output_again_ms) {
            (Some(refused), _) => Err(refused.clone()),
            (None, None) => Err("no output since".to_owned()),
            (None, Some(ms)) if ms > most_ms => Err(format!("output again after {ms:.0} ms, must be {most_ms:.0}")),
            (None, Some(_)) if !row.invariants.broken().is_empty() => Err(row.invariants.broken().join(", ")),
            (None, Some(ms)) => {
                let detected =
                    row.detected_ms.map_or("not detected".to_owned(), |ms| format!("detected after {ms:.0} ms"));
                Ok((Some(ms), format!("{detected}; {} parts lost", row.lost)))
            }
        };
        rows.push(row);
        return Ok(outcome);
    }
    let files = files(&settings.setup.out);
    let wanted = step.rotated.unwrap_or(0);
    Ok(if files.len() >= wanted {
        Ok((None, format!("{} files", files.len())))
    } else {
        Err(format!("{} files, must be {wanted} at least", files.len()))
    })
}

/// Some seconds in which every sweep is answered whole.
fn nominal(seconds: f64, session: &mut Session<'_>) -> Result<Outcome, SoakError> {
    let before = session.observer.availability.overall;
    let end_ns = clock::now_ns() + (seconds * 1e9) as u64;
    while session.goes_on() && clock::now_ns() < end_ns {
        session.turn(false)?;
    }
    let after = session.observer.availability.overall;
    let (broken, missing) = (after.broken - before.broken, after.missing - before.missing);
    let says = format!("{} sweeps, {} late", after.due - before.due, after.late - before.late);
    Ok(if broken + missing > 0 || after.due == before.due {
        Err(format!("{says}, {broken} broken, {missing} not answered"))
    } else {
        Ok((None, says))
    })
}

/// Runs a command of this executable while the chain is looked at; whether it ended well, and what it said.
fn ask<'w>(words: impl Iterator<Item = &'w str>, session: &mut Session<'_>) -> Result<(bool, String), SoakError> {
    let mut command = encke(words);
    let spawned = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut child = spawned.map_err(SoakError::file(Path::new("encke")))?;
    loop {
        session.turn(false)?;
        match child.try_wait() {
            Ok(Some(status)) => return Ok((status.success(), said(&mut child))),
            Ok(None) if session.goes_on() => {}
            _ => {
                let _ = child.kill();
                let _ = child.wait();
                return Ok((false, "it did not end".to_owned()));
            }
        }
    }
}

/// A command of `encke ctl`, and what it leads to.
fn command(words: &[String], settings: &Settings, session: &mut Session<'_>) -> Result<Outcome, SoakError> {
    let instance = &settings.setup.instance;
    let generation = Plan::read(instance).map_or(0, |plan| plan.generation);
    let lives: Vec<(String, u64)> =
        session.observer.pages.all().map(|(stage, counts)| (stage.to_owned(), counts.incarnation)).collect();
    let asked_ns = clock::now_ns();
    let all = ["ctl"].into_iter().chain(words.iter().map(String::as_str)).chain(["--instance", instance.name()]);
    let (accepted, said) = ask(all, session)?;
    if !accepted {
        return Ok(Err(said));
    }
    let word = words.first().map_or("", String::as_str);
    if !["pause", "resume", "safe", "degrade", "reload", "restart"].contains(&word) {
        return Ok(Ok((None, String::new())));
    }
    let page = PageView::open(&Plan::page_path(instance, SUPERVISOR)).map_err(SoakError::chain)?;
    while session.goes_on() && clock::now_ns() < asked_ns + EFFECT_NS {
        session.turn(false)?;
        let mode = Mode::from_number(page.counts().mode);
        let pages = &session.observer.pages;
        let parameters = &session.observer.plan.parameters;
        let mut tables = pages.all().filter(|(stage, _)| parameters.contains_key(*stage));
        let done = match word {
            "pause" => mode == Mode::Paused,
            "safe" => mode == Mode::Safe,
            "degrade" => mode == Mode::Degraded,
            // The ladder of overload may leave something out by itself.
            "resume" => mode != Mode::Paused && mode != Mode::Safe,
            "reload" => tables.all(|(_, counts)| counts.table_active > generation),
            _ => pages.all().filter(|(stage, _)| words.iter().any(|word| word == stage)).all(|(stage, counts)| {
                counts.state == State::Running
                    && lives.iter().all(|(of, life)| of != stage || counts.incarnation > *life)
            }),
        };
        if done {
            let took_ms = (clock::now_ns() - asked_ns) as f64 / 1e6;
            return Ok(Ok((Some(took_ms), String::new())));
        }
    }
    Ok(Err(format!("not in effect after {} s", EFFECT_NS / 1_000_000_000)))
}

/// A fault, watched for a while.
fn inject(words: &[String], settings: &Settings, session: &mut Session<'_>) -> Result<Row, SoakError> {
    let stage = words.get(1).filter(|word| !word.starts_with('-')).cloned();
    let injection = Injection {
        at_s: session.observer.t_s(clock::now_ns()),
        fault: words.first().cloned().unwrap_or_default(),
        stage,
        words: words.to_vec(),
        lasts_s: 0.0,
        again_ms: None,
    };
    let all = ["inject"].into_iter().chain(words.iter().map(String::as_str));
    let all = all.chain(["--instance", settings.setup.instance.name()]);
    let now_ns = clock::now_ns();
    let may_be_dead = injection.ends_supervisor();
    let spawned = encke(all).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let child = spawned.map_err(SoakError::file(Path::new("encke")))?;
    let settle_ns = (settings.bars.settle_s * 1e9) as u64;
    session.observer.marks.after_injections.add(now_ns, now_ns + settle_ns);
    session.observer.marks.faults.add(now_ns, now_ns + settle_ns);
    let mut open =
        Open::new(injection, Some(child), now_ns, Some(now_ns), &Baseline::of(&session.observer), &session.observer);
    let mut until_ns = now_ns + (FAULT_S * 1e9) as u64;
    while session.goes_on() && clock::now_ns() < until_ns {
        let (looked, now_ns) = session.turn(may_be_dead)?;
        open.note(&looked.answers, &looked.events, &session.observer, now_ns);
        if let Some(mut child) = open.child.take() {
            match child.try_wait() {
                Ok(Some(status)) if !status.success() => open.refused = Some(said(&mut child)),
                Ok(Some(_)) => {}
                // It lasts: the time counts from its end.
                _ => {
                    until_ns = now_ns + (FAULT_S * 1e9) as u64;
                    open.child = Some(child);
                }
            }
        }
    }
    Ok(open.close(&session.observer, clock::now_ns()))
}

/// The files of the day's recording.
fn files(out: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(out).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_one = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        name.starts_with("day") && name.ends_with(".mcap")
    };
    entries.filter(is_one).collect()
}

/// The steps after the end of the chain, whose verdict is known.
pub(crate) fn afterwards(file: &DayFile, settings: &Settings, verdict: &Verdict) -> Result<Vec<Step>, SoakError> {
    let mut steps = Vec::new();
    for step in file.step.iter().skip_while(|step| !step.shutdown) {
        let outcome = if step.replay {
            replay(settings)
        } else if step.shutdown {
            let failed: Vec<_> = verdict.bars.iter().filter(|bar| bar.passed == Some(false)).collect();
            let names = failed.iter().map(|bar| bar.name.clone()).collect::<Vec<_>>().join(", ");
            if failed.is_empty() { Ok((None, "ledger closed, nothing left behind".to_owned())) } else { Err(names) }
        } else {
            Err("comes after the chain's end".to_owned())
        };
        steps.push(told(step, verdict.duration_s, outcome));
    }
    Ok(steps)
}

/// Replays the recording and compares.
fn replay(settings: &Settings) -> Outcome {
    let out = &settings.setup.out;
    let again = out.join("replay.jsonl");
    let from = out.join("day*.mcap");
    let words = ["run", "--pace", "fast", "--instance", settings.setup.instance.name()].map(OsString::from);
    let mut command = encke(words);
    command.arg("--from").arg(&from).arg("--detections").arg(&again);
    let log = File::create(out.join("replay.log")).map_err(|cause| cause.to_string())?;
    let began_ns = clock::now_ns();
    let status = command.stdout(Stdio::null()).stderr(log).status().map_err(|cause| cause.to_string())?;
    if !status.success() {
        return Err(format!("{status}: replay.log says why"));
    }
    let (live, again) = (lines(&detections(out))?, lines(&again)?);
    let (mut compared, mut other, mut comparable) = (0_u64, 0_u64, 0_u64);
    for (sensor_time_ns, line) in &live {
        let Some(line) = line else { continue };
        comparable += 1;
        if let Some(Some(replayed)) = again.get(sensor_time_ns) {
            compared += 1;
            other += u64::from(replayed != line);
        }
    }
    let says = format!("{compared} of {comparable} whole sweeps compared, {other} differ");
    if other > 0 || compared == 0 || (compared as f64) < LEAST_COMPARED * comparable as f64 {
        return Err(says);
    }
    Ok((Some((clock::now_ns() - began_ns) as f64 / 1e6), says))
}

/// The lines of a file of detections by sensor time, without the number of the sweep; none for those that are not whole, were not
/// processed in full, or share their time with another.
fn lines(path: &Path) -> Result<BTreeMap<u64, Option<String>>, String> {
    let file = File::open(path).map_err(|cause| format!("{}: {cause}", path.display()))?;
    let mut lines = BTreeMap::new();
    for line in BufReader::new(file).lines() {
        let line = line.map_err(|cause| format!("{}: {cause}", path.display()))?;
        let value: Value = serde_json::from_str(&line).map_err(|cause| format!("{}: {cause}", path.display()))?;
        let Some(sensor_time_ns) = value["sensor_time_ns"].as_u64() else { continue };
        let whole = value["complete"] == true
            && ["step", "missing_sectors", "rejected_sectors"].iter().all(|key| value.get(key).is_none());
        // `{"sweep":N,` and what follows; a recording numbers its sweeps anew.
        let rest = line.split_once(',').map(|(_, rest)| rest.to_owned()).filter(|_| whole);
        lines.entry(sensor_time_ns).and_modify(|known| *known = None).or_insert(rest);
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_sweeps_of_full_work_and_of_a_time_of_their_own_are_compared() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("d.jsonl");
        let text = "{\"sweep\":0,\"complete\":true,\"sensor_time_ns\":10,\"detections\":[]}\n\
                    {\"sweep\":1,\"complete\":false,\"sensor_time_ns\":20,\"detections\":[]}\n\
                    {\"sweep\":2,\"complete\":true,\"step\":\"fewer-starts\",\"sensor_time_ns\":30,\"detections\":[]}\n\
                    {\"sweep\":3,\"complete\":true,\"sensor_time_ns\":40,\"detections\":[]}\n\
                    {\"sweep\":4,\"complete\":true,\"sensor_time_ns\":40,\"detections\":[]}\n";
        fs::write(&path, text).unwrap();
        let lines = lines(&path).unwrap();
        assert_eq!(lines[&10].as_deref(), Some("\"complete\":true,\"sensor_time_ns\":10,\"detections\":[]}"));
        assert!([20, 30, 40].iter().all(|time| lines[time].is_none()));
    }
}
