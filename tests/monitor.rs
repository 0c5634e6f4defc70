//! Viewers of a running chain: they see what it counts, and it does not see them.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use support::{Finished, LADDER, NO_LADDER, Run, chain_with, encke, text};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// A chain that runs until it is told to stop, and has begun. It leaves nothing out, however busy the machine is.
fn running(pace: &str) -> (Run, Child) {
    let (config, chain) = chain_with(&[(LADDER, NO_LADDER)]);
    let run = Run::new(&["--duration", "forever", "--pace", pace, "--chain", &chain]);
    let child = run.start();
    run.wait_for_sweeps(5);
    drop(config);
    (run, child)
}

fn stop(run: Run, child: Child) -> Finished {
    let stopped = encke().args(["ctl", "stop", "--instance", &run.instance]).output().unwrap();
    assert!(stopped.status.success(), "{}", text(&stopped.stderr));
    run.collect(child).expect_code(0)
}

/// `encke live` on a chain, and its address.
fn live(run: &Run) -> (Child, String) {
    serving(run, &["live", "--port", "0"])
}

/// A command that looks at a chain and serves what it sees, and its address.
fn serving(run: &Run, command: &[&str]) -> (Child, String) {
    let mut child = encke()
        .args(command)
        .args(["--instance", &run.instance])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    out.read_line(&mut line).unwrap();
    // Open until its end: the account still comes.
    child.stdout = Some(out.into_inner());
    (child, line.trim().to_owned())
}

fn signal(child: &Child, signal: Signal) {
    kill_process(Pid::from_raw(child.id() as i32).unwrap(), signal).unwrap();
}

