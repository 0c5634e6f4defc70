//! Files that a run writes: refused before it starts where they cannot be written, or would destroy something.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::Failure;

/// Refuses outputs that cannot be written, that are one file, or that are part of the source.
pub(crate) fn check(outputs: &[(&str, Option<&Path>)], source: &Path) -> Result<(), Failure> {
    let mut taken: Vec<(String, PathBuf)> =
        inputs(source).into_iter().map(|path| ("the source".into(), path)).collect();
    for (flag, path) in outputs {
        let Some(path) = path.filter(|path| *path != Path::new("-")) else { continue };
        let new = !path.exists();
        if !is_special(path) {
            let open = OpenOptions::new().append(true).create(true).open(path);
            open.map_err(|cause| Failure::start(format!("{flag} {}: cannot be written: {cause}", path.display())))?;
            if let Some((other, _)) = taken.iter().find(|(_, other)| is_same(path, other)) {
                return Err(Failure::start(format!("{flag} {}: is also {other}; name another file", path.display())));
            }
        }
        taken.push(((*flag).to_owned(), path.to_owned()));
        if new {
            // Only tried: the run makes it when it has something to write.
            let _ = fs::remove_file(path);
        }
    }
    Ok(())
}

/// The files that a source is made of; a name that nothing has yet is itself.
fn inputs(source: &Path) -> Vec<PathBuf> {
    replay::matched(source).unwrap_or_else(|_| vec![source.to_owned()])
}

/// A pipe or a device: opening it may wait, and nothing in it can be destroyed.
fn is_special(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir())
}

fn is_same(one: &Path, other: &Path) -> bool {
    match (fs::metadata(one), fs::metadata(other)) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => one == other,
    }
}

/// Writes a file as a whole: what was there before stays until the new one is complete.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let failed = |cause: std::io::Error| Failure::run(format!("{}: {cause}", path.display()));
    if is_special(path) {
        return OpenOptions::new().write(true).open(path).and_then(|mut file| file.write_all(bytes)).map_err(failed);
    }
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let write = || {
        File::create(&beside)?.write_all(bytes)?;
        fs::rename(&beside, path)
    };
    write().map_err(failed)
}
