//! What is made of the samples: pure functions of numbers.

mod availability;
mod drift;
mod slope;
mod trend;
mod windows;

pub use availability::Tally;
pub(crate) use availability::{Answer, Availability, Exclusions};
pub use drift::Drift;
pub use slope::Slope;
pub(crate) use trend::median;

pub(crate) use windows::Window;
pub use windows::WindowReport;
