use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::{Builder, JoinHandle};

use crossbeam_channel::{Receiver, Sender, bounded};
use messages::{Order, Place, Trace, Tracks, Verdict};
use stage::{Alert, Settled, Sink, SinkError};

use crate::alerts::Alerts;
use crate::output::{Commit, Failure, Output};
use crate::part_rows::{PartRows, Wanted, is_coherent};
use crate::settings::{RecorderError, Settings};
use crate::snapshot::Snapshot;
use crate::stats::Statistics;
use crate::trace_events::Traced;
use crate::trace_file::TraceLine;
use crate::writer::{Progress, Writer};
use crate::{repair, repair_trace};

/// The chain's ledgered sink: detections, tracks and labels as files, latencies as statistics.
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
    wanted: Wanted,
    alerts: Alerts,
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
    /// Opens the files, allocates every buffer and starts the writer threads: one for detections, tracks and labels, one for the
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
        let Outputs { detections, tracks, labels, trace, last_sweep } = open_outputs(&settings)?;
        let in_files = last_sweep.map_or(0, |last| last.saturating_add(1));
        let trace = trace.map(|output| TraceLine::start(output, &settings.stages, settings.lossless)).transpose()?;
        let wanted = Wanted { members: labels.is_some(), tracks: tracks.is_some() };
        let line = if detections.is_none() && wanted == Wanted::default() {
            None
        } else {
            let writer = Writer { detections, tracks, labels, progress: Arc::clone(&progress) };
            Some(Line::start(writer, settings.queue_parts, wanted)?)
        };
        Ok(Self {
            statistics,
            line,
            trace,
            progress,
            lossless: settings.lossless,
            order: settings.in_order_from.map(|first| Order::from_sweep(first.max(in_files))),
            wanted,
            alerts: Alerts::new(),
            finished: false,
            statistics_file: settings.statistics,
            snapshot: Snapshot::default(),
        })
    }

    /// Copies the statistics so far into `snapshot`, whose memory is used again.
    pub fn snapshot_into(&self, snapshot: &mut Snapshot) {
        self.statistics.snapshot_into(snapshot);
        snapshot.lost_sweeps.detections = self.progress.lost_detections.load(Ordering::Relaxed);
        snapshot.lost_sweeps.tracks = self.progress.lost_tracks.load(Ordering::Relaxed);
        snapshot.lost_sweeps.labels = self.progress.lost_labels.load(Ordering::Relaxed);
        snapshot.trace = self.trace.as_ref().map(TraceLine::counts);
        snapshot.tracks = self.alerts.counts();
    }

    fn take(&mut self, trace: &Trace, input: &Tracks) -> Verdict {
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
        rows.fill(trace, input, self.wanted);
        // The queue holds as many parts as there are buffers, so only a dead writer refuses.
        match line.queue.try_send(rows) {
            Ok(()) => Verdict::Complete,
            Err(_) => Verdict::RejectedSinkFull,
        }
    }
}

impl Line {
    fn start(writer: Writer, parts: usize, wanted: Wanted) -> Result<Self, RecorderError> {
        let (queue, queued) = bounded(parts);
        let (freed, free) = bounded(parts);
        for _ in 0..parts {
            // Cannot fail: there is room for all, and `free` is alive.
            let _ = freed.try_send(Box::new(PartRows::reserved(wanted)));
        }
        let writer = Builder::new()
            .name("recorder-writer".to_owned())
            .spawn(move || writer.run(queued, freed))
            .map_err(RecorderError::Thread)?;
        Ok(Self { queue, free, writer })
    }
}

impl Sink for Recorder {
    type Input = Tracks;

    /// Counts the part, copies its rows into a free buffer and passes it on. Never waits unless `lossless`.
    ///
    /// [`Verdict::RejectedSinkFull`]: no buffer is free. [`Verdict::RejectedMalformed`]: members, solids or keys out of place.
    /// [`Verdict::RejectedDouble`] and [`Verdict::RejectedAhead`]: see [`Settings::in_order_from`].
    fn accept(&mut self, trace: &Trace, input: &Tracks) -> Verdict {
        self.alerts.clear();
        match self.order.as_mut().map(|order| order.take(trace)) {
            Some(Place::Double) => return Verdict::RejectedDouble,
            Some(Place::Ahead) => return Verdict::RejectedAhead,
            // The same part as before, which is in the statistics.
            Some(Place::Again) => return self.take(trace, input),
            Some(Place::Next) | None => {}
        }
        let verdict = self.take(trace, input);
        if verdict == Verdict::Complete {
            self.alerts.note(&input.table);
        }
        let answer = self.statistics.add(trace, &input.detections, verdict);
        if let Some(line) = &self.trace {
            line.send(Traced { trace: *trace, answer });
        }
        verdict
    }

