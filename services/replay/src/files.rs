//! Which files a recording consists of, and in which format they are.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::error::{Place, ReplayError};
use crate::faults::{Fault, Faults};
use crate::format::Format;

/// Bytes by which a format is told.
const HEAD_BYTES: u64 = 4_096;

/// The first bytes of a file.
pub(crate) fn head(path: &Path) -> Result<Vec<u8>, ReplayError> {
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head))
        .map_err(|source| ReplayError::Io { path: path.to_owned(), source })?;
    Ok(head)
}

/// The files that `path` stands for, in name order: itself, those of a folder, or those that match a pattern (`*`, `?`,
/// `[…]`, `**`). What exists is no pattern. Folders and hidden files are none of a recording's. Nothing where the path is
/// a file.
fn several(path: &Path) -> Result<Option<Vec<PathBuf>>, ReplayError> {
    let io = |source| ReplayError::Io { path: path.to_owned(), source };
    let is_hidden = |file: &Path| file.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    let mut files = Vec::new();
    match std::fs::metadata(path) {
        Ok(metadata) if !metadata.is_dir() => return Ok(None),
        Ok(_) => {
            for entry in std::fs::read_dir(path).map_err(io)? {
                let file = entry.map_err(io)?.path();
                if file.is_file() && !is_hidden(&file) {
                    files.push(file);
                }
            }
        }
        Err(source) => {
            let Some(pattern) = pattern(path) else { return Err(io(source)) };
            let bad = |what: String| ReplayError::Pattern { path: path.to_owned(), what };
            let options = glob::MatchOptions { require_literal_leading_dot: true, ..glob::MatchOptions::new() };
            for file in glob::glob_with(pattern, options).map_err(|error| bad(error.to_string()))? {
                // Folders that may not be read hold no file that could be.
                files.extend(file.ok().filter(|file| file.is_file()));
            }
            if files.is_empty() {
                return Err(bad("no file matches".to_owned()));
            }
        }
    }
    files.sort();
    Ok(Some(files))
}

/// The path as a pattern, if it is one.
fn pattern(path: &Path) -> Option<&str> {
    path.to_str().filter(|text| text.contains(['*', '?', '[']))
}

/// The files that `from` stands for, in name order: itself, those of a folder, or those that match a pattern. Their
/// content is not looked at.
///
/// # Errors
/// The path is not there, and is no pattern or one that nothing matches.
pub fn matched(from: &Path) -> Result<Vec<PathBuf>, ReplayError> {
    Ok(several(from)?.unwrap_or_else(|| vec![from.to_owned()]))
}

/// The files of a recording in name order, and their format: found by content unless it is `forced`.
pub(crate) fn find(
    path: &Path,
    forced: Option<Format>,
    faults: &mut Faults,
) -> Result<(Vec<PathBuf>, Format), ReplayError> {
    let Some(files) = several(path)? else {
        let format = match forced {
            Some(format) => format,
            None => told(path)?.map_err(|found| ReplayError::UnknownFormat { path: path.to_owned(), found })?,
        };
        return Ok((vec![path.to_owned()], format));
    };

    let mut found: Vec<(PathBuf, Format)> = Vec::new();
    let mut others: Vec<(&PathBuf, String)> = Vec::new();
    for file in &files {
        match told(file) {
            Ok(Ok(format)) => found.push((file.clone(), format)),
            Ok(Err(what)) => others.push((file, what)),
            Err(error) => others.push((file, error.to_string())),
        }
    }
    if let Some(forced) = forced {
        found.retain(|(_, format)| *format == forced);
        if found.is_empty() {
            // None is told by its content, so the caller must know better.
            found = files.iter().map(|file| (file.clone(), forced)).collect();
            others.clear();
        }
    }
    let Some((first_file, first)) = found.first().cloned() else {
        return Err(ReplayError::NoRecording { path: path.to_owned(), files: files.len() });
    };
    if let Some((second_file, second)) = found.iter().find(|(_, format)| *format != first).cloned() {
        return Err(ReplayError::MixedFormats { path: path.to_owned(), first, first_file, second, second_file });
    }
    for (file, what) in others {
        faults.note(Fault::OtherFile, 1, file, Place::Byte(0), what);
    }
    Ok((found.into_iter().map(|(file, _)| file).collect(), first))
}

/// The file's format, or what its first bytes are.
fn told(path: &Path) -> Result<Result<Format, String>, ReplayError> {
    let head = head(path)?;
    Ok(Format::of(&head).ok_or_else(|| match head.get(..8.min(head.len())) {
        Some([]) | None => "is empty".to_owned(),
        Some(bytes) => {
            let hex: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            format!("begins with bytes {} at offset 0, the mark of no known format", hex.join(" "))
        }
    }))
}
