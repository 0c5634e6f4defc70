use messages::Fit;
use nalgebra::{Matrix3, Vector3};
use pulp::Arch;

use super::bounds::Bounds;
use super::budget::Purse;
use super::descent::Descent;
use super::frames::{FRAMES, Frames, TURNED, turned};
use super::outcome::solid_fit;
use super::rays::{Beam, MOST_LANES, thin};
use super::residuals::{Measure, Rays};
use super::solid::for_kind;
use super::spread::spread;
use super::start::Cloud;
use super::{Beliefs, Body, Bundle, FitSettings, Kind, Ray};

// The numbers below were chosen together by trial on scenes of reference.toml and default.toml: of those tried, the cheapest
// under which the right solid still wins about as often as when every start is followed to its end.

/// Axes this near to one another, |cosine|, are one start.
const ALIKE: f64 = 0.97;
/// Share of the budget for the search among starts; the rest is for the likelihood's minima.
const SCOUTING: f64 = 0.6;
/// Share of a solid's starts that goes on after one step.
const FIRST_CUT: f64 = 0.6;
/// Steps from the first cut to the second, and on to the third.
const STEPS: (usize, usize) = (2, 4);
/// Evaluations that a step takes, on average: some are tried twice.
const PER_STEP: f64 = 1.3;
/// Fewest and most starts of a solid left by the second and by the third cut.
const SECOND_CUT: (f64, f64) = (2.0, 10.0);
const THIRD_CUT: (f64, f64) = (1.0, 6.0);
/// Steps on the likelihood before the last cut.
const POLISH: usize = 3;
/// Steps on the likelihood after it.
const LAST: usize = 15;
/// Cost above the best of its solid beyond which a minimum is not followed further: it would decide nothing.
const BEHIND_OWN: f64 = 20.0;
/// The same above the best of all.
const BEHIND_ALL: f64 = 60.0;
/// Least standard deviation of a range while scouting [m]: wide valleys lead further.
const SCOUTING_SIGMA_M: f64 = 0.03;

/// Most starts: boxes, ellipsoids, cylinders up and cones both ways along every axis.
const MOST_STARTS: usize = FRAMES + TURNED + 2 + 9 * FRAMES;

/// Fits the four solids to one cluster at a time, with the memory it needs.
#[derive(Debug)]
pub struct Fitter {
    settings: FitSettings,
    /// The instructions of this machine.
    arch: Arch,
    frames: Frames,
    few: Picked,
    full: Picked,
    axes: Vec<Vector3<f64>>,
    descents: Vec<Descent>,
    bounds: Bounds,
}

/// Rays that were chosen from a bundle.
#[derive(Debug)]
struct Picked {
    most: usize,
    hits: Vec<Ray>,
    misses: Vec<Ray>,
    /// The same side by side.
    beams: [Beam; 2],
}

impl Picked {
    fn new(most: usize) -> Self {
        Self {
            most,
            hits: Vec::with_capacity(most),
            misses: Vec::with_capacity(most),
            beams: [Beam::new(most), Beam::new(most)],
        }
    }

    fn pick(&mut self, bundle: &Bundle) {
        thin(&bundle.hits, self.most, &mut self.hits);
        thin(&bundle.misses, self.most, &mut self.misses);
        self.beams[0].take(&self.hits);
        self.beams[1].take(&self.misses);
    }

    fn rays<'a>(&'a self, arch: Arch, sigma_m: f64, beliefs: &'a Beliefs) -> Rays<'a> {
        let [hits, misses] = &self.beams;
        Rays { arch, hits, misses, sigma_m, beliefs }
    }
}

impl Fitter {
    /// Takes all memory that fits will need.
    pub fn new(settings: FitSettings) -> Self {
        Self {
            settings,
            arch: Arch::new(),
            frames: Frames::new(),
            few: Picked::new(settings.scouting_rays),
            full: Picked::new(settings.rays),
            axes: Vec::with_capacity(3 * FRAMES),
            descents: Vec::with_capacity(MOST_STARTS),
            bounds: Bounds::new(2 * settings.rays.div_ceil(MOST_LANES)),
        }
    }

