//! The log of a run: JSON lines, appended by the supervisor alone, throttled and of bounded size.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use crate::throttle::Throttle;
use crate::{Event, EventId, Reader};

/// A log that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {cause}; free space there, or choose another folder")]
pub struct LogError {
    /// The file.
    pub path: PathBuf,
    /// What the system said.
    pub cause: io::Error,
}

/// How much is said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Of each event of each process so many at once.
    pub burst: u32,
    /// Then so many a second.
    pub per_s: f64,
    /// Size at which the file is cut to its latest half [bytes].
    pub log_bytes: u64,
}

/// Something to be said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Happened<'a> {
    /// Host time [ns].
    pub time_ns: u64,
    /// Time of day [ns since 1970].
    pub utc_ns: u64,
    /// What.
    pub id: EventId,
    /// The process that it is about, or [`crate::CHAIN`].
    pub stage: &'a str,
    /// The sweep that the source was at.
    pub sweep: u64,
    /// How bad it is among its kind: how long, how many. 0 where none is worse than another.
    pub size: u64,
    /// What happened, one line.
    pub text: &'a str,
}

/// The writing end of a run's log.
pub struct Log {
    path: PathBuf,
    /// None while it cannot be written.
    file: Option<File>,
    bytes: u64,
    log_bytes: u64,
    copy: Option<Box<dyn Write + Send>>,
    next: u64,
    before_ns: u64,
    throttle: Throttle,
    counts: BTreeMap<&'static str, u64>,
    unsaid: u64,
    unwritten: u64,
    line: Vec<u8>,
}

impl Log {
    /// Begins the log at `path`, readable by this user alone, or goes on with the one that is there. With `copy`, every line
    /// is also written there (`-`: to standard output), and that file is never cut.
    ///
    /// # Errors
    /// One of the files cannot be made.
    pub fn create(path: &Path, bounds: Bounds, copy: Option<&Path>) -> Result<Self, LogError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |cause| LogError { path, cause }
        };
        let mut before = Reader::new(path, 0);
        let (mut next, mut before_ns, mut counts) = (0, 0, BTreeMap::<&'static str, u64>::new());
        before.read(|event| {
            next = event.number + 1;
            before_ns = event.time_ns.max(before_ns);
            if let Some(id) = event.event_id() {
                *counts.entry(id.entry().name).or_default() += 1;
            }
        });
        let file = append(path).map_err(failed(path))?;
        let bytes = end_last_line(&file, path).map_err(failed(path))?;
        let copy: Option<Box<dyn Write + Send>> = match copy {
            Some(to) if to == Path::new("-") => Some(Box::new(io::stdout())),
            Some(to) => {
                let open = OpenOptions::new().create(true).append(next > 0).write(true).truncate(next == 0).open(to);
                Some(Box::new(open.map_err(failed(to))?))
            }
            None => None,
        };
        Ok(Self {
            path: path.to_owned(),
            file: Some(file),
            bytes,
            log_bytes: bounds.log_bytes,
            copy,
            next,
            before_ns,
            throttle: Throttle::new(bounds.burst, bounds.per_s),
            counts,
            unsaid: 0,
            unwritten: 0,
            line: Vec::new(),
        })
    }

    /// Sets other bounds, from the next event on.
    pub fn set_bounds(&mut self, bounds: Bounds) {
        self.log_bytes = bounds.log_bytes;
        self.throttle.set(bounds.burst, bounds.per_s);
    }

    /// Says that something happened, or counts it where its kind comes too often. Whether it was said.
    pub fn say(&mut self, happened: &Happened<'_>) -> bool {
        let Happened { time_ns, id, stage, size, .. } = *happened;
        let admitted = self.throttle.admit(time_ns, id, stage, size);
        match admitted {
            Some(unsaid) => self.put(happened, unsaid),
            None => self.unsaid = self.unsaid.saturating_add(1),
        }
        admitted.is_some()
    }

    /// Tells how many events were left unsaid of each kind that has not come for a second; with `all`, of every kind. To be
    /// called about as often as events are said.
    pub fn settle(&mut self, (time_ns, utc_ns): (u64, u64), sweep: u64, all: bool) {
        for (id, stage, unsaid) in self.throttle.over(time_ns, all) {
            let text = format!("{unsaid} more {}", id.entry().name);
            let id = EventId::EventsUnsaid;
            let told = Happened { time_ns, utc_ns, id, stage: &stage, sweep, size: unsaid, text: &text };
            self.put(&told, unsaid);
        }
    }

    /// How often each event was said, by name; of the lives before this one, what the log still held.
    pub fn counts(&self) -> &BTreeMap<&'static str, u64> {
        &self.counts
    }

    /// Events that were counted and not said.
    pub fn unsaid(&self) -> u64 {
        self.unsaid
    }

    /// Host time of the latest event of a life before this one [ns]; 0 where there was none.
    pub fn before_ns(&self) -> u64 {
        self.before_ns
    }

    /// Lines that the log or its copy lacks because they could not be written.
    pub fn unwritten(&self) -> u64 {
        self.unwritten
    }

    fn put(&mut self, happened: &Happened<'_>, unsaid: u64) {
        let entry = happened.id.entry();
        let event = Event {
            number: self.next,
            time_ns: happened.time_ns,
            utc_ns: happened.utc_ns,
            id: happened.id as u32,
            name: entry.name.to_owned(),
            severity: entry.severity,
            stage: happened.stage.to_owned(),
            sweep: happened.sweep,
            text: happened.text.to_owned(),
            unsaid,
        };
        self.next += 1;
        let count = self.counts.entry(entry.name).or_default();
        *count = count.saturating_add(1);
        self.line.clear();
        // Numbers and words alone: cannot fail.
        let _ = serde_json::to_writer(&mut self.line, &event);
        self.line.push(b'\n');
        // A full disk costs the log, not the chain.
        let written = self.append();
        let copied =
            self.copy.as_mut().is_none_or(|copy| copy.write_all(&self.line).and_then(|()| copy.flush()).is_ok());
        self.unwritten = self.unwritten.saturating_add(u64::from(!written || !copied));
    }

    fn append(&mut self) -> bool {
        let length = self.line.len() as u64;
        if self.bytes + length > self.log_bytes.max(2 * length) {
            self.cut();
        }
        let Some(file) = self.file.as_mut().filter(|_| self.bytes + length <= self.log_bytes.max(2 * length)) else {
            return false;
        };
        if file.write_all(&self.line).is_err() {
            // What was written of the line goes again; where even that fails, a reader passes over it.
            let _ = file.set_len(self.bytes);
            return false;
        }
        self.bytes += length;
        true
    }

    /// Leaves the latest half of the file, in a new one that takes its place as a whole: who reads the old one can end it.
    fn cut(&mut self) {
        let beside = self.path.with_extension("part");
        let cut = || -> io::Result<(File, u64)> {
            let bytes = fs::read(&self.path)?;
            let half = bytes.len() / 2;
            let from = bytes[half..].iter().position(|&byte| byte == b'\n').map_or(bytes.len(), |end| half + end + 1);
            let _ = fs::remove_file(&beside);
            let mut file = append(&beside)?;
            file.write_all(&bytes[from..])?;
            fs::rename(&beside, &self.path)?;
            Ok((file, (bytes.len() - from) as u64))
        };
        // Where it fails, the log stands still at its size, and the next line tries again.
        if let Ok((file, bytes)) = cut() {
            (self.file, self.bytes) = (Some(file), bytes);
        }
    }
}

