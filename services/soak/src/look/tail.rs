use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

use events::Event;

/// Most that is read at once [bytes].
const CHUNK: usize = 1 << 20;
/// Most that is kept of the log [bytes].
const MOST_COPIED: u64 = 256 << 20;

/// A log that is read while it grows, and kept.
pub(crate) struct Tail {
    path: PathBuf,
    from: Option<(u64, File)>,
    /// Read, and no whole line yet.
    rest: Vec<u8>,
    buffer: Vec<u8>,
    copy: File,
    copied: u64,
    next: u64,
    last_ns: u64,
    /// Events by name, those left unsaid included.
    pub(crate) counts: BTreeMap<String, u64>,
    /// Numbers of the log that were skipped.
    pub(crate) skipped: u64,
}

impl Tail {
    /// Of the log at `path`, which need not be there yet, into `copy`.
    pub(crate) fn new(path: PathBuf, copy: File) -> Self {
        Self {
            path,
            from: None,
            rest: Vec::new(),
            buffer: vec![0; CHUNK],
            copy,
            copied: 0,
            next: 0,
            last_ns: 0,
            counts: BTreeMap::new(),
            skipped: 0,
        }
    }

    /// Everything new.
    pub(crate) fn read(&mut self) -> Vec<Event> {
        self.reopen();
        let mut new = Vec::new();
        while let Some((_, file)) = &mut self.from {
            let read = file.read(&mut self.buffer).unwrap_or(0);
            if read == 0 {
                break;
            }
            self.rest.extend_from_slice(&self.buffer[..read]);
            while let Some(end) = self.rest.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.rest.drain(..=end).collect();
                new.extend(self.take(&line));
            }
        }
        new
    }

    /// One line; none if it is known or no event.
    fn take(&mut self, line: &[u8]) -> Option<Event> {
        let event: Event = serde_json::from_slice(line).ok()?;
        // A log that begins anew counts from 0; one that was cut repeats its latter half.
        if event.number < self.next && event.time_ns <= self.last_ns {
            return None;
        }
        if event.number >= self.next {
            self.skipped += event.number - self.next;
        }
        (self.next, self.last_ns) = (event.number + 1, event.time_ns);
        *self.counts.entry(event.name.clone()).or_default() += 1 + event.unsaid;
        if self.copied < MOST_COPIED {
            self.copied += line.len() as u64;
            let _ = self.copy.write_all(line); // a full disk costs the copy
        }
        Some(event)
    }

    /// The file of the name may be another one by now, or have been cut.
    fn reopen(&mut self) {
        let Ok(meta) = std::fs::metadata(&self.path) else { return };
        let place = self.from.as_mut().and_then(|(inode, file)| Some((*inode, file.stream_position().ok()?)));
        if place.is_some_and(|(inode, at)| inode == meta.ino() && at <= meta.len()) {
            return;
        }
        self.rest.clear();
        self.from = File::open(&self.path).ok().map(|mut file| {
            let _ = file.seek(SeekFrom::Start(0));
            (meta.ino(), file)
        });
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, OpenOptions};
    use std::path::Path;

    use events::EventId;

    use super::*;

    fn say(path: &Path, number: u64, time_ns: u64) {
        let id = EventId::StageDied;
        let event = Event {
            number,
            time_ns,
            utc_ns: 0,
            id: id as u32,
            name: id.entry().name.to_owned(),
            severity: id.severity(),
            stage: "clusterer".to_owned(),
            sweep: 7,
            text: "signal 9".to_owned(),
            unsaid: 0,
        };
        let mut file = OpenOptions::new().create(true).append(true).open(path).unwrap();
        writeln!(file, "{}", serde_json::to_string(&event).unwrap()).unwrap();
    }

    #[test]
    fn a_log_is_followed_through_cuts_and_new_beginnings() {
        let dir = tempfile::tempdir().unwrap();
        let (path, copy) = (dir.path().join("events.jsonl"), dir.path().join("copy.jsonl"));
        let mut sut = Tail::new(path.clone(), File::create(&copy).unwrap());
        assert!(sut.read().is_empty());
        say(&path, 0, 1);
        say(&path, 1, 2);
        assert_eq!(sut.read().len(), 2);
        assert!(sut.read().is_empty());
        // Cut to its latter half: another file, a known line and one that is new; a number between was never seen.
        let cut = dir.path().join("cut");
        say(&cut, 1, 2);
        say(&cut, 3, 3);
        fs::rename(&cut, &path).unwrap();
        let new = sut.read();
        assert_eq!((new.len(), new[0].number, sut.skipped), (1, 3, 1));
        // Another run's.
        say(&cut, 0, 4);
        fs::rename(&cut, &path).unwrap();
        assert_eq!(sut.read()[0].number, 0);
        assert_eq!(sut.counts["stage_died"], 4);
        assert_eq!(fs::read_to_string(&copy).unwrap().lines().count(), 4);
    }
}
