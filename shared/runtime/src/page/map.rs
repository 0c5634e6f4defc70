use std::fs::{File, OpenOptions};
use std::io;
use std::ops::Deref;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use memmap2::{MmapOptions, MmapRaw};

use super::words::{MAGIC, Page};
use crate::ShellError;

/// A page mapped into this process.
pub struct PageMap {
    map: MmapRaw,
}

impl PageMap {
    /// Creates the page file of a stage that never ran, readable by this user alone.
    pub fn create(path: &Path) -> Result<Self, ShellError> {
        let open = || {
            let file = OpenOptions::new().read(true).write(true).create_new(true).mode(0o600).open(path)?;
            file.set_len(size_of::<Page>() as u64)?;
            MmapRaw::map_raw(&file)
        };
        let page = Self { map: open().map_err(|cause| broken(path, cause))? };
        page.magic.set(MAGIC);
        Ok(page)
    }

    /// Maps a page file that the supervisor has made.
    pub fn open(path: &Path) -> Result<Self, ShellError> {
        let file = File::options().read(true).write(true).open(path).map_err(|cause| broken(path, cause))?;
        Self::of_file(path, &file, |file| MmapRaw::map_raw(file))
    }

    /// Maps a page so that a write to it would end this process; [`super::PageView`] gives no way to write.
    pub(super) fn open_to_read(path: &Path) -> Result<Self, ShellError> {
        let file = File::open(path).map_err(|cause| broken(path, cause))?;
        Self::of_file(path, &file, |file| MmapOptions::new().map_raw_read_only(file))
    }

    fn of_file(path: &Path, file: &File, map: impl FnOnce(&File) -> io::Result<MmapRaw>) -> Result<Self, ShellError> {
        let found = file.metadata().map_err(|cause| broken(path, cause))?.len();
        let expected = size_of::<Page>() as u64;
        if found != expected {
            return Err(broken(path, format!("is {found} bytes, must be {expected}: another version's page?")));
        }
        let page = Self { map: map(file).map_err(|cause| broken(path, cause))? };
        if page.magic.get() != MAGIC {
            return Err(broken(path, "is not a page of this version"));
        }
        Ok(page)
    }
}

impl Deref for PageMap {
    type Target = Page;

    fn deref(&self) -> &Page {
        // SAFETY: the mapping is as long as a `Page` (checked when it was made) and aligned to a memory page; a `Page` is
        // nothing but atomics, valid for any bytes and safe to share; the mapping lives as long as `self`. Of one that was mapped
        // to be read only, `PageView` loads words and stores none.
        #[expect(unsafe_code, reason = "a page is shared with other processes")]
        unsafe {
            &*self.map.as_ptr().cast::<Page>()
        }
    }
}

fn broken(path: &Path, cause: impl ToString) -> ShellError {
    ShellError::File { path: PathBuf::from(path), cause: cause.to_string() }
}
