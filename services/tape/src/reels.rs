//! The files of a run: begun, turned over by size and age, removed for the quota, closed by an error and tried again.

use std::fs::OpenOptions;
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use crate::Topic;
use crate::counts::{Tally, add};
use crate::kept::KeptFiles;
use crate::names::numbered;
use crate::reel::{About, Closed, Reel, Stamps};
use crate::settings::{Settings, TapeError, WhenFull};
use crate::sink::Target;

/// How often the time between two attempts doubles. A disk that is full is a little less so once a torn chunk is cut
/// off: without patience it would be filled with small files.
const MOST_DOUBLINGS: u32 = 8;

/// Creates a file of the run, or empties it.
pub(crate) type Open = Box<dyn Fn(&Path) -> io::Result<Box<dyn Target>> + Send>;

/// Opens files of the file system.
pub(crate) fn on_disk() -> Open {
    Box::new(|path| Ok(Box::new(OpenOptions::new().write(true).create(true).truncate(true).open(path)?)))
}

/// What is being written.
enum State {
    /// A file, begun at a host time [ns].
    Writing(Box<Reel>, u64),
    /// Nothing until a host time [ns], because of an error; nothing ever again without one.
    Failed(Option<u64>),
    /// Nothing ever again: the quota is used up.
    Full,
}

/// The run's files.
pub(crate) struct Reels {
    settings: Settings,
    path: PathBuf,
    about: About,
    open: Open,
    state: State,
    /// Of the latest file.
    number: u64,
    /// Whether the latest file was left without a message, so that its number is used again.
    empty: bool,
    /// Whether nothing was written since the latest error.
    failing: bool,
    /// Attempts in a row of which no file was completed.
    attempts: u32,
    /// All files but the one being written.
    pub(crate) kept: KeptFiles,
    /// Whether there can be more than one file: not where the path is a device.
    regular: bool,
    pub(crate) files: u64,
    pub(crate) failure: Option<String>,
    pub(crate) lost: Tally,
    closed_bytes: u64,
}

impl Reels {
    /// Begins the run's first file, or with `resume` the one after those that are there.
    pub(crate) fn start(
        settings: Settings,
        path: &Path,
        about: About,
        resume: bool,
        open: Open,
        utc_ns: u64,
    ) -> Result<Self, TapeError> {
        let create = |source| TapeError::Create { path: path.to_owned(), source };
        let kind = std::fs::metadata(path).map(|metadata| metadata.file_type());
        if kind.as_ref().is_ok_and(|kind| kind.is_fifo() || kind.is_socket()) {
            return Err(TapeError::NoFile(path.to_owned()));
        }
        if kind.as_ref().is_ok_and(std::fs::FileType::is_dir) {
            return Err(create(io::ErrorKind::IsADirectory.into()));
        }
        let regular = kind.map_or(true, |kind| kind.is_file());
        let mut reels = Self {
            settings,
            path: path.to_owned(),
            about,
            open,
            state: State::Failed(None),
            number: 0,
            empty: true,
            failing: false,
            attempts: 0,
            kept: KeptFiles::default(),
            regular,
            files: 0,
            failure: None,
            lost: Tally::default(),
            closed_bytes: 0,
        };
        if regular {
            let foreign = |other| TapeError::Foreign { path: path.to_owned(), other };
            reels.number = reels.kept.look(path, resume).map_err(create)?.map_err(foreign)?;
        }
        // What cannot even be opened is refused; what cannot be written is an event, as later on.
        let target = (reels.open)(&numbered(path, reels.number)).map_err(create)?;
        reels.begin(target, utc_ns);
        Ok(reels)
    }

    fn begin(&mut self, target: Box<dyn Target>, utc_ns: u64) {
        self.files += u64::from(self.files == 0 || !self.empty);
        match Reel::begin(target, &self.settings, &self.about, self.number) {
            Ok(reel) => self.state = State::Writing(Box::new(reel), utc_ns),
            Err(error) => self.fail(Closed::default(), &error, utc_ns),
        }
    }

