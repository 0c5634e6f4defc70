//! A look → Prometheus' text, version 0.0.4: base units, counters end in `_total`.

use std::fmt::{Display, Write};

use chain::Mode;
use messages::{TrackState, Verdict};
use runtime::page::{Counts, State};

use super::ears::Tracked;
use super::look::{Look, Told};
use crate::process::Usage;

/// All that is known; of no chain, that there is none.
pub(super) fn page(chain: Option<(&Look, &Told, Option<&Tracked>)>) -> String {
    let mut page = Page(String::new());
    page.one(Gauge, "encke_up", "Whether the chain's supervisor runs.", u8::from(chain.is_some()));
    if let Some((look, told, tracked)) = chain {
        page.chain(look);
        page.stages(look);
        page.processes(look);
        if let Some(tracked) = tracked {
            page.tracks(tracked, look.at_ns);
        }
        page.events(told);
    }
    page.0
}

use Kind::{Counter, Gauge};

#[derive(Clone, Copy)]
enum Kind {
    Counter,
    Gauge,
}

/// What is told of each stage's page.
type OfStage = (Kind, &'static str, &'static str, fn(&Counts) -> u64);

const OF_STAGES: [OfStage; 12] = [
    (Gauge, "encke_stage_up", "Whether a process of the stage is connected.", |of| u64::from(is_up(of))),
    (Counter, "encke_stage_restarts_total", "Processes beyond the first.", |of| of.incarnation.saturating_sub(1)),
    (Gauge, "encke_stage_tier", "Build of the stage: 0 as configured, 1 built-in, 2 a stand-in.", |of| of.tier),
    (Gauge, "encke_stage_table_generation", "Generation of the parameters in use.", |of| of.table_active),
    (Counter, "encke_parts_received_total", "Parts taken from shared memory.", |of| of.received),
    (Counter, "encke_parts_processed_total", "Parts processed; the sink: written.", |of| of.processed),
    (Counter, "encke_parts_published_total", "Parts published; the sink: accepted.", |of| of.published),
    (Counter, "encke_parts_dropped_total", "Parts that overflowed the queue before it.", |of| of.dropped),
    (Counter, "encke_parts_lost_total", "Parts that died with a process.", |of| of.lost),
    (Counter, "encke_budget_overruns_total", "Sweeps beyond the stage's budget.", |of| of.overruns),
    (Counter, "encke_slips_total", "Parts that had waited when the one before was done.", |of| of.slips),
    (Counter, "encke_late_sweeps_total", "Sweeps that left the stage after the deadline.", |of| of.late),
];

fn is_up(counts: &Counts) -> bool {
    counts.incarnation > counts.settled_incarnation && matches!(counts.state, State::Running | State::Ended)
}

/// Nanoseconds as seconds.
fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

struct Page(String);

