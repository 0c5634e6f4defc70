//! Lossy taps for people: the running chain in a terminal and as a live view.
//!
//! [`top`] draws it, [`live`] serves it to Foxglove, [`metrics`] to Prometheus. All only look: pages are mapped read-only, messages are taken from
//! taps that the chain neither waits for nor wakes, and what is missed is counted. Reading order of `top`:
//! `attached` (what is looked at) → `model` (samples → [`top::View`]) → `draw` (a view → a frame) → `terminal` (the loop).

mod attached;
mod error;
mod events;
pub mod live;
pub mod metrics;
mod process;
mod sample;
pub mod top;

pub use error::MonitorError;
