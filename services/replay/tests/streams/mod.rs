//! Data packets of sensors that do what a test wants, as captures.
#![allow(dead_code, unreachable_pub, reason = "each test file uses a part of it")]
#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::path::PathBuf;

use lidar::SensorModel;
use messages::Sweep;
use replay::{Fault, Options, Recording, open};

use crate::support::{all, assert_true, sensors};

pub const HOUR_US: u64 = 3_600_000_000;

/// A data packet and when the host received it [µs].
#[derive(Clone, Debug)]
pub struct Sent {
    pub bytes: Vec<u8>,
    pub host_us: u64,
}

impl Sent {
    pub fn stamp_us(&self) -> u32 {
        u32::from_le_bytes(self.bytes[1_200..1_204].try_into().unwrap())
    }

    pub fn set_stamp_us(&mut self, stamp_us: u64) {
        self.bytes[1_200..1_204].copy_from_slice(&((stamp_us % HOUR_US) as u32).to_le_bytes());
    }

    pub fn azimuth(&self, block: usize) -> u16 {
        u16::from_le_bytes(self.bytes[100 * block + 2..100 * block + 4].try_into().unwrap())
    }

    pub fn set_azimuth(&mut self, block: usize, azimuth_cdeg: u16) {
        self.bytes[100 * block + 2..100 * block + 4].copy_from_slice(&azimuth_cdeg.to_le_bytes());
    }
}

/// What a sensor is set to.
#[derive(Clone, Debug)]
pub struct Head {
    pub sensor: SensorModel,
    pub mode: u8,
    /// Turning [0.01°/block].
    pub step_cdeg: f64,
    /// What it sees [0.01°], clockwise from the first to the second; all where they are equal.
    pub view_cdeg: [f64; 2],
    /// Host time of the first firing [µs]; stamps are of the same clock.
    pub start_us: u64,
}

impl Head {
    pub fn new(sensor: &str, mode: u8) -> Self {
        Self { sensor: sensors(sensor).unwrap(), mode, step_cdeg: 20.0, view_cdeg: [0.0, 0.0], start_us: 600_000_000 }
    }

    fn sees(&self, azimuth_cdeg: f64) -> bool {
        let [from, to] = self.view_cdeg;
        from == to || (azimuth_cdeg - from).rem_euclid(36_000.0) < (to - from).rem_euclid(36_000.0)
    }

    /// The packets of `cycles` firing cycles, those out of view included. `echoes` gives distance in counts and intensity
    /// of the last and the strongest return of a firing, by its cycle and channel.
    pub fn packets(&self, cycles: usize, echoes: impl Fn(usize, usize) -> [(u16, u8); 2]) -> Vec<Sent> {
        let is_dual = self.mode == 0x39;
        let per_cycle = if is_dual { 2 } else { 1 };
        let cycle_us = f64::from(self.sensor.cycle_ns()) / 1_000.0;
        let mut sent: Vec<Sent> = Vec::new();
        let (mut bytes, mut stamp_us) = (Vec::new(), 0.0);
        for cycle in 0..cycles {
            let azimuth_cdeg = (cycle as f64 * self.step_cdeg).rem_euclid(36_000.0);
            if !self.sees(azimuth_cdeg) {
                continue;
            }
            let time_us = self.start_us as f64 + cycle as f64 * cycle_us;
            if bytes.is_empty() {
                stamp_us = time_us;
            }
            for echo in 0..per_cycle {
                bytes.extend([0xFF, 0xEE]);
                bytes.extend((azimuth_cdeg as u16).to_le_bytes());
                for channel in 0..32 {
                    // Last returns come before the strongest; the mode of the last returns gives those alone.
                    let which = if is_dual { echo } else { usize::from(self.mode != 0x38) };
                    let (distance, intensity) = echoes(cycle, channel)[which];
                    bytes.extend(distance.to_le_bytes());
                    bytes.push(intensity);
                }
            }
            if bytes.len() == 1_200 {
                bytes.extend([0; 4]);
                bytes.extend([self.mode, self.sensor.product_id()]);
                let mut packet = Sent { bytes: std::mem::take(&mut bytes), host_us: (time_us + 150.0) as u64 };
                packet.set_stamp_us(stamp_us as u64);
                sent.push(packet);
            }
        }
        sent
    }

    /// As [`Head::packets`], with one return a firing.
    pub fn plain(&self, cycles: usize) -> Vec<Sent> {
        self.packets(cycles, |cycle, channel| {
            [(1_000 + (cycle % 50) as u16 * 10 + channel as u16, channel as u8 + 1); 2]
        })
    }
}

/// A classic capture of frames without headers of a link (raw IP).
pub fn capture(packets: &[Sent]) -> Vec<u8> {
    let mut bytes: Vec<u8> =
        [0xa1b2_c3d4_u32, 4 << 16 | 2, 0, 0, 65_535, 101].iter().flat_map(|word| word.to_le_bytes()).collect();
    for packet in packets {
        let mut frame = Vec::new();
        let builder = etherparse::PacketBuilder::ipv4([10, 0, 0, 1], [255; 4], 9).udp(443, 2_368);
        builder.write(&mut frame, &packet.bytes).unwrap();
        let (seconds, micros) = (packet.host_us / 1_000_000, packet.host_us % 1_000_000);
        let words = [seconds as u32, micros as u32, frame.len() as u32, frame.len() as u32];
        bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        bytes.extend(frame);
    }
    bytes
}

pub fn file(packets: &[Sent]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    std::fs::write(&path, capture(packets)).unwrap();
    (folder, path)
}

pub fn replayed_with(packets: &[Sent], options: &Options) -> (Vec<Box<Sweep>>, Recording) {
    let (_folder, path) = file(packets);
    let mut recording = open(&path, options, &sensors).unwrap();
    let sweeps = all(&mut recording);
    sweeps.iter().for_each(|sweep| assert_true(sweep));
    (sweeps, recording)
}

pub fn replayed(packets: &[Sent]) -> (Vec<Box<Sweep>>, Recording) {
    replayed_with(packets, &Options::default())
}

pub fn faults(recording: &Recording) -> Vec<(Fault, u64)> {
    recording.faults().found().collect()
}

/// Columns of all sweeps: received, and not.
pub fn columns(sweeps: &[Box<Sweep>]) -> (usize, usize) {
    let all = || sweeps.iter().flat_map(|sweep| sweep.columns.iter());
    (all().filter(|column| column.valid == 1).count(), all().filter(|column| column.valid == 0).count())
}
