//! What is timed: adding a stage is adding one entry to [`STAGES`], and what it calls.

use std::hash::{DefaultHasher, Hasher};

use clusterer::Clusterer;
use extractor::Extractor;
use messages::{Clusters, Descriptors, MIN_FEATURE_POINTS, Message, Part, Sweep, Verdict};
use runtime::{Plan, clock};
use stage::Stage;
use zerocopy::IntoBytes;

use super::machine::Machine;
use super::measure::Once;
use super::surface::Surface;
use crate::assets::Assets;
use crate::cli::BenchArgs;
use crate::{Failure, dispatch};

/// One line of the bench. Works on what the workbench holds, and leaves there what it found there.
pub(super) struct Timed {
    pub(super) name: &'static str,
    work: fn(&mut Workbench) -> Result<(), Rejected>,
    /// Writes the work's output, for comparison.
    output: fn(&Workbench, &mut dyn Hasher),
}

/// The stages, in the order of their lines.
pub(super) const STAGES: &[Timed] = &[
    Timed { name: "cluster", work: Workbench::cluster, output: Workbench::write_clusters },
    Timed { name: "normals", work: Workbench::normals, output: Workbench::write_normals },
    Timed { name: "histogram", work: Workbench::histogram, output: Workbench::write_histogram },
    Timed { name: "svm", work: Workbench::svm, output: Workbench::write_judgements },
    Timed { name: "paper_chain", work: Workbench::paper_chain, output: Workbench::write_judgements },
];

/// Every sweep is whole.
pub(super) const PART: Part = Part { ordinal: 0, sweep: 0, sector: 0, sectors: 1, sensor_time_ns: 0 };

/// A stage would not take the sweep.
#[derive(Debug, thiserror::Error)]
#[error("rejected by the {stage}: {}", .verdict.name())]
pub(super) struct Rejected {
    stage: &'static str,
    verdict: Verdict,
}

impl Rejected {
    fn unless_taken(stage: &'static str, verdict: Verdict) -> Result<(), Self> {
        if verdict.is_rejected() { Err(Self { stage, verdict }) } else { Ok(()) }
    }
}

/// The stages, one sweep, and what each stage made of it.
pub(super) struct Workbench {
    /// Smaller clusters are left out before features are extracted; 0 where the extractor's own minimum is enough.
    min_points: u32,
    clusterer: Clusterer,
    extractor: Extractor,
    surface: Surface,
    machine: Machine,
    sweep: Box<Sweep>,
    /// Clusters of the sweep, before smaller ones are left out.
    found: usize,
    clusters: Box<Clusters>,
    descriptors: Box<Descriptors>,
}

impl Workbench {
    /// Builds the stages as the chain's files and the command line say.
    pub(super) fn new(args: &BenchArgs, plan: &Plan, assets: &Assets) -> Result<Self, Failure> {
        let extractor = dispatch::init::<Extractor>(plan, |_| Ok(()))?;
        let surface = Surface::new(&dispatch::params::<Extractor>(plan)?.checked().map_err(Failure::start)?);
        let machine = match &args.model {
            Some(path) => Machine::of_file(path)?,
            None => Machine::configured(plan, assets)?,
        };
        Ok(Self {
            min_points: args.min_points.filter(|&points| points as usize > MIN_FEATURE_POINTS).unwrap_or(0),
            clusterer: clusterer(args, plan)?,
            extractor,
            surface,
            machine,
            sweep: zeroed()?,
            found: 0,
            clusters: zeroed()?,
            descriptors: zeroed()?,
        })
    }
    /// Takes a sweep and runs all stages on it once, so that each finds its input from then on.
    pub(super) fn load(&mut self, sweep: Box<Sweep>) -> Result<(), Failure> {
        self.sweep = sweep;
        self.paper_chain().map_err(Failure::run)?;
        self.surface.load(&self.clusters);
        self.surface.normals();
        self.surface.histogram();
        if self.surface.bins() != &self.descriptors.bins[..] {
            return Err(Failure::run("normals and histogram apart give other features than the extractor"));
        }
        Ok(())
    }

    /// One run of a stage.
    pub(super) fn run(&mut self, stage: &Timed) -> Result<Once, Rejected> {
        let started_ns = clock::now_ns();
        (stage.work)(self)?;
        let ns = clock::now_ns() - started_ns;
        let mut hash = DefaultHasher::new();
        (stage.output)(self, &mut hash);
        Ok(Once { ns, output: hash.finish() })
    }

    /// Returns of the sweep.
    pub(super) fn returns(&self) -> usize {
        self.sweep.returns.len()
    }

    /// All clusters of the sweep.
    pub(super) fn found(&self) -> usize {
        self.found
    }

    /// Clusters with features.
    pub(super) fn described(&self) -> usize {
        self.surface.described()
    }