impl Page {
    fn family(&mut self, kind: Kind, name: &str, help: &str) {
        let kind = if matches!(kind, Counter) { "counter" } else { "gauge" };
        // Writing to a String cannot fail, here and below.
        let _ = write!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}\n");
    }

    fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: impl Display) {
        let escaped = |value: &str| value.replace('\\', r"\\").replace('"', "\\\"").replace('\n', r"\n");
        let labels: Vec<_> = labels.iter().map(|(label, value)| format!("{label}=\"{}\"", escaped(value))).collect();
        let labels = if labels.is_empty() { String::new() } else { format!("{{{}}}", labels.join(",")) };
        let _ = writeln!(self.0, "{name}{labels} {value}");
    }

    fn one(&mut self, kind: Kind, name: &str, help: &str, value: impl Display) {
        self.family(kind, name, help);
        self.sample(name, &[], value);
    }

    fn chain(&mut self, look: &Look) {
        let (source, sink) = (look.stages.first().map(|of| of.1), look.stages.last().map(|of| of.1));
        let (source, sink) = (source.unwrap_or_default(), sink.unwrap_or_default());
        let (supervisor, sectors) = (&look.supervisor.0, look.sectors.to_string());
        let about = [
            ("instance", look.instance.as_str()),
            ("version", env!("CARGO_PKG_VERSION")),
            ("source", &look.source),
            ("sensor", &look.sensor),
            ("pace", look.pace),
            ("sectors", &sectors),
        ];
        self.family(Gauge, "encke_info", "What runs; always 1.");
        self.sample("encke_info", &about, 1);
        self.family(Gauge, "encke_mode", "1 for the mode of the chain, 0 for the others.");
        for mode in Mode::ALL {
            self.sample("encke_mode", &[("mode", mode.name())], u8::from(mode == Mode::from_number(supervisor.mode)));
        }
        self.one(Counter, "encke_mode_changes_total", "Changes of mode.", supervisor.mode_changes);
        self.one(Counter, "encke_modes_late_total", "Changes of mode that took too long.", supervisor.modes_late);
        self.family(Counter, "encke_commands_total", "Commands, by what became of them.");
        self.sample("encke_commands_total", &[("outcome", "accepted")], supervisor.commands_accepted);
        self.sample("encke_commands_total", &[("outcome", "refused")], supervisor.commands_refused);
        self.one(Gauge, "encke_degradation_step", "Step of degradation in force, 0 to 4.", source.step);
        let sweeps = source.published / u64::from(look.sectors.max(1));
        self.one(Counter, "encke_sweeps_total", "Sweeps that the source has published.", sweeps);
        let period_s = seconds(source.period_ns);
        self.one(
            Gauge,
            "encke_sweep_period_seconds",
            "From one sweep to the next; 0 where nothing paces it.",
            period_s,
        );
        let latency_s = seconds(sink.latency_ns);
        let help = "Of the latest sweep, from its last return to its last detection sent.";
        self.one(Gauge, "encke_sweep_latency_seconds", help, latency_s);
        if sink.answered_ns > 0 {
            let age_s = seconds(look.at_ns.saturating_sub(sink.answered_ns));
            self.one(Gauge, "encke_answer_age_seconds", "Since a sweep was last answered.", age_s);
        }
        if let Some(deadline_ms) = look.deadline_ms {
            self.one(Gauge, "encke_deadline_seconds", "What the latency may be.", deadline_ms / 1e3);
        }
    }

    fn stages(&mut self, look: &Look) {
        for (kind, name, help, value) in OF_STAGES {
            self.family(kind, name, help);
            for (stage, counts, _) in &look.stages {
                self.sample(name, &[("stage", stage)], value(counts));
            }
        }
        let name = "encke_parts_rejected_total";
        self.family(Counter, name, "Parts rejected, by reason.");
        for (stage, counts, _) in look.stages.iter().skip(1) {
            for verdict in Verdict::ALL.into_iter().filter(|verdict| verdict.is_rejected()) {
                let labels = [("stage", stage.as_str()), ("reason", verdict.name())];
                self.sample(name, &labels, counts.rejected[verdict as usize]);
            }
        }
        let name = "encke_queue_parts";
        self.family(Gauge, name, "Parts that wait for the stage.");
        for pair in look.stages.windows(2) {
            let waiting = pair[0].1.published.saturating_sub(pair[1].1.next_sequence);
            self.sample(name, &[("stage", &pair[1].0)], waiting);
        }
        let name = "encke_stage_heartbeat_age_seconds";
        self.family(Gauge, name, "Since the stage's working thread last showed progress.");
        for (stage, counts, _) in &look.stages {
            self.sample(name, &[("stage", stage)], seconds(look.at_ns.saturating_sub(counts.heartbeat_ns)));
        }
        if let Some((counts, _)) = &look.tape {
            let (received, dropped) = (counts.received, counts.dropped);
            self.one(Counter, "encke_tape_parts_received_total", "Parts that the recording took.", received);
            self.one(Counter, "encke_tape_parts_dropped_total", "Parts that overflowed its queues.", dropped);
        }
    }

    fn processes(&mut self, look: &Look) {
        let stages = look.stages.iter().map(|(stage, _, usage)| (stage.as_str(), *usage));
        let tape = look.tape.iter().map(|(_, usage)| (runtime::TAPE, *usage));
        let all: Vec<(&str, Usage)> = stages
            .chain(tape)
            .chain([(chain::SUPERVISOR, look.supervisor.1)])
            .filter_map(|(process, usage)| Some((process, usage?)))
            .collect();
        self.family(Counter, "encke_process_cpu_seconds_total", "CPU time of the process of this life.");
        for (process, usage) in &all {
            self.sample("encke_process_cpu_seconds_total", &[("process", process)], usage.cpu_s);
        }
        self.family(Gauge, "encke_process_resident_memory_bytes", "Memory resident.");
        for (process, usage) in &all {
            self.sample("encke_process_resident_memory_bytes", &[("process", process)], usage.rss_bytes);
        }
    }

    fn tracks(&mut self, tracked: &Tracked, at_ns: u64) {
        self.family(Gauge, "encke_tracks", "Obstacles that are tracked, by state of their track.");
        for state in [TrackState::Tentative, TrackState::Confirmed, TrackState::Coasting] {
            self.sample("encke_tracks", &[("state", state.name())], tracked.states[state as usize]);
        }
        self.one(Gauge, "encke_tracks_on_alert", "Tracks likelier to be met than allowed.", tracked.alerts);
        let help = "Largest probability that a track is met within the horizon.";
        self.one(Gauge, "encke_collision_probability", help, tracked.probability);
        if let Some((time_s, distance_m)) = tracked.approach {
            let help = "Until the closest approach of the track that is likeliest met.";
            self.one(Gauge, "encke_closest_approach_seconds", help, time_s);
            let help = "Distance of that track's middle then.";
            self.one(Gauge, "encke_closest_approach_distance_meters", help, distance_m);
        }
        let age_s = seconds(at_ns.saturating_sub(tracked.sent_ns));
        self.one(Gauge, "encke_tracks_age_seconds", "Since these tracks were sent.", age_s);
    }

    fn events(&mut self, told: &Told) {
        let name = "encke_events_total";
        self.family(Counter, name, "Events in the log, by name.");
        for (id, count) in &told.events {
            let entry = id.entry();
            let severity = format!("{:?}", entry.severity).to_lowercase();
            self.sample(name, &[("name", entry.name), ("severity", &severity)], count);
        }
        self.one(Counter, "encke_events_unsaid_total", "Events that were counted, not said.", told.unsaid);
    }
}

#[cfg(test)]
mod tests;
