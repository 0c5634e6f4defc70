//! What a chain says of itself: in its log, to whoever asks, in its recording, to Prometheus.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

use events::{EventId, Severity};
use prost::Message;
use runtime::Plan;
use runtime::page::{PageMap, Said};
use serde_json::Value;
use support::{Finished, LADDER, NO_LADDER, Run, chain_with, encke, text};
use transport::Instance;

/// A chain that runs until it is told to stop, has begun, and leaves nothing out.
fn running(pace: &str, flags: &[(&str, &str)]) -> (Run, Child) {
    let (config, chain) = chain_with(&[(LADDER, NO_LADDER)]);
    let mut run = Run::new(&["--duration", "forever", "--pace", pace, "--chain", &chain]);
    for (flag, file) in flags {
        run = run.with_file(flag, file);
    }
    let child = run.start();
    run.wait_for_sweeps(5);
    drop(config);
    (run, child)
}

fn stop(run: Run, child: Child) -> (Finished, tempfile::TempDir) {
    let stopped = encke().args(["ctl", "stop", "--instance", &run.instance]).output().unwrap();
    assert!(stopped.status.success(), "{}", text(&stopped.stderr));
    run.collect_and_keep(child)
}

/// Waits until the tape has kept five sweeps more than the source has sent by now: then nothing is to be sent again.
fn wait_until_kept(run: &Run) {
    let status = run.status().unwrap();
    let [sent, sectors] = ["sweep", "sectors"].map(|key| status[key].as_u64().unwrap());
    let page = Plan::page_path(&Instance::named(&run.instance).unwrap(), runtime::TAPE);
    let page = PageMap::open(&page).unwrap();
    run.wait_for(|_| page.next_ordinal_out.get() >= (sent + 5) * sectors);
}

fn lines(path: &Path) -> Vec<Value> {
    std::fs::read_to_string(path).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Name and stage of each event.
fn told(events: &[Value]) -> Vec<(&str, &str)> {
    events.iter().map(|event| (event["name"].as_str().unwrap(), event["stage"].as_str().unwrap())).collect()
}

fn expect_no_gap(events: &[Value]) {
    for (place, event) in events.iter().enumerate() {
        assert_eq!(event["number"].as_u64().unwrap(), place as u64, "{event}");
    }
}

/// Place of the first event of this name and stage, after another place.
fn find(events: &[Value], after: usize, name: &str, stage: &str) -> usize {
    let found = told(events)[after..].iter().position(|event| *event == (name, stage));
    after + found.unwrap_or_else(|| panic!("{name} of {stage} in {:?}", told(events)))
}

/// Number, name and stage of each event of a recording.
fn recorded(path: &Path) -> Vec<(u64, String, String)> {
    let bytes = std::fs::read(path).unwrap();
    // The file of a killed tape ends without a summary.
    let all = mcap::MessageStream::new(&bytes).unwrap().map_while(Result::ok);
    all.filter(|message| message.channel.topic == "/encke/events")
        .map(|message| {
            let log = foxglove::messages::Log::decode(&message.data[..]).unwrap();
            (u64::from(log.line), log.file, log.name)
        })
        .collect()
}

#[test]
fn a_killed_stage_is_told_in_order_and_the_recording_tells_the_same() {
    let (run, child) = running("fast", &[("--events", "e.jsonl"), ("--record", "r.mcap")]);
    run.inject(&["kill", "extractor"]);
    run.wait_for(|status| status["stages"][2]["restarts"] == 1 && status["stages"][2]["state"] == "running");
    wait_until_kept(&run);
    let (finished, dir) = stop(run, child);
    let finished = finished.expect_code(0);
    assert!(finished.is_closed(), "{}", finished.stdout());
    let events = lines(&dir.path().join("e.jsonl"));
    expect_no_gap(&events);
    let started = find(&events, 0, "stage_started", "extractor");
    let began = find(&events, started, "run_began", "chain");
    let died = find(&events, began, "stage_died", "extractor");
    assert!(events[died]["text"].as_str().unwrap().ends_with("signal 9"), "{}", events[died]);
    let restarted = find(&events, died, "stage_restarted", "extractor");
    let again = find(&events, restarted, "stage_started", "extractor");
    find(&events, again, "run_ends", "chain");
    assert_eq!(told(&events).iter().filter(|event| event.0 == "stage_died").count(), 1);
    // The report counts them.
    let counts = &finished.report["events"];
    assert_eq!((&counts["stage_died"], &counts["run_ends"], &counts["unwritten"]), (&1.into(), &1.into(), &0.into()));
    assert!(finished.stdout().contains("events      stage_died 1"), "{}", finished.stdout());
    // The recorder leaves before the tape: what is said until then is recorded, once and in order.
    let recorded = recorded(&dir.path().join("r.mcap"));
    let names: Vec<(u64, String, String)> = events
        .iter()
        .map(|event| {
            let word = |key: &str| event[key].as_str().unwrap().to_owned();
            (event["number"].as_u64().unwrap(), word("name"), word("stage"))
        })
        .collect();
    assert_eq!(recorded, names[..recorded.len()]);
    assert!(recorded.len() > again, "{} of {}", recorded.len(), names.len());
}

#[test]
fn a_tape_that_was_killed_goes_on_in_the_log_where_it_was() {
    let (run, child) = running("fast", &[("--events", "e.jsonl"), ("--record", "r.mcap")]);
    let page = Plan::page_path(&Instance::named(&run.instance).unwrap(), runtime::TAPE);
    support::kill(PageMap::open(&page).unwrap().pid.get());
    let is_second_life = |event: &Value| {
        event["name"] == "stage_started"
            && event["stage"] == "tape"
            && event["text"].as_str().unwrap().ends_with("life 2")
    };
    run.wait_for(|_| run.events().iter().any(is_second_life));
    wait_until_kept(&run);
    let (finished, dir) = stop(run, child);
    let finished = finished.expect_code(0);
    assert!(finished.is_closed(), "{}", finished.stdout());
    let events = lines(&dir.path().join("e.jsonl"));
    expect_no_gap(&events);
    find(&events, 0, "stage_died", "tape");
    let [first, second] = ["r.mcap", "r_0001.mcap"].map(|file| recorded(&dir.path().join(file)));
    for file in [&first, &second] {
        assert!(file.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1), "once and in order in each file: {file:?}");
    }
    // What the dead one had written and not counted yet may stand there twice, under one number.
    let (ended, goes_on) = (first.last().map_or(0, |event| event.0 + 1), second[0].0);
    assert!(first.first().is_none_or(|event| event.0 == 0) && goes_on <= ended, "none is left out: {ended}, {goes_on}");
    assert!(second.iter().any(|(_, name, stage)| name == "stage_died" && stage == "tape"));
}