    /// Counts the part, and writes its sweep without it. Never waits.
    fn refuse(&mut self, trace: &Trace, input: &Tracks, verdict: Verdict) -> Verdict {
        self.alerts.clear();
        let answer = self.statistics.add(trace, &input.detections, verdict);
        if let Some(line) = &self.trace {
            line.send(Traced { trace: *trace, answer });
        }
        let line = self.line.as_ref().filter(|_| !self.finished);
        if let Some((line, mut rows)) = line.and_then(|line| Some((line, line.free.try_recv().ok()?))) {
            rows.fill_refused(trace, &input.detections.header);
            // Only a dead writer refuses; then no sweep is written.
            let _ = line.queue.try_send(rows);
        }
        verdict
    }

    fn alerts(&self) -> &[Alert] {
        self.alerts.begun()
    }

    fn wanted_attempt(&self) -> u32 {
        self.order.map_or(0, |order| order.wanted_attempt())
    }

    fn failed_files(&self) -> u64 {
        let lost = [&self.progress.lost_detections, &self.progress.lost_tracks, &self.progress.lost_labels];
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
    tracks: Option<Output>,
    labels: Option<Output>,
    trace: Option<Output>,
    /// The last sweep that an earlier life has written.
    last_sweep: Option<u64>,
}

fn open_outputs(settings: &Settings) -> Result<Outputs, RecorderError> {
    // In the order in which they are written, backwards: whoever has a sweep's last file has the sweep.
    let mut written = None;
    let detections = settings.detections.as_deref().map(|path| match settings.resume {
        false => Output::create(path, Commit::LastByte),
        true => Output::resume(path, Commit::LastByte, |file| {
            let found = repair::lines(path, file, "detections", None)?;
            written = Some(found);
            Ok(found.length)
        }),
    });
    let detections = detections.transpose()?;
    let tracks = settings.tracks.as_deref().map(|path| match settings.resume {
        false => Output::create(path, Commit::LastByte),
        true => Output::resume(path, Commit::LastByte, |file| {
            let found = repair::lines(path, file, "tracks", written)?;
            written.get_or_insert(found);
            Ok(found.length)
        }),
    });
    let tracks = tracks.transpose()?;
    let labels = settings.labels.as_deref().map(|path| match settings.resume {
        false => Output::create(path, Commit::FirstByte),
        true => Output::resume(path, Commit::FirstByte, |file| {
            let found = repair::labels(path, file, written)?;
            written.get_or_insert(found);
            Ok(found.length)
        }),
    });
    let labels = labels.transpose()?;
    let trace = settings.trace.as_deref().map(|path| match settings.resume {
        false => Output::create(path, Commit::LastByte),
        true => Output::resume(path, Commit::LastByte, |file| repair_trace::trace(path, file)),
    });
    let trace = trace.transpose()?;
    let all = [
        (&detections, &settings.detections),
        (&tracks, &settings.tracks),
        (&labels, &settings.labels),
        (&trace, &settings.trace),
    ];
    for (place, (later, path)) in all.iter().enumerate() {
        let is_same = |(earlier, _): &(&Option<Output>, _)| {
            earlier.as_ref().zip(later.as_ref()).is_some_and(|(earlier, later)| earlier.is_same_file(later))
        };
        if all[..place].iter().any(is_same) {
            return Err(RecorderError::SameFile((*path).clone().unwrap_or_default()));
        }
    }
    Ok(Outputs { detections, tracks, labels, trace, last_sweep: written.and_then(|whole| whole.last_sweep) })
}

fn tell(failures: &[Failure]) -> String {
    let line = |failure: &Failure| {
        let Failure { path, error, lost, what } = failure;
        format!("{}: {error}: {lost} {what} lost", path.display())
    };
    let lines: Vec<String> = failures.iter().map(line).collect();
    format!("{}; make room or give another path", lines.join("; "))
}
