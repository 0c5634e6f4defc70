//! Velodyne data packets: taken apart into sweeps, and made from sweeps.
//!
//! HDL-32E User's Manual (firing order p. 10, appendices B and E) and application note 63-9277 (stamp = first firing,
//! azimuth interpolated over the packet); VLP-32C User Manual 63-9325 (azimuth offsets). The sensor model says the rest (elevations, times, counts of distance),
//! so a sensor with the same blocks is one more file in `config/sensors/`.

mod cycles;
mod encode;
mod field;
mod packet;
mod product;
mod rate;
mod slots;
mod spacing;
mod sweeps;

pub use encode::{PacketWriter, PcapStamps, WriteError};
pub(crate) use packet::{PACKET_BYTES, Packet};
pub(crate) use product::{is_of_another, name_of};
pub(crate) use rate::Probe;
pub(crate) use spacing::SpacingWatch;
pub(crate) use sweeps::{Progress, Sweeps, to_frame};
