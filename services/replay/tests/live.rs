//! A live sensor: packets over real sockets on the loopback interface.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use std::net::UdpSocket;
use std::path::Path;

use messages::{Message, Sweep, Truth};
use proptest::prelude::*;
use replay::{Fault, Live, LiveAddress, Options, ReplayError, listen};
use stage::{Next, Source};
use support::{all, assert_true, data, new_sweep, opened, sensors};
use zerocopy::FromZeros;

const CAPTURE: &str = "hdl32e/monterey_hdl32e.pcap";
/// The capture's first hour as a host's clock would say it [ns]: 11 Dec 2012, 22:06:33 UTC.
const HOST_NS: u64 = 1_355_263_593_000_000_000;
/// Packets on their way at most: fewer than the smallest buffer of a socket takes.
const ON_THE_WAY: usize = 32;
/// Calls without a sweep after which none can come: each waits for 20 ms, and the sensor's patience is 0.4 s.
const SILENT_CALLS: usize = 24;

/// Data packets of a classic capture of Ethernet frames.
fn packets(capture: &Path) -> Vec<Vec<u8>> {
    let bytes = std::fs::read(capture).unwrap();
    let (mut at, mut found) = (24, Vec::new());
    while at + 16 < bytes.len() {
        let length = u32::from_le_bytes(bytes[at + 8..at + 12].try_into().unwrap()) as usize;
        let frame = &bytes[at + 16..at + 16 + length];
        found.extend((frame.len() == 42 + 1_206).then(|| frame[42..].to_vec()));
        at += 16 + length;
    }
    found
}

fn listening(address: &str, options: &Options) -> Live {
    listen(&address.parse().unwrap(), options, &sensors, || HOST_NS).unwrap()
}

fn on_loopback() -> Live {
    listening("udp://127.0.0.1:0", &Options::default())
}

/// A socket of this machine that sends to `live`.
fn sender(live: &Live) -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(live.local_addr()).unwrap();
    socket
}

/// Sends datagrams, no more at once than every buffer takes, while `live` is asked for sweeps; then until it is silent.
fn received(live: &mut Live, datagrams: &[Vec<u8>]) -> Vec<Box<Sweep>> {
    let socket = sender(live);
    let traffic = live.traffic().clone();
    let (mut sent, mut sweeps, mut silent) = (0, Vec::new(), 0);
    let mut truth = Truth::new_box_zeroed().unwrap();
    while silent < SILENT_CALLS {
        let most = datagrams.len().min(sent + ON_THE_WAY).min(traffic.arrived() as usize + ON_THE_WAY);
        for datagram in &datagrams[sent.min(most)..most] {
            socket.send(datagram).unwrap();
            sent += 1;
        }
        let mut sweep = new_sweep();
        let next = live.next(&mut sweep, &mut truth).unwrap();
        silent = if sent < datagrams.len() || next == Next::Sweep { 0 } else { silent + 1 };
        match next {
            Next::Sweep => {
                assert_true(&sweep);
                sweeps.push(sweep);
            }
            Next::Nothing => assert!(sweep.returns.is_empty() && sweep.columns.is_empty(), "nothing is nothing"),
            Next::End => panic!("a live sensor has no end"),
        }
    }
    sweeps
}

// verifies RPL-028
#[test]
fn packets_over_a_socket_give_the_captures_sweeps_to_the_bit() {
    let Some(capture) = data(CAPTURE) else { return };
    let expected = all(&mut opened(&capture).unwrap());
    let mut live = on_loopback();
    let sweeps = received(&mut live, &packets(&capture));
    assert_eq!(live.faults().found().collect::<Vec<_>>(), []);
    assert_eq!(live.traffic().packets(), 2_702);
    assert_eq!(sweeps.len(), expected.len());
    for (sweep, expected) in sweeps.iter().zip(&expected) {
        assert_eq!(sweep.header, expected.header);
        assert_eq!(sweep.columns[..], expected.columns[..]);
        assert_eq!(sweep.returns[..], expected.returns[..]);
        assert_eq!(sweep.rings[..], expected.rings[..]);
    }
}

