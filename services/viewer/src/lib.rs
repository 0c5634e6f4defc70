//! A recording of the chain as a web page of our own: written as one file that needs nothing else, or served on this
//! machine so that long recordings work.
//!
//! [`Recording`] finds what an MCAP file of Encke's holds of each sweep; [`write_page`] puts a [`Selection`] of its sweeps
//! into one HTML file; [`Server`] hands out the same page and its sweeps one by one, a recording's or those of a running
//! chain ([`Live`]). The page draws by itself (`page/`).
//!
//! ```
//! use viewer::Recording;
//! let error = Recording::open("no/such/file.mcap".as_ref()).err().unwrap();
//! assert!(error.to_string().starts_with("no/such/file.mcap: cannot be read"));
//! ```

mod cloud;
mod columns;
mod error;
mod http;
mod live;
mod overview;
mod page;
mod paths;
mod recording;
mod records;
mod row;
mod serve;
mod shelf;
mod tracks;
mod write;

pub use cloud::POINT_UNIT_M;
pub use error::ViewError;
pub use live::Live;
pub use recording::{Recording, Selection};
pub use row::Row;
pub use serve::Server;
pub use shelf::{Recorded, Shelf};
pub use write::{Limits, Written, write_page};
