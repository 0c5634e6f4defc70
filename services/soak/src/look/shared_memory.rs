use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use transport::Instance;

/// What an instance has in shared memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SharedMemory {
    /// Objects.
    pub(crate) files: u64,
    /// Their length: memory that they may take.
    pub(crate) length_kib: u64,
    /// Memory that they take, which is what was touched of them so far.
    pub(crate) kib: u64,
}

impl SharedMemory {
    /// Of an instance now.
    pub(crate) fn of(instance: &Instance) -> Self {
        let mut all = Self::default();
        for name in instance.shared_memory() {
            // It may be gone by now.
            let Ok(meta) = fs::metadata(Path::new("/dev/shm").join(name)) else { continue };
            all.files += 1;
            all.length_kib += meta.len() / 1024;
            all.kib += meta.blocks() / 2; // of 512 bytes
        }
        all
    }
}
