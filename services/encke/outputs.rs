//! Files that a run writes: refused before it starts where they cannot be written, or would destroy something.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use runtime::clock;
use rustix::fs::OFlags;
use rustix::io::Errno;

use crate::Failure;

/// How long a named pipe may be without a reader [ns]: one that is started beside this takes a moment.
const READER_PATIENCE_NS: u64 = 3_000_000_000;

/// Named pipes of the outputs, open until this is dropped: whoever reads one sees its end no earlier.
#[must_use = "a pipe's reader would leave"]
pub(crate) struct Pipes {
    _open: Vec<File>,
}

/// Files that were made to see whether they can be: gone again with this. The run makes them when it has something to write.
struct Tried(Vec<PathBuf>);

impl Drop for Tried {
    fn drop(&mut self) {
        for path in &self.0 {
            let _ = fs::remove_file(path);
        }
    }
}

/// Refuses outputs that cannot be written, that are one file, that are part of the source, or that are pipes which nobody reads.
pub(crate) fn check(outputs: &[(&str, Option<&Path>)], source: &Path) -> Result<Pipes, Failure> {
    let mut taken: Vec<(String, PathBuf)> =
        inputs(source).into_iter().map(|path| ("the source".into(), path)).collect();
    let (mut pipes, mut tried) = (Vec::new(), Tried(Vec::new()));
    for (flag, path) in outputs {
        let Some(path) = path.filter(|path| *path != Path::new("-")) else { continue };
        let failed =
            |cause: io::Error| Failure::start(format!("{flag} {}: cannot be written: {cause}", path.display()));
        if is_pipe(path) {
            pipes.push(open_pipe(path, READER_PATIENCE_NS).map_err(failed)?);
        }
        if !is_special(path) {
            let new = !path.exists();
            OpenOptions::new().append(true).create(true).open(path).map_err(failed)?;
            if new {
                // Of a link the file that it leads to.
                tried.0.push(fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()));
            }
            if let Some((other, _)) = taken.iter().find(|(_, other)| is_same(path, other)) {
                return Err(Failure::start(format!("{flag} {}: is also {other}; name another file", path.display())));
            }
        }
        taken.push(((*flag).to_owned(), path.to_owned()));
    }
    Ok(Pipes { _open: pipes })
}

/// The files that a source is made of; a name that nothing has yet is itself.
fn inputs(source: &Path) -> Vec<PathBuf> {
    replay::matched(source).unwrap_or_else(|_| vec![source.to_owned()])
}

/// A pipe or a device: opening it may wait, and nothing in it can be destroyed.
fn is_special(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir())
}

fn is_pipe(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|meta| meta.file_type().is_fifo())
}

/// Opens a named pipe as soon as it has a reader; an error after so long without one.
fn open_pipe(path: &Path, patience_ns: u64) -> io::Result<File> {
    let mut options = OpenOptions::new();
    // By default it would wait for a reader, however long that takes, and for no signal.
    options.write(true).custom_flags(OFlags::NONBLOCK.bits() as i32);
    let no_reader = |cause: &io::Error| cause.raw_os_error() == Some(Errno::NXIO.raw_os_error());
    let mut opened = options.open(path);
    clock::wait_for(patience_ns, || {
        if opened.as_ref().is_err_and(no_reader) {
            opened = options.open(path);
        }
        !opened.as_ref().is_err_and(no_reader)
    });
    match opened {
        Err(cause) if no_reader(&cause) => Err(io::Error::other("nobody reads this pipe; start its reader first")),
        opened => opened,
    }
}

fn is_same(one: &Path, other: &Path) -> bool {
    match (fs::metadata(one), fs::metadata(other)) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => one == other,
    }
}

/// Where a link leads, and the next one, whether or not anything is there.
fn led_to(path: &Path) -> PathBuf {
    // As many as the kernel follows (path_resolution(7)).
    const LINKS: usize = 40;
    let mut path = path.to_owned();
    for _ in 0..LINKS {
        let Ok(to) = fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(to);
    }
    path
}

/// Writes a file as a whole: what was there before stays until the new one is complete. A link stays one.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let failed = |cause: io::Error| Failure::run(format!("{}: {cause}", path.display()));
    if is_special(path) {
        if is_pipe(path) {
            // Its reader may have left since; opened as below it would be waited for.
            open_pipe(path, READER_PATIENCE_NS).map_err(failed)?;
        }
        return OpenOptions::new().write(true).open(path).and_then(|mut file| file.write_all(bytes)).map_err(failed);
    }
    let path = &led_to(path);
    let mut beside = path.as_os_str().to_owned();
    beside.push(".part");
    let write = || {
        File::create(&beside)?.write_all(bytes)?;
        fs::rename(&beside, path)
    };
    write().map_err(failed)
}
