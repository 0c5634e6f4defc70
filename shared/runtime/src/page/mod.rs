//! One small page per stage in a shared file: its heartbeat, its counts and what it has in hand. It outlives `kill -9`.
//!
//! Every word has one writer at a time: the stage while it lives, the supervisor between two of its lives. All words are
//! atomics; the stage alone orders them (release), readers follow (acquire).

mod ledger;
mod map;
mod ring;
mod view;
mod words;

pub use ledger::{Gap, GapKind, Settlement};
pub use map::PageMap;
pub use ring::{Heard, Said};
pub use view::{Counts, PageView};
pub use words::{Page, State, Tier};
