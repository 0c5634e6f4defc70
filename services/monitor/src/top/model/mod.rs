//! Samples and parts in, a [`View`] out. Reads no clock and no file: the same input gives the same view.

mod detections;
mod sweeps;
#[cfg(test)]
mod tests;
mod tracks;

use std::collections::VecDeque;

use messages::{Step, Trace, Tracks};
use runtime::page::{Counts, State};

use super::view::{ProcessView, StageView, TapView, TracksView, View};
use crate::attached::Facts;
use crate::events::Events;
use crate::process::Usage;
use crate::sample::{Sample, StageSample};
use detections::Collector;
use sweeps::Sweeps;

/// Rates are taken over this time [ns]: the kernel counts CPU time in ticks of 10 ms.
const RATE_NS: u64 = 2_000_000_000;

/// What is known of a running chain.
pub(crate) struct Model {
    facts: Facts,
    sweeps: Sweeps,
    collector: Collector,
    tracks: TracksView,
    events: Events,
    /// Looks of the last [`RATE_NS`] and the one before, the latest last.
    marks: VecDeque<Mark>,
    uptime_s: Option<f64>,
    /// When the supervisor started, as far as it was seen, by the clock of host time [s].
    started_s: f64,
    notice: Option<String>,
}

/// A look, and what the tap had counted by then.
struct Mark {
    sample: Sample,
    busy_ns: Vec<u64>,
    parts: u64,
}

impl Model {
    pub(crate) fn new(facts: Facts) -> Self {
        Self {
            sweeps: Sweeps::new(&facts),
            facts,
            collector: Collector::default(),
            tracks: TracksView::default(),
            events: Events::default(),
            marks: VecDeque::new(),
            uptime_s: None,
            started_s: 0.0,
            notice: None,
        }
    }

    /// Goes on with another life of the same instance: counts start anew, what happened stays.
    pub(crate) fn renew(&mut self, facts: Facts) {
        let events = std::mem::take(&mut self.events);
        *self = Self { events, ..Self::new(facts) };
        self.events.add_renewal();
    }

    /// Adds a part that the tap saw.
    pub(crate) fn part(&mut self, trace: &Trace, message: &Tracks) {
        let whole = self.sweeps.add(trace);
        self.collector.add(&trace.part, &message.detections, whole);
        if let Some(tracks) = tracks::view(&trace.part, &message.table) {
            self.tracks = tracks;
        }
    }

    /// Adds a look. Looks come in order of time.
    pub(crate) fn sample(&mut self, sample: Sample) {
        let at_s = sample.at_ns as f64 / 1e9;
        self.uptime_s = sample.supervisor.map(|supervisor| at_s - supervisor.started_s);
        self.started_s = sample.supervisor.map_or(self.started_s, |supervisor| supervisor.started_s);
        let busy_ns = self.sweeps.busy_ns().to_vec();
        let parts = self.sweeps.tap().parts;
        let from_ns = sample.at_ns.saturating_sub(RATE_NS);
        self.marks.push_back(Mark { sample, busy_ns, parts });
        while self.marks.get(1).is_some_and(|mark| mark.sample.at_ns <= from_ns) {
            self.marks.pop_front();
        }
    }

    /// Adds an event of the log, after the first look.
    pub(crate) fn happened(&mut self, event: &events::Event) {
        self.events.add((event.time_ns as f64 / 1e9 - self.started_s).max(0.0), event);
    }

    /// Says why there is nothing new, or that there is again.
    pub(crate) fn note(&mut self, notice: Option<String>) {
        self.notice = notice;
    }

    /// What is to be shown.
    pub(crate) fn view(&self) -> View {
        let facts = &self.facts;
        let last = self.marks.back();
        let source = last.and_then(|mark| mark.sample.stages.first());
        let stages: Vec<StageView> = (0..facts.stages.len()).map(|place| self.stage(place)).collect();
        View {
            instance: facts.instance.clone(),
            source: facts.source.clone(),
            pace: if facts.paced { "realtime" } else { "fast" },
            sectors: facts.sectors,
            uptime_s: self.uptime_s.map(tenths),
            step: Step::from_number(source.map_or(0, |source| source.counts.step) as u32).name(),
            sweep: last.map_or(0, |mark| sent_sweeps(facts, &mark.sample)),
            sweeps_per_s: stages.first().map_or(0.0, |source| source.sweeps_per_s),
            notice: self.notice.clone(),
            latency: self.sweeps.latency(),
            stages,
            supervisor: self.process(|sample| sample.supervisor),
            viewer: self.process(|sample| sample.viewer),
            detections: self.collector.view(),
            tracks: self.tracks.clone(),
            events: self.events.views(),
            tap: self.sweeps.tap(),
        }
    }

