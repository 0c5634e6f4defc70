use messages::{Clusters, Message, Part, Sweep, Verdict};
use stage::{InitError, Stage};

use crate::cells::Cells;
use crate::gather::Gather;
use crate::input;
use crate::params::Params;
use crate::partition::Partition;

/// Sweep → Clusters. Every accepted return is in exactly one cluster, alone or not.
///
/// Takes whole sweeps. A part of a sweep that travels in sectors is `RejectedIncomplete`, one that contradicts itself
/// `RejectedMalformed`: the output then has the sweep's header and nothing else. `PartialCells` means that the cells of
/// some last clusters did not fit. An empty sweep has no clusters and is `Complete`.
///
/// Allocates in `process` only to build a k-d tree.
pub struct Clusterer {
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
            partition: Partition::new(&params),
            gather: Gather::new(params.range_d_m),
            cells: Cells::new(params.min_points),
        })
    }

    fn process(&mut self, part: Part, sweep: &Sweep, output: &mut Clusters) -> Verdict {
        output.clear();
        output.header = sweep.header;
        if part.sectors != 1 {
            return Verdict::RejectedIncomplete;
        }
        if !input::is_consistent(&part, sweep) {
            return Verdict::RejectedMalformed;
        }
        output.turn_columns = if sweep.header.is_complete() { sweep.columns.len() as u64 } else { 0 };
        for ring in &sweep.rings {
            // As many rings as the sweep has fit.
            let _ = output.ring_elevation_rad.push(ring.elevation_rad);
        }
        let roots = self.partition.roots(sweep);
        self.gather.fill(sweep, roots, output);
        self.cells.fill(sweep, self.gather.cluster_of(), output)
    }
}
