use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{Builder, JoinHandle};

use crossbeam_channel::{Receiver, Sender, bounded};
use messages::{Detections, Order, Place, Trace, Verdict};
use stage::{Settled, Sink, SinkError};

use crate::output::{Commit, Failure, Output};
use crate::part_rows::{PartRows, is_coherent};
use crate::repair::Whole;
use crate::settings::{RecorderError, Settings};
use crate::snapshot::Snapshot;
use crate::stats::Statistics;
use crate::trace_events::Traced;
use crate::trace_file::TraceLine;
use crate::writer::{Progress, Writer};
use crate::{repair, repair_trace};

/// The chain's ledgered sink: detections and labels as files, latencies as statistics.
///
/// Dropping it without [`Sink::finish`] does not wait: the writer ends by itself when it has written what it was given.
pub struct Recorder {
    statistics: Statistics,
    /// The way to the writer; none when nothing is written, or after `finish`.
    line: Option<Line>,
    /// The way to the trace file, where one is written.
    trace: Option<TraceLine>,
    progress: Arc<Progress>,
    lossless: bool,
    /// Where the source sends again what was lost.
    order: Option<Order>,
    with_members: bool,
    finished: bool,
    statistics_file: Option<PathBuf>,
    /// Memory that is used again for every checkpoint.
    snapshot: Snapshot,
}

/// Buffers go round: from `free`, filled, into `queue`, and back when they are written.
struct Line {
    queue: Sender<Box<PartRows>>,
    free: Receiver<Box<PartRows>>,
    writer: JoinHandle<Vec<Failure>>,
}

impl Recorder {
    /// Opens the files, allocates every buffer and starts the writer threads: one for detections and labels, one for the
    /// trace file, each where there is such a file.
    ///
    /// With `resume`, what a killed process left torn at a file's end is cut, and writing goes on from there.
    /// A named pipe is opened when the first sweep is written, because opening waits for a reader.
    ///
    /// # Errors
    /// A setting out of range, a file that cannot be written, one to go on with that is not the recorder's.
    pub fn start(settings: Settings, settled: Settled) -> Result<Self, RecorderError> {
        settings.check()?;
        let statistics = Statistics::new(&settings)?;
        let progress = Arc::new(Progress::new(settled));
        let Outputs { detections, labels, trace, last_sweep } = open_outputs(&settings)?;
        let in_files = last_sweep.map_or(0, |last| last.saturating_add(1));
        let trace = trace.map(|output| TraceLine::start(output, &settings.stages, settings.lossless)).transpose()?;
        let with_members = labels.is_some();
        let line = if detections.is_none() && labels.is_none() {
            None
        } else {
            let writer = Writer { detections, labels, progress: Arc::clone(&progress) };
            Some(Line::start(writer, settings.queue_parts, with_members)?)
        };
        Ok(Self {
            statistics,
            line,
            trace,
            progress,
            lossless: settings.lossless,
            order: settings.in_order_from.map(|first| Order::from_sweep(first.max(in_files))),
            with_members,
            finished: false,
            statistics_file: settings.statistics,
            snapshot: Snapshot::default(),
        })
    }

    /// Copies the statistics so far into `snapshot`, whose memory is used again.
    pub fn snapshot_into(&self, snapshot: &mut Snapshot) {
        self.statistics.snapshot_into(snapshot);
        snapshot.lost_sweeps.detections = self.progress.lost_detections.load(Ordering::Relaxed);
        snapshot.lost_sweeps.labels = self.progress.lost_labels.load(Ordering::Relaxed);
        snapshot.trace = self.trace.as_ref().map(TraceLine::counts);
    }

    fn take(&mut self, trace: &Trace, input: &Detections) -> Verdict {
        if !is_coherent(trace, input) {
            return Verdict::RejectedMalformed;
        }
        if self.finished {
            return Verdict::RejectedSinkFull;
        }
        let Some(line) = &self.line else {
            (self.progress.settled)(trace.part);
            return Verdict::Complete;
        };
        let buffer = if self.lossless { line.free.recv().ok() } else { line.free.try_recv().ok() };
        let Some(mut rows) = buffer else { return Verdict::RejectedSinkFull };
        rows.fill(trace, input, self.with_members);
        // The queue holds as many parts as there are buffers, so only a dead writer refuses.
        match line.queue.try_send(rows) {
            Ok(()) => Verdict::Complete,
            Err(_) => Verdict::RejectedSinkFull,
        }
    }
}

impl Line {
    fn start(writer: Writer, parts: usize, with_members: bool) -> Result<Self, RecorderError> {
        let (queue, queued) = bounded(parts);
        let (freed, free) = bounded(parts);
        for _ in 0..parts {
            // Cannot fail: there is room for all, and `free` is alive.
            let _ = freed.try_send(Box::new(PartRows::reserved(with_members)));
        }
        let writer = Builder::new()
            .name("recorder-writer".to_owned())
            .spawn(move || writer.run(queued, freed))
            .map_err(RecorderError::Thread)?;
        Ok(Self { queue, free, writer })
    }
}

impl Sink for Recorder {
    type Input = Detections;

