//! A live sensor in the place of a recording: its packets over a real socket, into the running chain.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod support;

use std::net::UdpSocket;
use std::process::Stdio;
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

/// Packets as an early VLP-16 sends them at 10 Hz, which carry the HDL-32E's factory byte: 1327 µs apart, 4.8° each.
fn of_a_vlp_16(count: u32) -> Vec<Vec<u8>> {
    let packet = |number: u32| {
        let mut bytes = vec![0; 1_206];
        for block in 0..12 {
            let at = block as usize * 100;
            bytes[at..at + 2].copy_from_slice(&[0xFF, 0xEE]);
            let azimuth_cdeg = (number * 480 + block * 40) % 36_000;
            bytes[at + 2..at + 4].copy_from_slice(&(azimuth_cdeg as u16).to_le_bytes());
            bytes[at + 4..at + 100].fill(9);
        }
        bytes[1_200..1_204].copy_from_slice(&(number * 1_327).to_le_bytes());
        bytes[1_204..].copy_from_slice(&[0x37, 0x21]);
        bytes
    };
    (0..count).map(packet).collect()
}

#[test]
fn a_sensor_of_another_kind_is_refused_before_anything_starts_or_left_out_where_it_comes_later() {
    let port = free_port();
    let from = format!("udp://127.0.0.1:{port}");
    let packets = of_a_vlp_16(1_000);
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    let send = |packet: &Vec<u8>| {
        // Nobody may be listening.
        let _ = sender.send_to(packet, ("127.0.0.1", port));
        std::thread::sleep(Duration::from_micros(1_300));
    };
    // Sends until the run has ended.
    let read_as = |sensor: &str| {
        let mut command = encke();
        command.args(["run", "--sweeps", "2", "--from", &from, "--sensor", sensor]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut all = packets.iter().cycle();
        while child.try_wait().unwrap().is_none() {
            all.next().into_iter().for_each(send);
        }
        let output = child.wait_with_output().unwrap();
        (output.status.code(), text(&output.stderr))
    };
    let (code, said) = read_as("hdl-32e");
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("its data packets are 1327 us apart, those of hdl-32e 553 us") && said.lines().count() == 1);
    // The remedy is one.
    let (code, said) = read_as("vlp-16");
    assert_eq!(code, Some(0), "{said}");

    let run = Run::new(&["--from", &from, "--sensor", "hdl-32e"]);
    let child = run.start();
    run.wait_for(|status| status["stages"].as_array().unwrap().iter().all(|stage| stage["state"] == "running"));
    packets[..500].iter().for_each(send);
    assert_eq!(run.status().unwrap()["sweep"], 0, "six turns, and no sweep of them");
    run.ctl(&["stop"]);
    let run = run.collect(child).expect_code(0);
    let said = run.stderr();
    assert!(said.contains("data packets that are 1327 us apart, those of hdl-32e 553 us"), "{said}");
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
