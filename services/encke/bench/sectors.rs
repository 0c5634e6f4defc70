//! What is left to do when a sweep's last return is there: the chain's work on its last sector.

use std::hash::Hasher;

use messages::{Clusters, Cutter, Message, Part, Sweep};
use runtime::Plan;
use stage::Stage;

use super::clustering::{Clustering, clusterer};
use super::stages::{Rejected, zeroed};
use crate::Failure;
use crate::cli::BenchArgs;

/// A clusterer that is given the sweep in as many sectors as the chain sends.
pub(super) struct Sectors {
    clusterer: clusterer::Clusterer,
    cutter: Cutter,
    sectors: u32,
    whole: Box<Sweep>,
    piece: Box<Sweep>,
    pub(super) clusters: Box<Clusters>,
}

impl Sectors {
    pub(super) fn new(args: &BenchArgs, plan: &Plan) -> Result<Self, Failure> {
        Ok(Self {
            clusterer: clusterer(args, plan)?,
            cutter: Cutter::new(plan.chain.sectors),
            sectors: plan.chain.sectors,
            whole: zeroed()?,
            piece: zeroed()?,
            clusters: zeroed()?,
        })
    }

    pub(super) fn load(&mut self, sweep: &Sweep) {
        // One sector of one: a copy.
        self.whole.clear();
        Cutter::new(1).fill(sweep, 0, &mut self.whole);
        self.cutter.measure(&mut self.whole);
    }

    /// All sectors but the last, which is left ready.
    pub(super) fn approach(&mut self) -> Result<(), Rejected> {
        for sector in 0..self.sectors - 1 {
            self.cut(sector);
            self.take(sector)?;
        }
        self.cut(self.sectors - 1);
        Ok(())
    }

    /// The last sector.
    pub(super) fn process(&mut self) -> Result<(), Rejected> {
        self.take(self.sectors - 1)
    }

    fn cut(&mut self, sector: u32) {
        self.piece.clear();
        self.cutter.fill(&self.whole, sector, &mut self.piece);
    }

    fn take(&mut self, sector: u32) -> Result<(), Rejected> {
        self.clusters.clear();
        let part = Part { ordinal: u64::from(sector), sector, sectors: self.sectors, ..Part::default() };
        let verdict = self.clusterer.process(part, &self.piece, &mut self.clusters);
        Rejected::unless_taken(clusterer::Clusterer::NAME, verdict)
    }

    pub(super) fn write(&self, hash: &mut dyn Hasher) {
        Clustering::write_clusters(&self.clusters, hash);
    }
}
