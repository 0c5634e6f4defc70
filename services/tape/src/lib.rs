//! What the chain says, kept in MCAP files: lossless for replay, in Foxglove's schemas for people.
//!
//! [`Tape`] takes parts of messages as they come, joins them and writes files; see the room's note for what they hold.
//! It reads no clock, starts no thread and makes nobody wait. [`Clouds`], [`Scenes`], [`TrackScenes`],
//! [`DetectionsJoiner`] and [`colour`] serve whoever else shows a sweep.
//!
//! ```
//! use messages::{Detections, Sweep, Trace, TrackTable};
//! use tape::{About, Tape, TapeFile, Topic};
//! use zerocopy::FromZeros;
//!
//! let folder = tempfile::tempdir()?;
//! let file: TapeFile = toml::from_str(include_str!("../../../config/tape.toml"))?;
//! let utc_ns = 1_700_000_000_000_000_000;
//! let mut tape = Tape::start(file.checked()?, &folder.path().join("run.mcap"), About::default(), None, utc_ns)?;
//! let (sweep, detections) = (Sweep::new_box_zeroed().unwrap(), Detections::new_box_zeroed().unwrap());
//! tape.sweep(utc_ns, &Trace::default(), &sweep);
//! tape.detections(utc_ns, &Trace::default(), &detections);
//! tape.tracks(utc_ns, &Trace::default(), &*TrackTable::new_box_zeroed().unwrap());
//! tape.finish(utc_ns)?;
//! assert_eq!(tape.counts().of(Topic::Clusters).unwrap().messages, 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cloud;
mod colours;
mod counts;
mod early;
mod entities;
mod hold;
mod joiner;
mod kept;
mod names;
mod pairs;
mod reel;
mod reels;
mod scene;
mod schemas;
mod settings;
mod sink;
mod stamps;
mod stream;
mod tape;
mod topic;
mod tracks;
mod words;

pub use cloud::{Clouds, Clustered, FRAME_ID, NO_CLUSTER};
pub use colours::{ALERT, CONICAL, CYLINDRICAL, ELLIPSOIDAL, RECTANGULAR, UNCLASSIFIED, colour};
pub use counts::{Counts, TopicCounts};
pub use joiner::DetectionsJoiner;
pub use reel::About;
pub use scene::{CENTROID_M, Scenes};
pub use settings::{
    Compression, MAX_CHUNK_KIB, MAX_HOLD_SWEEPS, Settings, SettingsError, TapeError, TapeFile, WhenFull,
};
pub use tape::Tape;
pub use topic::Topic;
pub use tracks::{ARROW_S, TrackScenes};
pub use words::{Event, Level};