// verifies RPL-029
#[test]
fn of_a_burst_every_packet_is_accounted_for() {
    let Some(capture) = data(CAPTURE) else { return };
    let datagrams = packets(&capture);
    let mut live = on_loopback();
    let socket = sender(&live);
    for datagram in &datagrams {
        socket.send(datagram).unwrap();
    }
    let (mut sweeps, mut silent) = (Vec::new(), 0);
    let mut truth = Truth::new_box_zeroed().unwrap();
    // The ring may hold 32 calls' worth of packets.
    while silent < 2 * SILENT_CALLS + 32 {
        let mut sweep = new_sweep();
        match live.next(&mut sweep, &mut truth).unwrap() {
            Next::Sweep => sweeps.push(sweep),
            _ => silent += 1,
        }
    }
    let traffic = live.traffic();
    // The ring holds 2,048 packets; what the socket's buffer could not hold the kernel counts, where it does.
    assert!(traffic.packets() >= 32);
    if Path::new("/proc/net/udp").exists() {
        assert_eq!(traffic.arrived(), datagrams.len() as u64, "{traffic:?}");
    }
    sweeps.iter().for_each(|sweep| assert_true(sweep));
    let received = sweeps.iter().flat_map(|sweep| sweep.columns.iter()).filter(|column| column.valid == 1).count();
    assert!(received as u64 <= 12 * traffic.packets());
    assert_eq!(live.faults().count(Fault::RingFull), traffic.ring_full());
    assert_eq!(live.faults().count(Fault::KernelDrop), traffic.kernel_drops());
}

// verifies RPL-028
#[test]
fn a_silent_sensor_gives_nothing_and_what_it_began_comes_out_incomplete() {
    let Some(capture) = data(CAPTURE) else { return };
    let mut live = on_loopback();
    let (mut sweep, mut truth) = (new_sweep(), Truth::new_box_zeroed().unwrap());
    for _ in 0..30 {
        sweep.clear();
        assert_eq!(live.next(&mut sweep, &mut truth).unwrap(), Next::Nothing);
    }
    live.skip(1_000, &mut sweep, &mut truth).unwrap();
    assert!(live.is_live());
    let datagrams = packets(&capture);
    let first = received(&mut live, &datagrams[..100]);
    assert_eq!(first.iter().map(|sweep| sweep.columns.len()).sum::<usize>(), 1_200);
    assert!(!first.last().unwrap().header.is_complete());
    // It was switched off and on: nothing is made up in between.
    let second = received(&mut live, &datagrams[400..500]);
    assert_eq!(second.iter().map(|sweep| sweep.columns.len()).sum::<usize>(), 1_200);
    assert!(!second[0].header.is_complete());
    assert_eq!(live.faults().found().collect::<Vec<_>>(), []);
}

// verifies RPL-029
#[test]
fn what_is_not_the_sensors_data_is_counted_by_reason_and_left_out() {
    let Some(capture) = data(CAPTURE) else { return };
    let packet = packets(&capture)[0].clone();
    let mut other = packet.clone();
    other[1_205] = 0x28;
    let mixed =
        vec![vec![], vec![1; 512], vec![1; 1_205], vec![1; 1_207], vec![1; 9_000], other.clone(), other, packet];
    let mut live = on_loopback();
    let sweeps = received(&mut live, &mixed);
    assert_eq!(sweeps.iter().map(|sweep| sweep.columns.len()).sum::<usize>(), 12);
    let expected = [(Fault::OtherLength, 5), (Fault::OtherProduct, 2)];
    assert_eq!(live.faults().found().collect::<Vec<_>>(), expected);

    // Another address of the same machine is another sender.
    let mut live = listening("udp://127.0.0.2@127.0.0.1:0", &Options::default());
    assert!(received(&mut live, &mixed).is_empty());
    assert_eq!(live.faults().found().collect::<Vec<_>>(), [(Fault::OtherSender, 8)]);
}

// verifies RPL-028
#[test]
fn a_socket_of_all_addresses_takes_only_the_sender_named() {
    let Some(capture) = data(CAPTURE) else { return };
    let datagrams = packets(&capture);
    let mut live = listening("udp://127.0.0.1@0.0.0.0:0", &Options::default());
    let to = format!("127.0.0.1:{}", live.local_addr().port());
    let stranger = UdpSocket::bind("127.0.0.3:0").unwrap();
    for _ in 0..5 {
        stranger.send_to(&datagrams[0], &to).unwrap();
    }
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    for datagram in &datagrams[..10] {
        socket.send_to(datagram, &to).unwrap();
    }
    let sweeps = received(&mut live, &[]);
    assert_eq!(sweeps.iter().map(|sweep| sweep.columns.len()).sum::<usize>(), 120);
    assert_eq!(live.faults().found().collect::<Vec<_>>(), [(Fault::OtherSender, 5)]);
}

