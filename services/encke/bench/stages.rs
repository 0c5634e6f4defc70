//! What is timed: adding a stage is adding one entry to [`STAGES`], and what it calls.

use std::hash::{DefaultHasher, Hasher};

use extractor::Extractor;
use messages::{Message, Part, Sweep, Verdict};
use runtime::{Plan, clock};
use zerocopy::IntoBytes;

use super::clustering::Clustering;
use super::extraction::{Extraction, making};
use super::judge::Judge;
use super::measure::Once;
use super::sectors::Sectors;
use super::surface::Surface;
use super::tracking::Tracking;
use crate::assets::Assets;
use crate::cli::BenchArgs;
use crate::{Failure, dispatch};

/// One line of the bench. Works on what the workbench holds, and leaves there what it found there.
pub(super) struct Timed {
    pub(super) name: &'static str,
    /// Done before the clock starts.
    prepare: fn(&mut Workbench) -> Result<(), Rejected>,
    work: fn(&mut Workbench) -> Result<(), Rejected>,
    /// Writes the work's output, for comparison.
    output: fn(&Workbench, &mut dyn Hasher),
}

/// The stages, in the order of their lines.
pub(super) const STAGES: &[Timed] = &[
    Timed { name: "cluster", prepare: Workbench::nothing, work: Workbench::cluster, output: Workbench::write_clusters },
    Timed { name: "normals", prepare: Workbench::nothing, work: Workbench::normals, output: Workbench::write_normals },
    Timed {
        name: "histogram",
        prepare: Workbench::nothing,
        work: Workbench::histogram,
        output: Workbench::write_histogram,
    },
    Timed { name: "svm", prepare: Workbench::nothing, work: Workbench::svm, output: Workbench::write_svm },
    Timed { name: FIT, prepare: Workbench::nothing, work: Workbench::fit, output: Workbench::write_fits },
    Timed {
        name: "paper_chain",
        prepare: Workbench::nothing,
        work: Workbench::paper_chain,
        output: Workbench::write_svm,
    },
    Timed {
        name: FULL_CHAIN,
        prepare: Workbench::nothing,
        work: Workbench::full_chain,
        output: Workbench::write_judgements,
    },
    Timed { name: TRACK, prepare: Workbench::meet, work: Workbench::track, output: Workbench::write_tracks },
    Timed {
        name: "paper_last_sector",
        prepare: Workbench::approach,
        work: Workbench::paper_last_sector,
        output: Workbench::write_last_sector,
    },
    Timed {
        name: FULL_LAST_SECTOR,
        prepare: Workbench::approach,
        work: Workbench::full_last_sector,
        output: Workbench::write_last_sector,
    },
];

const FIT: &str = "fit";
pub(super) const FULL_CHAIN: &str = "full_chain";
const TRACK: &str = "track";
const FULL_LAST_SECTOR: &str = "full_last_sector";

/// Every sweep is whole.
pub(super) const PART: Part =
    Part { ordinal: 0, sweep: 0, sector: 0, sectors: 1, sensor_time_ns: 0, step: 0, attempt: 0 };

/// A stage would not take the sweep.
#[derive(Debug, thiserror::Error)]
#[error("rejected by the {stage}: {}", .verdict.name())]
pub(super) struct Rejected {
    stage: &'static str,
    verdict: Verdict,
}

impl Rejected {
    pub(super) fn unless_taken(stage: &'static str, verdict: Verdict) -> Result<(), Self> {
        if verdict.is_rejected() { Err(Self { stage, verdict }) } else { Ok(()) }
    }
}

/// The stages, one sweep, and what each stage made of it.
pub(super) struct Workbench {
    sweep: Box<Sweep>,
    clustering: Clustering,
    /// The paper's: histograms, and a support vector machine on them.
    surface: Surface,
    histograms: Extraction,
    pub(super) svm: Judge,
    /// Only fitted solids.
    solids: Extraction,
    /// The chain's own.
    extraction: Extraction,
    judge: Judge,
    tracking: Tracking,
    sectors: Sectors,
}

impl Workbench {
    /// Builds the stages as the chain's files and the command line say.
    pub(super) fn new(args: &BenchArgs, plan: &Plan, assets: &Assets) -> Result<Self, Failure> {
        let paper = making(plan, true, false)?;
        Ok(Self {
            sweep: zeroed()?,
            clustering: Clustering::new(args, plan)?,
            surface: Surface::new(&dispatch::params::<Extractor>(&paper)?.checked().map_err(Failure::start)?),
            histograms: Extraction::new(&paper)?,
            svm: match &args.model {
                Some(path) => Judge::of_file(path)?,
                None => Judge::svm(&paper, assets)?,
            },
            solids: Extraction::new(&making(plan, false, true)?)?,
            extraction: Extraction::new(plan)?,
            judge: Judge::configured(plan, assets)?,
            tracking: Tracking::new(plan)?,
            sectors: Sectors::new(args, plan)?,
        })
    }

