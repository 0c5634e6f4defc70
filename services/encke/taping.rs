//! The tape as a process of the chain: what it reads along, and what it says of the chain beside that.

use std::path::PathBuf;

use events::{Reader, Severity};
use messages::{Clusters, Descriptors, Sweep, Trace, Tracks, Truth};
use runtime::{Pace, Plan, Shell};
use stage::{SinkError, Tap};
use tape::{About, Counts, Event, Level, Tape, TapeFile, Topic};
use transport::Instance;

use crate::Failure;
use crate::assets::Assets;

/// A tape with its place in an instance.
pub(crate) struct Taping {
    tape: Tape,
    /// Whether clusters and descriptors are kept as they pass between the stages.
    wants_between: (bool, bool),
    instance: Instance,
    counts_path: PathBuf,
    /// The log of the run.
    events: Reader,
    /// Write errors, and the last of them.
    failures: (u64, Option<String>),
}

/// The tape's settings, as `tape.toml` has them.
pub(crate) fn settings(assets: &Assets) -> Result<tape::Settings, Failure> {
    file(assets)?.checked().map_err(|cause| named(&cause))
}

/// Settings for simulated sweeps without a chain, in one file.
pub(crate) fn settings_for_sweeps(assets: &Assets) -> Result<tape::Settings, Failure> {
    let topics = vec![Topic::Sweep, Topic::RawSweep, Topic::Truth];
    let file = TapeFile { topics, rotate_mib: 0, rotate_s: 0.0, quota_mib: 0, ..file(assets)? };
    file.checked().map_err(|cause| named(&cause))
}

fn file(assets: &Assets) -> Result<TapeFile, Failure> {
    let text = assets.text("tape.toml").map_err(Failure::start)?;
    toml::from_str(&text).map_err(|cause| named(&cause))
}

fn named(cause: &dyn std::fmt::Display) -> Failure {
    Failure::start(format!("tape.toml: {}", cause.to_string().trim_end()))
}

impl Taping {
    /// Begins the recording of the shell's plan, or its next file where an earlier life had begun it.
    pub(crate) fn start(shell: &Shell, assets: &Assets) -> Result<Self, Failure> {
        let plan = shell.plan();
        let Some(path) = &plan.outputs.record else {
            return Err(Failure::start("the run records nothing: give it --record"));
        };
        let about = About {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            source: plan.source.from.display().to_string(),
            sensor: plan.sensor.clone(),
            sectors: plan.chain.sectors,
            pace: if plan.pace == Pace::Fast { "fast" } else { "realtime" }.to_owned(),
            instance: shell.instance().name().to_owned(),
            deadline_ms: (plan.pace == Pace::Realtime).then_some(plan.chain.deadline_ms),
        };
        let resume = (shell.incarnation() > 1).then(|| shell.answered_sweeps());
        let utc_ns = runtime::clock::utc_ns();
        let settings = settings(assets)?;
        let wants_between = (settings.has(Topic::RawClusters), settings.has(Topic::RawDescriptors));
        let tape = Tape::start(settings, path, about, resume, utc_ns).map_err(Failure::start)?;
        Ok(Self {
            tape,
            wants_between,
            instance: shell.instance().clone(),
            counts_path: Plan::counts_path(shell.instance(), shell.incarnation()),
            events: Reader::new(&Plan::events_path(shell.instance()), recorded_events(shell)),
            failures: (0, None),
        })
    }

    /// Notes the chain's state, and what has happened since the last time.
    fn look_at_chain(&mut self, utc_ns: u64) {
        // The supervisor may be taking the instance down.
        if let Ok(now) = supervisor::status(&self.instance)
            && let Ok(json) = serde_json::to_vec(&now)
        {
            self.tape.status(utc_ns, &json);
        }
        let tape = &mut self.tape;
        self.events.read(|event| {
            let level = match event.severity {
                Severity::Info => Level::Info,
                Severity::Warning => Level::Warning,
                Severity::Error => Level::Error,
                Severity::Critical => Level::Fatal,
            };
            let (name, word, number) = (event.stage.as_str(), event.name.as_str(), event.number);
            tape.event(event.utc_ns, &Event { level, name, word, number, message: &event.text });
        });
    }

    fn save_counts(&self) {
        let json = serde_json::to_vec(&self.tape.counts()).unwrap_or_default();
        // As a whole or not at all: who comes after a death goes on behind what it says.
        let scratch = self.counts_path.with_extension("part");
        let written = std::fs::write(&scratch, json).and_then(|()| std::fs::rename(&scratch, &self.counts_path));
        // A full disk costs the count, not the chain.
        if let Err(error) = written {
            tracing::error!(%error, "what was recorded could not be counted");
        }
    }
}

/// Events that earlier lives have in their files: this one goes on with the next. Each is one message. What a life had written
/// and not counted when it died comes again, under the same number; none is left out.
fn recorded_events(shell: &Shell) -> u64 {
    let of_life = |life: u32| {
        let text = std::fs::read(Plan::counts_path(shell.instance(), life)).ok()?;
        let counts: Counts = serde_json::from_slice(&text).ok()?;
        let events = counts.of(Topic::Events)?;
        Some(events.messages + events.removed)
    };
    (1..shell.incarnation()).filter_map(of_life).sum()
}

impl Tap for Taping {
    fn sweep(&mut self, trace: &Trace, part: &Sweep, utc_ns: u64) {
        self.tape.sweep(utc_ns, trace, part);
    }

    fn tracks(&mut self, trace: &Trace, part: &Tracks, utc_ns: u64) {
        self.tape.detections(utc_ns, trace, &part.detections);
        self.tape.tracks(utc_ns, trace, &part.table);
    }

    fn wants_between(&self) -> (bool, bool) {
        self.wants_between
    }

    fn clusters(&mut self, trace: &Trace, part: &Clusters, utc_ns: u64) {
        self.tape.clusters(utc_ns, trace, part);
    }

    fn descriptors(&mut self, trace: &Trace, part: &Descriptors, utc_ns: u64) {
        self.tape.descriptors(utc_ns, trace, part);
    }

    fn truth(&mut self, trace: &Trace, truth: &Truth, utc_ns: u64) {
        self.tape.truth(utc_ns, trace, truth);
    }

    fn files(&mut self) -> (u64, u64) {
        let Counts { files, failure, .. } = self.tape.counts();
        let (failures, last) = &mut self.failures;
        if failure.is_some() && failure != *last {
            *failures += 1;
            *last = failure;
        }
        (files, *failures)
    }

    fn tick(&mut self, utc_ns: u64) {
        self.look_at_chain(utc_ns);
    }

    fn checkpoint(&mut self, utc_ns: u64) {
        self.tape.checkpoint(utc_ns);
        self.save_counts();
    }

    fn done_sweeps(&mut self) -> u64 {
        self.tape.done_sweeps()
    }

    fn finish(&mut self, utc_ns: u64) -> Result<(), SinkError> {
        self.look_at_chain(utc_ns);
        let finished = self.tape.finish(utc_ns);
        self.save_counts();
        finished.map_err(|cause| SinkError(cause.to_string()))
    }
}
