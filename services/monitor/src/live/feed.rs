//! Taps → whole sweeps → messages, as far as somebody wants them.

use std::collections::VecDeque;

use lidar::Return;
use messages::{Detections, Joiner, Message, Sweep, Trace, TrackTable, Tracks};
use tape::{Clouds, Clustered, DetectionsJoiner, Scenes, Topic, TrackScenes};
use transport::{Tap, TransportError};

use super::server::Server;
use crate::MonitorError;
use crate::attached::Attached;

/// Sweeps that wait for their detections.
const HELD: usize = 3;

/// What the chain says, for clients.
pub(super) struct Feed {
    sweeps: Ears<Sweep>,
    tracks: Ears<Tracks>,
    joiner: Joiner,
    detections_joiner: DetectionsJoiner,
    clouds: Clouds,
    scenes: Scenes,
    track_scenes: TrackScenes,
    held: VecDeque<Held>,
    /// Sensor time of the latest part [ns].
    pub(super) sensor_time_ns: u64,
}

/// A sweep whose detections are still to come.
#[derive(Default)]
struct Held {
    sweep: u64,
    sensor_time_ns: u64,
    returns: Vec<Return>,
    recorded_index: Vec<u32>,
}

/// A tap that counts what it did not see.
struct Ears<T: Message> {
    tap: Tap<T>,
    next_sequence: Option<u64>,
    unseen: u64,
}

impl<T: Message> Ears<T> {
    fn new(tap: Tap<T>) -> Self {
        Self { tap, next_sequence: None, unseen: 0 }
    }

    fn take(&mut self) -> Result<Option<transport::Taken<T>>, TransportError> {
        let taken = self.tap.take()?;
        if let Some(taken) = &taken {
            let sequence = sequence(taken.trace());
            self.unseen += self.next_sequence.map_or(0, |next| sequence.saturating_sub(next));
            self.next_sequence = Some(sequence + 1);
        }
        Ok(taken)
    }
}

fn sequence(trace: &Trace) -> u64 {
    trace.hops().last().map_or(0, |hop| hop.sequence)
}

impl Feed {
    /// Taps a running chain.
    pub(super) fn of(chain: &Attached) -> Result<Self, MonitorError> {
        Ok(Self {
            sweeps: Ears::new(chain.node.tap()?),
            tracks: Ears::new(chain.node.tap()?),
            joiner: Joiner::new().ok_or(MonitorError::Memory)?,
            detections_joiner: DetectionsJoiner::new().ok_or(MonitorError::Memory)?,
            clouds: Clouds::default(),
            scenes: Scenes::default(),
            track_scenes: TrackScenes::default(),
            held: VecDeque::new(),
            sensor_time_ns: 0,
        })
    }

    /// Parts that passed unseen: of sweeps, of detections.
    pub(super) fn unseen(&self) -> (u64, u64) {
        (self.sweeps.unseen, self.tracks.unseen)
    }

    /// Takes all there is and offers what it makes.
    pub(super) fn turn(&mut self, server: &mut Server) -> Result<(), MonitorError> {
        while let Some(taken) = self.sweeps.take()? {
            self.sensor_time_ns = taken.trace().part.sensor_time_ns;
            self.sweep(taken.trace(), taken.message(), server);
        }
        while let Some(taken) = self.tracks.take()? {
            let Tracks { detections, table } = taken.message();
            self.detections(taken.trace(), detections, server);
            self.tracks(taken.trace(), table, server);
        }
        Ok(())
    }

    fn sweep(&mut self, trace: &Trace, piece: &Sweep, server: &mut Server) {
        let part = &trace.part;
        // Joined only where it would be sent: without clients a part costs nothing but its release.
        let holds = server.wants(Topic::Clusters);
        let whole = if holds || server.wants(Topic::Sweep) { self.joiner.add(part, piece) } else { None };
        if !part.is_last() {
            return;
        }
        let Some(whole) = whole else {
            server.skip(Topic::Sweep);
            return;
        };
        let clouds = &self.clouds;
        server.offer(Topic::Sweep, part.sensor_time_ns, |out| {
            clouds.sweep(whole, out);
            true
        });
        if holds {
            let mut held =
                if self.held.len() < HELD { Held::default() } else { self.held.pop_front().unwrap_or_default() };
            (held.sweep, held.sensor_time_ns) = (part.sweep, part.sensor_time_ns);
            held.returns.clear();
            held.returns.extend_from_slice(&whole.returns);
            held.recorded_index.clear();
            held.recorded_index.extend_from_slice(&whole.recorded_index);
            self.held.push_back(held);
        }
    }

    fn detections(&mut self, trace: &Trace, piece: &Detections, server: &mut Server) {
        let part = &trace.part;
        let wanted = server.wants(Topic::Clusters) || server.wants(Topic::Detections);
        let whole = if wanted { self.detections_joiner.add(part, piece) } else { None };
        if !part.is_last() {
            return;
        }
        let Some(whole) = whole else {
            server.skip(Topic::Clusters);
            server.skip(Topic::Detections);
            return;
        };
        let scenes = &mut self.scenes;
        server.offer(Topic::Detections, part.sensor_time_ns, |out| {
            scenes.detections(whole, out);
            true
        });
        let Some(held) = self.held.iter().find(|held| held.sweep == part.sweep) else {
            server.skip(Topic::Clusters);
            return;
        };
        let clouds = &mut self.clouds;
        server.offer(Topic::Clusters, part.sensor_time_ns, |out| {
            let clustered = Clustered {
                sensor_time_ns: held.sensor_time_ns,
                returns: &held.returns,
                recorded_index: &held.recorded_index,
                detections: &whole.detections,
                members: &whole.members,
            };
            clouds.clusters(&clustered, out)
        });
    }
    /// Tracks are whole with the last part of their sweep.
    fn tracks(&mut self, trace: &Trace, table: &TrackTable, server: &mut Server) {
        let part = &trace.part;
        if !part.is_last() {
            return;
        }
        if table.time_ns == 0 {
            server.skip(Topic::Tracks);
            return;
        }
        let scenes = &mut self.track_scenes;
        server.offer(Topic::Tracks, part.sensor_time_ns, |out| {
            scenes.tracks(table, out);
            true
        });
    }
}