    /// Fits all four solids to the rays of a cluster with at least one hit; `sigma_m` is the standard deviation of a range.
    ///
    /// Starts of each solid are scouted on few rays and cut down in rounds; the survivors go down the likelihood on more
    /// rays, best first, as far as the budget lasts. Every solid is owed one body on the few rays and one on the more: on
    /// a small budget up to four times both counts of rays are evaluated beyond it. Without hits the fit is all 0.
    pub fn fit(&mut self, bundle: &Bundle, sigma_m: f64) -> Fit {
        self.fit_within(self.settings.evaluations, bundle, sigma_m)
    }

    /// As [`Fitter::fit`] on another budget.
    pub fn fit_within(&mut self, evaluations: u64, bundle: &Bundle, sigma_m: f64) -> Fit {
        let mut fit = Fit::default();
        if bundle.hits.is_empty() {
            return fit;
        }
        self.few.pick(bundle);
        self.full.pick(bundle);
        let frames = self.frames.find(&self.full.hits);
        self.find_axes(&frames);

        let mut purse = Purse::new(evaluations);
        self.scout(&frames, sigma_m, &mut purse);
        self.polish(sigma_m, &mut purse);

        let rays = self.full.rays(self.arch, sigma_m, &self.settings.beliefs);
        let least = self.descents[0].cost();
        for kind in Kind::ALL {
            let of_kind = || self.descents.iter().filter(|descent| descent.kind == kind);
            let others = || of_kind().skip(1);
            // Every solid has a start.
            let Some(best) = of_kind().next() else { continue };
            // One farther behind was not followed to its minimum.
            let bounds = Some(&mut self.bounds).filter(|_| best.cost() <= least + BEHIND_ALL);
            let spread = bounds.and_then(|bounds| for_kind!(kind, S => spread::<S>(best, others(), &rays, bounds)));
            fit.solids[kind as usize] = solid_fit(best, others().next(), spread);
        }
        fit.hits = self.full.hits.len() as u32;
        fit.misses = self.full.misses.len() as u32;
        fit.nearer = bundle.nearer;
        fit.evaluations = purse.spent().min(u64::from(u32::MAX)) as u32;
        fit
    }

    /// Axes of all frames but those like an earlier one.
    fn find_axes(&mut self, frames: &[Matrix3<f64>; FRAMES]) {
        self.axes.clear();
        for axis in frames.iter().flat_map(|frame| frame.column_iter()) {
            if self.axes.iter().all(|other| other.dot(&axis).abs() < ALIKE) {
                self.axes.push(axis.into());
            }
        }
    }

    /// Leaves the best starts of each solid in `descents`.
    fn scout(&mut self, frames: &[Matrix3<f64>; FRAMES], sigma_m: f64, purse: &mut Purse) {
        let rays = self.few.rays(self.arch, sigma_m.max(SCOUTING_SIGMA_M), &self.settings.beliefs);
        let cloud = Cloud::new(&self.full.hits);
        let axes = &self.axes;
        let starts = FRAMES + TURNED + 2 + 3 * axes.len();
        let cuts = Cuts::new(purse.left(), starts, rays.count(), self.full.hits.len() + self.full.misses.len());
        let mut scouting = purse.split(SCOUTING);
        let mut camp = Camp { rays: &rays, cuts, left: starts, purse: &mut scouting, descents: &mut self.descents };

        camp.descents.clear();
        let (boxes, rounds) = (FRAMES + TURNED, axes.len());
        camp.scout(Kind::Cuboid, boxes, frames.iter().chain(&turned(frames)).map(|frame| cloud.body(frame)));
        camp.scout(Kind::Ellipsoid, 2, frames[..2].iter().map(|frame| cloud.body(frame)));
        camp.scout(Kind::Cylinder, rounds, axes.iter().map(|axis| cloud.round_body(axis)));
        let ends = axes.iter().flat_map(|axis| [*axis, -axis]);
        camp.scout(Kind::Cone, 2 * rounds, ends.map(|axis| cloud.round_body(&axis)));
        purse.join(scouting);
    }

