use std::path::Path;

use super::Cloud;
use crate::error::{Place, ReplayError};
use crate::faults::Faults;

/// Where clouds come from, one after the other.
pub(crate) trait CloudSource {
    /// Reads the next one into `cloud`, which is empty; none after the last. After an error comes the one after.
    fn read(&mut self, cloud: &mut Cloud, faults: &mut Faults) -> Option<Result<(), ReplayError>>;

    /// Starts again with the first.
    fn rewind(&mut self);

    /// Number of clouds, where that is known; those that cannot be read count too.
    fn count(&self) -> Option<u64>;

    /// File and place of the one last read.
    fn place(&self) -> (&Path, Place);
}
