//! What a cluster's surface looks like, said twice: as the solids that explain its rays, and as the paper's histogram.
//!
//! `Clusters` in, [`Descriptors`](messages::Descriptors) out; all geometry in the sensor frame, in metres; each cluster from
//! its own returns and the cells round it alone. Either description may be left out.
//!
//! - The four solids fitted to the cluster's rays ([`fit`]), and the shape of its surface in numbers ([`Relief`]).
//! - The paper's fast point feature histogram: nearest neighbours ([`Neighbours`]), normals ([`estimate_normals`], Eq. 4),
//!   the angles of each pair of neighbours ([`Darboux`], Eqs. 1 and 2), and their joint histogram of 1728 bins
//!   ([`Histogram`], Eq. 3), which sums to 1. Equation and section numbers are those of Bylard and Paudel.
//!
//! ```
//! use extractor::{Features, Params};
//! use lidar::Return;
//! let file = include_str!("../../../config/stages/extractor.toml");
//! let params: Params = toml::from_str(file)?;
//! let mut features = Features::new(&params.checked()?);
//! // A wall 4 m ahead: every normal is the same, so every angle is 0 and one bin holds everything.
//! let wall: Vec<Return> = (0..25_u16)
//!     .map(|i| Return { x: 4.0, y: f32::from(i % 5) * 0.1, z: f32::from(i / 5) * 0.1, ..Return::default() })
//!     .collect();
//! let bins: Vec<_> = features.describe(&wall, 1).bins().collect();
//! assert_eq!(bins.len(), 1);
//! assert_eq!(bins[0].weight, 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod block_query;
mod blocks;
mod darboux;
mod features;
pub mod fit;
mod histogram;
mod kd_tree;
mod lanes;
mod neighbours;
mod normals;
mod params;
mod relief;
mod room;
mod stride;

pub use darboux::{Darboux, LEVELS, joint_bin};
pub use features::Features;
pub use histogram::{BINS, Histogram};
pub use neighbours::{MAX_OTHERS, Neighbours};
pub use normals::estimate_normals;
pub use params::{CheckedParams, OverloadParams, Params, ParamsError};
pub use relief::Relief;
pub use room::Extractor;
pub use stride::{Phases, column_stride};
