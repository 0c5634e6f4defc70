//! Viewers of a running chain: they see what it counts, and it does not see them.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Stdio};
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
    let mut child = encke()
        .args(["live", "--port", "0", "--instance", &run.instance])
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
