//! Recorded data → Sweep: packet captures, tables, point clouds and MCAP files as a source of the chain.
//!
//! A recording is a file, or files of one format in a folder or by a pattern; the format is found by content. Geometry stays in the
//! recording's own sensor frame (packets: x forward, y left, z up). What is intact is used; what is not is counted by
//! reason, returns in the sweep's header, the rest in [`Faults`], and named once with file and place.
//!
//! ```
//! use replay::{Options, open};
//! let sensors = |_: &str| Err("no such sensor".into());
//! let error = open("no/such/file.pcap".as_ref(), &Options::default(), &sensors).err().unwrap();
//! assert!(error.to_string().starts_with("no/such/file.pcap: cannot be read"));
//! ```

mod capture;
mod cloud;
mod error;
mod faults;
mod files;
mod format;
mod intake;
mod live;
mod mcap;
mod recording;
mod table;
mod time;
mod velodyne;

pub use error::{Place, ReplayError};
pub use faults::{Fault, Faults};
pub use files::matched;
pub use format::{Format, UnknownFormat};
pub use live::{Live, LiveAddress, LiveAddressError, Traffic, listen};
pub use recording::{Options, Recording, SensorLookup, open};
pub use table::TableWriter;
pub use velodyne::{PacketWriter, PcapStamps, WriteError};
