//! What a cluster's surface looks like: the paper's fast point feature histogram, one of 1728 joint bins per cluster.
//!
//! `Clusters` in, [`Descriptors`](messages::Descriptors) out; all geometry in the sensor frame, in metres. Per cluster, and
//! from that cluster alone: nearest neighbours ([`Neighbours`]), normals ([`estimate_normals`], Eq. 4), the angles of each
//! pair of neighbours ([`Darboux`], Eqs. 1 and 2), their joint histogram ([`Histogram`], Eq. 3), which sums to 1.
//! Equation and section numbers are those of Bylard and Paudel.
//!
//! ```
//! use extractor::{Features, Params};
//! use lidar::Return;
//! let params = Params { neighbours: 5, spacing_deg: 0.72 }.checked().unwrap();
//! let mut features = Features::new(&params);
//! // A wall 4 m ahead: every normal is the same, so every angle is 0 and one bin holds everything.
//! let wall: Vec<Return> = (0..25_u16)
//!     .map(|i| Return { x: 4.0, y: f32::from(i % 5) * 0.1, z: f32::from(i / 5) * 0.1, ..Return::default() })
//!     .collect();
//! let bins: Vec<_> = features.describe(&wall, 1).bins().collect();
//! assert_eq!(bins.len(), 1);
//! assert_eq!(bins[0].weight, 1.0);
//! ```

mod darboux;
mod features;
mod histogram;
mod neighbours;
mod normals;
mod params;
mod room;
mod stride;

pub use darboux::{Darboux, LEVELS, joint_bin};
pub use features::Features;
pub use histogram::{BINS, Histogram};
pub use neighbours::{MAX_OTHERS, Neighbours};
pub use normals::estimate_normals;
pub use params::{CheckedParams, Params, ParamsError};
pub use room::Extractor;
pub use stride::column_stride;