    /// Writes a message, or counts it as lost.
    pub(crate) fn write(&mut self, topic: Topic, stamps: &Stamps, data: &[u8]) {
        self.turn(stamps.utc_ns);
        let State::Writing(reel, _) = &mut self.state else {
            self.lost[topic as usize] += 1;
            return;
        };
        let written = reel.write(&self.settings, topic, stamps, data);
        let full = reel.open_bytes() >= self.settings.chunk_bytes;
        if let Err(error) = written {
            self.close_failed(&error, stamps.utc_ns);
        } else if full {
            self.commit(stamps.utc_ns);
        }
    }

    /// Hands all that was written to the system.
    pub(crate) fn commit(&mut self, utc_ns: u64) {
        let State::Writing(reel, _) = &mut self.state else { return };
        if let Err(error) = reel.commit() {
            self.close_failed(&error, utc_ns);
            return;
        }
        if self.failing && *reel.committed() != Tally::default() {
            self.failing = false;
            tracing::info!(file = %numbered(&self.path, self.number).display(), "recording goes on");
        }
        self.keep_quota(utc_ns);
    }

    /// Whether messages wait to be handed to the system.
    pub(crate) fn is_open(&self) -> bool {
        matches!(&self.state, State::Writing(reel, _) if reel.open_bytes() > 0)
    }

    /// Ends the file being written; false where that fails.
    pub(crate) fn finish(&mut self, utc_ns: u64) -> bool {
        let State::Writing(reel, _) = std::mem::replace(&mut self.state, State::Failed(None)) else { return true };
        let (closed, result) = reel.finish();
        match result {
            Ok(()) => {
                self.keep(closed);
                self.attempts = 0;
            }
            Err(error) => {
                self.fail(closed, &error, utc_ns);
                return false;
            }
        }
        true
    }

    /// Begins the next file where it is time for it.
    fn turn(&mut self, utc_ns: u64) {
        let due = match &self.state {
            State::Writing(reel, begun_ns) => {
                let old = self.settings.rotate_ns.is_some_and(|age| utc_ns.saturating_sub(*begun_ns) >= age);
                let large = self.settings.rotate_bytes.is_some_and(|most| reel.bytes() >= most);
                self.regular && (old || large)
            }
            State::Failed(again_ns) => again_ns.is_some_and(|again_ns| utc_ns >= again_ns),
            State::Full => false,
        };
        if !due || !self.finish(utc_ns) {
            return;
        }
        self.number += u64::from(!self.empty);
        match (self.open)(&numbered(&self.path, self.number)) {
            Ok(target) => self.begin(target, utc_ns),
            Err(error) => self.fail(Closed::default(), &error, utc_ns),
        }
    }

    fn close_failed(&mut self, error: &io::Error, utc_ns: u64) {
        if let State::Writing(reel, _) = std::mem::replace(&mut self.state, State::Failed(None)) {
            self.fail(reel.give_up(), error, utc_ns);
        }
    }

    /// Waits for another attempt. Tells the first error of several in a row.
    fn fail(&mut self, closed: Closed, error: &io::Error, utc_ns: u64) {
        add(&mut self.lost, &closed.lost);
        self.keep(closed);
        let path = numbered(&self.path, self.number);
        if !std::mem::replace(&mut self.failing, true) {
            tracing::error!(file = %path.display(), %error, "recording closed, what it should hold is lost from here on");
        }
        self.failure = Some(format!("{}: {error}", path.display()));
        let again = self.settings.retry_ns.filter(|_| self.regular);
        let span_ns = |first_ns: u64| first_ns.saturating_mul(1 << self.attempts.min(MOST_DOUBLINGS));
        self.state = State::Failed(again.map(|first_ns| utc_ns.saturating_add(span_ns(first_ns))));
        self.attempts += 1;
    }

    fn keep(&mut self, closed: Closed) {
        self.closed_bytes += closed.bytes;
        self.empty = closed.messages == Tally::default();
        if !self.empty {
            self.kept.keep(numbered(&self.path, self.number), closed.bytes, closed.messages);
        }
    }

    fn keep_quota(&mut self, utc_ns: u64) {
        let Some(quota) = self.settings.quota_bytes.filter(|_| self.regular) else { return };
        while self.current_bytes() + self.kept.bytes() > quota {
            if self.settings.when_full == WhenFull::Stop {
                self.finish(utc_ns);
                self.state = State::Full;
                tracing::warn!(file = %self.path.display(), "recording ends, its quota is used up");
                return;
            }
            if !self.kept.remove_oldest() {
                return;
            }
        }
    }

