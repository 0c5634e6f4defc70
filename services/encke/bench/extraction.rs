//! An extractor that is timed: as its file has it, or making only what one kind of classifier judges.

use std::hash::Hasher;

use extractor::Extractor;
use messages::{Clusters, Descriptors, Message};
use runtime::Plan;
use stage::Stage;

use super::stages::{PART, Rejected, zeroed};
use crate::{Failure, dispatch};

/// An extractor, and what it made last.
pub(super) struct Extraction {
    extractor: Extractor,
    pub(super) descriptors: Box<Descriptors>,
}

impl Extraction {
    /// Builds the extractor as its file says.
    pub(super) fn new(plan: &Plan) -> Result<Self, Failure> {
        Ok(Self { extractor: dispatch::init(plan, |_| Ok(()))?, descriptors: zeroed()? })
    }

    pub(super) fn process(&mut self, clusters: &Clusters) -> Result<(), Rejected> {
        self.descriptors.clear();
        let verdict = self.extractor.process(PART, clusters, &mut self.descriptors);
        Rejected::unless_taken(Extractor::NAME, verdict)
    }

    /// Clusters with fitted solids, and the mean number of residuals evaluated for one; 0 where there are none.
    pub(super) fn fits(&self) -> (usize, f64) {
        let fits = &self.descriptors.fits;
        let evaluations: u64 = fits.iter().map(|fit| u64::from(fit.evaluations)).sum();
        (fits.len(), evaluations as f64 / fits.len().max(1) as f64)
    }

    pub(super) fn write(&self, hash: &mut dyn Hasher) {
        hash.write(self.descriptors.descriptors.item_bytes());
        hash.write(self.descriptors.bins.item_bytes());
        hash.write(self.descriptors.fits.item_bytes());
    }
}

/// The plan with an extractor that makes this, whatever its file says. In the plan and not only in the extractor, because
/// a model is checked against the plan's.
pub(super) fn making(plan: &Plan, histogram: bool, solids: bool) -> Result<Plan, Failure> {
    // What is wrong with the file is said by its name.
    dispatch::params::<Extractor>(plan)?;
    let mut plan = plan.clone();
    if let Some(text) = plan.parameters.get_mut(Extractor::NAME) {
        let mut table: toml::Table = toml::from_str(text).map_err(Failure::start)?;
        for (key, value) in [("histogram", histogram), ("solids", solids)] {
            table.insert(key.to_owned(), value.into());
        }
        *text = table.to_string();
    }
    Ok(plan)
}