fn append(path: &Path) -> io::Result<File> {
    OpenOptions::new().create(true).append(true).mode(0o600).open(path)
}

/// Makes sure that the next line begins one; gives the file's length.
fn end_last_line(mut file: &File, path: &Path) -> io::Result<u64> {
    let bytes = fs::read(path)?;
    if bytes.last().is_some_and(|&byte| byte != b'\n') {
        file.write_all(b"\n")?;
        return Ok(bytes.len() as u64 + 1);
    }
    Ok(bytes.len() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Severity;

    const BOUNDS: Bounds = Bounds { burst: 32, per_s: 15.0, log_bytes: 1 << 20 };

    fn happened(id: EventId, stage: &str, time_ns: u64, size: u64) -> Happened<'_> {
        Happened { time_ns, utc_ns: time_ns, id, stage, sweep: time_ns / 100_000_000, size, text: "so it was" }
    }

    fn events(path: &Path) -> Vec<Event> {
        let mut all = Vec::new();
        Reader::new(path, 0).read(|event| all.push(event));
        all
    }

    #[test]
    fn a_storm_of_ten_thousand_a_second_hides_nothing_and_every_event_is_accounted_for() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("events.jsonl");
        let mut sut = Log::create(&path, BOUNDS, None).unwrap();
        let (mut said, mut grave) = (0_u64, 0);
        for step in 0..20_000_u64 {
            let time_ns = step * 100_000;
            // The worst of all comes in the middle of it.
            let size = if step == 12_345 { 99 } else { step % 7 };
            sut.say(&happened(EventId::PartsDropped, "clusterer", time_ns, size));
            said += 1;
            if step % 1_000 == 500 {
                sut.say(&happened(EventId::PartsLost, "extractor", time_ns, 1));
                sut.say(&happened(EventId::StageDied, "clusterer", time_ns, 0));
                (said, grave) = (said + 2, grave + 2);
            }
            sut.settle((time_ns, time_ns), 0, false);
        }
        sut.settle((4_000_000_000, 0), 0, false);
        let all = events(&path);
        assert!(all.iter().enumerate().all(|(place, event)| event.number == place as u64), "no gap");
        assert_eq!(all.iter().filter(|event| event.severity >= Severity::Error).count(), grave);
        assert!(all.iter().any(|event| event.time_ns == 1_234_500_000 && event.name == "parts_dropped"), "the worst");
        let dropped = all.iter().filter(|event| event.name == "parts_dropped").count();
        assert!((60..=75).contains(&dropped), "32 at once, 15 a second, and what was worse than before: {dropped}");
        let ends: Vec<_> = all.iter().filter(|event| event.name == "events_unsaid").collect();
        assert_eq!((ends.len(), ends[0].stage.as_str()), (1, "clusterer"));
        let unsaid: u64 = all.iter().map(|event| event.unsaid).sum();
        assert_eq!((all.len() - ends.len()) as u64 + unsaid, said, "said or counted");
        assert_eq!((sut.unsaid(), sut.unwritten()), (unsaid, 0));
        assert_eq!(sut.counts()["stage_died"], 20);
    }

    #[test]
    fn the_log_is_cut_to_its_latest_half_and_goes_on_in_number_and_its_copy_is_whole() {
        let dir = tempfile::tempdir().unwrap();
        let (path, copy) = (dir.path().join("events.jsonl"), dir.path().join("copy.jsonl"));
        let bounds = Bounds { log_bytes: 10_000, ..BOUNDS };
        let mut sut = Log::create(&path, bounds, Some(&copy)).unwrap();
        let mut follower = Reader::new(&path, 0);
        let mut followed = Vec::new();
        for number in 0..500 {
            sut.say(&happened(EventId::StageDied, "clusterer", number, 0));
            assert!(fs::metadata(&path).unwrap().len() <= 10_000);
            if number % 7 == 0 {
                follower.read(|event| followed.push(event.number));
            }
        }
        follower.read(|event| followed.push(event.number));
        assert_eq!((followed, follower.missed()), ((0..500).collect::<Vec<_>>(), 0));
        let late = events(&path);
        assert!(late.len() >= 20 && late[0].number > 0 && late.last().unwrap().number == 499, "{}", late.len());
        assert!(late.windows(2).all(|pair| pair[0].number + 1 == pair[1].number));
        let mut reader = Reader::new(&path, 0);
        reader.read(|_| ());
        assert_eq!(reader.missed(), late[0].number, "who comes late sees what he missed");
        assert_eq!(events(&copy).len(), 500);
        assert_eq!(sut.unwritten(), 0);
    }

    #[test]
    fn a_successor_goes_on_where_a_torn_log_ended() {
        let dir = tempfile::tempdir().unwrap();
        let (path, copy) = (dir.path().join("events.jsonl"), dir.path().join("copy.jsonl"));
        let mut sut = Log::create(&path, BOUNDS, Some(&copy)).unwrap();
        for number in 0..3 {
            sut.say(&happened(EventId::StageDied, "clusterer", number, 0));
        }
        drop(sut);
        append(&path).unwrap().write_all(b"{\"number\":3,\"time").unwrap();
        let mut sut = Log::create(&path, BOUNDS, Some(&copy)).unwrap();
        sut.say(&happened(EventId::SupervisorAdopted, crate::CHAIN, 9, 0));
        let numbers = |path| events(path).iter().map(|event| event.number).collect::<Vec<_>>();
        assert_eq!((numbers(&path), numbers(&copy)), (vec![0, 1, 2, 3], vec![0, 1, 2, 3]));
        assert_eq!((sut.before_ns(), sut.counts()["stage_died"]), (2, 3));
        assert_eq!(numbers(&dir.path().join("none")), Vec::<u64>::new());
    }

    #[test]
    fn what_cannot_be_written_is_counted_and_nothing_else_happens() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("events.jsonl");
        let mut sut = Log::create(&path, BOUNDS, Some(Path::new("/dev/full"))).unwrap();
        assert!(sut.say(&happened(EventId::StageDied, "clusterer", 0, 0)));
        assert_eq!((sut.unwritten(), events(&path).len()), (1, 1));
        assert!(Log::create(&dir.path().join("none/events.jsonl"), BOUNDS, None).is_err());
    }

    #[test]
    fn a_line_longer_than_the_log_may_be_is_still_said() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("events.jsonl");
        let mut sut = Log::create(&path, Bounds { log_bytes: 10, ..BOUNDS }, None).unwrap();
        for number in 0..3 {
            sut.say(&happened(EventId::StageDied, "clusterer", number, 0));
        }
        assert_eq!(events(&path).last().unwrap().number, 2);
    }
}
