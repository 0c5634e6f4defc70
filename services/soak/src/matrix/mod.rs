//! The survival matrix: of each fault, what was seen, what was done about it, and what it cost.

mod open;
mod row;
mod table;

pub(crate) use open::{Baseline, Open};
pub use row::{Invariants, Row};
pub use table::{Line, Matrix};
