//! Sweeps as a spinning sensor would have sent them: data packets in a classic capture.

use std::io::{self, Write};

use lidar::SensorModel;
use messages::Sweep;

use super::packet::{BLOCK_FLAG, BLOCKS, CHANNELS, HOUR_US, PACKET_BYTES, Packet, STRONGEST, TURN_CDEG};

/// Neither a block nor one that was lost: fills up a packet that ends early.
const ABSENT: ([u8; 2], u16) = ([0, 0], 0xFFFF);
/// A firing cycle of which nothing is known.
const UNKNOWN_FLAG: [u8; 2] = [0, 0];

const UDP_BYTES: usize = 8 + PACKET_BYTES;
const IP_BYTES: usize = 20 + UDP_BYTES;
const FRAME_BYTES: usize = 14 + IP_BYTES;

/// Counts of a second in the capture's stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PcapStamps {
    /// Microseconds, as most recorders write.
    Micros,
    /// Nanoseconds.
    Nanos,
}

/// Why a sweep cannot be written as packets.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The file cannot be written.
    #[error("the capture cannot be written: {0}")]
    Io(#[from] io::Error),
    /// The sensor does not fire 32 lasers in every block.
    #[error("{lasers} lasers in {cycles} firing cycles a block cannot be written as packets, must be 32 in 1")]
    Sensor {
        /// Lasers.
        lasers: usize,
        /// Firing cycles in a block.
        cycles: u32,
    },
    /// The sweep has no rings and columns.
    #[error("an unorganised sweep cannot be written as packets")]
    Unorganised,
    /// Returns are not in the order of columns, or name a ring or column that does not exist.
    #[error("return {0} has a column or ring out of order")]
    Order(usize),
    /// Two returns of one firing.
    #[error("return {0} is a second one of its firing; packets carry the strongest only")]
    Second(usize),
    /// A range that a count of distance cannot say.
    #[error("return {index} has range {range_m} m, must be 1 to 65535 counts of distance")]
    Range {
        /// The return's place in the sweep.
        index: usize,
        /// Its range [m].
        range_m: f32,
    },
}

/// Writes sweeps of a sensor with 32 lasers as its data packets (UDP port 2368) in a classic `.pcap`.
///
/// Blocks go on over packets and sweeps as long as the columns' times do; where they do not, the packet ends early and
/// is filled up with blocks that carry neither flag nor possible azimuth. Azimuths are rounded to 0.01°, distances to
/// the sensor's count, stamps to 1 µs. Call [`PacketWriter::finish`], or the last packet is lost.
pub struct PacketWriter<W: Write> {
    out: W,
    stamps: PcapStamps,
    cycle_ns: u64,
    quantum_m: f64,
    product_id: u8,
    /// Channel of each ring.
    channels: [u8; CHANNELS],
    packet: Packet,
    blocks: usize,
    /// Time of the packet's first firing [ns].
    start_ns: u64,
}

impl<W: Write> PacketWriter<W> {
    /// Writes the capture's header.
    ///
    /// # Errors
    /// The sensor has no 32 lasers in one cycle a block, or `out` fails.
    pub fn new(mut out: W, sensor: &SensorModel, stamps: PcapStamps) -> Result<Self, WriteError> {
        let (lasers, cycles) = (sensor.lasers().len(), sensor.cycles_per_block());
        if lasers != CHANNELS || cycles != 1 {
            return Err(WriteError::Sensor { lasers, cycles });
        }
        let mut channels = [0; CHANNELS];
        for (channel, laser) in sensor.lasers().iter().enumerate() {
            channels[usize::from(laser.ring)] = channel as u8;
        }
        let magic: u32 = match stamps {
            PcapStamps::Micros => 0xa1b2_c3d4,
            PcapStamps::Nanos => 0xa1b2_3c4d,
        };
        // Version 2.4, no time zone, whole frames, Ethernet.
        for word in [magic, 4 << 16 | 2, 0, 0, 65_535, 1] {
            out.write_all(&word.to_le_bytes())?;
        }
        Ok(Self {
            out,
            stamps,
            cycle_ns: u64::from(sensor.cycle_ns()),
            quantum_m: sensor.quantum_m(),
            product_id: sensor.product_id(),
            channels,
            packet: Packet::default(),
            blocks: 0,
            start_ns: 0,
        })
    }

    /// Writes all columns of a whole sweep; those that are not valid are written as unknown.
    ///
    /// # Errors
    /// The sweep cannot be said in packets, or the file fails; packets before the fault are written.
    pub fn write(&mut self, sweep: &Sweep) -> Result<(), WriteError> {
        if !sweep.header.is_organised() || sweep.rings.len() != CHANNELS {
            return Err(WriteError::Unorganised);
        }
        let mut place = 0;
        for (index, column) in sweep.columns.iter().enumerate() {
            let time_ns = sweep.header.sensor_time_ns + u64::from(column.offset_ns);
            let azimuth_cdeg = device_azimuth_cdeg(column.azimuth_rad, index == 0);
            self.begin_block(time_ns, azimuth_cdeg, column.valid != 0)?;
            while let Some(found) = sweep.returns.get(place).filter(|found| usize::from(found.column) == index) {
                let ring = usize::from(found.ring);
                let &channel = self.channels.get(ring).ok_or(WriteError::Order(place))?;
                let counts = (f64::from(found.range_m()) / self.quantum_m).round();
                if !(1.0..=65_535.0).contains(&counts) {
                    return Err(WriteError::Range { index: place, range_m: found.range_m() });
                }
                if self.packet.channel(self.blocks, usize::from(channel)).0 != 0 {
                    return Err(WriteError::Second(place));
                }
                self.packet.set_channel(self.blocks, usize::from(channel), counts as u16, found.intensity);
                place += 1;
            }
            self.blocks += 1;
            if self.blocks == BLOCKS {
                self.send()?;
            }
        }
        if place < sweep.returns.len() { Err(WriteError::Order(place)) } else { Ok(()) }
    }

