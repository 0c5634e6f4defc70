//! The thread that writes the trace file: its own, so that neither a slow trace nor slow detections hold up the other.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{Builder, JoinHandle};

use crossbeam_channel::{Receiver, Sender, bounded};

use crate::output::{Failure, Output};
use crate::settings::RecorderError;
use crate::snapshot::TraceCounts;
use crate::trace_events::{TraceEvents, Traced};

/// Parts that may wait for the writer: 2.8 s of 36 sectors at 10 Hz, half a megabyte.
const QUEUE_PARTS: usize = 1_024;
/// Bytes of events after which they are written, though more parts are waiting.
const BLOCK_BYTES: usize = 1 << 16;

/// The way to the trace file.
pub(crate) struct TraceLine {
    queue: Option<Sender<Traced>>,
    writer: Option<JoinHandle<Option<Failure>>>,
    counts: Arc<Counts>,
    lossless: bool,
}

#[derive(Default)]
struct Counts {
    events: AtomicU64,
    lost: AtomicU64,
    failed: AtomicBool,
}

impl TraceLine {
    /// Starts the writer of `output`, which has events already if `resumed`.
    pub(crate) fn start(output: Output, stages: &[String], lossless: bool) -> Result<Self, RecorderError> {
        let (queue, queued) = bounded(QUEUE_PARTS);
        let counts = Arc::new(Counts::default());
        let events = TraceEvents::new(stages, output.is_begun());
        let writer =
            TraceWriter { output, events, counts: Arc::clone(&counts), bytes: Vec::with_capacity(2 * BLOCK_BYTES) };
        let writer = Builder::new()
            .name("recorder-trace".to_owned())
            .spawn(move || writer.run(&queued))
            .map_err(RecorderError::Thread)?;
        Ok(Self { queue: Some(queue), writer: Some(writer), counts, lossless })
    }

    /// Passes a part on. Waits for room if lossless; else what finds none is lost, and counted.
    pub(crate) fn send(&self, part: Traced) {
        let Some(queue) = &self.queue else { return };
        let sent = if self.lossless { queue.send(part).is_ok() } else { queue.try_send(part).is_ok() };
        if !sent {
            self.counts.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    pub(crate) fn counts(&self) -> TraceCounts {
        TraceCounts {
            events: self.counts.events.load(Ordering::Relaxed),
            lost: self.counts.lost.load(Ordering::Relaxed),
            failed: self.counts.failed.load(Ordering::Relaxed),
        }
    }

    /// Waits until all is written. Gives what failed; a second call gives nothing.
    pub(crate) fn finish(&mut self) -> std::thread::Result<Option<Failure>> {
        self.queue = None;
        self.writer.take().map_or(Ok(None), JoinHandle::join)
    }
}

/// Owns the file.
struct TraceWriter {
    output: Output,
    events: TraceEvents,
    counts: Arc<Counts>,
    bytes: Vec<u8>,
}

impl TraceWriter {
    /// Writes until the queue is closed and empty.
    fn run(mut self, queue: &Receiver<Traced>) -> Option<Failure> {
        let events = self.events.begin(&mut self.bytes);
        self.write(0, events, 0);
        for part in queue {
            let sweep = part.trace.part.sweep;
            self.bytes.clear();
            let (mut events, mut parts) = (self.events.add(&part, &mut self.bytes), 1);
            while self.bytes.len() < BLOCK_BYTES
                && let Ok(part) = queue.try_recv()
            {
                events += self.events.add(&part, &mut self.bytes);
                parts += 1;
            }
            self.write(sweep, events, parts);
        }
        self.bytes.clear();
        self.bytes.extend_from_slice(TraceEvents::END);
        self.write(0, 0, 0);
        let lost = self.counts.lost.load(Ordering::Relaxed);
        self.output.end().map(|failure| Failure { lost, what: "parts", ..failure })
    }

    fn write(&mut self, sweep: u64, events: u64, parts: u64) {
        if self.output.append(sweep, &self.bytes) {
            self.counts.events.fetch_add(events, Ordering::Relaxed);
        } else {
            self.counts.failed.store(true, Ordering::Relaxed);
            self.counts.lost.fetch_add(parts, Ordering::Relaxed);
        }
    }
}
