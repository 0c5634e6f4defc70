use std::collections::{BTreeMap, BTreeSet};

use events::EventId;

use super::*;

fn look() -> Look {
    let counts = Counts { incarnation: 2, received: 7, state: State::Running, ..Counts::default() };
    let full = Counts { incarnation: 1, published: u64::MAX, rejected: [u64::MAX; Verdict::ALL.len()], ..counts };
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
        at_ns: 1_000_000_000,
        ..Look::default()
    }
}

fn told() -> Told {
    Told { events: [(EventId::StageDied, 3), (EventId::PartsDropped, 1)].into(), unsaid: 9 }
}

fn tracked() -> Tracked {
    Tracked { states: [5, 38, 2], alerts: 1, probability: 0.1, approach: Some((7.5, 2.25)), sent_ns: 750_000_000 }
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
    let text = page(Some((&look(), &told(), Some(&tracked()))));
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
    let text = page(Some((&look(), &told(), Some(&tracked()))));
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
        "encke_tracks{state=\"confirmed\"} 38",
        "encke_tracks{state=\"coasting\"} 2",
        "encke_tracks_on_alert 1",
        "encke_collision_probability 0.1",
        "encke_closest_approach_seconds 7.5",
        "encke_closest_approach_distance_meters 2.25",
        "encke_tracks_age_seconds 0.25",
    ] {
        assert!(text.lines().any(|found| found == line), "{line} in\n{text}");
    }
    let info = text.lines().find(|line| line.starts_with("encke_info{")).unwrap();
    assert_eq!(parse(info).1[0], ("instance".to_owned(), "a\"b\\c\nd".to_owned()));
}

#[test]
fn of_tracks_that_are_not_known_nothing_is_said() {
    let text = page(Some((&look(), &told(), None)));
    assert!(!text.contains("encke_tracks") && !text.contains("encke_collision"));
    let nothing_comes = Tracked { approach: None, ..tracked() };
    assert!(!page(Some((&look(), &told(), Some(&nothing_comes)))).contains("closest_approach"));
}

#[test]
fn of_no_chain_it_is_said_that_there_is_none() {
    assert_eq!(page(None).lines().last(), Some("encke_up 0"));
}
