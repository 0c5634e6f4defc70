#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::io::Cursor;

use lidar::ObstacleClass;
use mcap::records::{MessageHeader, Metadata};
use messages::{ClusterSummary, Detection, Detections, Hop, Part, Raw, Trace, Verdict};
use serde_json::{Value, json};
use zerocopy::FromZeros;

use super::{RunFigures, RunReportError, recording};

/// A report of 30 sweeps as `encke run --report` writes it.
fn report() -> Value {
    let bucket = |place: u64| {
        json!({"t_s": 0.25 * place as f64, "sweeps": 3, "p50": 3.5, "p99": 5.0, "max": 6.125 + place as f64, "misses": 0,
               "missing": 0})
    };
    let percentiles = json!({"count": 30, "p50": 3.515, "p99": 8.04, "p999": 9.07, "max": 9.125});
    let hop = |stage: &str| {
        json!({"stage": stage, "published": 30, "received": 30, "processed": 30, "rejected": {}, "dropped": {}, "lost": 0,
               "in_flight": 0, "open": 0})
    };
    let spent = |stage: &str| json!({"stage": stage, "late": [], "transport": vec![0.25; 10], "queued": vec![0.0; 10], "busy": vec![2.0; 10]});
    let worst_hop = |stage: &str, at: f64| {
        json!({"stage": stage, "queued_ms": 0.5, "wake_ms": 0.25, "taken_ms": 0.5, "busy_ms": 1.0,
               "started_after_due_ms": at, "finished_after_due_ms": at + 1.5})
    };
    let mut report = json!({
        "encke": "0.1.0", "machine": "2 cores, some CPU", "source": "/somewhere/scene-of-the-test.toml", "sweeps": 30,
        "sectors": 1, "pace": "realtime", "cluster_range_m": 1.0, "period_ms": 100.0, "duration_s": 3.0,
        "ledger": {"closed": true, "hops": [hop("clusterer"), hop("recorder")], "gaps": []},
        "latency_ms": {"end_to_end": percentiles, "end_to_end_corrected": percentiles, "stages": {}},
        "obstacle_latency_ms": percentiles, "seam_latency_ms": {"count": 0, "p50": null},
        "deadline": {"deadline_ms": 100.0, "misses": 0, "margin_p999_pct": 91.25, "margin_ok": true, "causes": {}}
    });
    let used = json!({
        "worst_sweeps": [{"sweep": 417, "end_to_end_ms": 9.125, "cause": "clusterer compute", "step": "nominal",
                          "hops": [worst_hop("source", -1.0), worst_hop("clusterer", 2.0)]}],
        "steps": {"nominal": 30},
        "processes": [{"stage": "source", "pid": 4321, "restarts": 0, "cpu_pct": 12.5, "rss_peak_kib": 20480},
                      {"stage": "supervisor", "pid": 4320, "restarts": 0, "cpu_pct": 1.5, "rss_peak_kib": 10240}],
        "machine_load": {"own_cpu_pct": 14.0}, "noise_ms": {"count": 300, "p50": 0.0625, "p999": 1.5, "max": 2.5},
        "realtime_refused": [], "detections": {"rectangular": 1234, "conical": 77, "unclassified": 0}, "returns": 98765,
        "refused": {}, "complete_sweeps": 29, "stopped": null, "verdict": {"failed": null, "failed_strict": null},
        "latency_histogram_ms": {"end_to_end": [[1.5, 1], [3.5, 15], [8.0, 29], [9.125, 30]],
                                 "end_to_end_corrected": [[1.5, 1], [3.5, 15], [8.0, 29], [9.125, 30]],
                                 "obstacle": [[2.5, 100], [7.5, 200]], "seam": []}
    });
    let over_time = json!({
        "timeline": {"bucket_s": 0.25, "latency_ms": (0..10).map(bucket).collect::<Vec<_>>(),
            "spent_ms": [{"stage": "source", "late": vec![0.5; 10]}, spent("clusterer")],
            "detections": {"rectangular": vec![123; 10], "conical": vec![7; 10]}, "sample_s": 1.0, "sample_t_s": [0.0, 1.0, 2.0],
            "processes": {"source": {"cpu_pct": [12.0, 13.0, 12.5], "rss_kib": [20480, 20480, 20480]}},
            "machine": {"own_cpu_pct": [14.0, null, 14.0], "foreign_cpu_pct": [90.0, 80.0, 85.0], "steal_pct": [],
                        "wake_late_max_ms": [2.5, 0.5, 0.5]},
            "events": [], "event_count": 0}
    });
    for more in [used, over_time] {
        report.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    }
    report
}

