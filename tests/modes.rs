//! Modes of the running chain: commanded, in effect within two sweeps, and nothing lost on the way.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::net::UdpSocket;
use std::time::Duration;

use runtime::clock;
use supervisor::{Command, Word};
use support::{Finished, Run, chain_with};
use transport::Instance;

/// A ladder on which no trouble takes a step, so that modes change by command alone.
const STILL_LADDER: [(&str, &str); 2] =
    [("troubled_sweeps = 3", "troubled_sweeps = 1000"), ("within_sweeps = 10", "within_sweeps = 1000")];

fn commanded(run: &Run, word: Word) {
    let instance = Instance::named(&run.instance).unwrap();
    loop {
        let answer = supervisor::command(&instance, &Command::of(word)).unwrap();
        if answer.accepted {
            return;
        }
        assert!(answer.text.contains("commands in a second"), "{word:?}: {}", answer.text);
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Waits until the mode that was asked for last is in effect.
fn in_effect(run: &Run, mode: &str) {
    let instance = Instance::named(&run.instance).unwrap();
    let arrived = clock::wait_for(10_000_000_000, || {
        let status = supervisor::status(&instance).unwrap();
        assert_eq!(status.mode, mode);
        status.mode_took_ms.is_some()
    });
    assert!(arrived, "{mode} is stuck: {:?}", run.status());
}

fn stop(run: Run, child: std::process::Child, code: i32) -> Finished {
    run.ctl(&["stop"]);
    let run = run.collect(child).expect_code(code);
    assert!(run.is_closed(), "{}", run.stdout());
    run
}

/// Changes of mode in the test below; `ENCKE_MODE_CHANGES=10000` makes a campaign of it.
fn mode_changes() -> u64 {
    std::env::var("ENCKE_MODE_CHANGES").map_or(200, |changes| changes.parse().unwrap())
}

#[test]
fn hundreds_of_mode_changes_take_effect_within_two_sweeps_each_and_none_is_stuck() {
    let (_dir, chain) = chain_with(&STILL_LADDER);
    let run = Run::new(&[
        "--duration",
        "forever",
        "--rate",
        "10",
        "--from",
        "config/scenes/single.toml",
        "--chain",
        chain.as_str(),
    ]);
    // Nobody reads what it says before its end, and on a busy machine it has more to say than a pipe holds: nobody waits for that.
    let child = run.start();
    run.wait_for_sweeps(5);
    let walk = [
        (Word::Pause, "paused"),
        (Word::Resume, "nominal"),
        (Word::Safe, "safe"),
        (Word::Pause, "paused"),
        (Word::Resume, "safe"),
        (Word::Resume, "nominal"),
        (Word::Degrade, "degraded"),
        (Word::Safe, "safe"),
        (Word::Resume, "nominal"),
    ];
    for &(word, mode) in walk.iter().cycle().take(mode_changes() as usize) {
        commanded(&run, word);
        in_effect(&run, mode);
    }
    let run = stop(run, child, 0);
    // At a hundred sweeps a second a busy machine drops more than the ledger keeps by name: the latest 128 gaps of a stage.
    let gaps = run.report["ledger"]["gaps"].as_array().unwrap();
    if gaps.iter().all(|gap| gaps.iter().filter(|other| other["stage"] == gap["stage"]).count() < 128) {
        run.expect_every_sweep_accounted_for();
    }
    let modes = &run.report["modes"];
    println!("{modes}");
    assert_eq!((modes["changes"].as_u64().unwrap(), modes["late"].as_u64().unwrap()), (mode_changes(), 0), "{modes}");
}

#[test]
fn a_pause_longer_than_any_patience_loses_and_doubles_nothing_at_fast_pace() {
    let args = ["--from", "config/scenes/box.toml", "--sweeps", "400", "--pace", "fast"];
    let plain = Run::new(&args).finish().expect_code(0);
    let run = Run::new(&args);
    let child = run.start();
    run.wait_for_sweeps(2);
    for pause_s in [6, 0] {
        run.ctl(&["pause"]);
        run.wait_for_mode("paused");
        let before = run.status().unwrap()["sweep"].as_u64().unwrap();
        std::thread::sleep(Duration::from_secs(pause_s));
        assert_eq!(run.status().unwrap()["sweep"].as_u64().unwrap(), before, "nothing is sent");
        run.ctl(&["resume"]);
        run.wait_for_sweeps(before + 2);
    }
    let paused = run.collect(child).expect_code(0);
    assert_eq!(paused.missing(), 0);
    assert_eq!(plain.bytes, paused.bytes);
}

#[test]
fn after_a_pause_at_the_sensors_pace_the_next_sweep_follows_and_nobody_catches_up() {
    let run = Run::new(&["--sweeps", "40"]);
    let child = run.start();
    run.wait_for_sweeps(5);
    run.ctl(&["pause"]);
    run.wait_for_mode("paused");
    let before = run.status().unwrap()["sweep"].as_u64().unwrap();
    std::thread::sleep(Duration::from_secs(3));
    let status = run.status().unwrap();
    assert_eq!(status["sweep"].as_u64().unwrap(), before, "nothing is sent");
    for stage in status["stages"].as_array().unwrap() {
        assert!(stage["heartbeat_age_ms"].as_f64().unwrap() < 1_500.0, "all processes are awake: {stage}");
    }
    run.ctl(&["resume"]);
    run.wait_for_mode("nominal");
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed(), "{}", run.stdout());
    run.expect_every_sweep_accounted_for();
    assert_eq!(run.report["sweeps"], 40);
    let times: Vec<u64> = run.detections.iter().map(|line| line["sensor_time_ns"].as_u64().unwrap()).collect();
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]));
    // Whoever caught up would be three seconds late, by the sensor's clock before the pause.
    let max_ms = run.report["latency_ms"]["end_to_end"]["max"].as_f64().unwrap();
    assert!(max_ms < 2_500.0, "{max_ms}");
}

