//! Obstacles through time: a Kalman filter for each, in an inertial frame, with global nearest neighbour association.
//!
//! [`Detections`](messages::Detections) in, [`Tracks`](messages::Tracks) out. Each part's detections are passed on at
//! once; the table of tracks goes out with the last part of a sweep, propagated to its end. It is the same, to the byte,
//! for any number of sectors.
//!
//! ```
//! use messages::{Detections, Part, Tracks, Verdict};
//! use stage::Stage;
//! use tracker::{Params, Tracker};
//! use zerocopy::FromZeros;
//! let params: Params = toml::from_str(include_str!("../../../config/stages/tracker.toml")).unwrap();
//! let mut tracker = Tracker::init(params).unwrap();
//! let (input, mut output) = (Detections::new_box_zeroed().unwrap(), Tracks::new_box_zeroed().unwrap());
//! assert_eq!(tracker.process(Part::default(), &input, &mut output), Verdict::Complete);
//! assert!(output.table.tracks.is_empty());
//! ```

mod assignment;
mod association;
mod class;
pub mod danger;
mod filter;
mod frame;
mod gather;
mod lifecycle;
mod measurement;
mod occlusion;
mod params;
mod room;
mod sighting;
mod snapshots;
mod spin;
mod table;
mod tracked;
mod tracking;

pub use params::{
    AssociationParams, BirthParams, CentroidParams, ClassParams, DangerParams, FitParams, LifecycleParams,
    MotionParams, Params, ParamsError,
};
pub use room::Tracker;
pub use spin::SpinParams;
