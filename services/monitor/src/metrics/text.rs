//! A look → Prometheus' text, version 0.0.4: base units, counters end in `_total`.

use std::fmt::{Display, Write};

use chain::Mode;
use messages::Verdict;
use runtime::page::{Counts, State};

use super::look::{Look, Told};
use crate::process::Usage;

/// All that is known; of no chain, that there is none.
pub(super) fn page(chain: Option<(&Look, &Told)>) -> String {
    let mut page = Page(String::new());
    page.one(Gauge, "encke_up", "Whether the chain's supervisor runs.", u8::from(chain.is_some()));
    if let Some((look, told)) = chain {
        page.chain(look);
        page.stages(look);
        page.processes(look);
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
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use events::EventId;

    use super::*;

    fn look() -> Look {
        let counts = Counts { incarnation: 2, received: 7, state: State::Running, ..Counts::default() };
        let full = Counts { incarnation: 1, published: u64::MAX, rejected: [u64::MAX; 11], ..counts };
        let usage = Some(Usage { cpu_s: 0.25, rss_bytes: 4_096, started_s: 1.0 });
        Look {
            instance: "a\"b\\c\nd".to_owned(),
            source: "scenes/default.toml".to_owned(),
            pace: "realtime",
            sectors: 36,
            deadline_ms: Some(100.0),
            stages: vec![
                ("source".to_owned(), full, usage),
                ("clusterer".to_owned(), counts, None),
                ("recorder".to_owned(), Counts { answered_ns: 5, latency_ns: 1_500_000, ..counts }, usage),
            ],
            tape: Some((counts, usage)),
            ..Look::default()
        }
    }

    fn told() -> Told {
        Told { events: [(EventId::StageDied, 3), (EventId::PartsDropped, 1)].into(), unsaid: 9 }
    }

    fn is_name(name: &str) -> bool {
        name.starts_with(|first: char| first.is_ascii_alphabetic() || first == '_')
            && name.chars().all(|character| character.is_ascii_alphanumeric() || character == '_')
    }

    /// Name, labels (as they stand) and value of a sample line.
    fn parse(line: &str) -> (&str, Vec<(String, String)>, f64) {
        let (head, value) = line.rsplit_once(' ').unwrap();
        let Some((name, rest)) = head.split_once('{') else { return (head, Vec::new(), value.parse().unwrap()) };
        let mut rest = rest.strip_suffix('}').unwrap();
        let mut labels = Vec::new();
        while !rest.is_empty() {
            let (label, quoted) = rest.split_once("=\"").unwrap();
            let mut text = String::new();
            let mut characters = quoted.char_indices();
            let end = loop {
                match characters.next().unwrap() {
                    (at, '"') => break at,
                    (_, '\\') => match characters.next().unwrap().1 {
                        'n' => text.push('\n'),
                        other => {
                            assert!(matches!(other, '"' | '\\'));
                            text.push(other);
                        }
                    },
                    (_, character) => text.push(character),
                }
            };
            labels.push((label.to_owned(), text));
            rest = &quoted[end + 1..];
            rest = rest.strip_prefix(',').unwrap_or(rest);
        }
        (name, labels, value.parse().unwrap())
    }

    #[test]
    fn the_page_keeps_to_the_formats_grammar() {
        let text = page(Some((&look(), &told())));
        assert!(text.ends_with('\n') && !text.contains("\n\n"));
        let (mut kinds, mut series, mut current) = (BTreeMap::new(), BTreeSet::new(), String::new());
        for line in text.lines() {
            if let Some(help) = line.strip_prefix("# HELP ") {
                let (name, words) = help.split_once(' ').unwrap();
                assert!(is_name(name) && !words.is_empty() && !words.contains('\\'), "{line}");
                name.clone_into(&mut current);
            } else if let Some(kind) = line.strip_prefix("# TYPE ") {
                let (name, kind) = kind.split_once(' ').unwrap();
                assert_eq!(name, current, "help and type stand together");
                assert!(matches!(kind, "counter" | "gauge"));
                assert!(kinds.insert(name.to_owned(), kind.to_owned()).is_none(), "{name} stands once");
                assert_eq!(kind == "counter", name.ends_with("_total"), "{name}");
            } else {
                let (name, labels, value) = parse(line);
                assert_eq!(name, current, "all samples of a family stand together, below its type");
                assert!(labels.iter().all(|(label, _)| is_name(label)), "{line}");
                assert!(value.is_finite() && value >= 0.0, "{line}");
                assert!(series.insert((name.to_owned(), labels)), "{line} stands twice");
            }
        }
        assert!(series.len() > 60, "{}", series.len());
    }

    #[test]
    fn values_are_in_base_units_and_full_counters_stay_full() {
        let text = page(Some((&look(), &told())));
        for line in [
            "encke_up 1",
            "encke_sweep_latency_seconds 0.0015",
            "encke_deadline_seconds 0.1",
            "encke_parts_published_total{stage=\"source\"} 18446744073709551615",
            "encke_parts_rejected_total{stage=\"clusterer\",reason=\"stale\"} 0",
            "encke_stage_restarts_total{stage=\"clusterer\"} 1",
            "encke_process_resident_memory_bytes{process=\"tape\"} 4096",
            "encke_events_total{name=\"stage_died\",severity=\"error\"} 3",
            "encke_events_unsaid_total 9",
            "encke_mode{mode=\"nominal\"} 1",
            "encke_mode{mode=\"safe\"} 0",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} in\n{text}");
        }
        let info = text.lines().find(|line| line.starts_with("encke_info{")).unwrap();
        assert_eq!(parse(info).1[0], ("instance".to_owned(), "a\"b\\c\nd".to_owned()));
    }

    #[test]
    fn of_no_chain_it_is_said_that_there_is_none() {
        assert_eq!(page(None).lines().last(), Some("encke_up 0"));
    }
}
