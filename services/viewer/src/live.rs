use std::collections::BTreeMap;

use messages::{Detections, Joiner, Raw, Sweep, Trace, TrackTable, Tracks};
use runtime::{Pace, Plan, Shutdown, clock};
use tape::DetectionsJoiner;
use transport::{Instance, Node, Tap};
use zerocopy::FromZeros;

use crate::cloud::{self, Known};
use crate::page::{self, About};
use crate::paths::Paths;
use crate::row::{Row, note_detections, note_sweep, note_tracks};
use crate::shelf::Shelf;
use crate::{ViewError, overview};

/// Sweeps of which the numbers are kept: five minutes at 10 Hz.
const ROWS: usize = 3_000;
/// Between two looks whether the chain goes on with other files in shared memory [ns].
const LOOK_NS: u64 = 1_000_000_000;
/// What a viewer joins as.
const NAME: &str = "view";
/// Newest sweeps that can be shown; some 70 MB of an HDL-32E's.
const SWEEPS: usize = 64;
/// Newest sweeps of which it is known where the tracks were: those, and what their trails reach back to.
const PATHS: usize = 2 * SWEEPS;

/// What a running chain says, as far as it is kept. The chain neither waits for it nor knows of it.
pub struct Live {
    // The taps before the node whose guests they are.
    sweeps: Tap<Sweep>,
    tracks: Tap<Tracks>,
    node: Node,
    instance: Instance,
    queue_parts: usize,
    next_look_ns: u64,
    shutdown: Shutdown,
    title: String,
    run: BTreeMap<String, String>,
    most_points: usize,
    joiner: Joiner,
    detections_joiner: DetectionsJoiner,
    seen: BTreeMap<u32, Seen>,
    sweep: Box<Sweep>,
    found: Box<Detections>,
    table: Box<TrackTable>,
    paths: Paths,
}

/// One sweep: its numbers, and its messages as long as they are kept. Nothing is encoded before somebody asks.
#[derive(Default)]
struct Seen {
    row: Row,
    sweep: Option<Vec<u8>>,
    found: Option<Vec<u8>>,
    table: Option<Vec<u8>>,
}

impl Live {
    /// Attaches to an instance whose supervisor is up; at most so many returns of a sweep are shown.
    ///
    /// # Errors
    /// A file of the instance cannot be read (it may be starting or ending), or all places for viewers are taken.
    pub fn attach(instance: &Instance, most_points: usize) -> Result<Self, ViewError> {
        let plan = Plan::read(instance)?;
        let shutdown = Shutdown::install(plan.supervisor_pid)?;
        let node = Node::visit(instance, NAME, plan.chain.queue_parts())?;
        let paced = plan.pace == Pace::Realtime;
        let mut run = BTreeMap::from([
            ("source".to_owned(), plan.source.from.file_name().unwrap_or_default().to_string_lossy().into_owned()),
            ("pace".to_owned(), if paced { "realtime" } else { "fast" }.to_owned()),
        ]);
        if paced {
            run.insert("deadline_ms".to_owned(), plan.chain.deadline_ms.to_string());
        }
        Ok(Self {
            sweeps: node.tap()?,
            tracks: node.tap()?,
            node,
            instance: instance.clone(),
            queue_parts: plan.chain.queue_parts(),
            next_look_ns: 0,
            shutdown,
            title: instance.name().to_owned(),
            run,
            most_points,
            joiner: Joiner::new().ok_or(ViewError::NoMemory)?,
            detections_joiner: DetectionsJoiner::new().ok_or(ViewError::NoMemory)?,
            seen: BTreeMap::new(),
            sweep: Sweep::new_box_zeroed().map_err(|_| ViewError::NoMemory)?,
            found: Detections::new_box_zeroed().map_err(|_| ViewError::NoMemory)?,
            table: TrackTable::new_box_zeroed().map_err(|_| ViewError::NoMemory)?,
            paths: Paths::default(),
        })
    }

    /// Whether there is nothing more to come: the chain has ended, or this process is asked to.
    pub fn is_over(&self) -> bool {
        self.is_asked_to_leave() || self.shutdown.orphaned()
    }

    /// Whether this process is asked to leave, whatever the chain does.
    pub fn is_asked_to_leave(&self) -> bool {
        self.shutdown.asked()
    }