    /// Takes the survivors down the likelihood, and sorts them by cost.
    fn polish(&mut self, sigma_m: f64, purse: &mut Purse) {
        let rays = self.full.rays(self.arch, sigma_m, &self.settings.beliefs);
        let descents = &mut self.descents;
        for descent in descents.iter_mut() {
            *descent = Descent::at(descent.kind, descent.body, &rays, Measure::Range, purse);
        }
        sort(descents);
        for descent in descents.iter_mut() {
            descent.run(&rays, Measure::Range, POLISH, purse);
        }
        sort(descents);
        let best = descents[0].cost();
        let mut own = [f64::INFINITY; 4];
        for descent in descents.iter_mut() {
            let own = &mut own[descent.kind as usize];
            *own = own.min(descent.cost());
            if descent.cost() <= *own + BEHIND_OWN && descent.cost() <= best + BEHIND_ALL {
                descent.run(&rays, Measure::Range, LAST, purse);
            }
        }
        sort(descents);
    }
}

/// How many starts of a solid go on after each cut: as many as the budget allows.
#[derive(Clone, Copy, Debug)]
struct Cuts {
    second: usize,
    third: usize,
}

impl Cuts {
    fn new(evaluations: u64, starts: usize, few: usize, full: usize) -> Self {
        let evaluations = evaluations as f64;
        // Of each start one evaluation, and one step of those within the first cut.
        let opening = starts as f64 * (1.0 + FIRST_CUT * PER_STEP * (1 + STEPS.0) as f64);
        let second = (SCOUTING * evaluations / few.max(1) as f64 - opening) / (4.0 * STEPS.1 as f64 * PER_STEP);
        let third = (1.0 - SCOUTING) * evaluations / (4.0 * full.max(1) as f64 * (1.0 + POLISH as f64 * PER_STEP));
        Self {
            second: second.clamp(SECOND_CUT.0, SECOND_CUT.1) as usize,
            third: third.clamp(THIRD_CUT.0, THIRD_CUT.1) as usize,
        }
    }
}

/// Where starts are scouted.
struct Camp<'a> {
    rays: &'a Rays<'a>,
    cuts: Cuts,
    /// Starts that are still to come, of all solids.
    left: usize,
    purse: &'a mut Purse,
    descents: &'a mut Vec<Descent>,
}

impl Camp<'_> {
    /// Adds the best of the `count` starts of one solid to `descents`. Of the budget that is left, these starts get their
    /// share among all that are still to come.
    fn scout(&mut self, kind: Kind, count: usize, starts: impl Iterator<Item = Body>) {
        let mut purse = self.purse.split(count as f64 / self.left.max(1) as f64);
        self.left -= count;

        let first = self.descents.len();
        for start in starts {
            // One start is owed to every solid.
            if self.descents.len() > first && purse.left() < self.rays.count() as u64 {
                break;
            }
            self.descents.push(Descent::at(kind, start, self.rays, Measure::Near, &mut purse));
        }
        let third = self.cuts.third;
        let second = self.cuts.second.max(third);
        let many = (count as f64 * FIRST_CUT).ceil() as usize;
        for (steps, keep) in [(1, many.max(second)), (STEPS.0, second), (STEPS.1, third)] {
            let descents = &mut self.descents[first..];
            for descent in descents.iter_mut() {
                descent.run(self.rays, Measure::Near, steps, &mut purse);
            }
            sort(descents);
            self.descents.truncate(first + keep);
        }
        self.purse.join(purse);
    }
}

/// By cost; sorting in place takes no memory, and equal costs come in the same order every time.
fn sort(descents: &mut [Descent]) {
    descents.sort_unstable_by(|a, b| a.cost().total_cmp(&b.cost()));
}