// verifies RPL-028
#[test]
fn ipv6_is_listened_to_where_the_machine_has_it() {
    let Some(capture) = data(CAPTURE) else { return };
    let Ok(socket) = UdpSocket::bind("[::1]:0") else { return };
    let mut live = listening("udp://[::1]:0", &Options::default());
    for datagram in &packets(&capture)[..10] {
        socket.send_to(datagram, live.local_addr()).unwrap();
    }
    let sweeps = received_only(&mut live);
    assert_eq!(sweeps.iter().map(|sweep| sweep.columns.len()).sum::<usize>(), 120);
}

/// Sweeps of what was sent before.
fn received_only(live: &mut Live) -> Vec<Box<Sweep>> {
    let mut truth = Truth::new_box_zeroed().unwrap();
    let mut sweeps = Vec::new();
    for _ in 0..2 * SILENT_CALLS {
        let mut sweep = new_sweep();
        if live.next(&mut sweep, &mut truth).unwrap() == Next::Sweep {
            sweeps.push(sweep);
        }
    }
    sweeps
}

// verifies RPL-028
#[test]
fn a_field_of_view_shows_itself_over_a_socket_too() {
    let Some(mcap) = data("mcap/vlp32c_velodynescan.mcap") else { return };
    let expected = all(&mut opened(&mcap).unwrap());
    let options = Options { sensor: Some("vlp-32c".to_owned()), ..Options::default() };
    let mut live = listening("udp://127.0.0.1:0", &options);
    let sensor = sensors("vlp-32c").unwrap();
    // The same packets out of the sweeps.
    let mut writer = replay::PacketWriter::new(Vec::new(), &sensor, replay::PcapStamps::Micros).unwrap();
    expected.iter().for_each(|sweep| writer.write(sweep).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.pcap");
    std::fs::write(&path, writer.finish().unwrap()).unwrap();
    let sweeps = received(&mut live, &packets(&path));
    let returns: usize = sweeps.iter().map(|sweep| sweep.returns.len()).sum();
    assert_eq!(returns, 131_305);
}

/// Packets of a sensor that turns at 10 Hz, so far apart [µs], with this factory byte.
fn turning(count: u64, step_us: u64, product_id: u8) -> Vec<Vec<u8>> {
    let packet = |number: u64| {
        let mut bytes = vec![0; 1_206];
        for block in 0..12 {
            let at = block as usize * 100;
            bytes[at..at + 2].copy_from_slice(&[0xFF, 0xEE]);
            // 36° in 10 ms.
            let azimuth_cdeg = (number * step_us + block * step_us / 12) * 36_000 / 100_000 % 36_000;
            bytes[at + 2..at + 4].copy_from_slice(&(azimuth_cdeg as u16).to_le_bytes());
            bytes[at + 4..at + 100].fill(9);
        }
        bytes[1_200..1_204].copy_from_slice(&((number * step_us) as u32).to_le_bytes());
        bytes[1_204..].copy_from_slice(&[0x37, product_id]);
        bytes
    };
    (0..count).map(packet).collect()
}

/// Looks at the sensor while a thread sends these again and again, as a sensor does.
fn checked(options: &Options, datagrams: Vec<Vec<u8>>) -> Result<(), ReplayError> {
    let mut live = listening("udp://127.0.0.1:0", options);
    let socket = sender(&live);
    let ends = std::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut all = datagrams.iter().cycle();
            while !ends.load(std::sync::atomic::Ordering::Relaxed) {
                all.next().map(|datagram| socket.send(datagram).unwrap());
                std::thread::sleep(std::time::Duration::from_micros(500));
            }
        });
        let outcome = live.check_sensor();
        ends.store(true, std::sync::atomic::Ordering::Relaxed);
        outcome
    })
}

