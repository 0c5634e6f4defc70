//! What crosses a process boundary: one `#[repr(C)]` struct per topic, made of bounded vectors.
//!
//! Zero bytes are an empty message, so a message is never built on the stack or initialised field by field:
//! it is laid over shared memory, [cleared](Message::clear) (lengths only) and filled in place.
//! All geometry is in the sweep's sensor frame, in metres.
//!
//! ```
//! use messages::{Clusters, Message, Sweep};
//! use zerocopy::FromZeros;
//! let sweep = Sweep::new_box_zeroed().unwrap(); // tests only; stages get shared memory
//! assert!(sweep.returns.is_empty());
//! assert_eq!(Clusters::TYPE, "encke.Clusters.4");
//! ```

mod bounded;
mod clusters;
mod descriptors;
mod detections;
mod ego;
mod header;
mod joiner;
mod order;
mod raw;
mod sectors;
mod solids;
mod step;
mod sweep;
mod trace;
mod tracks;
mod truth;

pub use bounded::{Bounded, Full};
pub use clusters::{Cell, CellKind, Cluster, ClusterSummary, Clusters, MAX_CELLS, MAX_CLUSTERS};
pub use descriptors::{Bin, Descriptor, Descriptors, MAX_BINS, MIN_FEATURE_POINTS};
pub use detections::{Detection, Detections};
pub use ego::EgoMotion;
pub use header::{Refusal, SweepHeader};
pub use joiner::Joiner;
pub use order::{Order, Place};
pub use raw::{Raw, RawError};
pub use sectors::Cutter;
pub use solids::{Fit, MAX_FITS, RELIEF, SOLID_PARAMETERS, Solid, SolidFit};
pub use step::Step;
pub use sweep::Sweep;
pub use trace::{Hop, MAX_HOPS, Part, Trace, Verdict};
pub use tracks::{
    ClosestApproach, MAX_TRACK_KEYS, MAX_TRACKS, Propagated, Stale, TRACK_COVARIANCE, Track, TrackState, TrackTable,
    Tracks,
};
pub use truth::{MAX_TRUTH_OBJECTS, NO_OBJECT, SolidKind, Truth, TruthObject};

use zerocopy::{FromZeros, Immutable, KnownLayout};

/// A message of the chain: plain bytes for which zero means empty.
pub trait Message: FromZeros + KnownLayout + Immutable + Send + Sync + 'static {
    /// Name and version of the layout, checked when a service is opened.
    const TYPE: &'static str;

    /// Makes the message empty by resetting lengths and headers; items stay as they are, unread.
    fn clear(&mut self);
}
