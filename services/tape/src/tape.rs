//! The recording: what comes in parts is joined, what belongs together is brought together, all of it goes to files.

mod account;

use std::path::Path;

use messages::{Clusters, Descriptors, Detections, Joiner, Raw, Sweep, Trace, TrackTable, Truth};

use crate::cloud::Clouds;
use crate::early::{Early, Moment, What};
use crate::joiner::DetectionsJoiner;
use crate::pairs::Pairs;
use crate::reel::{About, Stamps};
use crate::reels::{Open, Reels, on_disk};
use crate::scene::Scenes;
use crate::settings::{Settings, TapeError};
use crate::stream::Stream;
use crate::topic::Topic;
use crate::tracks::TrackScenes;
use crate::words::{Event, put_truth};

/// A recording being written. Host time (UTC) comes with every call; nothing is read here but files.
pub struct Tape {
    reels: Reels,
    sweeps: Stream,
    joiner: Joiner,
    detections: Stream,
    detections_joiner: DetectionsJoiner,
    tracks: Stream,
    truths: Stream,
    /// Parts by ordinal.
    raw_clusters: Stream,
    raw_descriptors: Stream,
    pairs: Pairs,
    first_sweep: u64,
    clouds: Clouds,
    scenes: Scenes,
    track_scenes: TrackScenes,
    buffer: Vec<u8>,
    early: Early,
    /// Sensor time of the newest sweep [ns].
    sensor_time_ns: Option<u64>,
    /// Events and states so far.
    moments: [u32; 2],
    /// Of the latest commit.
    done_sweeps: u64,
}

impl Tape {
    /// Begins a recording. What cannot be opened is refused; what cannot be written is an event, then as later.
    ///
    /// `resume` is for the successor of a process that was killed: the sweep from which on nothing is in the files of
    /// the lives before ([`Tape::done_sweeps`] of the latest). Their files are left as they are, and the next number is
    /// begun. Without it the path, and numbered files of an earlier run of that name, are overwritten.
    pub fn start(
        settings: Settings,
        path: &Path,
        about: About,
        resume: Option<u64>,
        utc_ns: u64,
    ) -> Result<Self, TapeError> {
        Self::start_with(settings, path, about, resume, on_disk(), utc_ns)
    }

    pub(crate) fn start_with(
        settings: Settings,
        path: &Path,
        about: About,
        resume: Option<u64>,
        open: Open,
        utc_ns: u64,
    ) -> Result<Self, TapeError> {
        let first = resume.unwrap_or(0);
        let first_part = first.saturating_mul(about.sectors.into());
        Ok(Self {
            sweeps: Stream::new(first),
            joiner: Joiner::new().ok_or(TapeError::Memory)?,
            detections: Stream::new(first),
            detections_joiner: DetectionsJoiner::new().ok_or(TapeError::Memory)?,
            tracks: Stream::new(first),
            truths: Stream::new(first),
            raw_clusters: Stream::new(first_part),
            raw_descriptors: Stream::new(first_part),
            pairs: Pairs::new(settings.hold_sweeps),
            first_sweep: first,
            clouds: Clouds::default(),
            scenes: Scenes::default(),
            track_scenes: TrackScenes::default(),
            buffer: Vec::new(),
            early: Early::default(),
            sensor_time_ns: None,
            moments: [0; 2],
            done_sweeps: first,
            reels: Reels::start(settings, path, about, resume.is_some(), open, utc_ns)?,
        })
    }

    /// Takes a part of a sweep, as the source sends it. The sweep is written with its last part; one that lacks a part
    /// is given up with the first part of a later one. It may be sent again from its first part until it is written.
    pub fn sweep(&mut self, utc_ns: u64, trace: &Trace, piece: &Sweep) {
        let part = &trace.part;
        self.hear(piece.header.sensor_time_ns);
        if !self.sweeps.takes(part.sweep, part.sector) {
            return;
        }
        let Some(whole) = self.joiner.add(part, piece) else { return };
        self.sweeps.end(part.sweep);
        let sensor_time_ns = whole.header.sensor_time_ns;
        let stamps = Stamps { log_time_ns: sensor_time_ns, utc_ns, sequence: part.sweep as u32 };
        if self.reels.settings().has(Topic::RawSweep) {
            self.buffer.clear();
            whole.write_raw(&mut self.buffer);
            self.reels.write(Topic::RawSweep, &stamps, &self.buffer);
        }
        if self.reels.settings().has(Topic::Sweep) {
            self.buffer.clear();
            self.clouds.sweep(whole, &mut self.buffer);
            self.reels.write(Topic::Sweep, &stamps, &self.buffer);
        }
        if self.reels.settings().has(Topic::Clusters) {
            let settled = self.detections.next() > part.sweep;
            if self.pairs.sweep(part.sweep, whole, settled, &mut self.clouds, &mut self.buffer) {
                self.reels.write(Topic::Clusters, &stamps, &self.buffer);
            }
        }
    }

