//! Velodyne data packets: taken apart into sweeps, and made from sweeps.
//!
//! HDL-32E User's Manual (firing order p. 10, appendices B and E) and application note 63-9277 (stamp = first firing,
//! azimuth interpolated over the packet). The sensor model says the rest (elevations, times, counts of distance),
//! so a sensor with the same blocks is one more file in `config/sensors/`.

mod cycles;
mod encode;
mod packet;
mod rate;
mod sweeps;

pub use encode::{PacketWriter, PcapStamps, WriteError};
pub(crate) use packet::{PACKET_BYTES, Packet};
pub(crate) use rate::check_rate;
pub(crate) use sweeps::{Sweeps, to_frame};