fn page(report: &Value) -> String {
    RunFigures::from_json(report.to_string().as_bytes()).unwrap().to_html()
}

fn expect(page: &str, words: &[&str]) {
    for words in words {
        assert!(page.contains(words), "{words:?} is not in the page");
    }
    assert_whole(page);
}

/// One document that loads nothing, and in which every element that was opened is closed.
fn assert_whole(page: &str) {
    for foreign in ["http://", "https://", "<script", "@import", "url(", " src=", "NaN", "inf"] {
        let found = page.find(foreign).filter(|&at| !page[at..].starts_with("info"));
        assert!(found.is_none(), "{foreign:?} in {:?}", found.map(|at| &page[at.saturating_sub(60)..at + 20]));
    }
    for element in ["svg", "table", "tr", "td", "figure", "div", "p", "h2", "g", "text", "ul", "span"] {
        let opened = page.matches(&format!("<{element}>")).count() + page.matches(&format!("<{element} ")).count();
        assert_eq!(opened, page.matches(&format!("</{element}>")).count(), "<{element}>");
    }
}

// verifies GND-010
#[test]
fn the_page_shows_what_the_report_says() {
    let page = page(&report());
    expect(
        &page,
        &[
            "<h1>Run of scene-of-the-test.toml</h1>",
            "2 cores, some CPU",
            "98\u{202f}765 returns",
            "The ledger is closed",
            "No sweep missed the deadline of 100 ms. At p99.9, 91 % of it are left",
            "✓ None: all 30 sweeps were answered within 100 ms",
            "Exit code 0, with <code>--strict</code> as well.",
            "<td class=\"n\">8.04</td>",
            "417</tspan> · 9.12 ms",
            "clusterer compute",
            "<td class=\"n\">4321</td>",
            "1\u{202f}234",
            "all 2 cores",
            "woke 0.062 ms late at the median",
            "answered after 2.75 ms on average",
            "No stage was restarted",
        ],
    );
    assert!(!page.contains("class=\"absent\""), "nothing is missing");
}

#[test]
fn misses_restarts_and_an_open_ledger_are_told() {
    let mut report = report();
    report["ledger"]["closed"] = json!(false);
    report["ledger"]["hops"][0]["dropped"] = json!({"overflow": 4});
    report["ledger"]["gaps"] =
        json!([{"stage": "clusterer", "kind": "dropped", "first_sweep": 11, "last_sweep": 14, "parts": 4}]);
    report["deadline"] = json!({"deadline_ms": 100.0, "misses": 5, "margin_p999_pct": -20.0, "margin_ok": false,
                                "causes": {"clusterer dropped": 4, "source late": 1}});
    report["verdict"] = json!({"failed": "the ledger is OPEN", "failed_strict": "the ledger is OPEN"});
    report["timeline"]["events"] = json!([{"t_s": 1.5, "kind": "restart", "what": "clusterer (signal 9)"}]);
    report["timeline"]["event_count"] = json!(3);
    expect(
        &page(&report),
        &[
            "verdict bad",
            "<b>The ledger is OPEN</b>",
            "4 parts were dropped or lost",
            "5 of 30 sweeps missed the deadline of 100 ms, 4 of them by <b>clusterer dropped</b>",
            "At p99.9 it is exceeded by 20 %",
            "failed with exit code 1: the ledger is OPEN.",
            "80.0 %",
            "clusterer dropped: sweeps 11 to 14, 4 parts",
            "4 overflow",
            "restart: clusterer (signal 9)",
            "And 2 more.",
            "restart, numbered as under Events",
        ],
    );
}

#[test]
fn a_run_as_fast_as_it_goes_has_no_deadlines() {
    let mut report = report();
    report["pace"] = json!("fast");
    let page = page(&report);
    expect(&page, &["without deadlines", "there are no deadlines to miss", "as fast as it goes"]);
    assert!(!page.contains("deadline 100 ms"), "no line is drawn");
}

