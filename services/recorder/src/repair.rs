//! Finds how far a file of an earlier life is whole, reading no more than its last sweep.
//!
//! Detections and tracks: a line is whole when it ends. Labels: a sweep's rows are whole when their first byte is not NUL
//! (see [`crate::output::Commit`]). Of a sweep labels are written first, then tracks, then detections, so the one sweep that
//! an earlier file has and a later one lacks was under way; it is cut, too, and all files name the same sweeps.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;

use serde::Deserialize;

use crate::labels_csv::HEADER;
use crate::settings::RecorderError;

/// How far a file is whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Whole {
    pub(crate) length: u64,
    /// Number of its last sweep; none in an empty file.
    pub(crate) last_sweep: Option<u64>,
}

/// How far a file of lines, one a sweep, is whole. `written` is what is whole of a file that is written after it: one sweep
/// more than that was under way.
pub(crate) fn lines(
    path: &Path,
    file: &File,
    kind: &'static str,
    written: Option<Whole>,
) -> Result<Whole, RecorderError> {
    let mut span = FIRST_SPAN;
    loop {
        let (from, tail) = read_tail(path, file, span)?;
        let Some(end) = after_last_newline(&tail) else {
            if from == 0 {
                return not_begun(path, kind, &tail, |torn| torn.starts_with(b"{"));
            }
            span *= 2;
            continue;
        };
        let Some((begin, sweep)) = last_line(path, kind, &tail[..end], from == 0)? else {
            span *= 2;
            continue;
        };
        let whole = Whole { length: from + end as u64, last_sweep: Some(sweep) };
        if written.is_none_or(|written| written.last_sweep >= whole.last_sweep) {
            return Ok(whole);
        }
        if begin == 0 && from == 0 {
            return Ok(Whole::default());
        }
        let Some((_, before)) = last_line(path, kind, &tail[..begin], from == 0)? else {
            span *= 2;
            continue;
        };
        // More than one sweep beyond: the other file has failed, this one has not.
        let is_under_way = written.is_some_and(|written| Some(before) <= written.last_sweep);
        return Ok(if is_under_way { Whole { length: from + begin as u64, last_sweep: Some(before) } } else { whole });
    }
}

/// Where the last of these whole lines begins, and its sweep; none where it begins before what was read.
fn last_line(
    path: &Path,
    kind: &'static str,
    lines: &[u8],
    at_begin: bool,
) -> Result<Option<(usize, u64)>, RecorderError> {
    #[derive(Deserialize)]
    struct Line {
        sweep: u64,
    }
    let before = lines.len().saturating_sub(1);
    let Some(begin) = after_last_newline(&lines[..before]).or(at_begin.then_some(0)) else { return Ok(None) };
    let line = &lines[begin..];
    match serde_json::from_slice(line) {
        Ok(Line { sweep }) => Ok(Some((begin, sweep))),
        Err(_) => Err(foreign(path, kind, line)),
    }
}

/// How far the file of labels is whole. `written` is what is whole of a file that is written after it.
pub(crate) fn labels(path: &Path, file: &File, written: Option<Whole>) -> Result<Whole, RecorderError> {
    let (_, head) = read_from(path, file, 0, HEADER.len() as u64)?;
    if head != HEADER {
        return not_begun(path, "labels", &head, |torn| HEADER.starts_with(torn) || TORN_HEADER.starts_with(torn));
    }
    let mut span = FIRST_SPAN;
    loop {
        let (from, tail) = read_tail(path, file, span)?;
        match last_sweeps(&tail, from == 0) {
            Scan::Foreign(line) => return Err(foreign(path, "labels", line)),
            Scan::More => span *= 2,
            Scan::Found { end, last, before_last } => {
                return Ok(match (last, written) {
                    // More than one sweep beyond: the other file has failed, this one has not.
                    (Some((sweep, begin)), Some(line))
                        if Some(sweep) > line.last_sweep && before_last <= line.last_sweep =>
                    {
                        Whole { length: from + begin as u64, last_sweep: before_last }
                    }
                    _ => Whole { length: from + end as u64, last_sweep: last.map(|(sweep, _)| sweep) },
                });
            }
        }
    }
}

pub(crate) const FIRST_SPAN: u64 = 1 << 16;

