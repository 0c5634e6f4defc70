use lidar::{MAX_COLUMNS, MAX_RETURNS, Return};
use messages::{Cluster, Clusters, Descriptor, Descriptors, Fit, MAX_CELLS, MIN_FEATURE_POINTS, Part, Step, Verdict};
use stage::{InitError, Stage};

use crate::fit::{Bundle, FitSettings, Fitter};
use crate::{Features, Params, Relief, column_stride};

/// The stage: clusters in, descriptors out.
#[derive(Debug)]
pub struct Extractor {
    spacing_rad: f32,
    features: Option<Features>,
    solids: Option<Solids>,
    /// Whether clusters get histograms, by step.
    histogram: [bool; Step::ALL.len()],
    /// Residuals that may be evaluated for one cluster, by step; none where no solids are fitted.
    evaluations: [Option<u64>; Step::ALL.len()],
}

/// What fits solids to clusters.
#[derive(Debug)]
struct Solids {
    settings: FitSettings,
    bundle: Bundle,
    fitter: Fitter,
    relief: Relief,
}

impl Stage for Extractor {
    const NAME: &'static str = "extractor";
    type Params = Params;
    type Input = Clusters;
    type Output = Descriptors;

    fn init(params: Params) -> Result<Self, InitError> {
        let params = params.checked().map_err(InitError::new)?;
        Ok(Self {
            spacing_rad: params.spacing_rad,
            features: (params.histogram || params.overload.histogram).then(|| Features::new(&params)),
            solids: params.fit.map(Solids::new),
            histogram: Step::ALL.map(|step| match step {
                Step::Nominal | Step::FewerStarts => params.histogram,
                Step::PaperFeatures => params.histogram || params.overload.histogram,
                Step::ClustersOnly | Step::EverySecondSweep => false,
            }),
            evaluations: Step::ALL.map(|step| match step {
                Step::Nominal => params.fit.map(|fit| fit.evaluations),
                Step::FewerStarts => params.fit.map(|fit| fit.evaluations.min(params.overload.evaluations)),
                Step::PaperFeatures | Step::ClustersOnly | Step::EverySecondSweep => None,
            }),
        })
    }

    fn process(&mut self, part: Part, input: &Clusters, output: &mut Descriptors) -> Verdict {
        output.header = input.header;
        if !is_well_formed(input) || output.members.extend_from_slice(&input.members).is_err() {
            return Verdict::RejectedMalformed;
        }
        let stride = column_stride(&input.header, self.spacing_rad);
        let step = part.step() as usize;
        let (histogram, evaluations) = (self.histogram[step], self.evaluations[step]);
        let mut verdict = Verdict::Complete;
        for cluster in &input.clusters {
            let mut descriptor = Descriptor {
                summary: cluster.summary,
                first_bin: output.bins.len() as u32,
                first_fit: output.fits.len() as u32,
                ..Descriptor::default()
            };
            let returns = &input.returns[cluster.summary.member_places()];
            if returns.len() >= MIN_FEATURE_POINTS {
                if let Some(features) = self.features.as_mut().filter(|_| histogram) {
                    for bin in features.describe(returns, stride).bins() {
                        // Cannot overflow: see `MAX_BINS`.
                        let _ = output.bins.push(bin);
                    }
                }
                let solids = self.solids.as_mut().zip(evaluations);
                let fit = solids.and_then(|(solids, evaluations)| solids.fit(input, cluster, returns, evaluations));
                if fit.is_some_and(|fit| output.fits.push(fit).is_err()) {
                    verdict = Verdict::PartialFits;
                }
            }
            descriptor.bins = output.bins.len() as u32 - descriptor.first_bin;
            descriptor.fits = output.fits.len() as u32 - descriptor.first_fit;
            let _ = output.descriptors.push(descriptor);
        }
        verdict
    }
}

impl Solids {
    fn new(settings: FitSettings) -> Self {
        Self {
            settings,
            bundle: Bundle::new(MAX_RETURNS, MAX_CELLS),
            fitter: Fitter::new(settings),
            relief: Relief::new(),
        }
    }

    /// None for a cluster that is wider than any solid looked for.
    fn fit(&mut self, input: &Clusters, cluster: &Cluster, returns: &[Return], evaluations: u64) -> Option<Fit> {
        if width_m(returns) > self.settings.widest_m {
            return None;
        }
        let header = &input.header;
        self.bundle.take(input, cluster, returns);
        let sigma_m = f64::from(header.range_sigma_m).max(self.settings.range_sigma_m);
        let mut fit = self.fitter.fit_within(evaluations, &self.bundle, sigma_m);
        fit.relief = self.relief.describe(returns);
        Some(fit)
    }
}

/// Largest extent along an axis of the sensor [m].
fn width_m(returns: &[Return]) -> f32 {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for r in returns {
        for (axis, value) in r.position().into_iter().enumerate() {
            low[axis] = low[axis].min(value);
            high[axis] = high[axis].max(value);
        }
    }
    (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f32::max)
}

/// Whether the clusters part returns and cells among them, in order, and every return is a place in space.
fn is_well_formed(input: &Clusters) -> bool {
    let (mut next, mut next_cell) = (0_u64, 0_u64);
    for cluster in &input.clusters {
        let summary = cluster.summary;
        if summary.points == 0 || u64::from(summary.first_member) != next {
            return false;
        }
        if cluster.cells > 0 && u64::from(cluster.first_cell) != next_cell {
            return false;
        }
        next += u64::from(summary.points);
        next_cell += u64::from(cluster.cells);
    }
    input.turn_columns <= MAX_COLUMNS as u64
        && next == input.returns.len() as u64
        && next_cell == input.cells.len() as u64
        && input.members.len() == input.returns.len()
        && input.returns.iter().all(|r| r.x.is_finite() && r.y.is_finite() && r.z.is_finite())
        && input.cells.iter().all(|cell| cell.azimuth_rad.is_finite() && cell.range_m.is_finite())
}
