use serde::{Deserialize, Serialize};

use crate::catalogue::{Fault, Lasting, Strength, Unit};

/// A fault with all that there is to say about it: what `encke inject` is given.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Planned {
    /// When, after the campaign's beginning [s].
    pub at_s: f64,
    /// What.
    pub fault: Fault,
    /// Whom it hits; none where that is the chain or the machine.
    pub stage: Option<String>,
    /// How strong it is, in the unit that the catalogue names.
    pub argument: Option<f64>,
    /// How long it lasts [s].
    pub for_s: Option<f64>,
    /// How often it is had.
    pub times: Option<u64>,
    /// Of all that is random in it.
    pub seed: u64,
}

/// A fault that cannot be had in this way.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// It hits a stage, and none is named.
    #[error("{0} hits {1}: name one")]
    NoStage(&'static str, &'static str),
    /// It hits no stage, and one is named.
    #[error("{0} hits {1}; {2:?} is named")]
    Stage(&'static str, &'static str, String),
    /// It is neither stronger nor weaker.
    #[error("{0} has no strength; leave `by` out")]
    NoStrength(&'static str),
    /// It is too strong or too weak.
    #[error("{name}: {what} is {is}, must be {least} to {most}")]
    Strength {
        /// The fault.
        name: &'static str,
        /// What its strength is.
        what: &'static str,
        /// As given.
        is: f64,
        /// The least.
        least: f64,
        /// The most.
        most: f64,
    },
    /// A strength that is counted is broken.
    #[error("{0}: {1} is {2}, must be a whole number")]
    Broken(&'static str, &'static str, f64),
    /// It is not had for a time.
    #[error("{0} does not last for a time; leave `for` out")]
    NoTime(&'static str),
    /// It cannot last so long.
    #[error("{0} lasts {1} s, must be 0.001 to 86400")]
    Time(&'static str, f64),
    /// It is not had a number of times.
    #[error("{0} is not had a number of times; leave `times` out")]
    NotTimes(&'static str),
    /// It cannot be had so often.
    #[error("{0} is had 0 times, must be at least 1")]
    Never(&'static str),
}

impl Planned {
    /// A fault as it usually is, at `at_s`.
    pub fn usual(fault: Fault, at_s: f64, stage: Option<String>, seed: u64) -> Self {
        let entry = fault.entry();
        Self {
            at_s,
            fault,
            stage: stage.or_else(|| entry.target.implied().map(str::to_owned)),
            argument: entry.strength.map(|strength| strength.usual),
            for_s: if let Lasting::Time(time_s) = entry.lasting { Some(time_s) } else { None },
            times: if let Lasting::Times(times) = entry.lasting { Some(times) } else { None },
            seed,
        }
    }

    /// Whether the catalogue allows it.
    ///
    /// # Errors
    /// A part that the fault has not, or one out of its bounds. Whether the chain has the stage is not known here.
    pub fn checked(self) -> Result<Self, PlanError> {
        let entry = self.fault.entry();
        let (name, target) = (entry.name, entry.target);
        match &self.stage {
            None if target.needs_stage() => return Err(PlanError::NoStage(name, target.words())),
            Some(stage) if !target.takes_stage() => {
                return Err(PlanError::Stage(name, target.words(), stage.clone()));
            }
            Some(stage) if target.implied().is_some_and(|implied| implied != stage && name_is_fixed(self.fault)) => {
                return Err(PlanError::Stage(name, target.words(), stage.clone()));
            }
            _ => {}
        }
        match (self.argument, entry.strength) {
            (Some(_), None) => return Err(PlanError::NoStrength(name)),
            (Some(is), Some(Strength { what, unit, least, most, .. })) => {
                if !(least..=most).contains(&is) {
                    return Err(PlanError::Strength { name, what, is, least, most });
                }
                if unit == Unit::Count && is.fract() != 0.0 {
                    return Err(PlanError::Broken(name, what, is));
                }
            }
            (None, _) => {}
        }
        match (self.for_s, entry.lasting) {
            (Some(_), Lasting::Once | Lasting::Times(_)) => return Err(PlanError::NoTime(name)),
            (Some(for_s), _) if !(0.001..=86_400.0).contains(&for_s) => return Err(PlanError::Time(name, for_s)),
            _ => {}
        }
        match (self.times, entry.lasting) {
            (Some(0), _) => Err(PlanError::Never(name)),
            (Some(_), Lasting::Once | Lasting::Time(_) | Lasting::Open) => Err(PlanError::NotTimes(name)),
            _ => Ok(self),
        }
    }

    /// The words after `encke inject` that put it into a chain.
    pub fn command_line(&self) -> Vec<String> {
        let mut words = vec![self.fault.name().to_owned()];
        words.extend(self.stage.clone());
        if let (Some(by), Some(strength)) = (self.argument, self.fault.entry().strength) {
            let by = match strength.unit {
                Unit::Count => format!("{by:.0}"),
                Unit::Milliseconds | Unit::SignedMilliseconds => format!("{:.0}us", by * 1e3),
            };
            words.push(format!("--by={by}"));
        }
        if let Some(for_s) = self.for_s {
            words.extend(["--for".to_owned(), format!("{:.0}us", for_s * 1e6)]);
        }
        if let Some(times) = self.times {
            words.extend(["--times".to_owned(), times.to_string()]);
        }
        words.extend(["--seed".to_owned(), self.seed.to_string()]);
        words
    }
}

/// Whether the stage that is implied is the only one.
fn name_is_fixed(fault: Fault) -> bool {
    !matches!(fault.entry().target, crate::catalogue::Target::Writer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalogue::CATALOGUE;

    fn usual(fault: Fault) -> Planned {
        let stage = fault.entry().target.needs_stage().then(|| "clusterer".to_owned());
        Planned::usual(fault, 0.0, stage, 1)
    }

    #[test]
    fn every_fault_can_be_had_as_it_usually_is() {
        for entry in CATALOGUE {
            let planned = usual(entry.fault);
            assert_eq!(planned.clone().checked(), Ok(planned), "{}", entry.name);
        }
    }

    #[test]
    fn what_a_fault_has_not_is_refused_with_what_it_has() {
        let refused = |spoil: fn(&mut Planned), fault| {
            let mut planned = usual(fault);
            spoil(&mut planned);
            planned.checked().unwrap_err().to_string()
        };
        let cases: [(&str, String); 10] = [
            ("panic hits a stage: name one", refused(|p| p.stage = None, Fault::Panic)),
            (
                "kill-all hits the chain: no name; \"source\" is named",
                refused(|p| p.stage = Some("source".to_owned()), Fault::KillAll),
            ),
            (
                "dust hits the source, which need not be named; \"recorder\" is named",
                refused(|p| p.stage = Some("recorder".to_owned()), Fault::Dust),
            ),
            ("panic has no strength; leave `by` out", refused(|p| p.argument = Some(1.0), Fault::Panic)),
            ("dust: level is 4, must be 1 to 3", refused(|p| p.argument = Some(4.0), Fault::Dust)),
            ("dust: level is 1.5, must be a whole number", refused(|p| p.argument = Some(1.5), Fault::Dust)),
            ("dust does not last for a time; leave `for` out", refused(|p| p.for_s = Some(1.0), Fault::Dust)),
            ("stop lasts 0 s, must be 0.001 to 86400", refused(|p| p.for_s = Some(0.0), Fault::Stop)),
            ("stop is not had a number of times; leave `times` out", refused(|p| p.times = Some(1), Fault::Stop)),
            ("panic is had 0 times, must be at least 1", refused(|p| p.times = Some(0), Fault::Panic)),
        ];
        for (expected, said) in cases {
            assert_eq!(said, expected);
        }
    }

    #[test]
    fn a_command_line_says_all_of_it() {
        let mut planned = usual(Fault::ClockStepped);
        planned.argument = Some(-3_600_000.0);
        assert_eq!(planned.command_line(), ["clock-step", "source", "--by=-3600000000us", "--seed", "1"]);
        assert_eq!(usual(Fault::Stop).command_line(), ["stop", "clusterer", "--for", "500000us", "--seed", "1"]);
        assert_eq!(usual(Fault::Panic).command_line(), ["panic", "clusterer", "--times", "1", "--seed", "1"]);
    }
}