// verifies RPL-032
#[test]
fn a_sensor_of_another_kind_is_refused_by_what_was_seen_and_its_own_and_a_silent_one_are_not() {
    let vlp_16 = Options { sensor: Some("vlp-16".to_owned()), ..Options::default() };
    // Early ones carry the HDL-32E's factory byte.
    let error = checked(&Options::default(), turning(2_000, 1_327, 0x21)).unwrap_err().to_string();
    let says = ": its data packets are 1327 us apart, those of hdl-32e 553 us; name the right sensor with --sensor";
    assert!(error.starts_with("udp://127.0.0.1:0") && error.ends_with(says), "{error}");
    let error = checked(&Options::default(), turning(2_000, 1_327, 0x22)).unwrap_err().to_string();
    assert!(
        error.ends_with(
            ": its data packets are of vlp-16 (factory byte 0x22), read as hdl-32e; name the right sensor with --sensor"
        ),
        "{error}"
    );
    checked(&vlp_16, turning(2_000, 1_327, 0x21)).unwrap();
    checked(&Options::default(), turning(2_000, 553, 0x21)).unwrap();
    // Very old firmware.
    checked(&Options::default(), turning(2_000, 553, 0x00)).unwrap();
    on_loopback().check_sensor().unwrap();
}

// verifies RPL-032
#[test]
fn packets_of_another_kind_of_sensor_are_left_out_wherever_they_begin() {
    let mut live = on_loopback();
    let others = turning(400, 1_327, 0x21);
    assert!(received(&mut live, &others).is_empty(), "five turns, and no sweep of them");
    // The first nine tell.
    assert_eq!(live.traffic().other_spacing(), 400 - 8);
    let own = received(&mut live, &turning(1_000, 553, 0x21));
    assert!(own.iter().filter(|sweep| sweep.header.is_complete()).count() >= 4, "{}", own.len());
    // Its clock is behind the other's, so it takes some more to tell.
    assert!(live.traffic().other_spacing() < 400 + 20, "{:?}", live.traffic());
    let before = live.traffic().packets();
    assert!(received(&mut live, &others).iter().all(|sweep| !sweep.header.is_complete()));
    assert_eq!(live.traffic().packets(), before + 400);
    assert!(live.faults().count(Fault::OtherSpacing) >= 2 * (400 - 8) - 100);
}

// verifies RPL-028
#[test]
fn a_port_that_is_taken_is_refused_in_one_line() {
    let live = on_loopback();
    let address: LiveAddress = format!("udp://{}", live.local_addr()).parse().unwrap();
    let error = listen(&address, &Options::default(), &sensors, || HOST_NS).err().unwrap();
    assert!(matches!(error, ReplayError::Socket { .. }));
    assert!(error.to_string().starts_with(&format!("{address}: cannot be listened to")), "{error}");
    assert!(!error.to_string().contains('\n'));
}

fn hostile() -> impl Strategy<Value = Vec<Vec<u8>>> {
    let whole = |seed: u16| {
        let mut bytes = vec![0; 1_206];
        for block in 0..12_u16 {
            let at = usize::from(block) * 100;
            bytes[at..at + 2].copy_from_slice(&[0xFF, 0xEE]);
            let azimuth = (seed.wrapping_mul(240).wrapping_add(20 * block)) % 36_000;
            bytes[at + 2..at + 4].copy_from_slice(&azimuth.to_le_bytes());
            bytes[at + 4..at + 100].fill(seed as u8);
        }
        bytes[1_200..1_204].copy_from_slice(&(u32::from(seed) * 553).to_le_bytes());
        bytes[1_204..].copy_from_slice(&[0x37 + (seed % 3) as u8, 0x21]);
        bytes
    };
    let mutated =
        (0..400_u16, proptest::collection::vec((0..1_206_usize, any::<u8>()), 0..8)).prop_map(move |(seed, flips)| {
            let mut bytes = whole(seed);
            flips.into_iter().for_each(|(at, value)| bytes[at] = value);
            bytes
        });
    let random = proptest::collection::vec(any::<u8>(), 1_206);
    let other = proptest::collection::vec(any::<u8>(), 0..1_500);
    proptest::collection::vec(prop_oneof![6 => mutated, 2 => random, 1 => other], 0..60)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    // verifies RPL-029
    #[test]
    fn no_datagrams_break_it(datagrams in hostile()) {
        let mut live = on_loopback();
        let sweeps = received(&mut live, &datagrams);
        prop_assert_eq!(live.traffic().arrived(), datagrams.len() as u64);
        for sweep in &sweeps {
            prop_assert!(sweep.columns.len() <= lidar::MAX_COLUMNS);
        }
        // And it still works.
        prop_assert!(live.next(&mut new_sweep(), &mut Truth::new_box_zeroed().unwrap()).is_ok());
    }
}