#[test]
fn what_an_older_report_lacks_is_named_and_the_rest_is_shown() {
    let whole = report();
    for name in whole.as_object().unwrap().keys() {
        let mut report = whole.clone();
        report.as_object_mut().unwrap().remove(name);
        assert_whole(&page(&report));
    }
    let mut older = whole;
    for name in ["timeline", "latency_histogram_ms", "verdict", "worst_sweeps"] {
        older.as_object_mut().unwrap().remove(name);
    }
    expect(
        &page(&older),
        &[
            "it has percentiles and no distributions to draw",
            "it has no timeline.",
            "does not say how the command ended",
            "does not name its slowest sweeps",
            "<td class=\"n\">8.04</td>",
        ],
    );
    assert_whole(&page(&json!({"ledger": {}})));
}

#[test]
fn hostile_words_and_numbers_stay_words_and_numbers() {
    let hostile = "</title><script>alert('&')</script>\" onload=\"x";
    let mut report = report();
    fn spoil(value: &mut Value, hostile: &str) {
        match value {
            Value::String(text) => *text = hostile.to_owned(),
            Value::Array(values) => values.iter_mut().for_each(|value| spoil(value, hostile)),
            Value::Object(object) => {
                object.values_mut().for_each(|value| spoil(value, hostile));
            }
            _ => {}
        }
    }
    spoil(&mut report, hostile);
    for name in
        ["/deadline/causes", "/detections", "/timeline/detections", "/steps", "/refused", "/ledger/hops/0/rejected"]
    {
        let value = if name == "/timeline/detections" { json!(vec![5; 10]) } else { json!(5) };
        *report.pointer_mut(name).unwrap() = json!({ hostile: value });
    }
    report["timeline"]["processes"] = json!({hostile: {"cpu_pct": [1.0, 2.0, 3.0], "rss_kib": [1, 2, 3]}});
    report["deadline"]["misses"] = json!(5);
    report["timeline"]["events"] = json!([{"t_s": 1.0, "kind": hostile, "what": hostile}]);
    let found = page(&report);
    assert!(!found.contains("<script") && !found.contains("onload=\"x"));
    assert_whole(&found);
    for extreme in [json!(-1e300), json!(1e300), json!(0.0), json!(1e-300)] {
        let mut report = self::report();
        fn stretch(value: &mut Value, extreme: &Value) {
            match value {
                Value::Number(number) if number.is_f64() => *value = extreme.clone(),
                Value::Array(values) => values.iter_mut().for_each(|value| stretch(value, extreme)),
                Value::Object(object) => object.values_mut().for_each(|value| stretch(value, extreme)),
                _ => {}
            }
        }
        stretch(&mut report, &extreme);
        let page = page(&report);
        assert!(!page.contains("NaN"), "{extreme}");
        assert!(page.len() < 2_000_000 && page.ends_with("</html>\n"), "{extreme}");
    }
}

// verifies GND-012
#[test]
fn what_is_no_report_is_refused_in_one_line_that_says_what_it_is() {
    let whole = report().to_string();
    let error = |bytes: &[u8]| RunFigures::from_json(bytes).unwrap_err().to_string();
    let cases: [(&[u8], &str); 9] = [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (&whole.as_bytes()[..whole.len() / 2], "is torn JSON: EOF while parsing"),
        (b"{\"sweep\":0,\"detections\":[]}\n{\"sweep\":1,\"detections\":[]}\n", "a file of detections"),
        (b"[{\"name\":\"process_name\",\"ph\":\"M\"}]", "is a trace"),
        (b"\xd4\xc3\xb2\xa1\x02\x00", "is a capture (pcap)"),
        (b"x,y,z\n1,2,3\n", "is some other text"),
        (b"\xff\xfe\x00", "is no text"),
        (b"{\"a\":1}", "is other JSON"),
    ];
    for (bytes, words) in cases {
        let error = error(bytes);
        assert!(error.contains(words) && !error.contains('\n'), "{error:?} instead of {words:?}");
    }
    let torn = RunFigures::from_json(&whole.as_bytes()[..100]).unwrap_err();
    assert!(matches!(torn, RunReportError::Torn { at: 100, length: 100, .. }), "{torn}");
    let odd = whole.replace("\"sweeps\":30", "\"sweeps\":\"many\"");
    assert!(error(odd.as_bytes()).contains("invalid type: string \"many\", expected u64"));
}

#[test]
fn a_report_cut_anywhere_is_refused_and_never_a_panic() {
    let whole = report().to_string();
    for length in (0..whole.len()).step_by(7) {
        assert!(RunFigures::from_json(&whole.as_bytes()[..length]).is_err(), "{length}");
    }
}

const MS: u64 = 1_000_000;
/// 2026-11-22 12:00:00 UTC.
const NOON_NS: u64 = 1_795_348_800_000_000_000;