    /// Takes a part of a sweep's detections, as the last stage sends it. They are written with the last part; those of
    /// an earlier sweep that have not come by then are given up.
    pub fn detections(&mut self, utc_ns: u64, trace: &Trace, piece: &Detections) {
        let part = &trace.part;
        self.hear(piece.header.sensor_time_ns);
        if !self.detections.takes(part.sweep, part.sector) {
            return;
        }
        let Some(whole) = self.detections_joiner.add(part, piece) else { return };
        self.detections.end(part.sweep);
        let stamps = Stamps { log_time_ns: whole.header.sensor_time_ns, utc_ns, sequence: part.sweep as u32 };
        if self.reels.settings().has(Topic::RawDetections) {
            put_raw(trace, whole, &mut self.buffer);
            self.reels.write(Topic::RawDetections, &stamps, &self.buffer);
        }
        if self.reels.settings().has(Topic::Detections) {
            self.buffer.clear();
            self.scenes.detections(whole, &mut self.buffer);
            self.reels.write(Topic::Detections, &stamps, &self.buffer);
        }
        if self.reels.settings().has(Topic::Clusters) {
            let settled = self.sweeps.next() > part.sweep;
            if self.pairs.detections(part.sweep, whole, settled, &mut self.clouds, &mut self.buffer) {
                self.reels.write(Topic::Clusters, &stamps, &self.buffer);
            }
        }
    }

    /// Takes the tracks that came with a part of a sweep's detections: those of the last part are written, also where
    /// the tracker could not answer and there is no table; all before it have none. Those of an earlier sweep that have
    /// not come by then are given up.
    pub fn tracks(&mut self, utc_ns: u64, trace: &Trace, table: &TrackTable) {
        let part = &trace.part;
        if !self.tracks.takes(part.sweep, part.sector) || !part.is_last() {
            return;
        }
        self.tracks.end(part.sweep);
        let stamps = Stamps { log_time_ns: part.sensor_time_ns, utc_ns, sequence: part.sweep as u32 };
        if self.reels.settings().has(Topic::RawTracks) {
            put_raw(trace, table, &mut self.buffer);
            self.reels.write(Topic::RawTracks, &stamps, &self.buffer);
        }
        if self.reels.settings().has(Topic::Tracks) {
            self.buffer.clear();
            self.track_scenes.tracks(table, &mut self.buffer);
            self.reels.write(Topic::Tracks, &stamps, &self.buffer);
        }
    }

    /// Takes what the simulator knows of a sweep.
    pub fn truth(&mut self, utc_ns: u64, trace: &Trace, truth: &Truth) {
        let sweep = trace.part.sweep;
        self.hear(truth.sensor_time_ns);
        if !self.reels.settings().has(Topic::Truth) || !self.truths.takes(sweep, 0) {
            return;
        }
        self.truths.end(sweep);
        self.buffer.clear();
        put_truth(sweep, truth, &mut self.buffer);
        let stamps = Stamps { log_time_ns: truth.sensor_time_ns, utc_ns, sequence: sweep as u32 };
        self.reels.write(Topic::Truth, &stamps, &self.buffer);
    }

    /// Takes a part of the clusters, as the clusterer sends it; written as it comes.
    pub fn clusters(&mut self, utc_ns: u64, trace: &Trace, piece: &Clusters) {
        self.hear(piece.header.sensor_time_ns);
        if self.reels.settings().has(Topic::RawClusters) && self.raw_clusters.takes(trace.part.ordinal, 0) {
            self.raw_clusters.end(trace.part.ordinal);
            self.raw_part(Topic::RawClusters, utc_ns, trace, piece.header.sensor_time_ns, piece);
        }
    }

