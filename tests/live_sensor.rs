//! A live sensor in the place of a recording: its packets over a real socket, into the running chain.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::net::UdpSocket;
use std::time::Duration;

use support::{Run, encke, text};

/// Payloads of the capture's data packets, in order. A classic capture of Ethernet frames without options: 24 bytes of
/// header, 16 before each record, 42 before each payload.
fn packets(capture: &[u8]) -> Vec<&[u8]> {
    let (mut at, mut packets) = (24, Vec::new());
    while let Some(length) = capture.get(at + 8..at + 12) {
        let length = u32::from_le_bytes(length.try_into().unwrap()) as usize;
        let record = &capture[at + 16..at + 16 + length];
        if record.len() == 42 + 1206 {
            packets.push(&record[42..]);
        }
        at += 16 + length;
    }
    packets
}

fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

#[test]
fn a_live_sensor_gives_the_detections_of_its_capture() {
    let Some(path) = support::recorded("hdl32e/monterey_hdl32e.pcap") else { return };
    let capture = std::fs::read(&path).unwrap();
    let recorded =
        Run::new(&["--from", path.to_str().unwrap(), "--sweeps", "8", "--pace", "fast"]).finish().expect_code(0);
    // Nothing is left out, however late this machine is.
    let (_dir, chain) = support::chain_with(&[
        (support::LADDER, support::NO_LADDER),
        ("queue_sweeps = 4", "queue_sweeps = 40"),
        ("allowed_age_ms = 1000.0", "allowed_age_ms = 60000.0"),
    ]);
    let port = free_port();
    let from = format!("udp://127.0.0.1:{port}");
    let run = Run::new(&["--from", &from, "--sweeps", "8", "--chain", &chain]);
    let child = run.start();
    run.wait_for(|status| status["stages"].as_array().unwrap().iter().all(|stage| stage["state"] == "running"));
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    for packet in packets(&capture).into_iter().take(1_500) {
        sender.send_to(packet, ("127.0.0.1", port)).unwrap();
        // Between the sensor's own 553 µs and a little more.
        std::thread::sleep(Duration::from_micros(550));
    }
    // What is no packet does no harm.
    for junk in [&b""[..], &[0xFF; 1206], &[0; 9_000]] {
        sender.send_to(junk, ("127.0.0.1", port)).unwrap();
    }
    let live = run.collect(child).expect_code(0);
    assert_eq!((live.is_closed(), live.missing()), (true, 0), "{}", live.stdout());
    assert_eq!(live.sweeps(), (0..8).collect::<Vec<_>>());
    for (live, recorded) in live.detections.iter().zip(&recorded.detections) {
        // A packet does not say its hour; all else is the same.
        for key in ["sweep", "complete", "returns", "detections"] {
            assert_eq!(live[key], recorded[key], "{key} of sweep {}", recorded["sweep"]);
        }
    }
}

#[test]
fn a_silent_sensor_keeps_the_chain_waiting_until_it_is_stopped() {
    let from = format!("udp://127.0.0.1:{}", free_port());
    let run = Run::new(&["--from", &from]);
    let child = run.start();
    run.wait_for(|status| status["stages"][0]["state"] == "running");
    std::thread::sleep(Duration::from_secs(1));
    assert_eq!(run.status().unwrap()["sweep"], 0);
    let stop = encke().args(["ctl", "stop", "--instance", &run.instance]).status().unwrap();
    assert!(stop.success());
    let run = run.collect(child).expect_code(0);
    assert!(run.is_closed() && run.sweeps().is_empty());
}

#[test]
fn an_address_that_will_not_do_is_refused_in_one_line() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let taken = format!("udp://{}", taken.local_addr().unwrap());
    for (args, says) in [
        (vec!["--from", "udp://nowhere"], "must be udp://"),
        (vec!["--from", "udp://0.0.0.0:2368"], "names no sender"),
        (vec!["--from", taken.as_str()], "in use"),
        (vec!["--from", "udp://127.0.0.1:0", "--pace", "fast"], "--pace is not for live sensors"),
        (vec!["--from", "udp://127.0.0.1:0", "--loop"], "--loop is not for live sensors"),
    ] {
        let output = encke().arg("run").args(&args).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        let said = text(&output.stderr);
        assert!(said.lines().count() == 1 && said.contains(says), "{args:?}: {said}");
    }
}
