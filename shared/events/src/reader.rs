//! The reading end of a log: for whoever wants to know what happened, while it happens or afterwards.

use std::fs::{self, File};
use std::io::{self, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::Event;

/// Bytes that are read at once.
const BLOCK: usize = 64 * 1024;
/// Longest line that is kept in memory; a longer one is passed over.
const MAX_LINE: usize = 256 * 1024;

/// Reads a log from a number on, follows its growth, and survives that it is cut.
pub struct Reader {
    path: PathBuf,
    /// The file that is being read, with its number in the file system.
    file: Option<(File, u64)>,
    /// The beginning of a line whose end has not come.
    rest: Vec<u8>,
    next: u64,
    /// Host time of the latest event [ns].
    last_ns: u64,
    missed: u64,
}

impl Reader {
    /// Of the log at `path`, which need not be there yet, from event `since` on.
    pub fn new(path: &Path, since: u64) -> Self {
        Self { path: path.to_owned(), file: None, rest: Vec::new(), next: since, last_ns: 0, missed: 0 }
    }

    /// Passes over what is in the log now.
    pub fn skip(&mut self) {
        self.read(|_| ());
        self.missed = 0;
    }

    /// Tells what has come since the last call, in order of numbers. A line that is no event, and one whose end has not
    /// come, is passed over.
    pub fn read(&mut self, mut tell: impl FnMut(Event)) {
        // A log that was cut is another file: the one at hand is read to its end first.
        self.read_file(&mut tell);
        let there = fs::metadata(&self.path).ok().map(|meta| meta.ino());
        if there.is_some() && there != self.file.as_ref().map(|(_, inode)| *inode) {
            self.rest.clear();
            self.file = open(&self.path).ok();
            self.read_file(&mut tell);
        }
    }

    /// The number of the next event.
    pub fn next(&self) -> u64 {
        self.next
    }

    /// Events that were cut away before they were read.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    fn read_file(&mut self, tell: &mut impl FnMut(Event)) {
        let Some((mut file, inode)) = self.file.take() else { return };
        let mut block = vec![0; BLOCK];
        while let Ok(length) = file.read(&mut block) {
            if length == 0 {
                break;
            }
            for line in block[..length].split_inclusive(|&byte| byte == b'\n') {
                self.rest.extend_from_slice(line);
                if line.ends_with(b"\n") {
                    let line = std::mem::take(&mut self.rest);
                    self.take(&line, tell);
                } else if self.rest.len() > MAX_LINE {
                    self.rest.clear();
                }
            }
        }
        self.file = Some((file, inode));
    }

    fn take(&mut self, line: &[u8], tell: &mut impl FnMut(Event)) {
        let Ok(event) = serde_json::from_slice::<Event>(line) else { return };
        // Of another run under the same name, which counts from 0 again.
        if event.number == 0 && event.time_ns > self.last_ns && self.last_ns > 0 {
            self.next = 0;
        }
        if event.number >= self.next {
            self.last_ns = event.time_ns;
            self.missed = self.missed.saturating_add(event.number - self.next);
            self.next = event.number.saturating_add(1);
            tell(event);
        }
    }
}

fn open(path: &Path) -> io::Result<(File, u64)> {
    let file = File::open(path)?;
    let inode = file.metadata()?.ino();
    Ok((file, inode))
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn line(number: u64) -> String {
        let text = r#""time_ns":5,"utc_ns":6,"id":301,"name":"parts_dropped","severity":"warning","stage":"s","#;
        format!("{{\"number\":{number},{text}\"sweep\":7,\"text\":\"\",\"unsaid\":0}}\n")
    }

    fn numbers(sut: &mut Reader) -> Vec<u64> {
        let mut all = Vec::new();
        sut.read(|event| all.push(event.number));
        all
    }

    #[test]
    fn it_follows_growth_and_takes_a_torn_line_when_its_end_has_come() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log");
        let mut sut = Reader::new(&path, 1);
        assert_eq!(numbers(&mut sut), [] as [u64; 0], "there is no log yet");
        let mut file = File::create(&path).unwrap();
        let third = line(2);
        write!(file, "{}{}{}", line(0), line(1), &third[..20]).unwrap();
        assert_eq!(numbers(&mut sut), [1]);
        write!(file, "{}no event\n\u{0}\n{}", &third[20..], line(3)).unwrap();
        assert_eq!(numbers(&mut sut), [2, 3]);
        assert_eq!((numbers(&mut sut).len(), sut.missed(), sut.next()), (0, 0, 4));
    }

    #[test]
    fn what_was_cut_away_unread_is_noticed_by_number() {
        let dir = tempfile::tempdir().unwrap();
        let (path, beside) = (dir.path().join("log"), dir.path().join("beside"));
        fs::write(&path, line(0)).unwrap();
        let mut sut = Reader::new(&path, 0);
        assert_eq!(numbers(&mut sut), [0]);
        fs::write(&beside, line(4) + &line(5)).unwrap();
        fs::rename(&beside, &path).unwrap();
        assert_eq!((numbers(&mut sut), sut.missed()), (vec![4, 5], 3));
        let mut late = Reader::new(&path, 0);
        late.skip();
        assert_eq!((late.next(), late.missed()), (6, 0));
    }

    #[test]
    fn the_log_of_the_next_run_under_the_name_is_read_from_its_beginning() {
        let dir = tempfile::tempdir().unwrap();
        let (path, beside) = (dir.path().join("log"), dir.path().join("beside"));
        fs::write(&path, line(0) + &line(1)).unwrap();
        let mut sut = Reader::new(&path, 0);
        assert_eq!(numbers(&mut sut), [0, 1]);
        fs::write(&beside, (line(0) + &line(1)).replace("\"time_ns\":5", "\"time_ns\":9")).unwrap();
        fs::rename(&beside, &path).unwrap();
        assert_eq!((numbers(&mut sut), sut.missed()), (vec![0, 1], 0));
    }

    #[test]
    fn a_line_without_end_is_not_kept_in_memory() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log");
        fs::write(&path, vec![b'x'; 3 * MAX_LINE]).unwrap();
        let mut sut = Reader::new(&path, 0);
        assert_eq!(numbers(&mut sut).len(), 0);
        assert!(sut.rest.len() <= MAX_LINE + BLOCK);
    }
}
