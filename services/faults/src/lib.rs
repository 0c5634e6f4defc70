//! Faults on purpose: which there are, what a sweep looks like that one has spoiled, and campaigns of many.
//!
//! A pure room. Who puts a fault into a running chain is `encke inject`; what a stage's own process does to itself is in
//! `runtime`.
//!
//! ```
//! use faults::{Campaign, Fault, schedule};
//! let text = "[[script]]\nat_s = 2.0\nfault = \"kill\"\nstage = \"extractor\"";
//! let list = schedule(&Campaign::parse(text)?, 42, 60.0);
//! assert_eq!(list[0].fault, Fault::Kill);
//! assert_eq!(list[0].command_line()[..2], ["kill", "extractor"]);
//! # Ok::<(), faults::CampaignError>(())
//! ```

mod campaign;
mod catalogue;
mod corrupt;
mod corrupted;
mod damage;
mod planned;
mod schedule;

pub use campaign::{Campaign, CampaignError, CampaignFile, Spacing};
pub use catalogue::{CATALOGUE, Entry, FOR_EVER, Fault, Lasting, Strength, Target, Unit};
pub use corrupt::Corruptor;
pub use corrupted::{Corrupted, Held};
pub use damage::{damage, damaged_text, shuffled};
pub use planned::{PlanError, Planned};
pub use schedule::schedule;
