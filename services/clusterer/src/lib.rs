//! Sweep → Clusters: returns at most d apart are one obstacle (paper, Algorithm 1).
//!
//! A sweep comes in one or more sectors; each cluster goes out as soon as no later one can reach it. Two methods give the
//! same clusters to the byte: the scan window for sweeps in firing order, and a k-d tree for every input. All points are
//! in the sensor frame [m].
//!
//! ```
//! use clusterer::{Clusterer, Method, Params};
//! use messages::{Clusters, Part, Sweep, Verdict};
//! use stage::Stage;
//! use zerocopy::FromZeros;
//!
//! let mut sweep = Sweep::new_box_zeroed().map_err(|_| "no memory")?;
//! for x in [3.0, 3.5, 9.0] {
//!     sweep.returns.push(lidar::Return { x, ..Default::default() })?;
//! }
//! sweep.header.recorded = 3;
//! let mut clusters = Clusters::new_box_zeroed().map_err(|_| "no memory")?;
//! let mut clusterer = Clusterer::init(Params { range_d_m: 1.0, method: Method::Auto, min_points: 5 })?;
//! let part = Part { sectors: 1, ..Part::default() };
//! assert_eq!(clusterer.process(part, &sweep, &mut clusters), Verdict::Complete);
//! assert_eq!(clusters.clusters.len(), 2);
//! assert_eq!(&clusters.members[..], &[0, 1, 2]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arcsine;
mod boxes;
mod cells;
mod clusterer;
mod distance;
mod field;
mod gather;
mod input;
mod params;
mod partition;
mod runs;
mod scan;
mod seam;
mod seen;
mod sequence;
mod sets;
mod stray;
mod tree;
mod turn;
pub mod validation;

pub use clusterer::Clusterer;
pub use distance::squared_m2;
pub use params::{Method, Params, ParamsError};
