use messages::{Clusters, Message, Part, Sweep, Verdict};
use stage::{InitError, Stage};

use crate::cells::Cells;
use crate::gather::Gather;
use crate::input::Before;
use crate::params::Params;
use crate::partition::Partition;
use crate::seen::{Seen, Store};
use crate::sequence::Sequence;

/// Sweep → Clusters. Every accepted return is in exactly one cluster of one message, alone or not.
///
/// A sweep travels as any number of sectors. Each cluster goes out with the first of them after which no return still to
/// come can belong to it, and is the same to the byte for any number. Sweeps that may not be cut go out with their last
/// sector.
///
/// `RejectedMalformed`: the part contradicts itself, those before, or what its sweep promises. `RejectedIncomplete`: a
/// part before it is missing or was malformed. `RejectedShed`: a part of an odd sweep at [`messages::Step::EverySecondSweep`]. The
/// output then has the part's header and nothing else. `PartialCells` means that the cells of some last clusters of the
/// message did not fit. An empty part has no clusters and is `Complete`.
///
/// Allocates in `process` only to build a k-d tree.
pub struct Clusterer {
    sequence: Sequence,
    before: Before,
    store: Store,
    partition: Partition,
    gather: Gather,
    cells: Cells,
}

impl Stage for Clusterer {
    const NAME: &'static str = "clusterer";
    type Params = Params;
    type Input = Sweep;
    type Output = Clusters;

    fn init(params: Params) -> Result<Self, InitError> {
        let params = params.checked().map_err(InitError::new)?;
        Ok(Self {
            sequence: Sequence::default(),
            before: Before::new(),
            store: Store::new(),
            partition: Partition::new(&params),
            gather: Gather::new(params.range_d_m),
            cells: Cells::new(params.min_points),
        })
    }

    fn process(&mut self, part: Part, sector: &Sweep, output: &mut Clusters) -> Verdict {
        output.clear();
        output.header = sector.header;
        if part.is_shed() {
            self.sequence.give_up();
            return Verdict::RejectedShed;
        }
        if part.sector >= part.sectors {
            self.sequence.give_up();
            return Verdict::RejectedMalformed;
        }
        if !self.sequence.follows(&part) {
            return Verdict::RejectedIncomplete;
        }
        if part.sector == 0 {
            self.begin(sector);
        }
        match self.take(&part, sector, output) {
            Some(verdict) => verdict,
            None => {
                self.sequence.give_up();
                Verdict::RejectedMalformed
            }
        }
    }
}

impl Clusterer {
    fn begin(&mut self, first: &Sweep) {
        self.before.begin(first);
        self.store.reset();
        self.partition.begin();
        self.gather.begin();
        self.cells.begin();
    }

    /// Takes in a part that follows those before and fills in what closes with it; none where it is malformed.
    fn take(&mut self, part: &Part, sector: &Sweep, output: &mut Clusters) -> Option<Verdict> {
        if !self.before.add(part, sector) {
            return None;
        }
        let (last, may_be_cut) = (part.is_last(), sector.header.stray_rad > 0.0);
        // A part that has the whole sweep is read where it is.
        let is_whole = part.sectors == 1 || !may_be_cut;
        if !is_whole && !self.store.add(sector) {
            return None;
        }
        let seen = if is_whole { Seen::whole(sector) } else { self.store.seen(sector) };
        if may_be_cut {
            let (columns, returns) = (sector.columns.len(), sector.returns.len());
            if !self.partition.go_on(&seen, columns, returns, last) {
                return None;
            }
        } else if last {
            self.partition.whole(&seen);
        }
        if last && sector.header.is_complete() {
            output.turn_columns = seen.columns.len() as u64;
        }
        for ring in &sector.rings {
            // As many rings as the sweep has fit.
            let _ = output.ring_elevation_rad.push(ring.elevation_rad);
        }
        self.gather.fill(&seen, &self.partition, last, output);
        Some(self.cells.fill(&seen, self.gather.cluster_of(), self.partition.sense(), last, output))
    }
}