    /// The support vector machine's name, and its number of support vectors.
    pub(super) fn model(&self) -> (&str, usize) {
        (&self.machine.name, self.machine.support_vectors)
    }

    fn cluster(&mut self) -> Result<(), Rejected> {
        self.clusters.clear();
        let verdict = self.clusterer.process(PART, &self.sweep, &mut self.clusters);
        self.found = self.clusters.clusters.len();
        if self.min_points > 0 {
            leave_out_smaller(&mut self.clusters, self.min_points);
        }
        Rejected::unless_taken(Clusterer::NAME, verdict)
    }

    fn normals(&mut self) -> Result<(), Rejected> {
        self.surface.normals();
        Ok(())
    }

    fn histogram(&mut self) -> Result<(), Rejected> {
        self.surface.histogram();
        Ok(())
    }

    fn extract(&mut self) -> Result<(), Rejected> {
        self.descriptors.clear();
        let verdict = self.extractor.process(PART, &self.clusters, &mut self.descriptors);
        Rejected::unless_taken(Extractor::NAME, verdict)
    }

    fn svm(&mut self) -> Result<(), Rejected> {
        Rejected::unless_taken("svm", self.machine.process(&self.descriptors))
    }

    fn paper_chain(&mut self) -> Result<(), Rejected> {
        self.cluster()?;
        self.extract()?;
        self.svm()
    }

    fn write_clusters(&self, hash: &mut dyn Hasher) {
        hash.write(self.clusters.clusters.item_bytes());
        hash.write(self.clusters.members.item_bytes());
        hash.write(self.clusters.cells.item_bytes());
    }

    fn write_normals(&self, hash: &mut dyn Hasher) {
        self.surface.write_normals(hash);
    }

    fn write_histogram(&self, hash: &mut dyn Hasher) {
        hash.write(self.surface.bins().as_bytes());
    }

    fn write_judgements(&self, hash: &mut dyn Hasher) {
        self.machine.write(hash);
    }
}

/// The clusterer, with what the command line says of it.
fn clusterer(args: &BenchArgs, plan: &Plan) -> Result<Clusterer, Failure> {
    let flags = [args.range.map(|_| "--range"), args.min_points.map(|_| "--min-points")];
    let given: Vec<_> = flags.into_iter().flatten().collect();
    if given.is_empty() {
        return dispatch::init(plan, |_| Ok(()));
    }
    let mut params = dispatch::params::<Clusterer>(plan)?;
    params.range_d_m = args.range.unwrap_or(params.range_d_m);
    params.min_points = args.min_points.unwrap_or(params.min_points);
    Clusterer::init(params).map_err(|cause| Failure::start(format!("{}: {cause}", given.join(", "))))
}

/// Drops clusters of fewer points, with their returns. They have no cells: the clusterer has the same minimum.
fn leave_out_smaller(clusters: &mut Clusters, min_points: u32) {
    let (mut kept, mut members) = (0, 0);
    for place in 0..clusters.clusters.len() {
        let mut cluster = clusters.clusters[place];
        if cluster.summary.points < min_points {
            continue;
        }
        let places = cluster.summary.member_places();
        cluster.summary.first_member = members as u32;
        let count = places.len();
        clusters.returns.copy_within(places.clone(), members);
        clusters.members.copy_within(places, members);
        clusters.clusters[kept] = cluster;
        members += count;
        kept += 1;
    }
    clusters.clusters.truncate(kept);
    clusters.returns.truncate(members);
    clusters.members.truncate(members);
}

/// An empty message.
pub(super) fn zeroed<M: Message>() -> Result<Box<M>, Failure> {
    M::new_box_zeroed().map_err(|_| Failure::start("no memory for a message"))
}

#[cfg(test)]
mod tests {
    use lidar::Return;
    use messages::{Cluster, ClusterSummary};

    use super::*;

    #[test]
    fn smaller_clusters_go_with_their_returns_and_the_others_keep_theirs() {
        let mut sut = zeroed::<Clusters>().unwrap();
        for points in [1, 3, 2, 4] {
            let first_member = sut.members.len() as u32;
            let summary = ClusterSummary { first_member, points, ..ClusterSummary::default() };
            sut.clusters.push(Cluster { summary, ..Cluster::default() }).unwrap();
            for member in first_member..first_member + points {
                sut.members.push(member).unwrap();
                sut.returns.push(Return { x: member as f32, ..Return::default() }).unwrap();
            }
        }
        leave_out_smaller(&mut sut, 3);
        let places: Vec<_> = sut.clusters.iter().map(|cluster| cluster.summary.member_places()).collect();
        assert_eq!(places, [0..3, 3..7]);
        assert_eq!(&sut.members[..], &[1, 2, 3, 6, 7, 8, 9]);
        assert!(sut.returns.iter().zip(&sut.members).all(|(r, &member)| r.x == member as f32));
        assert_eq!(sut.returns.len(), 7);
    }
}
