//! Where a file's bytes go: gathered, written in large pieces, and cut back to what is whole when a write fails.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that are gathered before they are written, and that are written at once: while the kernel copies them nobody else
/// may have the core, where it cannot be preempted.
const GATHERED: usize = 64 * 1024;

/// What takes the bytes.
pub(crate) trait Target: Write + Send {
    /// Cuts off what is beyond a length.
    fn cut(&mut self, length: u64) -> io::Result<()>;
}

impl Target for File {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }
}

/// How far a sink has come, for who does not own it. Bytes.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    position: AtomicU64,
    committed: AtomicU64,
}

impl Meter {
    fn position(&self) -> u64 {
        self.position.load(Ordering::Relaxed)
    }

    /// Length up to the latest flush: whole records, in the system's hands.
    pub(crate) fn committed(&self) -> u64 {
        self.committed.load(Ordering::Relaxed)
    }
}

/// A stream of records. Flushed after whole ones only; after its first error it takes nothing more.
pub(crate) struct Sink {
    target: Box<dyn Target>,
    gathered: Vec<u8>,
    meter: Arc<Meter>,
    failed: bool,
}

impl Sink {
    pub(crate) fn new(target: Box<dyn Target>) -> Self {
        Self { target, gathered: Vec::with_capacity(GATHERED), meter: Arc::default(), failed: false }
    }

    pub(crate) fn meter(&self) -> Arc<Meter> {
        Arc::clone(&self.meter)
    }

    fn drain(&mut self) -> io::Result<()> {
        let written = self.target.write_all(&self.gathered);
        self.gathered.clear();
        self.checked(written)
    }

    fn checked(&mut self, result: io::Result<()>) -> io::Result<()> {
        if result.is_err() {
            self.failed = true;
            // Where even that fails, a reader finds the tear as after a crash.
            let _ = self.target.cut(self.meter.committed());
        }
        result
    }

    fn ready(&self) -> io::Result<()> {
        if self.failed { Err(io::Error::other("the file was closed by an error before")) } else { Ok(()) }
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.ready()?;
        if self.gathered.len() + bytes.len() > GATHERED {
            self.drain()?;
        }
        if bytes.len() < GATHERED {
            self.gathered.extend_from_slice(bytes);
        } else {
            for piece in bytes.chunks(GATHERED) {
                let written = self.target.write_all(piece);
                self.checked(written)?;
            }
        }
        self.meter.position.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.ready()?;
        self.drain()?;
        let flushed = self.target.flush();
        self.checked(flushed)?;
        self.meter.committed.store(self.meter.position(), Ordering::Relaxed);
        Ok(())
    }
}

impl Seek for Sink {
    /// Tells the position; goes nowhere else.
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.meter.position()),
            _ => Err(io::Error::from(io::ErrorKind::Unsupported)),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::sync::Mutex;

    use super::*;

    /// A disk in memory that is full after some bytes.
    #[derive(Clone, Default)]
    pub(crate) struct SmallDisk {
        pub(crate) bytes: Arc<Mutex<Vec<u8>>>,
        pub(crate) room: usize,
    }

    impl Write for SmallDisk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut held = self.bytes.lock().unwrap();
            let fits = bytes.len().min(self.room - held.len());
            held.extend_from_slice(&bytes[..fits]);
            if fits == 0 && !bytes.is_empty() { Err(io::ErrorKind::StorageFull.into()) } else { Ok(fits) }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Target for SmallDisk {
        fn cut(&mut self, length: u64) -> io::Result<()> {
            self.bytes.lock().unwrap().truncate(length as usize);
            Ok(())
        }
    }

    #[test]
    fn bytes_small_and_large_arrive_in_order() {
        let disk = SmallDisk { room: usize::MAX, ..SmallDisk::default() };
        let mut sut = Sink::new(Box::new(disk.clone()));
        let pieces = [1, GATHERED - 1, 1, GATHERED, 7, 3 * GATHERED, 2];
        let mut all = Vec::new();
        for (place, length) in pieces.into_iter().enumerate() {
            let piece = vec![place as u8; length];
            sut.write_all(&piece).unwrap();
            all.extend_from_slice(&piece);
            assert_eq!(sut.stream_position().unwrap(), all.len() as u64);
        }
        assert_eq!(sut.meter().committed(), 0);
        sut.flush().unwrap();
        assert_eq!(sut.meter().committed(), all.len() as u64);
        assert_eq!(*disk.bytes.lock().unwrap(), all);
    }

    #[test]
    fn a_full_disk_keeps_what_was_flushed_and_takes_nothing_more() {
        for room in [10, 11, GATHERED, GATHERED + 15] {
            let disk = SmallDisk { room, ..SmallDisk::default() };
            let mut sut = Sink::new(Box::new(disk.clone()));
            sut.write_all(&[1; 10]).unwrap();
            sut.flush().unwrap();
            let written =
                sut.write_all(&[2; 20]).and_then(|()| sut.write_all(&[2; GATHERED])).and_then(|()| sut.flush());
            assert!(written.is_err());
            assert!(sut.write_all(&[3]).is_err() && sut.flush().is_err());
            drop(sut);
            assert_eq!(*disk.bytes.lock().unwrap(), [1; 10], "{room}");
        }
    }
}
