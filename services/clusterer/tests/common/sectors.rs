//! Sweeps in sectors, and what becomes of them put together again.

use clusterer::Clusterer;
use lidar::Return;
use messages::{Cell, Cluster, Clusters, Cutter, Message, Part, Step, Sweep, Verdict};
use stage::Stage;
use zerocopy::{FromZeros, IntoBytes};

/// A cluster apart from its message.
#[derive(Clone, PartialEq)]
pub(crate) struct Closed {
    /// Sector with which it went out.
    pub(crate) sector: u32,
    /// Its places in the message are 0.
    pub(crate) cluster: Cluster,
    pub(crate) returns: Vec<Return>,
    pub(crate) members: Vec<u32>,
    pub(crate) cells: Vec<Cell>,
}

impl Closed {
    /// All of its bytes.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let parts = [self.cluster.as_bytes(), self.returns.as_bytes(), self.members.as_bytes(), self.cells.as_bytes()];
        parts.concat()
    }
}

/// Sends sectors of sweeps through a room.
pub(crate) struct Sender {
    pub(crate) room: Clusterer,
    pub(crate) piece: Box<Sweep>,
    pub(crate) output: Box<Clusters>,
    pub(crate) sweep: u64,
    pub(crate) step: Step,
}

impl Sender {
    pub(crate) fn new(room: Clusterer) -> Self {
        let (piece, output) = (Sweep::new_box_zeroed().unwrap(), Clusters::new_box_zeroed().unwrap());
        Self { room, piece, output, sweep: 0, step: Step::Nominal }
    }

    /// Cuts one sector out.
    pub(crate) fn cut(&mut self, whole: &Sweep, sectors: u32, sector: u32) {
        self.piece.clear();
        Cutter::new(sectors).fill(whole, sector, &mut self.piece);
    }

    /// Sends the piece as a sector of the current sweep. Rejected parts must be empty.
    #[track_caller]
    pub(crate) fn send(&mut self, sectors: u32, sector: u32) -> Verdict {
        let part = Part { sweep: self.sweep, sector, sectors, step: self.step as u32, ..Part::default() };
        let verdict = self.room.process(part, &self.piece, &mut self.output);
        assert_eq!(self.output.header.as_bytes(), self.piece.header.as_bytes());
        if verdict.is_rejected() {
            let output = &self.output;
            let lengths = [output.clusters.len(), output.returns.len(), output.members.len(), output.cells.len()];
            assert_eq!((lengths, output.ring_elevation_rad.len(), output.turn_columns), ([0; 4], 0, 0));
        } else {
            let elevations: Vec<f32> = self.piece.rings.iter().map(|ring| ring.elevation_rad).collect();
            assert_eq!(self.output.ring_elevation_rad[..], elevations[..]);
        }
        verdict
    }

    /// Sends one sector of a measured sweep.
    #[track_caller]
    pub(crate) fn send_sector(&mut self, whole: &Sweep, sectors: u32, sector: u32) -> Verdict {
        self.cut(whole, sectors, sector);
        self.send(sectors, sector)
    }

    /// Sends one sector of a measured sweep and looks at nothing.
    pub(crate) fn send_quietly(&mut self, whole: &Sweep, sectors: u32, sector: u32) {
        self.cut(whole, sectors, sector);
        let part = Part { sweep: self.sweep, sector, sectors, ..Part::default() };
        self.room.process(part, &self.piece, &mut self.output);
    }

    /// What the last message holds.
    #[track_caller]
    pub(crate) fn closed(&self, sector: u32, closed: &mut Vec<Closed>) {
        let (mut members, mut cells, mut key) = (0, 0, None);
        for cluster in &self.output.clusters {
            assert_eq!(cluster.summary.first_member as usize, members);
            assert!(cluster.cells == 0 || cluster.first_cell as usize == cells);
            assert!(key < Some(cluster.summary.key), "clusters of a message are in order of keys");
            key = Some(cluster.summary.key);
            (members, cells) = (members + cluster.summary.points as usize, cells + cluster.cells as usize);
            let mut apart = Closed {
                sector,
                cluster: *cluster,
                returns: self.output.returns[cluster.summary.member_places()].to_vec(),
                members: self.output.members[cluster.summary.member_places()].to_vec(),
                cells: self.output.cells[cluster.cell_places()].to_vec(),
            };
            (apart.cluster.summary.first_member, apart.cluster.first_cell) = (0, 0);
            closed.push(apart);
        }
        assert_eq!((members, cells), (self.output.members.len(), self.output.cells.len()));
        assert_eq!(members, self.output.returns.len());
    }

    /// Sends a measured sweep in sectors, all of which must be complete. Gives the clusters in order of keys.
    #[track_caller]
    pub(crate) fn send_all(&mut self, whole: &Sweep, sectors: u32) -> Vec<Closed> {
        let mut closed = Vec::new();
        for sector in 0..sectors {
            assert_eq!(self.send_sector(whole, sectors, sector), Verdict::Complete, "sector {sector} of {sectors}");
            self.closed(sector, &mut closed);
            let last = sector + 1 == sectors;
            let turn = if last && whole.header.is_complete() { whole.columns.len() as u64 } else { 0 };
            assert_eq!(self.output.turn_columns, turn);
        }
        self.sweep += 1;
        closed.sort_by_key(|closed| closed.cluster.summary.key);
        closed
    }
}

/// A sweep is the same clusters to the byte in any number of sectors as in one. Gives how many clusters went out early
/// with the most sectors. The sweep comes to be measured.
#[track_caller]
pub(crate) fn assert_same_in_sectors(sender: &mut Sender, sweep: &mut Sweep, numbers: &[u32]) -> usize {
    let promised = std::mem::replace(&mut sweep.header.stray_rad, 0.0);
    assert_eq!(promised, 0.0, "the sweep was measured already");
    let unpromised = sender.send_all(sweep, 1);
    let mut early = 0;
    for &sectors in numbers {
        Cutter::new(sectors).measure(sweep);
        let promises = sweep.header.stray_rad > 0.0;
        let closed = sender.send_all(sweep, sectors);
        assert_eq!(closed.len(), unpromised.len(), "{sectors} sectors: number of clusters");
        for (is, must_be) in closed.iter().zip(&unpromised) {
            let key = must_be.cluster.summary.key;
            assert_eq!(is.cluster.summary, must_be.cluster.summary, "{sectors} sectors: cluster {key}");
            assert!(is.bytes() == must_be.bytes(), "{sectors} sectors: bytes of cluster {key}");
            assert!(promises || is.sector + 1 == sectors);
        }
        early = closed.iter().filter(|closed| closed.sector + 1 < sectors).count();
    }
    early
}