    /// Takes a sweep and runs the paper's stages on it once, so that each finds its input from then on.
    pub(super) fn load(&mut self, sweep: Box<Sweep>) -> Result<(), Failure> {
        self.sectors.load(&sweep);
        self.tracking.unload();
        self.sweep = sweep;
        self.paper_chain().map_err(Failure::run)?;
        self.surface.load(&self.clustering.clusters);
        self.surface.normals();
        self.surface.histogram();
        if self.surface.bins() != &self.histograms.descriptors.bins[..] {
            return Err(Failure::run("normals and histogram apart give other features than the extractor"));
        }
        Ok(())
    }

    /// One run of a stage.
    pub(super) fn run(&mut self, stage: &Timed) -> Result<Once, Rejected> {
        (stage.prepare)(self)?;
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
        self.clustering.found
    }

    /// Clusters with features.
    pub(super) fn described(&self) -> usize {
        self.surface.described()
    }

    /// The model that goes with a stage: the chain's own where the full chain's work is looked at, else the support vector machine.
    pub(super) fn judge_of(&self, stage: &Timed) -> &Judge {
        if [FULL_CHAIN, TRACK, FULL_LAST_SECTOR].contains(&stage.name) { &self.judge } else { &self.svm }
    }

    /// Clusters with fitted solids and mean evaluations for one, where that is the stage's work.
    pub(super) fn fits_of(&self, stage: &Timed) -> Option<(usize, f64)> {
        (stage.name == FIT).then(|| self.solids.fits())
    }

    fn nothing(&mut self) -> Result<(), Rejected> {
        Ok(())
    }

    fn cluster(&mut self) -> Result<(), Rejected> {
        self.clustering.process(&self.sweep)
    }

    fn normals(&mut self) -> Result<(), Rejected> {
        self.surface.normals();
        Ok(())
    }

    fn histogram(&mut self) -> Result<(), Rejected> {
        self.surface.histogram();
        Ok(())
    }

    fn svm(&mut self) -> Result<(), Rejected> {
        self.svm.process(&self.histograms.descriptors)
    }

    fn fit(&mut self) -> Result<(), Rejected> {
        self.solids.process(&self.clustering.clusters)
    }

    fn paper_chain(&mut self) -> Result<(), Rejected> {
        self.cluster()?;
        self.histograms.process(&self.clustering.clusters)?;
        self.svm()
    }

    fn full_chain(&mut self) -> Result<(), Rejected> {
        self.cluster()?;
        self.extraction.process(&self.clustering.clusters)?;
        self.judge.process(&self.extraction.descriptors)
    }

    /// Lets the tracker meet the obstacles, the first time.
    fn meet(&mut self) -> Result<(), Rejected> {
        if self.tracking.is_warm() {
            return Ok(());
        }
        self.full_chain()?;
        self.judge.detections().map_or(Ok(()), |detections| self.tracking.warm_up(detections))
    }

    fn track(&mut self) -> Result<(), Rejected> {
        self.tracking.process_again()
    }

    fn approach(&mut self) -> Result<(), Rejected> {
        self.sectors.approach()
    }

    fn paper_last_sector(&mut self) -> Result<(), Rejected> {
        self.sectors.process()?;
        self.histograms.process(&self.sectors.clusters)?;
        self.svm()
    }

    fn full_last_sector(&mut self) -> Result<(), Rejected> {
        self.sectors.process()?;
        self.extraction.process(&self.sectors.clusters)?;
        self.judge.process(&self.extraction.descriptors)
    }

    fn write_tracks(&self, hash: &mut dyn Hasher) {
        self.tracking.write(hash);
    }

    fn write_last_sector(&self, hash: &mut dyn Hasher) {
        self.sectors.write(hash);
    }

    fn write_clusters(&self, hash: &mut dyn Hasher) {
        self.clustering.write(hash);
    }

    fn write_normals(&self, hash: &mut dyn Hasher) {
        self.surface.write_normals(hash);
    }

    fn write_histogram(&self, hash: &mut dyn Hasher) {
        hash.write(self.surface.bins().as_bytes());
    }

    fn write_svm(&self, hash: &mut dyn Hasher) {
        self.svm.write(hash);
    }

    fn write_fits(&self, hash: &mut dyn Hasher) {
        self.solids.write(hash);
    }

    fn write_judgements(&self, hash: &mut dyn Hasher) {
        self.extraction.write(hash);
        self.judge.write(hash);
    }
}

/// An empty message.
pub(super) fn zeroed<M: Message>() -> Result<Box<M>, Failure> {
    M::new_box_zeroed().map_err(|_| Failure::start("no memory for a message"))
}
