//! The writer thread: takes parts in order, assembles sweeps, formats and writes them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam_channel::{Receiver, Sender};
use stage::Settled;

use crate::assemble::{Assembly, SweepRows};
use crate::detections_json::write_line;
use crate::labels_csv::{HEADER, Labels};
use crate::output::{Failure, Output};
use crate::part_rows::PartRows;
use crate::tracks_json;

/// What the writer has done so far: for the other thread to read, and whom to tell.
pub(crate) struct Progress {
    pub(crate) settled: Settled,
    pub(crate) lost_detections: AtomicU64,
    pub(crate) lost_tracks: AtomicU64,
    pub(crate) lost_labels: AtomicU64,
}

impl Progress {
    pub(crate) fn new(settled: Settled) -> Self {
        let none = || AtomicU64::new(0);
        Self { settled, lost_detections: none(), lost_tracks: none(), lost_labels: none() }
    }
}

/// Owns the files.
pub(crate) struct Writer {
    pub(crate) detections: Option<Output>,
    pub(crate) tracks: Option<Output>,
    pub(crate) labels: Option<Output>,
    pub(crate) progress: Arc<Progress>,
}

impl Writer {
    /// Writes until the queue is closed and empty; gives the outputs that failed.
    pub(crate) fn run(mut self, queue: Receiver<Box<PartRows>>, free: Sender<Box<PartRows>>) -> Vec<Failure> {
        if let Some(labels) = self.labels.as_mut().filter(|labels| !labels.is_begun()) {
            labels.begin(HEADER);
        }
        let mut assembly = Assembly::default();
        let mut format = Format::default();
        for rows in &queue {
            if let Some(sweep) = assembly.end_before(&rows.part) {
                self.write(sweep, &mut format);
            }
            if let Some(sweep) = assembly.add(&rows) {
                self.write(sweep, &mut format);
            }
            let (part, settles) = (rows.part, rows.settles);
            // The buffer first: who sees the part settled finds room for another. Fails only when nobody is left.
            let _ = free.send(rows);
            if settles {
                (self.progress.settled)(part);
            }
        }
        if let Some(sweep) = assembly.end() {
            self.write(sweep, &mut format);
        }
        [self.labels, self.tracks, self.detections].into_iter().flatten().filter_map(Output::end).collect()
    }

    /// Labels, tracks, detections: the last of them that is written says that the sweep is (see [`crate::repair`]).
    fn write(&mut self, sweep: &SweepRows, format: &mut Format) {
        if let Some(output) = &mut self.labels {
            format.bytes.clear();
            format.labels.write_rows(sweep, &mut format.bytes);
            if !output.append(sweep.part.sweep, &format.bytes) {
                self.progress.lost_labels.fetch_add(1, Ordering::Relaxed);
            }
        }
        if let Some(output) = &mut self.tracks {
            format.bytes.clear();
            let formatted = tracks_json::write_line(sweep, &mut format.bytes);
            debug_assert!(formatted.is_ok(), "writing to memory cannot fail");
            if !output.append(sweep.part.sweep, &format.bytes) {
                self.progress.lost_tracks.fetch_add(1, Ordering::Relaxed);
            }
        }
        if let Some(output) = &mut self.detections {
            format.bytes.clear();
            let formatted = write_line(sweep, &mut format.bytes);
            debug_assert!(formatted.is_ok(), "writing to memory cannot fail");
            if !output.append(sweep.part.sweep, &format.bytes) {
                self.progress.lost_detections.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

/// Memory that is used again for every sweep.
#[derive(Default)]
struct Format {
    labels: Labels,
    bytes: Vec<u8>,
}
