//! Tracks against truth.

mod assignment;
mod clear_mot;
mod frame;
#[cfg(test)]
mod golden;
mod hota;
mod identity;