    fn current_bytes(&self) -> u64 {
        match &self.state {
            State::Writing(reel, _) => reel.bytes(),
            _ => 0,
        }
    }

    /// Bytes of all files of this life, removed ones included.
    pub(crate) fn bytes(&self) -> u64 {
        self.closed_bytes + self.current_bytes()
    }

    /// Messages of this life in files that are there.
    pub(crate) fn messages(&self) -> Tally {
        let mut sum = self.kept.written;
        if let State::Writing(reel, _) = &self.state {
            add(&mut sum, reel.committed());
        }
        sum
    }

    pub(crate) fn settings(&self) -> &Settings {
        &self.settings
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::{Arc, Mutex};

    use super::*;
    use crate::Compression;
    use crate::settings::TapeFile;
    use crate::settings::tests::shipped;
    use crate::sink::tests::SmallDisk;

    const S: u64 = 1_000_000_000;

    thread_local! {
        /// What was told on this thread as an error, and as anything else.
        static TOLD: Cell<[usize; 2]> = const { Cell::new([0; 2]) };
    }

    /// Counts what is told, for each test apart.
    struct Told;

    impl tracing::Subscriber for Told {
        fn enabled(&self, _: &tracing::Metadata<'_>) -> bool {
            true
        }

        fn new_span(&self, _: &tracing::span::Attributes<'_>) -> tracing::span::Id {
            tracing::span::Id::from_u64(1)
        }

        fn event(&self, event: &tracing::Event<'_>) {
            let other = usize::from(*event.metadata().level() != tracing::Level::ERROR);
            let mut told = TOLD.get();
            told[other] += 1;
            TOLD.set(told);
        }

        fn record(&self, _: &tracing::span::Id, _: &tracing::span::Record<'_>) {}
        fn record_follows_from(&self, _: &tracing::span::Id, _: &tracing::span::Id) {}
        fn enter(&self, _: &tracing::span::Id) {}
        fn exit(&self, _: &tracing::span::Id) {}
    }
    const MESSAGE: [u8; 1000] = [7; 1000];

    /// Files in memory, each on a disk with the room that there is when it is opened.
    #[derive(Clone, Default)]
    struct Shelf {
        room: Arc<AtomicUsize>,
        files: Arc<Mutex<Vec<(PathBuf, SmallDisk)>>>,
    }

    impl Shelf {
        fn open(&self) -> Open {
            let shelf = self.clone();
            Box::new(move |path| {
                let room = shelf.room.load(Ordering::Relaxed);
                if room == 0 {
                    return Err(io::ErrorKind::ReadOnlyFilesystem.into());
                }
                let disk = SmallDisk { room, ..SmallDisk::default() };
                shelf.files.lock().unwrap().push((path.to_owned(), disk.clone()));
                Ok(Box::new(disk))
            })
        }

        /// Name and messages of each file, as far as it reads.
        fn read(&self) -> Vec<(String, usize)> {
            let files = self.files.lock().unwrap();
            let read = |(path, disk): &(PathBuf, SmallDisk)| {
                let bytes = disk.bytes.lock().unwrap().clone();
                let stream =
                    mcap::MessageStream::new_with_options(&bytes, mcap::read::Options::IgnoreEndMagic.into()).unwrap();
                let name = path.file_name().unwrap().to_str().unwrap().to_owned();
                (name, stream.take_while(Result::is_ok).count())
            };
            files.iter().map(read).collect()
        }
    }

    fn start(shelf: &Shelf, folder: &Path, change: impl FnOnce(&mut TapeFile)) -> Result<Reels, TapeError> {
        let mut file = TapeFile { compression: Compression::None, chunk_kib: 1, ..shipped() };
        change(&mut file);
        Reels::start(file.checked().unwrap(), &folder.join("run.mcap"), About::default(), false, shelf.open(), 0)
    }

    fn write(reels: &mut Reels, utc_ns: u64) {
        reels.write(Topic::Status, &Stamps { log_time_ns: 5, utc_ns, sequence: 0 }, &MESSAGE);
        reels.commit(utc_ns);
    }

    fn told(reels: &Reels) -> (u64, u64) {
        (reels.messages()[Topic::Status as usize], reels.lost[Topic::Status as usize])
    }

    #[test]
    fn what_is_lost_and_what_is_written_add_up_wherever_the_disk_fills() {
        let folder = tempfile::tempdir().unwrap();
        // The schemas and the first message are the first chunk.
        for room in (400..16_000).step_by(97) {
            let shelf = Shelf::default();
            shelf.room.store(room, Ordering::Relaxed);
            let mut sut = start(&shelf, folder.path(), |file| file.retry_s = 0.0).unwrap();
            for number in 0..20 {
                write(&mut sut, number * 3600 * S);
            }
            sut.finish(0);
            let (written, lost) = told(&sut);
            assert_eq!(written + lost, 20, "{room}");
            assert_eq!(shelf.read(), [("run.mcap".to_owned(), written as usize)], "{room}");
            assert_eq!(shelf.files.lock().unwrap()[0].1.bytes.lock().unwrap().len() as u64, sut.bytes());
            assert!(sut.failure.is_some());
        }
    }

    #[test]
    fn a_new_file_is_tried_later_and_one_without_messages_is_used_again() {
        let folder = tempfile::tempdir().unwrap();
        let shelf = Shelf::default();
        shelf.room.store(14_000, Ordering::Relaxed);
        let mut sut = start(&shelf, folder.path(), |file| file.retry_s = 10.0).unwrap();
        while sut.failure.is_none() {
            write(&mut sut, S);
        }
        let (first, lost) = told(&sut);
        assert!(first > 0);
        assert_eq!(lost, 1);
        write(&mut sut, 10 * S);
        assert_eq!(shelf.read().len(), 1, "not yet");
        shelf.room.store(500, Ordering::Relaxed);
        write(&mut sut, 11 * S);
        shelf.room.store(0, Ordering::Relaxed);
        write(&mut sut, 30 * S);
        assert_eq!(shelf.read().len(), 2, "twice as long");
        write(&mut sut, 31 * S);
        shelf.room.store(14_000, Ordering::Relaxed);
        write(&mut sut, 71 * S);
        write(&mut sut, 72 * S);
        sut.finish(73 * S);
        assert_eq!(told(&sut), (first + 2, lost + 4));
        let names = |name: &str, messages: u64| (name.to_owned(), messages as usize);
        assert_eq!(shelf.read(), [names("run.mcap", first), names("run_0001.mcap", 0), names("run_0001.mcap", 2)]);
    }

    #[test]
    fn a_disk_that_is_full_at_the_start_is_an_event_and_one_that_cannot_be_opened_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let shelf = Shelf::default();
        assert!(matches!(start(&shelf, folder.path(), |_| ()), Err(TapeError::Create { .. })));
        shelf.room.store(10, Ordering::Relaxed);
        let mut sut = start(&shelf, folder.path(), |file| file.retry_s = 0.0).unwrap();
        write(&mut sut, S);
        assert_eq!((told(&sut), sut.failure.is_some()), ((0, 1), true));
    }

    #[test]
    fn a_disk_that_stays_full_is_told_once_and_so_is_that_recording_goes_on() {
        let folder = tempfile::tempdir().unwrap();
        // One for all tests: what is told is found by place in the code, and a place that was once told to nobody stays mute.
        let _ = tracing::subscriber::set_global_default(Told);
        let before = TOLD.get();
        let told = || [0, 1].map(|which| TOLD.get()[which] - before[which]);
        let shelf = Shelf::default();
        shelf.room.store(14_000, Ordering::Relaxed);
        let mut sut = start(&shelf, folder.path(), |file| file.retry_s = 1.0).unwrap();
        (0..10).for_each(|_| write(&mut sut, 0));
        shelf.room.store(300, Ordering::Relaxed);
        (1..1000).for_each(|second| write(&mut sut, second * S));
        assert_eq!(told(), [1, 0]);
        shelf.room.store(1 << 20, Ordering::Relaxed);
        (1000..1300).for_each(|second| write(&mut sut, second * S));
        assert_eq!(told(), [1, 1]);
        assert_eq!(sut.number, 1);
    }
}