    /// Taps the chain anew where it goes on with other files in shared memory. It may not have made them yet.
    fn follow(&mut self) {
        if !self.node.is_left_behind() {
            return;
        }
        let Ok(node) = Node::visit(&self.instance, NAME, self.queue_parts) else { return };
        if let (Ok(sweeps), Ok(tracks)) = (node.tap(), node.tap()) {
            (self.sweeps, self.tracks) = (sweeps, tracks);
            self.node = node;
        }
    }

    /// Takes what the chain has said since. To be called often: what is not taken in time is dropped, for us alone.
    ///
    /// # Errors
    /// Shared memory fails.
    pub fn take(&mut self) -> Result<(), ViewError> {
        let now_ns = clock::now_ns();
        if now_ns >= self.next_look_ns {
            self.next_look_ns = now_ns + LOOK_NS;
            self.follow();
        }
        while let Some(taken) = self.sweeps.take()? {
            let part = taken.trace().part;
            if let Some(whole) = self.joiner.add(&part, taken.message()) {
                let seen = entry(&mut self.seen, part.sweep);
                note_sweep(whole, &mut seen.row);
                whole.write_raw(seen.sweep.insert(Vec::new()));
            }
        }
        while let Some(taken) = self.tracks.take()? {
            let (part, Tracks { detections, table }) = (taken.trace().part, taken.message());
            if part.is_last() && table.time_ns > 0 {
                let seen = entry(&mut self.seen, part.sweep);
                note_tracks(table, &mut seen.row);
                self.paths.note(seen.row.sweep, table);
                table.write_raw(seen.table.insert(Vec::new()));
            }
            if let Some(whole) = self.detections_joiner.add(&part, detections) {
                let seen = entry(&mut self.seen, part.sweep);
                note_detections(taken.trace(), whole, seen.sweep.is_some(), &mut seen.row);
                self.paths.note_turn(seen.row.sweep, &whole.header);
                let bytes = seen.found.insert(Vec::new());
                Trace::write_raw(taken.trace(), bytes);
                whole.write_raw(bytes);
            }
        }
        while self.seen.len() > ROWS {
            self.seen.pop_first();
        }
        let old = self.seen.len().saturating_sub(SWEEPS);
        for seen in self.seen.values_mut().take(old).rev().take(SWEEPS) {
            (seen.sweep, seen.found, seen.table) = (None, None, None);
        }
        self.paths.keep(PATHS);
        Ok(())
    }
}

fn entry(seen: &mut BTreeMap<u32, Seen>, sweep: u64) -> &mut Seen {
    let seen = seen.entry(sweep as u32).or_default();
    seen.row.sweep = sweep as u32;
    seen
}

impl Shelf for Live {
    fn page(&mut self) -> Result<Vec<u8>, ViewError> {
        let about = About {
            title: self.title.clone(),
            run: &self.run,
            damage: &[],
            rows: &[],
            kept: &[],
            selected: 0,
            most_points: self.most_points,
            served: true,
            live: true,
        };
        let mut page = Vec::new();
        page::write(&mut page, &about, &[]).map_err(ViewError::Write)?;
        Ok(page)
    }

    fn overview(&mut self) -> Result<Vec<u8>, ViewError> {
        let rows: Vec<Row> = self.seen.values().map(|seen| seen.row.clone()).collect();
        // A sweep whose detections are still on their way would be shown bare for good.
        let here: Vec<bool> = self.seen.values().map(|seen| seen.found.is_some()).collect();
        overview::encode(&rows, Some(&here)).map_err(ViewError::Write)
    }

    fn sweep(&mut self, number: u32) -> Result<Option<Vec<u8>>, ViewError> {
        let Some(Seen { sweep, found: Some(found), table, .. }) = self.seen.get(&number) else { return Ok(None) };
        // All were written by us.
        let sweep = sweep.as_ref().filter(|bytes| self.sweep.read_raw(bytes).is_ok()).map(|_| &*self.sweep);
        let read = Trace::read_raw(found).and_then(|(_, bytes)| self.found.read_raw(bytes));
        let detections = read.is_ok().then_some(&*self.found);
        let table = table.as_ref().filter(|bytes| self.table.read_raw(bytes).is_ok()).map(|_| &*self.table);
        let tracks = table.map(|table| (table, &self.paths));
        let known = Known { number, sweep, detections, tracks };
        cloud::encode(known, self.most_points).map(Some).map_err(ViewError::Write)
    }
}
