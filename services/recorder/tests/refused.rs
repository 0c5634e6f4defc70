//! Parts that nobody may act on any more.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use common::{HandMade, Line, lines, settings_in, start};
use messages::{Detections, Verdict};
use recorder::{Settings, Snapshot};
use stage::Sink;
use zerocopy::FromZeros;

// verifies REC-024
#[test]
fn a_refused_part_is_counted_once_and_its_sweep_is_written_without_it() {
    for sectors in [1, 3] {
        let folder = tempfile::tempdir().unwrap();
        let mut recorder = start(Settings { queue_parts: 16, ..settings_in(folder.path()) }).unwrap();
        for sweep in 0..3 {
            let parts = HandMade::interleaved(sweep, 600, 6, 10).sectors(sectors, |place| place as u32 % sectors);
            for (trace, message) in &parts {
                if sweep == 1 && trace.part.sector + 1 == sectors {
                    assert_eq!(recorder.refuse(trace, message, Verdict::RejectedStale), Verdict::RejectedStale);
                } else {
                    assert_eq!(recorder.accept(trace, message), Verdict::Complete);
                }
            }
        }
        recorder.finish().unwrap();
        assert_eq!(recorder.settled(), 3 * u64::from(sectors) - 1, "what is refused is not settled, too");
        let written: Vec<Line> = lines(&folder.path().join("detections.jsonl"));
        let complete: Vec<bool> = written.iter().map(|line| line.complete).collect();
        assert_eq!(complete, [true, false, true]);
        assert_eq!(written[1].rejected_sectors, Some(1));
        assert_eq!(written[1].missing_sectors, None);
        let rows: Vec<usize> = written.iter().map(|line| line.detections.len()).collect();
        assert_eq!(rows, [6, 6 - 6 / sectors as usize, 6]);
        let mut snapshot = Snapshot::default();
        recorder.snapshot_into(&mut snapshot);
        assert_eq!((snapshot.sweeps, snapshot.complete_sweeps, snapshot.missing_sweeps), (3, 2, 0));
        assert_eq!(snapshot.deadline.causes.get("recorder stale"), Some(&1));
        assert_eq!(snapshot.verdicts.get("stale"), Some(&1));
    }
}

// verifies REC-024
#[test]
fn a_refused_part_makes_nobody_wait() {
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = start(Settings { queue_parts: 1, ..settings_in(folder.path()) }).unwrap();
    let empty = Detections::new_box_zeroed().unwrap();
    // With one buffer most find none free.
    for sweep in 0..1_000 {
        let (trace, _) = HandMade::interleaved(sweep, 10, 1, 10).whole();
        recorder.refuse(&trace, &empty, Verdict::RejectedStale);
    }
    recorder.finish().unwrap();
    assert_eq!(recorder.settled(), 0);
    let written = lines(&folder.path().join("detections.jsonl"));
    assert!(written.iter().all(|line| !line.complete && line.detections.is_empty()));
}
