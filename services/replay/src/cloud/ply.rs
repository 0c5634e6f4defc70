//! Polygon file format: a text header, then ascii or binary elements.

use std::path::Path;

use super::Cloud;
use crate::error::{Place, ReplayError};
use crate::faults::Faults;

/// Whether a file begins as a PLY header does.
pub(crate) fn is_ply(head: &[u8]) -> bool {
    head.strip_prefix(b"ply").is_some_and(|rest| rest.starts_with(b"\n") || rest.starts_with(b"\r"))
}

/// Reads the points of `path` into `cloud`, which is empty. `line` is memory to use again.
pub(crate) fn read(path: &Path, _: &mut Cloud, _: &mut Vec<u8>, _: &mut Faults) -> Result<(), ReplayError> {
    let what = "PLY cannot be read yet; give another format".to_owned();
    Err(ReplayError::Malformed { path: path.to_owned(), place: Place::Byte(0), what })
}