    /// Takes a part of the descriptors, as the extractor sends it; written as it comes.
    pub fn descriptors(&mut self, utc_ns: u64, trace: &Trace, piece: &Descriptors) {
        self.hear(piece.header.sensor_time_ns);
        if self.reels.settings().has(Topic::RawDescriptors) && self.raw_descriptors.takes(trace.part.ordinal, 0) {
            self.raw_descriptors.end(trace.part.ordinal);
            self.raw_part(Topic::RawDescriptors, utc_ns, trace, piece.header.sensor_time_ns, piece);
        }
    }

    fn raw_part(&mut self, topic: Topic, utc_ns: u64, trace: &Trace, sensor_time_ns: u64, piece: &impl Raw) {
        let stamps = Stamps { log_time_ns: sensor_time_ns, utc_ns, sequence: trace.part.sweep as u32 };
        put_raw(trace, piece, &mut self.buffer);
        self.reels.write(topic, &stamps, &self.buffer);
    }

    /// Takes what `encke ctl status --json` says. Before the first sweep it waits, to be stamped with sensor time.
    pub fn status(&mut self, utc_ns: u64, json: &[u8]) {
        self.moment(Moment { topic: Topic::Status, utc_ns, what: What::Status(json) });
    }

    /// Takes something that happened. Before the first sweep it waits, to be stamped with sensor time.
    pub fn event(&mut self, utc_ns: u64, event: &Event<'_>) {
        self.moment(Moment { topic: Topic::Events, utc_ns, what: What::Event(*event) });
    }

    fn moment(&mut self, moment: Moment<'_>) {
        let topic = moment.topic;
        if !self.reels.settings().has(topic) {
            return;
        }
        let Some(sensor_time_ns) = self.sensor_time_ns else {
            if !self.early.keep(&moment) {
                self.reels.lost[topic as usize] += 1;
            }
            return;
        };
        self.buffer.clear();
        moment.put(sensor_time_ns, &mut self.buffer);
        let count = &mut self.moments[usize::from(topic == Topic::Status)];
        let stamps = Stamps { log_time_ns: sensor_time_ns, utc_ns: moment.utc_ns, sequence: *count };
        *count = count.wrapping_add(1);
        self.reels.write(topic, &stamps, &self.buffer);
    }

    /// Learns the sensor's time, and writes what has waited for it.
    fn hear(&mut self, sensor_time_ns: u64) {
        let first = self.sensor_time_ns.is_none();
        self.sensor_time_ns = self.sensor_time_ns.max(Some(sensor_time_ns));
        if first {
            self.write_early();
        }
    }

    fn write_early(&mut self) {
        for kept in self.early.take() {
            self.moment(kept.moment());
        }
    }

    /// Hands what was written to the system: a kill loses nothing of it. To be called about once a second, and at
    /// lossless pace whenever nothing more is there to take.
    pub fn checkpoint(&mut self, utc_ns: u64) {
        self.reels.commit(utc_ns);
        self.done_sweeps = self.settled();
    }

    /// Gives up what has not come, completes the file and closes it. Nothing is to be handed over afterwards. An error
    /// where a write error cost messages; [`Tape::counts`] says more.
    pub fn finish(&mut self, utc_ns: u64) -> Result<(), TapeError> {
        let seen = self.sweeps.seen().max(self.detections.seen()).max(self.tracks.seen());
        for stream in [&mut self.sweeps, &mut self.detections, &mut self.tracks] {
            stream.give_up_below(seen);
        }
        self.sensor_time_ns.get_or_insert(0);
        self.write_early();
        self.reels.finish(utc_ns);
        self.done_sweeps = self.settled();
        let lost = self.reels.lost.iter().sum();
        match &self.reels.failure {
            Some(failure) => {
                Err(TapeError::Incomplete { path: self.reels.path().to_owned(), failure: failure.clone(), lost })
            }
            None => Ok(()),
        }
    }
}

/// Makes a trace and the message behind it all of `out`.
fn put_raw(trace: &Trace, message: &impl Raw, out: &mut Vec<u8>) {
    out.clear();
    trace.write_raw(out);
    message.write_raw(out);
}
