//! `accept` allocates nothing. One test in a file of its own: the allocator counts for the whole process.

mod common;

use std::alloc::System;
use std::fs::OpenOptions;
use std::os::unix::fs::OpenOptionsExt;

use common::{HandMade, settings, start};
use messages::Verdict;
use recorder::{Settings, Snapshot};
use rustix::fs::{CWD, Mode, OFlags, mkfifoat};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static GLOBAL: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

// verifies REC-009
#[test]
fn accepting_and_rejecting_parts_allocates_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pipe");
    mkfifoat(CWD, &path, Mode::from_raw_mode(0o600)).unwrap();
    let flags = OFlags::NONBLOCK.bits();
    let reader = OpenOptions::new().read(true).custom_flags(flags as i32).open(&path).unwrap();
    let of = Settings {
        detections: Some("/dev/null".into()),
        labels: Some(path),
        trace: Some("/dev/full".into()),
        lossless: false,
        queue_parts: 4,
        ..settings()
    };
    let mut recorder = start(of).unwrap();
    let (trace, large) = HandMade::interleaved(0, 50_000, 400, 100).whole();
    let (_, alone) = HandMade::interleaved(0, 50_000, 50_000, 100).whole();

    // Once rows are in the pipe, the writer has formatted them all and hangs in writing; the trace has
    // failed: nobody else allocates then.
    assert_eq!(recorder.accept(&trace, &large), Verdict::Complete);
    let header = "sweep,return,cluster\n".len() as u64;
    let mut snapshot = Snapshot::default();
    let mut written = || {
        recorder.snapshot_into(&mut snapshot);
        rustix::io::ioctl_fionread(&reader).unwrap() > header && snapshot.trace.is_some_and(|trace| trace.lost == 1)
    };
    assert!((0..6_000).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(10));
        written()
    }));

    let region = Region::new(GLOBAL);
    let verdicts = [&large, &alone, &large, &large, &alone].map(|part| recorder.accept(&trace, part));
    let change = region.change();
    assert_eq!(verdicts[..3], [Verdict::Complete; 3]);
    assert_eq!(verdicts[3..], [Verdict::RejectedSinkFull; 2]);
    assert_eq!((change.allocations, change.reallocations, change.deallocations), (0, 0, 0));
}