#[test]
fn a_storm_of_one_stage_hides_no_error_of_another_and_costs_the_chain_nothing() {
    let (run, child) = running("fast", &[("--events", "e.jsonl")]);
    let instance = Instance::named(&run.instance).unwrap();
    let page = |stage| PageMap::open(&Plan::page_path(&instance, stage)).unwrap();
    let (stormy, calm) = (page("clusterer"), page("classifier"));
    let said = |id, a| Said { id, time_ns: runtime::clock::now_ns(), sweep: 0, a, b: 0 };
    let (mut storm, mut grave) = (0, 0);
    // About ten thousand a second.
    for turn in 0..1_000 {
        for _ in 0..10 {
            stormy.say(said(EventId::BudgetOverrun, 1));
            storm += 1;
        }
        if turn % 100 == 50 {
            calm.say(said(EventId::PartsLost, turn));
            grave += 1;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    stormy.say(said(EventId::BudgetOverrun, 3_600_000_000));
    storm += 1;
    run.wait_for_more(2);
    std::thread::sleep(Duration::from_millis(1_500));
    let (finished, dir) = stop(run, child);
    let finished = finished.expect_code(0);
    assert!(finished.is_closed() && finished.missing() == 0);
    let events = lines(&dir.path().join("e.jsonl"));
    expect_no_gap(&events);
    let of = |name: &str, stage: &str| {
        let fits = move |event: &&Value| event["name"] == name && event["stage"] == stage;
        events.iter().filter(fits).collect::<Vec<_>>()
    };
    assert_eq!(of("parts_lost", "classifier").len(), grave, "not one error is hidden");
    let overruns = of("budget_overrun", "clusterer");
    assert!(overruns.iter().any(|event| event["text"].as_str().unwrap().contains("3600000000")), "nor the worst");
    assert!(overruns.len() < 200, "{} lines", overruns.len());
    // What was not said was counted, by the supervisor or by the ring.
    let unsaid: u64 = events.iter().map(|event| event["unsaid"].as_u64().unwrap()).sum();
    let first_number =
        |event: &&Value| event["text"].as_str().unwrap().split(' ').next().unwrap().parse::<u64>().unwrap();
    let unread: u64 = of("events_unread", "clusterer").iter().map(first_number).sum();
    assert!(overruns.len() as u64 + unsaid + unread >= storm, "{} + {unsaid} + {unread}", overruns.len());
    assert_eq!(finished.report["events"]["unsaid"], unsaid);
}

#[test]
fn the_log_can_be_asked_for_while_the_chain_runs_and_afterwards() {
    let (run, child) = running("fast", &[("--events", "e.jsonl")]);
    let ask = |args: &[&str]| {
        let output = encke().args(["ctl", "events"]).args(args).output().unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let of_run = ["--instance", run.instance.as_str()];
    let all = ask(&of_run);
    assert!(all.contains("run_began: all processes are up") && all.starts_with("     0  "), "{all}");
    let since = ask(&[&of_run[..], &["--since", "3", "--json"]].concat());
    let first: Value = serde_json::from_str(since.lines().next().unwrap()).unwrap();
    assert_eq!(first["number"], 3);
    assert_eq!(ask(&[&of_run[..], &["--severity", "critical"]].concat()), "");
    let mut follower = encke();
    follower.args(["ctl", "events", "--follow", "--severity", "error"]);
    let mut follower = follower.args(of_run).stdout(Stdio::piped()).spawn().unwrap();
    run.inject(&["kill", "classifier"]);
    let mut line = String::new();
    let mut out = BufReader::new(follower.stdout.take().unwrap());
    out.read_line(&mut line).unwrap();
    assert!(line.contains("error") && line.contains("stage_died"), "{line}");
    let (_, dir) = stop(run, child);
    assert!(follower.wait().unwrap().success(), "it ends with the chain");
    let kept = ask(&["--file", dir.path().join("e.jsonl").to_str().unwrap()]);
    assert!(kept.starts_with(&all) && kept.contains("run_ends"), "{kept}");
    for (args, why) in [
        (vec!["ctl", "events", "--file", "/nowhere/e.jsonl"], "/nowhere/e.jsonl"),
        (vec!["ctl", "stop", "--follow"], "are for `encke ctl events`"),
        (vec!["run", "--events", "/nowhere/e.jsonl"], "--events /nowhere/e.jsonl: cannot be written"),
    ] {
        let output = encke().args(&args).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(text(&output.stderr).contains(why), "{}", text(&output.stderr));
    }
}

#[test]
fn the_dictionary_in_the_documents_is_that_of_the_code() {
    let output = encke().args(["ctl", "events", "--dictionary"]).output().unwrap();
    let kept = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/events.md")).unwrap();
    assert_eq!(text(&output.stdout), kept, "write it anew: encke ctl events --dictionary > docs/events.md");
    let output = encke().args(["ctl", "events", "--dictionary", "--json"]).output().unwrap();
    let all: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(all.len(), events::DICTIONARY.len());
    assert!(all.iter().any(|entry| entry["severity"] == serde_json::to_value(Severity::Critical).unwrap()));
}

/// What a server answers to a request.
fn http(address: &str, request: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(100))).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn prometheus_gets_the_counters_of_the_status_and_a_scraper_that_hangs_costs_nothing() {
    let (run, child) = running("fast", &[]);
    let mut metrics = encke();
    metrics.args(["metrics", "--listen", "127.0.0.1:0", "--instance", &run.instance]);
    let mut metrics = metrics.stdout(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(metrics.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().trim_start_matches("http://").trim_end_matches("/metrics").to_owned();
    let _hanging: Vec<TcpStream> = (0..3).map(|_| TcpStream::connect(&address).unwrap()).collect();
    let before = run.status().unwrap();
    let answer = http(&address, "GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n");
    let after = run.status().unwrap();
    assert!(answer.starts_with("HTTP/1.1 200 OK\r\nContent-Type: text/plain; version=0.0.4"), "{answer}");
    for (place, stage) in
        ["source", "clusterer", "extractor", "classifier", "tracker", "recorder"].into_iter().enumerate()
    {
        let name = format!("encke_parts_published_total{{stage=\"{stage}\"}} ");
        let seen: u64 = answer.lines().find_map(|line| line.strip_prefix(&name)).unwrap().parse().unwrap();
        let [first, last] = [&before, &after].map(|status| status["stages"][place]["published"].as_u64().unwrap());
        assert!((first..=last).contains(&seen), "{stage}: {first} {seen} {last}");
    }
    assert!(answer.contains("encke_events_total{name=\"run_began\",severity=\"info\"} 1\n"), "{answer}");
    assert!(http(&address, "POST /metrics HTTP/1.1\r\n\r\n").starts_with("HTTP/1.1 405 "));
    let (finished, _dir) = stop(run, child);
    assert!(finished.is_closed() && finished.missing() == 0);
    assert!(http(&address, "GET /metrics HTTP/1.1\r\n\r\n").ends_with("encke_up 0\n"));
    support::kill(metrics.id().into());
    metrics.wait().unwrap();
    let output = encke().args(["metrics", "--listen", "0.0.0.0:0"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("must be a loopback address, or come with --anywhere"));
}

#[test]
fn the_status_has_every_counter_with_its_unit() {
    let (run, child) = running("realtime", &[]);
    run.wait_for(|status| status["latency_ms"].is_number());
    let status = run.status().unwrap();
    let stage = &status["stages"][1];
    for key in
        ["received", "processed", "published", "dropped", "lost", "overruns", "slips", "late", "restarts", "queue"]
    {
        assert!(stage[key].is_u64(), "{key} of {stage}");
    }
    assert!(stage["rejected"].is_object() && stage["tier"] == "configured", "{stage}");
    assert!(stage["cpu_s"].is_number() && stage["rss_mib"].as_f64().unwrap() > 1.0, "{stage}");
    assert!(status["stages"][0]["queue"].is_null());
    let (finished, _dir) = stop(run, child);
    assert!(finished.is_closed());
}
