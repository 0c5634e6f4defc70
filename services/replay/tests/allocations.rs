//! Once it runs, replaying a capture takes no memory, nor does listening to a sensor. Without test harness: its threads allocate when they like.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod support;

use messages::{Message, Truth};
use stage::{Next, Source};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use zerocopy::FromZeros;

#[global_allocator]
static GLOBAL: &StatsAlloc<std::alloc::System> = &INSTRUMENTED_SYSTEM;

// verifies RPL-018
fn main() {
    let Some(capture) = support::data("hdl32e/monterey_hdl32e.pcap") else { return };
    let mut recording = support::opened(&capture).unwrap();
    let (mut sweep, mut truth) = (support::new_sweep(), Truth::new_box_zeroed().unwrap());
    assert!(support::next(&mut recording, &mut sweep, &mut truth));
    let region = Region::new(GLOBAL);
    for _ in 0..17 {
        assert!(support::next(&mut recording, &mut sweep, &mut truth));
    }
    let change = region.change();
    assert_eq!((change.allocations, change.reallocations), (0, 0), "a sweep takes none after the first");
    println!("a_sweep_of_a_capture_takes_no_allocation_after_the_first ... ok");
    live(&std::fs::read(&capture).unwrap());
}

// verifies RPL-029
fn live(capture: &[u8]) {
    let address = "udp://127.0.0.1:0".parse().unwrap();
    let mut live = replay::listen(&address, &replay::Options::default(), &support::sensors, || 1).unwrap();
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.connect(live.local_addr()).unwrap();
    let (mut sweep, mut truth) = (support::new_sweep(), Truth::new_box_zeroed().unwrap());
    // Records are a header of 16 bytes and a frame with 42 bytes before its payload; some are position packets.
    let (mut at, mut sweeps, mut region) = (24, 0, None);
    while sweeps < 8 {
        for _ in 0..16 {
            let length = u32::from_le_bytes(capture[at + 8..at + 12].try_into().unwrap()) as usize;
            socket.send(&capture[at + 16 + 42..at + 16 + length]).unwrap();
            at += 16 + length;
        }
        sweep.clear();
        sweeps += usize::from(live.next(&mut sweep, &mut truth).unwrap() == Next::Sweep);
        if sweeps == 2 && region.is_none() {
            region = Some(Region::new(GLOBAL));
        }
    }
    let change = region.unwrap().change();
    assert!(live.traffic().packets() > 500);
    assert_eq!((change.allocations, change.reallocations), (0, 0), "a packet takes none");
    println!("a_packet_of_a_live_sensor_takes_no_allocation ... ok");
}