    /// Counts the part, copies its rows into a free buffer and passes it on. Never waits unless `lossless`.
    ///
    /// [`Verdict::RejectedSinkFull`]: no buffer is free. [`Verdict::RejectedMalformed`]: members or solids out of place.
    /// [`Verdict::RejectedDouble`] and [`Verdict::RejectedAhead`]: see [`Settings::in_order_from`].
    fn accept(&mut self, trace: &Trace, input: &Detections) -> Verdict {
        match self.order.as_mut().map(|order| order.take(trace)) {
            Some(Place::Double) => return Verdict::RejectedDouble,
            Some(Place::Ahead) => return Verdict::RejectedAhead,
            // The same part as before, which is in the statistics.
            Some(Place::Again) => return self.take(trace, input),
            Some(Place::Next) | None => {}
        }
        let verdict = self.take(trace, input);
        let answer = self.statistics.add(trace, input, verdict);
        if let Some(line) = &self.trace {
            line.send(Traced { trace: *trace, answer });
        }
        verdict
    }

    /// Counts the part, and writes its sweep without it. Never waits.
    fn refuse(&mut self, trace: &Trace, input: &Detections, verdict: Verdict) -> Verdict {
        let answer = self.statistics.add(trace, input, verdict);
        if let Some(line) = &self.trace {
            line.send(Traced { trace: *trace, answer });
        }
        let line = self.line.as_ref().filter(|_| !self.finished);
        if let Some((line, mut rows)) = line.and_then(|line| Some((line, line.free.try_recv().ok()?))) {
            rows.fill_refused(trace, &input.header);
            // Only a dead writer refuses; then no sweep is written.
            let _ = line.queue.try_send(rows);
        }
        verdict
    }

    fn wanted_attempt(&self) -> u32 {
        self.order.map_or(0, |order| order.wanted_attempt())
    }

    fn failed_files(&self) -> u64 {
        let lost = [&self.progress.lost_detections, &self.progress.lost_labels];
        let trace = self.trace.as_ref().is_some_and(|trace| trace.counts().failed);
        lost.into_iter().filter(|lost| lost.load(Ordering::Relaxed) > 0).count() as u64 + u64::from(trace)
    }

    /// Writes the statistics so far, where the settings name a file for them.
    fn checkpoint(&mut self) -> Result<(), SinkError> {
        let Some(path) = &self.statistics_file else { return Ok(()) };
        let mut snapshot = std::mem::take(&mut self.snapshot);
        self.snapshot_into(&mut snapshot);
        let written = snapshot.write(path).map_err(|error| SinkError(error.to_string()));
        self.snapshot = snapshot;
        written
    }

    /// Waits until everything is written: for as long as a pipe's reader takes. A second call does nothing.
    fn finish(&mut self) -> Result<(), SinkError> {
        self.finished = true;
        let panicked = |_| SinkError("a writer thread of the recorder panicked".to_owned());
        let mut failures = Vec::new();
        if let Some(Line { queue, free, writer }) = self.line.take() {
            drop(queue);
            failures = writer.join().map_err(panicked)?;
            drop(free);
        }
        if let Some(line) = &mut self.trace {
            failures.extend(line.finish().map_err(panicked)?);
        }
        self.checkpoint()?;
        if failures.is_empty() { Ok(()) } else { Err(SinkError(tell(&failures))) }
    }
}

/// The files of the settings.
struct Outputs {
    detections: Option<Output>,
    labels: Option<Output>,
    trace: Option<Output>,
    /// The last sweep that an earlier life has written.
    last_sweep: Option<u64>,
}

fn open_outputs(settings: &Settings) -> Result<Outputs, RecorderError> {
    let (mut whole, mut labelled) = (None, None);
    let detections = settings.detections.as_deref().map(|path| match settings.resume {
        false => Output::create(path, Commit::LastByte),
        true => Output::resume(path, Commit::LastByte, |file| {
            let found = repair::detections(path, file)?;
            whole = Some(found);
            Ok(found.length)
        }),
    });
    let detections = detections.transpose()?;
    let labels = settings.labels.as_deref().map(|path| match settings.resume {
        false => Output::create(path, Commit::FirstByte),
        true => Output::resume(path, Commit::FirstByte, |file| {
            let found = repair::labels(path, file, whole)?;
            labelled = found.last_sweep;
            Ok(found.length)
        }),
    });
    let labels = labels.transpose()?;
    let trace = settings.trace.as_deref().map(|path| match settings.resume {
        false => Output::create(path, Commit::LastByte),
        true => Output::resume(path, Commit::LastByte, |file| repair_trace::trace(path, file)),
    });
    let trace = trace.transpose()?;
    let is_same = |one: &Option<Output>, other: &Option<Output>| {
        one.as_ref().zip(other.as_ref()).is_some_and(|(one, other)| one.is_same_file(other))
    };
    if is_same(&detections, &labels) {
        return Err(RecorderError::SameFile(settings.labels.clone().unwrap_or_default()));
    }
    if is_same(&detections, &trace) || is_same(&labels, &trace) {
        return Err(RecorderError::SameFile(settings.trace.clone().unwrap_or_default()));
    }
    let last_sweep = whole.map_or(labelled, |whole: Whole| whole.last_sweep);
    Ok(Outputs { detections, labels, trace, last_sweep })
}

fn tell(failures: &[Failure]) -> String {
    let line = |failure: &Failure| {
        let Failure { path, error, lost, what } = failure;
        format!("{}: {error}: {lost} {what} lost", path.display())
    };
    let lines: Vec<String> = failures.iter().map(line).collect();
    format!("{}; make room or give another path", lines.join("; "))
}