    fn stage(&self, place: usize) -> StageView {
        let name = self.facts.stages.get(place).cloned().unwrap_or_default();
        let Some(last) = self.marks.back() else { return StageView { stage: name, ..StageView::default() } };
        let stage = last.sample.stages.get(place).copied().unwrap_or_default();
        let counts = stage.counts;
        let parts_per_s = self.rate(|mark| passed(mark, place));
        let before = place.checked_sub(1).and_then(|place| last.sample.stages.get(place));
        let (p50, p99) = self.sweeps.busy_ms(place);
        StageView {
            stage: name,
            pid: counts.pid,
            state: state(&stage),
            restarts: counts.incarnation.saturating_sub(1),
            heartbeat_age_ms: tenths(last.sample.at_ns.saturating_sub(counts.heartbeat_ns) as f64 / 1e6),
            parts_per_s: tenths(parts_per_s),
            sweeps_per_s: tenths(parts_per_s / f64::from(self.facts.sectors)),
            busy_pct: self.busy_pct(place).map(tenths),
            busy_p50_ms: p50,
            busy_p99_ms: p99,
            queue: before.map(|before| before.counts.published.saturating_sub(counts.next_sequence)),
            received: counts.received,
            published: counts.published,
            processed: counts.processed,
            rejected: counts.rejected_total(),
            dropped: counts.dropped,
            lost: counts.lost,
            overruns: counts.overruns,
            slips: counts.slips,
            late: counts.late,
            process: self.process(|sample| sample.stages.get(place)?.usage),
        }
    }

    /// Growth in a second over the last [`RATE_NS`].
    fn rate(&self, count: impl Fn(&Mark) -> u64) -> f64 {
        let (Some(first), Some(last)) = (self.marks.front(), self.marks.back()) else { return 0.0 };
        let passed_s = last.sample.at_ns.saturating_sub(first.sample.at_ns) as f64 / 1e9;
        if passed_s > 0.0 { count(last).saturating_sub(count(first)) as f64 / passed_s } else { 0.0 }
    }

    /// Share of the time that a stage was busy: of the parts that were seen, for as many as passed.
    fn busy_pct(&self, place: usize) -> Option<f64> {
        if place + 1 >= self.facts.stages.len() {
            return None;
        }
        let seen_per_s = self.rate(|mark| mark.parts);
        let busy_ns_per_s = self.rate(|mark| mark.busy_ns.get(place).copied().unwrap_or(0));
        let sent_per_s = self.rate(|mark| passed(mark, place));
        (seen_per_s > 0.0).then(|| busy_ns_per_s / 1e7 * (sent_per_s / seen_per_s).max(1.0))
    }

    fn process(&self, usage: impl Fn(&Sample) -> Option<Usage>) -> ProcessView {
        let Some(last) = self.marks.back() else { return ProcessView::default() };
        let Some(now) = usage(&last.sample) else { return ProcessView::default() };
        // Of this life alone: another one's process has another start.
        let first = self.marks.iter().find_map(|mark| {
            let then = usage(&mark.sample).filter(|then| then.started_s == now.started_s)?;
            Some((mark.sample.at_ns, then.cpu_s)).filter(|(at_ns, _)| *at_ns < last.sample.at_ns)
        });
        let cpu_pct = first.map(|(at_ns, cpu_s)| {
            let passed_s = (last.sample.at_ns - at_ns) as f64 / 1e9;
            tenths((now.cpu_s - cpu_s) / passed_s * 100.0)
        });
        ProcessView { cpu_pct, rss_mib: Some(tenths(now.rss_bytes as f64 / 1024.0 / 1024.0)) }
    }
}

impl TapView {
    /// Share that passed unseen [%].
    pub fn missed_pct(&self) -> f64 {
        let all = self.parts + self.missed;
        if all > 0 { self.missed as f64 / all as f64 * 100.0 } else { 0.0 }
    }
}

/// Parts that a stage has taken; the source: sent.
fn passed(mark: &Mark, place: usize) -> u64 {
    let counts = mark.sample.stages.get(place).map(|stage| stage.counts).unwrap_or_default();
    if place == 0 { counts.published } else { counts.received }
}

fn sent_sweeps(facts: &Facts, sample: &Sample) -> u64 {
    sample.stages.first().map_or(0, |source| source.counts.published) / u64::from(facts.sectors.max(1))
}

/// The state's word; a process that ended without saying so has died.
fn state(stage: &StageSample) -> &'static str {
    let Counts { state, incarnation, .. } = stage.counts;
    match state {
        State::Stopped => state.name(),
        _ if incarnation > 0 && stage.usage.is_none() => "died",
        _ => state.name(),
    }
}

/// Rounds to tenths.
fn tenths(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}
