//! Finds how far a trace file of an earlier life is whole: up to its last whole event.
//!
//! A line is an event, with a comma where another follows; `[` stands alone in the first line, `]` in the last.

use std::fs::File;
use std::path::Path;

use serde::Deserialize;

use crate::repair::{FIRST_SPAN, foreign, not_begun, read_from, read_tail};
use crate::settings::RecorderError;

/// What every event has.
#[derive(Deserialize)]
struct Event {
    #[serde(rename = "name")]
    _name: String,
    #[serde(rename = "ph")]
    _phase: String,
}

/// Length of the file up to its last whole event, without a comma or an end behind it; 0 without one.
pub(crate) fn trace(path: &Path, file: &File) -> Result<u64, RecorderError> {
    let (_, head) = read_from(path, file, 0, HEAD.len() as u64)?;
    if head != HEAD {
        not_begun(path, "a trace", &head, |torn| HEAD.starts_with(torn))?;
        return Ok(0);
    }
    let mut span = FIRST_SPAN;
    loop {
        let (from, tail) = read_tail(path, file, span)?;
        match last_event(&tail, from == 0) {
            Found::End(end) => return Ok(from + end as u64),
            Found::Nothing if from == 0 => return Ok(0),
            Found::Nothing => span *= 2,
            Found::Foreign(line) => return Err(foreign(path, "a trace", line)),
        }
    }
}

const HEAD: &[u8] = b"[\n{\"name\":\"process_name\"";

enum Found<'a> {
    /// An event that ends here.
    End(usize),
    Nothing,
    Foreign(&'a [u8]),
}

/// Goes back line by line. The last line may be torn, and so may be the first one unless `at_head`.
fn last_event(tail: &[u8], at_head: bool) -> Found<'_> {
    let mut end = tail.len();
    let mut torn = false;
    loop {
        let begin = tail[..end].iter().rposition(|&byte| byte == b'\n').map(|place| place + 1);
        let line = &tail[begin.unwrap_or(0)..end];
        let event = line.strip_suffix(b",").unwrap_or(line);
        if (begin.is_some() || at_head) && serde_json::from_slice::<Event>(event).is_ok() {
            return Found::End(begin.unwrap_or(0) + event.len());
        }
        let Some(begin) = begin else { return Found::Nothing };
        match line {
            b"" | b"]" | b"[" => {}
            _ if torn => return Found::Foreign(line),
            _ => torn = true,
        }
        end = begin - 1;
    }
}
