use messages::Step;
use serde::{Deserialize, Serialize};

use crate::OverloadFile;
use crate::check::{ChainError, number};

/// What is left out under overload, and when. A sweep is in trouble when a stage overran its budget on it, when it was
/// late, or when a part was dropped or refused as stale while it passed.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Eq, Serialize)]
pub struct Overload {
    /// Numbers of the [`Step`]s that are taken, gentlest first.
    pub steps: Vec<u32>,
    /// Sweeps in trouble, of the last `within_sweeps`, after which a step is taken.
    pub troubled_sweeps: u32,
    /// Sweeps looked back on.
    pub within_sweeps: u32,
    /// Sweeps without trouble after which a step is taken back.
    pub recover_sweeps: u32,
}

impl OverloadFile {
    /// The ladder that the file describes.
    pub(crate) fn checked(self) -> Result<Overload, ChainError> {
        let Self { steps, troubled_sweeps, within_sweeps, recover_sweeps } = self;
        let within = f64::from(within_sweeps);
        number("overload.within_sweeps", within, "1 to 1000", (1..=1_000).contains(&within_sweeps))?;
        number(
            "overload.troubled_sweeps",
            f64::from(troubled_sweeps),
            "1 to within_sweeps",
            (1..=within_sweeps).contains(&troubled_sweeps),
        )?;
        number(
            "overload.recover_sweeps",
            f64::from(recover_sweeps),
            "1 to 100000",
            (1..=100_000).contains(&recover_sweeps),
        )?;
        let mut numbers = Vec::new();
        for name in steps {
            let known = Step::ALL.into_iter().filter(|&step| step != Step::Nominal).find(|step| step.name() == name);
            let Some(step) = known else { return Err(ChainError::Step(name)) };
            if numbers.last().is_some_and(|&before| before >= step as u32) {
                return Err(ChainError::StepOrder(name));
            }
            numbers.push(step as u32);
        }
        Ok(Overload { steps: numbers, troubled_sweeps, within_sweeps, recover_sweeps })
    }
}
