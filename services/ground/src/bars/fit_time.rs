//! What a fit takes, on one thread.

use super::EvaluateError;
use super::plan::FitPlan;
use super::share::quantile;
use super::views;
use crate::{Files, Observer};

/// Host time \[ns\], from the one place that reads it.
pub type Clock<'a> = &'a dyn Fn() -> u64;

/// Time of the extractor with solids alone, over the clusters that got a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitTime {
    /// Fits of one pass.
    pub fits: u32,
    /// Mean over fits, the median of all passes \[ms\]; none without a fit.
    pub median_ms: Option<f64>,
    /// The same, the least of all passes \[ms\].
    pub least_ms: Option<f64>,
}

impl FitTime {
    /// `evaluations`: the fit's budget, where it is to be another than the extractor's file has.
    pub(crate) fn measure(
        plan: &FitPlan,
        evaluations: Option<u64>,
        read: Files<'_>,
        clock: Clock<'_>,
    ) -> Result<Self, EvaluateError> {
        let mut observer = Observer::new(&views::timed(&plan.scene, evaluations), &read)?;
        let mut fits = 0;
        let mut passes_ns = vec![0; plan.passes as usize];
        for sweep in 0..plan.sweeps {
            // Touches all that the passes will, too.
            observer.show(None, sweep.into())?;
            fits += observer.seen().descriptors.fits.len() as u32;
            for pass_ns in &mut passes_ns {
                let started_ns = clock();
                observer.extract();
                *pass_ns += clock().saturating_sub(started_ns);
            }
        }
        let each_ms = |ns: &u64| *ns as f64 * 1e-6 / f64::from(fits.max(1));
        let of_passes = |at| quantile(passes_ns.iter().map(each_ms).collect(), at).filter(|_| fits > 0);
        Ok(Self { fits, median_ms: of_passes(0.5), least_ms: of_passes(0.0) })
    }
}