    /// Writes the last packet and hands the file back.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(mut self) -> Result<W, WriteError> {
        self.send()?;
        self.out.flush()?;
        Ok(self.out)
    }

    fn begin_block(&mut self, time_ns: u64, azimuth_cdeg: u16, is_known: bool) -> Result<(), WriteError> {
        let due_ns = self.start_ns + self.blocks as u64 * self.cycle_ns;
        if self.blocks > 0 && time_ns.abs_diff(due_ns) > self.cycle_ns / 2 {
            self.send()?;
        }
        if self.blocks == 0 {
            self.start_ns = time_ns;
        }
        self.packet.set_block(self.blocks, if is_known { BLOCK_FLAG } else { UNKNOWN_FLAG }, azimuth_cdeg);
        Ok(())
    }

    /// Sends what blocks there are as one packet.
    fn send(&mut self) -> Result<(), WriteError> {
        if self.blocks == 0 {
            return Ok(());
        }
        for block in self.blocks..BLOCKS {
            self.packet.set_block(block, ABSENT.0, ABSENT.1);
        }
        let stamp_us = (self.start_ns + 500) / 1_000 % HOUR_US;
        self.packet.set_end(stamp_us as u32, STRONGEST, self.product_id);
        // A packet leaves when its last firing is done.
        let sent_ns = self.start_ns + BLOCKS as u64 * self.cycle_ns;
        let (seconds, rest_ns) = (sent_ns / 1_000_000_000, sent_ns % 1_000_000_000);
        let fraction = match self.stamps {
            PcapStamps::Micros => rest_ns / 1_000,
            PcapStamps::Nanos => rest_ns,
        };
        for word in [seconds as u32, fraction as u32, FRAME_BYTES as u32, FRAME_BYTES as u32] {
            self.out.write_all(&word.to_le_bytes())?;
        }
        self.out.write_all(&frame_header())?;
        self.out.write_all(&self.packet.bytes)?;
        self.blocks = 0;
        Ok(())
    }
}

/// The sensor's azimuth of a column [0.01°]. What rounds up to a whole turn stays in its turn, or the sweep would be cut
/// a column early; at the first column it is the turn's beginning.
fn device_azimuth_cdeg(azimuth_rad: f32, is_first: bool) -> u16 {
    let turn = f64::from(TURN_CDEG);
    let azimuth_cdeg = (-f64::from(azimuth_rad).to_degrees() * 100.0).rem_euclid(turn).round();
    match azimuth_cdeg < turn {
        true => azimuth_cdeg as u16,
        false if is_first => 0,
        false => TURN_CDEG - 1,
    }
}

/// Ethernet, IPv4 and UDP headers of a data packet: from 192.168.1.201 to everyone, port 2368.
fn frame_header() -> [u8; FRAME_BYTES - PACKET_BYTES] {
    let mut header = [0; FRAME_BYTES - PACKET_BYTES];
    header[..6].fill(0xFF);
    header[6..12].copy_from_slice(&[0x60, 0x76, 0x88, 0, 0, 0]); // the maker's block of addresses
    header[12..14].copy_from_slice(&[0x08, 0x00]);
    let ip = &mut header[14..34];
    ip[0] = 0x45;
    ip[2..4].copy_from_slice(&(IP_BYTES as u16).to_be_bytes());
    ip[6] = 0x40; // not to be fragmented
    ip[8] = 128;
    ip[9] = 17;
    ip[12..16].copy_from_slice(&[192, 168, 1, 201]);
    ip[16..20].fill(0xFF);
    let sum: u32 = ip.chunks_exact(2).map(|pair| u32::from(u16::from_be_bytes([pair[0], pair[1]]))).sum();
    let folded = (sum & 0xFFFF) + (sum >> 16);
    ip[10..12].copy_from_slice(&(!(folded as u16)).to_be_bytes());
    let udp = &mut header[34..];
    udp[..2].copy_from_slice(&443_u16.to_be_bytes());
    udp[2..4].copy_from_slice(&2_368_u16.to_be_bytes());
    udp[4..6].copy_from_slice(&(UDP_BYTES as u16).to_be_bytes());
    header
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_has_a_valid_checksum_and_the_classic_size() {
        assert_eq!(FRAME_BYTES, 1_248);
        let mut frame = frame_header().to_vec();
        frame.resize(FRAME_BYTES, 0);
        let parsed = etherparse::SlicedPacket::from_ethernet(&frame).unwrap();
        let Some(etherparse::NetSlice::Ipv4(ip)) = parsed.net else { panic!("no IPv4") };
        assert_eq!(ip.header().to_header().calc_header_checksum(), ip.header().header_checksum());
    }

    #[test]
    fn an_azimuth_that_rounds_up_to_the_turn_stays_on_its_side_of_the_wrap() {
        assert_eq!(device_azimuth_cdeg(0.0, true), 0);
        assert_eq!(device_azimuth_cdeg(-0.0, false), 0);
        assert_eq!(device_azimuth_cdeg(1e-6, false), 35_999);
        assert_eq!(device_azimuth_cdeg(1e-6, true), 0);
        assert_eq!(device_azimuth_cdeg(-std::f32::consts::FRAC_PI_2, false), 9_000);
        assert_eq!(device_azimuth_cdeg(-std::f32::consts::PI, false), 18_000);
    }
}