/// A sweep of two clusters that was answered so many ms after its last return.
fn sweep(number: u64, took_ms: u64, sectors: u32) -> Vec<u8> {
    let start_ns = 5_000 * MS + 100 * MS * number;
    let part = Part { ordinal: number * 4 + 3, sweep: number, sector: sectors - 1, sectors, ..Part::default() };
    let mut trace = Trace { part, due_ns: start_ns + 100 * MS, sweep_start_ns: start_ns, ..Trace::default() };
    let sent_ns = trace.due_ns + MS;
    trace.push(Hop { started_ns: trace.due_ns, finished_ns: sent_ns, ..Hop::default() });
    trace.push(Hop {
        stage: 1,
        received_ns: sent_ns,
        started_ns: sent_ns,
        finished_ns: trace.due_ns + took_ms * MS,
        ..Hop::default()
    });
    let mut message = Detections::new_box_zeroed().unwrap();
    (message.header.period_ns, message.header.complete, message.header.recorded) = (100 * MS, 1, 12);
    for (first_member, class) in [(0, ObstacleClass::Conical), (6, ObstacleClass::Rectangular)] {
        let summary = ClusterSummary { key: first_member, first_member, points: 6, ..ClusterSummary::default() };
        message.detections.push(Detection { summary, class, ..Detection::default() }).unwrap();
    }
    message.members.extend_from_slice(&(0..12).collect::<Vec<_>>()).unwrap();
    let mut bytes = Vec::new();
    trace.write_raw(&mut bytes);
    message.write_raw(&mut bytes);
    bytes
}