/// What a crash leaves of the header, written like rows: its first byte last.
const TORN_HEADER: &[u8] = b"\0weep,return,cluster\n";

/// What the end of a file of labels says.
#[derive(Debug, PartialEq)]
enum Scan<'a> {
    /// The last sweep begins before what was read.
    More,
    /// A line that is no row.
    Foreign(&'a [u8]),
    /// Whole up to `end`; the last sweep and where it begins; the sweep before that.
    Found { end: usize, last: Option<(u64, usize)>, before_last: Option<u64> },
}

/// Goes back row by row until two sweeps, or the header, are found. `tail` may begin inside a row unless `at_header`.
fn last_sweeps(tail: &[u8], at_header: bool) -> Scan<'_> {
    let Some(mut end) = after_last_newline(tail) else { return Scan::More };
    // A row without its end, in a block without a NUL: not ours, but its sweep is torn all the same.
    let mut torn = end < tail.len() && tail[end] != 0;
    let mut last: Option<(u64, usize)> = None;
    let mut place = end;
    loop {
        let Some(begin) = after_last_newline(&tail[..place - 1]).or(at_header.then_some(0)) else { return Scan::More };
        let row = &tail[begin..place];
        if row == HEADER && begin == 0 && at_header {
            return match last {
                Some((_, first)) if torn => Scan::Found { end: first, last: None, before_last: None },
                _ => Scan::Found { end, last, before_last: None },
            };
        }
        if row[0] == 0 {
            // The beginning of a block under way: what follows is torn.
            (end, last, torn) = (begin, None, false);
        } else {
            let Some(sweep) = sweep_of(row) else { return Scan::Foreign(row) };
            match last {
                Some((number, _)) if number == sweep => last = Some((sweep, begin)),
                Some((_, first)) if torn => {
                    (end, last, torn) = (first, Some((sweep, begin)), false);
                }
                Some(_) => return Scan::Found { end, last, before_last: Some(sweep) },
                None => last = Some((sweep, begin)),
            }
        }
        place = begin;
        if place == 0 {
            return Scan::Foreign(row);
        }
    }
}

/// The sweep of a row `sweep,return,cluster`.
fn sweep_of(row: &[u8]) -> Option<u64> {
    let digits = row.split(|&byte| byte == b',').next()?;
    std::str::from_utf8(digits).ok()?.parse().ok()
}

/// Place after the last newline.
fn after_last_newline(bytes: &[u8]) -> Option<usize> {
    bytes.iter().rposition(|&byte| byte == b'\n').map(|place| place + 1)
}

/// A file without a whole line: nothing of it is kept if it is the beginning of ours.
pub(crate) fn not_begun(
    path: &Path,
    kind: &'static str,
    bytes: &[u8],
    ours: impl Fn(&[u8]) -> bool,
) -> Result<Whole, RecorderError> {
    if bytes.is_empty() || ours(bytes) { Ok(Whole::default()) } else { Err(foreign(path, kind, bytes)) }
}

pub(crate) fn foreign(path: &Path, kind: &'static str, line: &[u8]) -> RecorderError {
    let shown = &line[..line.len().min(40)];
    RecorderError::Foreign { path: path.to_owned(), kind, found: String::from_utf8_lossy(shown).trim_end().to_owned() }
}

/// The last `span` bytes, or all, and where they begin.
pub(crate) fn read_tail(path: &Path, file: &File, span: u64) -> Result<(u64, Vec<u8>), RecorderError> {
    let length = file.metadata().map_err(|source| unreadable(path, source))?.len();
    read_from(path, file, length.saturating_sub(span), span)
}

/// Up to `span` bytes from `from` on.
pub(crate) fn read_from(path: &Path, file: &File, from: u64, span: u64) -> Result<(u64, Vec<u8>), RecorderError> {
    let length = file.metadata().map_err(|source| unreadable(path, source))?.len();
    let mut bytes = vec![0; span.min(length.saturating_sub(from)) as usize];
    file.read_exact_at(&mut bytes, from).map_err(|source| unreadable(path, source))?;
    Ok((from, bytes))
}

fn unreadable(path: &Path, source: io::Error) -> RecorderError {
    RecorderError::Resume { path: path.to_owned(), source }
}