#[test]
fn a_chain_that_is_paused_can_be_stopped_and_restarted() {
    let run = Run::new(&["--duration", "forever"]);
    let child = run.start();
    run.wait_for_sweeps(3);
    run.ctl(&["pause"]);
    run.wait_for_mode("paused");
    run.ctl(&["restart", "source"]);
    run.wait_for(|status| {
        let source = &status["stages"][0];
        source["restarts"] == 1 && source["state"] == "running"
    });
    let before = run.status().unwrap()["sweep"].as_u64().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(run.status().unwrap()["sweep"].as_u64().unwrap(), before, "a successor stands still, too");
    run.ctl(&["resume"]);
    run.wait_for_sweeps(before + 3);
    run.ctl(&["pause"]);
    run.wait_for_mode("paused");
    let run = stop(run, child, 0);
    run.expect_every_sweep_accounted_for();
    assert_eq!(run.report["mode"], "paused");
}

#[test]
fn safe_mode_locates_obstacles_and_resume_brings_their_classes_back() {
    let (_dir, chain) = chain_with(&STILL_LADDER);
    let run = Run::new(&["--duration", "forever", "--chain", &chain]);
    let child = run.start();
    run.wait_for_sweeps(3);
    for (word, mode) in [("safe", "safe"), ("resume", "nominal"), ("degrade", "degraded"), ("resume", "nominal")] {
        run.ctl(&[word]);
        run.wait_for_mode(mode);
        run.wait_for_more(4);
    }
    let run = stop(run, child, 0);
    let mut steps: Vec<&str> = run.detections.iter().map(|line| line["step"].as_str().unwrap_or("nominal")).collect();
    steps.dedup();
    assert_eq!(steps, ["nominal", "clusters-only", "nominal", "fewer-starts", "nominal"]);
    for line in &run.detections {
        let detections = line["detections"].as_array().unwrap();
        assert!(line["complete"] != true || !detections.is_empty(), "obstacles are located in any mode: {line}");
        let classified = detections.iter().any(|detection| detection["class"] != "unclassified");
        assert_eq!(classified, line["step"] != "clusters-only" && line["complete"] == true, "{line}");
    }
    let safe = &run.report["safe_entered"];
    assert_eq!((safe["by"].as_str(), safe["reason"].as_str()), (Some("command"), Some("by command")));
}

#[test]
fn what_a_live_sensor_sends_during_a_pause_is_discarded() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("sweeps.pcap");
    let simulate = ["simulate", "--scene", "config/scenes/box.toml", "--sweeps", "60", "--out", file.to_str().unwrap()];
    assert!(support::encke().args(simulate).status().unwrap().success());
    let packets = payloads(&std::fs::read(&file).unwrap());
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let port = socket.local_addr().unwrap().port();
    drop(socket);
    let sensor = ["--sensor", "hdl-32e-paper"]; // the scene's
    let run = Run::new(&[&["--from", &format!("udp://127.0.0.1:{port}")][..], &sensor].concat());
    let child = run.start();
    run.wait_for(|status| status["stages"].as_array().unwrap().iter().all(|stage| stage["state"] == "running"));
    let run = std::thread::scope(|scope| {
        scope.spawn(|| {
            let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
            let start_ns = clock::now_ns();
            for (after_ns, packet) in &packets {
                clock::sleep_until_ns(start_ns + after_ns);
                sender.send_to(packet, ("127.0.0.1", port)).unwrap();
            }
        });
        run.wait_for_sweeps(5);
        run.ctl(&["pause"]);
        run.wait_for_mode("paused");
        std::thread::sleep(Duration::from_millis(1_500));
        run.ctl(&["resume"]);
        run.wait_for_mode("nominal");
        run.wait_for_more(5);
        run
    });
    let run = stop(run, child, 0);
    let numbers: Vec<u64> = (0..run.report["sweeps"].as_u64().unwrap()).collect();
    assert_eq!(run.sweeps(), numbers, "every sweep that was seen has a line, once");
    // The first and the last, and the first after the pause, were not seen from wrap to wrap.
    let partial = run.detections.iter().filter(|line| line["complete"] != true).count();
    assert!(partial <= 3, "{partial} partial sweeps");
    let times: Vec<u64> = run.detections.iter().map(|line| line["sensor_time_ns"].as_u64().unwrap()).collect();
    let widest = times.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).max().unwrap();
    assert!(widest > 1_000_000_000, "the pause is a gap in what was sent: {widest} of {times:?}");
}

/// Payloads of a classic capture of Ethernet frames without options, each with its time since the first [ns].
fn payloads(capture: &[u8]) -> Vec<(u64, Vec<u8>)> {
    let (mut at, mut all) = (24, Vec::new());
    let word = |at: usize| u64::from(u32::from_le_bytes(capture[at..at + 4].try_into().unwrap()));
    while at + 16 < capture.len() {
        let (at_ns, length) = (word(at) * 1_000_000_000 + word(at + 4) * 1_000, word(at + 8) as usize);
        all.push((at_ns, capture[at + 16 + 42..at + 16 + length].to_vec()));
        at += 16 + length;
    }
    all.retain(|(_, payload)| payload.len() == 1_206);
    let first_ns = all[0].0;
    all.iter_mut().for_each(|(at_ns, _)| *at_ns -= first_ns);
    all
}