/// A viewer that has subscribed to channels 1 to 6 under the same numbers.
fn viewer(address: &str) -> WebSocket<MaybeTlsStream<TcpStream>> {
    let mut request = address.into_client_request().unwrap();
    request.headers_mut().insert("sec-websocket-protocol", "foxglove.sdk.v1".parse().unwrap());
    let (mut viewer, _) = tungstenite::connect(request).unwrap();
    if let MaybeTlsStream::Plain(stream) = viewer.get_ref() {
        stream.set_read_timeout(Some(Duration::from_secs(100))).unwrap();
    }
    let each = (1..=6).map(|id| format!(r#"{{"id":{id},"channelId":{id}}}"#)).collect::<Vec<_>>().join(",");
    viewer.send(Message::text(format!(r#"{{"op":"subscribe","subscriptions":[{each}]}}"#))).unwrap();
    viewer
}

/// The next message: its subscription, its sensor time, its payload.
fn data(viewer: &mut WebSocket<MaybeTlsStream<TcpStream>>) -> (u32, u64, Vec<u8>) {
    loop {
        if let Message::Binary(frame) = viewer.read().unwrap() {
            assert_eq!(frame[0], 1);
            let subscription = u32::from_le_bytes(frame[1..5].try_into().unwrap());
            return (subscription, u64::from_le_bytes(frame[5..13].try_into().unwrap()), frame[13..].to_vec());
        }
    }
}

/// A snapshot, and the status before and after it.
fn top(run: &Run) -> [Value; 3] {
    let before = run.status().unwrap();
    let output = encke().args(["top", "--once", "--json", "--instance", &run.instance]).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    [before, serde_json::from_slice(&output.stdout).unwrap(), run.status().unwrap()]
}

#[test]
fn top_shows_the_stages_and_counts_that_the_status_has() {
    let (run, child) = running("realtime");
    // On a busy machine no sweep may be answered while it looks.
    let looks = (0..50).map(|_| top(&run));
    let [before, view, after] =
        looks.into_iter().find(|[_, view, _]| view["latency"]["p99_ms"].is_number()).expect("an answered sweep");
    assert_eq!((&view["instance"], &view["sectors"]), (&run.instance.as_str().into(), &after["sectors"]));
    for place in 0..5 {
        let (first, seen, last) = (&before["stages"][place], &view["stages"][place], &after["stages"][place]);
        for key in ["stage", "pid", "state", "restarts"] {
            assert_eq!(seen[key], last[key], "{key} of {seen}");
        }
        for key in ["received", "published"] {
            let [first, seen, last] = [first, seen, last].map(|stage| stage[key].as_u64().unwrap());
            assert!((first..=last).contains(&seen), "{key}: {first} {seen} {last}");
        }
    }
    assert!(view["detections"]["rows"].as_array().unwrap().iter().any(|row| row["p"].is_number()), "{view}");
    assert!(view["tracks"]["states"].as_array().unwrap().len() == 3, "{view}");
    assert!(view["tap"]["parts"].as_u64().unwrap() > 0);
    let finished = stop(run, child);
    assert!(finished.is_closed());
}

#[test]
fn top_without_a_chain_says_so_and_does_not_start() {
    let output = encke().args(["top", "--instance", "nobody-here"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("no instance \"nobody-here\" is running"), "{}", text(&output.stderr));
}

#[test]
fn a_viewer_gets_sweeps_clusters_obstacles_tracks_and_status_and_ends_with_the_chain() {
    let (run, child) = running("realtime");
    let (mut server, address) = live(&run);
    let mut viewer = viewer(&address);
    let mut times: [Vec<u64>; 7] = Default::default();
    while [1, 2, 3, 6].iter().any(|&channel: &usize| times[channel].len() < 2) || times[5].is_empty() {
        let (channel, time_ns, payload) = data(&mut viewer);
        assert!(!payload.is_empty());
        if channel == 5 {
            let status: Value = serde_json::from_slice(&payload).unwrap();
            assert_eq!(status["instance"], run.instance.as_str());
        }
        times[channel as usize].push(time_ns);
    }
    for channel in [1, 2, 3, 6] {
        assert!(times[channel].windows(2).all(|pair| pair[0] < pair[1]), "sweeps come once and in order");
    }
    let finished = stop(run, child);
    assert!(finished.is_closed(), "{}", finished.stdout());
    // It ends by itself, and closes the connection in order.
    while viewer.read().is_ok() {}
    assert_eq!(server.wait().unwrap().code(), Some(0));
}

#[test]
fn viewers_that_stand_still_or_die_cost_the_chain_nothing() {
    let (run, child) = running("fast");
    let (mut stopped, address) = live(&run);
    let frozen = viewer(&address);
    let (mut killed, _) = live(&run);
    run.wait_for_more(5);
    signal(&stopped, Signal::STOP);
    signal(&killed, Signal::KILL);
    killed.wait().unwrap();
    // Far more than a queue holds. At this pace the chain loses nothing by itself.
    run.wait_for_more(15);
    signal(&stopped, Signal::CONT);
    run.wait_for_more(5);
    signal(&stopped, Signal::TERM);
    assert_eq!(stopped.wait().unwrap().code(), Some(0));
    drop(frozen);
    let finished = stop(run, child);
    assert!(finished.is_closed() && finished.missing() == 0, "{}", finished.stdout());
}

/// Its exit code and what it said on stderr. One that does not end is a failure, not a long test.
fn ended(mut child: Child) -> (Option<i32>, String) {
    for _ in 0..1_500 {
        if child.try_wait().unwrap().is_some() {
            let output = child.wait_with_output().unwrap();
            return (output.status.code(), text(&output.stderr));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    panic!("it did not end within 30 s");
}

/// Whether SIGHUP is ignored here, and so by all that is started (signal(7)): under nohup(1) nothing is to end by it.
fn is_under_nohup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    u64::from_str_radix(ignored.trim(), 16).unwrap() & 1 == 1
}

const SERVING: [&[&str]; 3] = [&["live", "--port", "0"], &["metrics", "--listen", "127.0.0.1:0"], &["view", "--live"]];

// verifies MON-018
#[test]
fn a_viewer_leaves_in_order_when_asked_or_when_its_terminal_closes() {
    let (run, child) = running("fast");
    for command in SERVING {
        for by in [Signal::HUP, Signal::INT, Signal::TERM] {
            if by == Signal::HUP && is_under_nohup() {
                continue;
            }
            let (viewer, _) = serving(&run, command);
            signal(&viewer, by);
            let (code, said) = ended(viewer);
            assert_eq!(code, Some(0), "{command:?} by {by:?}: {said}");
            assert!(!said.contains("has ended"), "the chain goes on: {said}");
        }
    }
    let (view, _) = serving(&run, &["view", "--live"]);
    let (waiting, _) = serving(&run, &["live", "--port", "0", "--wait"]);
    stop(run, child);
    let (code, said) = ended(view);
    assert!(code == Some(0) && said.contains("the chain has ended"), "{said}");
    // Also while it waits for the chain's next start. It looks for the supervisor all the time.
    std::thread::sleep(Duration::from_millis(500));
    signal(&waiting, Signal::TERM);
    assert_eq!(ended(waiting).0, Some(0));
}

// verifies MON-018
#[test]
fn top_leaves_in_order_when_its_terminal_closes() {
    if Command::new("script").arg("--version").output().is_err() {
        return eprintln!("skipped: no script(1) here, which has terminals");
    }
    let (run, child) = running("fast");
    let (code, shown) = (run.dir.path().join("code"), run.dir.path().join("shown"));
    // The shell outlives the terminal, and its trap does not pass to what it starts.
    let top = format!(
        "trap : HUP; stty rows 40 columns 140; {} top --instance {}; echo $? > {}",
        env!("CARGO_BIN_EXE_encke"),
        run.instance,
        code.display()
    );
    let mut terminal = Command::new("script");
    terminal.args(["-qfc", &top]).arg(&shown).env("SHELL", "/bin/sh").env("TERM", "xterm").stdin(Stdio::piped());
    let mut terminal = terminal.stdout(Stdio::null()).spawn().unwrap();
    let until = |what: &str, holds: &dyn Fn() -> bool| {
        for _ in 0..1_500 {
            if holds() {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("not within 30 s: {what}");
    };
    until("top shows the chain", &|| std::fs::read(&shown).is_ok_and(|shown| text(&shown).contains("tracker")));
    terminal.kill().unwrap();
    terminal.wait().unwrap();
    until("top has left", &|| std::fs::read_to_string(&code).is_ok_and(|code| code.ends_with('\n')));
    assert_eq!(std::fs::read_to_string(&code).unwrap(), "0\n");
    stop(run, child);
}

#[test]
fn a_chain_ends_in_order_with_its_terminal_but_not_under_nohup() {
    let ignoring = |command: Command| {
        let mut shell = Command::new("sh");
        shell.args(["-c", "trap '' HUP; exec \"$0\" \"$@\""]).arg(command.get_program()).args(command.get_args());
        shell
    };
    let run = Run::new(&["--duration", "forever", "--pace", "fast"]);
    let child = run.start_with(ignoring);
    run.wait_for_sweeps(5);
    let stage = run.status().unwrap()["stages"][1]["pid"].as_u64().unwrap();
    signal(&child, Signal::HUP);
    kill_process(Pid::from_raw(stage as i32).unwrap(), Signal::HUP).unwrap();
    run.wait_for_more(10);
    let finished = stop(run, child);
    assert_eq!(finished.process("clusterer")["restarts"], 0);
    if is_under_nohup() {
        return eprintln!("skipped: what is started under nohup is not to end with its terminal");
    }

    let (run, child) = running("fast");
    signal(&child, Signal::HUP);
    let finished = run.collect(child).expect_code(0);
    assert!(finished.is_closed() && finished.stdout().contains("ledger closed"), "{}", finished.stdout());
}