/// A recording of these sweeps, a status and an event.
fn recorded(sweeps: &[Vec<u8>], pace: &str) -> Vec<u8> {
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    let about = [("version", "0.1.0"), ("source", "sea.pcap"), ("pace", pace), ("sectors", "1"), ("deadline_ms", "50")];
    let about = about.map(|(key, value)| (key.to_owned(), value.to_owned()));
    writer.write_metadata(&Metadata { name: "encke.run".to_owned(), metadata: about.into() }).unwrap();
    let mut channel = |topic: &str| writer.add_channel(0, topic, "encke", &BTreeMap::new()).unwrap();
    let ids = ["/encke/raw/detections", "/encke/status", "/encke/events"].map(&mut channel);
    let mut write = |channel: usize, number: u64, data: &[u8]| {
        let publish_time = NOON_NS + 100 * MS * number;
        let header = MessageHeader { channel_id: ids[channel], sequence: 0, log_time: number, publish_time };
        writer.write_to_known_channel(&header, data).unwrap();
    };
    for (number, sweep) in (0..).zip(sweeps) {
        write(0, number, sweep);
    }
    let status = json!({"stages": [{"stage": "clusterer", "pid": 1, "received": 77, "published": 76, "restarts": 2}]});
    write(1, 4, status.to_string().as_bytes());
    write(2, 5, b"\x1a\x09said this\x22\x07restart");
    // As the log's events are recorded: who, what word, what number.
    write(2, 6, b"\x1a\x08signal 9\x22\x09clusterer\x2a\x0astage_died\x30\x07");
    write(2, 7, b"\x1a\x09restart 1\x22\x09clusterer\x2a\x0fstage_restarted\x30\x08");
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn read(bytes: &[u8]) -> Result<RunFigures, RunReportError> {
    recording::read(bytes, "flight.mcap".to_owned())
}

// verifies GND-011
#[test]
fn a_recording_says_what_its_traces_and_detections_say() {
    let sweeps: Vec<_> = [10, 11, 12, 80, 13].into_iter().zip([0, 1, 2, 3, 6]).collect();
    let sweeps: Vec<_> = sweeps.into_iter().map(|(took_ms, number)| sweep(number, took_ms, 1)).collect();
    let found = read(&recorded(&sweeps, "realtime")).unwrap();
    assert_eq!((found.sweeps, found.sectors, found.period_ms), (5, 1, Some(100.0)));
    let end_to_end = found.latency_ms.end_to_end;
    assert_eq!((end_to_end.count, end_to_end.max.map(|ms| ms.round())), (5, Some(80.0)));
    assert_eq!(found.obstacle_latency_ms.unwrap().count, 10);
    let deadline = found.deadline.clone().unwrap();
    assert_eq!((deadline.misses, deadline.deadline_ms), (3, 50.0));
    let causes = [("clusterer compute".to_owned(), 1), ("not in the recording".to_owned(), 2)];
    assert_eq!(deadline.causes, causes.into());
    assert_eq!(found.detections.as_ref().unwrap()["conical"], 5);
    assert_eq!(found.worst_sweeps.as_ref().unwrap()[0].sweep, 3);
    let timeline = found.timeline.as_ref().unwrap();
    assert_eq!(timeline.latency_ms.iter().map(|bucket| bucket.sweeps).sum::<u64>(), 5);
    // The first answer came 110 ms after the first firing; the event half a second after it.
    assert_eq!(timeline.events[0].kind, "restart");
    assert!((timeline.events[0].t_s - 0.61).abs() < 1e-6);
    assert_eq!((timeline.events[1].kind.as_str(), timeline.events[1].what.as_str()), ("restart", "clusterer"));
    assert_eq!((timeline.events.len(), found.events["stage_died"], found.events["stage_restarted"]), (2, 1, 1));
    expect(&found.to_html(), &["<td>stage_died</td><td class=\"n\">1</td>"]);
    let recording = found.read_from.as_ref().unwrap();
    let [first, last] = recording.written_utc.clone().unwrap();
    assert_eq!((first.as_str(), last.as_str()), ("2026-11-22 12:00:00", "2026-11-22 12:00:00"));
    assert_eq!((recording.unread, &recording.torn, recording.messages["/encke/raw/detections"]), (0, &None, 5));
    expect(
        &found.to_html(),
        &[
            "Run of sea.pcap",
            "Figures worked out from a recording.",
            "<td class=\"n\">77</td>",
            "deadline 50 ms",
            "said this",
        ],
    );
    let json = serde_json::to_vec(&found).unwrap();
    assert_eq!(RunFigures::from_json(&json).unwrap(), found);
}

#[test]
fn a_recording_in_sectors_has_no_obstacle_latencies_and_one_without_pace_no_deadline() {
    let sweeps = [sweep(0, 10, 4), sweep(1, 90, 4)];
    let found = read(&recorded(&sweeps, "realtime")).unwrap();
    assert_eq!((found.sectors, found.latency_ms.end_to_end.count, found.obstacle_latency_ms), (4, 2, None));
    let found = read(&recorded(&sweeps, "fast")).unwrap();
    assert_eq!((&found.deadline, found.pace.as_str()), (&None, "fast"));
    expect(&found.to_html(), &["verdict unknown", "without deadlines"]);
    let found = RunFigures { pace: String::new(), ..found };
    expect(&found.to_html(), &["It does not say what deadline the run had."]);
}

#[test]
fn a_torn_recording_is_used_up_to_the_tear_and_never_a_panic() {
    let sweeps: Vec<_> = (0..20).map(|number| sweep(number, 10, 1)).collect();
    let whole = recorded(&sweeps, "realtime");
    let mut used = 0;
    for length in (0..whole.len()).step_by(97) {
        match read(&whole[..length]) {
            Ok(found) => {
                assert!(found.read_from.as_ref().unwrap().torn.is_some(), "{length}");
                assert!(found.sweeps <= 20);
                used = used.max(found.sweeps);
            }
            Err(error) => assert!(matches!(error, RunReportError::NoSweeps(_)), "{error}"),
        }
    }
    assert_eq!(used, 20);
    let mut spoilt = whole;
    for at in (0..spoilt.len()).step_by(61) {
        spoilt[at] ^= 0x55;
        let _ = read(&spoilt).map(|found| found.to_html());
        spoilt[at] ^= 0x55;
    }
}

#[test]
fn a_sweep_that_cannot_be_read_and_one_that_was_rejected_are_told() {
    let mut short = sweep(1, 10, 1);
    short.truncate(short.len() - 3);
    let mut stale = Trace::read_raw(&sweep(2, 10, 1)).unwrap().0;
    stale.hops[1].verdict = Verdict::RejectedStale;
    let mut rejected = Vec::new();
    stale.write_raw(&mut rejected);
    Detections::new_box_zeroed().unwrap().write_raw(&mut rejected);
    let found = read(&recorded(&[sweep(0, 10, 1), short, rejected, sweep(3, 10, 1)], "realtime")).unwrap();
    assert_eq!(found.read_from.as_ref().unwrap().unread, 1);
    let causes = [("clusterer stale".to_owned(), 1), ("not in the recording".to_owned(), 1)];
    assert_eq!(found.deadline.as_ref().unwrap().causes, causes.into());
    expect(&found.to_html(), &["1 sweeps"]);
}
