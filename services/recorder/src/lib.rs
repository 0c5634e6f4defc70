//! The chain's ledgered sink: one JSON line of detections and one of tracks a sweep, one CSV row of labels a return, and the latency
//! statistics of every hop.
//!
//! [`Recorder`] copies each part into a buffer and hands it to one writer thread; a slow or full disk costs rows,
//! never time. It reads no clock: every time is in the [`messages::Trace`].
//!
//! ```
//! use std::sync::Arc;
//! use std::sync::atomic::{AtomicU64, Ordering};
//!
//! use messages::{Trace, Tracks};
//! use recorder::{Recorder, Settings, Snapshot};
//! use stage::Sink;
//! use zerocopy::FromZeros;
//!
//! let settings = Settings {
//!     detections: Some("/dev/null".into()),
//!     tracks: None,
//!     labels: None,
//!     trace: None,
//!     statistics: None,
//!     resume: false,
//!     queue_parts: 4,
//!     lossless: true,
//!     in_order_from: None,
//!     paced: false,
//!     rate: 1.0,
//!     deadline_ms: 100.0,
//!     stages: vec!["simulator".into(), "clusterer".into(), "extractor".into(), "classifier".into(), "tracker".into()],
//! };
//! let settled = Arc::new(AtomicU64::new(0));
//! let counter = Arc::clone(&settled);
//! let tell = Arc::new(move |_part| _ = counter.fetch_add(1, Ordering::Release));
//! let mut recorder = Recorder::start(settings, tell)?;
//! let empty = Tracks::new_box_zeroed().unwrap(); // tests only; stages get shared memory
//! assert!(!recorder.accept(&Trace::default(), &empty).is_rejected());
//! recorder.finish()?;
//! assert_eq!(settled.load(Ordering::Acquire), 1);
//! let mut snapshot = Snapshot::default();
//! recorder.snapshot_into(&mut snapshot);
//! assert_eq!(snapshot.sweeps, 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod alerts;
mod answers;
mod assemble;
mod buckets;
mod cause;
mod detections_json;
mod history;
mod labels_csv;
mod latency;
mod output;
mod over_time;
mod part_rows;
mod recorder;
mod repair;
mod repair_trace;
mod segments;
mod settings;
mod snapshot;
mod stage_stats;
mod stats;
mod sweeps;
mod timeline;
mod trace_events;
mod trace_file;
mod tracks_json;
mod worst;
mod writer;

pub use answers::Answered;
pub use buckets::{Buckets, Merge};
pub use latency::{LatencySnapshot, Percentiles};
pub use over_time::{LatencyBucket, LatencyPoints, SpentTime, SweepTimeline};
pub use recorder::Recorder;
pub use settings::{MAX_QUEUE_PARTS, RecorderError, Settings};
pub use snapshot::{Deadline, LostSweeps, Snapshot, SnapshotError, StageSnapshot, TraceCounts, TrackCounts, VERSION};
pub use timeline::{BucketSnapshot, TimelineSnapshot};
pub use worst::{WorstHop, WorstSweep};
