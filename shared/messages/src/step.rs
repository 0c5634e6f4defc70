/// How much of its work the chain leaves out under overload, least first: the rungs of the ladder that chain.toml
/// chooses from. Each step includes what the ones before it leave out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum Step {
    /// Everything is done.
    #[default]
    Nominal = 0,
    /// Solids are fitted on the extractor's smaller budget.
    FewerStarts = 1,
    /// No solids; the paper's histograms are judged instead, where the classifier has a model for them.
    PaperFeatures = 2,
    /// Nothing is said of clusters: all are unclassified.
    ClustersOnly = 3,
    /// As before, and every odd sweep is rejected as [`crate::Verdict::RejectedShed`].
    EverySecondSweep = 4,
}

impl Step {
    /// All steps, by their number.
    pub const ALL: [Self; 5] =
        [Self::Nominal, Self::FewerStarts, Self::PaperFeatures, Self::ClustersOnly, Self::EverySecondSweep];

    /// The step of a number; the last one for numbers beyond.
    pub fn from_number(number: u32) -> Self {
        Self::ALL.get(number as usize).copied().unwrap_or(Self::EverySecondSweep)
    }

    /// The step's word in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nominal => "nominal",
            Self::FewerStarts => "fewer-starts",
            Self::PaperFeatures => "paper-features",
            Self::ClustersOnly => "clusters-only",
            Self::EverySecondSweep => "every-second-sweep",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_stands_at_its_own_number_and_numbers_beyond_are_the_last() {
        for (number, step) in Step::ALL.into_iter().enumerate() {
            assert_eq!((step as usize, Step::from_number(number as u32)), (number, step));
        }
        assert_eq!(Step::from_number(u32::MAX), Step::EverySecondSweep);
    }
}
