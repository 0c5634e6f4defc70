//! Campaigns: which faults come when. As written → checked → a list that the seed alone decides.

use serde::Deserialize;

use crate::catalogue::Fault;
use crate::planned::{PlanError, Planned};

/// A campaign as its file has it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignFile {
    random: Option<RandomFile>,
    #[serde(default)]
    fault: Vec<FaultFile>,
    #[serde(default)]
    script: Vec<StepFile>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RandomFile {
    every_s: f64,
    spacing: Spacing,
    after_s: f64,
    quiet_s: f64,
}

/// How the times of random faults lie.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Spacing {
    /// At any moment, independently: the time from one to the next is exponential.
    Poisson,
    /// Always the same time from one to the next.
    Fixed,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FaultFile {
    name: String,
    weight: f64,
    #[serde(default)]
    stages: Vec<String>,
    by: Option<[f64; 2]>,
    for_s: Option<[f64; 2]>,
    times: Option<[u64; 2]>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StepFile {
    at_s: f64,
    fault: String,
    stage: Option<String>,
    by: Option<f64>,
    for_s: Option<f64>,
    times: Option<u64>,
}

/// A checked campaign.
#[derive(Clone, Debug, PartialEq)]
pub struct Campaign {
    pub(crate) random: Option<Random>,
    /// By time.
    pub(crate) script: Vec<Planned>,
}

/// Faults that are drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Random {
    pub(crate) every_s: f64,
    pub(crate) spacing: Spacing,
    pub(crate) after_s: f64,
    pub(crate) quiet_s: f64,
    pub(crate) kinds: Vec<Kind>,
}

/// One kind of fault among those that are drawn.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Kind {
    pub(crate) fault: Fault,
    pub(crate) weight: f64,
    pub(crate) stages: Vec<String>,
    pub(crate) by: Option<[f64; 2]>,
    pub(crate) for_s: Option<[f64; 2]>,
    pub(crate) times: Option<[u64; 2]>,
}

/// A campaign that cannot be run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// No text of a campaign.
    #[error("{0}")]
    Text(String),
    /// A number out of its bounds.
    #[error("{key} is {is}, must be {least} to {most}")]
    Bounds {
        /// Where it stands.
        key: &'static str,
        /// As written.
        is: f64,
        /// The least.
        least: f64,
        /// The most.
        most: f64,
    },
    /// A fault that there is not.
    #[error("no fault {0:?}; `encke inject --help` lists them")]
    Unknown(String),
    /// A range whose ends are the wrong way round.
    #[error("{fault}: {key} goes from {from} to {to}, must not fall")]
    Falls {
        /// The fault.
        fault: &'static str,
        /// Where it stands.
        key: &'static str,
        /// The first end.
        from: f64,
        /// The second end.
        to: f64,
    },
    /// A fault that cannot be had in this way.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Faults to draw, and nothing said of when.
    #[error("[[fault]] stands without [random]")]
    NotRandom,
    /// Times of faults, and none to draw.
    #[error("[random] stands without a [[fault]] of a weight above 0")]
    NoFault,
    /// Nothing at all.
    #[error("no fault: write [random] with [[fault]], or [[script]]")]
    Empty,
}

impl Campaign {
    /// Reads the text of a campaign and checks it.
    ///
    /// # Errors
    /// What does not hold, with both sides.
    pub fn parse(text: &str) -> Result<Self, CampaignError> {
        let file: CampaignFile = toml::from_str(text).map_err(|cause| CampaignError::Text(cause.to_string()))?;
        file.checked()
    }
}

impl CampaignFile {
    /// Checks every number, name and combination.
    ///
    /// # Errors
    /// See [`CampaignError`].
    pub fn checked(self) -> Result<Campaign, CampaignError> {
        let kinds = self.fault.into_iter().map(FaultFile::checked).collect::<Result<Vec<_>, _>>()?;
        let random = match self.random {
            None if !kinds.is_empty() => return Err(CampaignError::NotRandom),
            Some(_) if kinds.iter().all(|kind| kind.weight == 0.0) => return Err(CampaignError::NoFault),
            None => None,
            Some(RandomFile { every_s, spacing, after_s, quiet_s }) => {
                bounds("random.every_s", every_s, 0.1, 86_400.0)?;
                bounds("random.after_s", after_s, 0.0, 86_400.0)?;
                bounds("random.quiet_s", quiet_s, 0.0, 86_400.0)?;
                Some(Random { every_s, spacing, after_s, quiet_s, kinds })
            }
        };
        let mut script = self.script.into_iter().map(StepFile::checked).collect::<Result<Vec<_>, _>>()?;
        script.sort_by(|one, other| one.at_s.total_cmp(&other.at_s));
        if random.is_none() && script.is_empty() {
            return Err(CampaignError::Empty);
        }
        Ok(Campaign { random, script })
    }
}

impl FaultFile {
    fn checked(self) -> Result<Kind, CampaignError> {
        let Self { name, weight, mut stages, by, for_s, times } = self;
        let fault = known(&name)?;
        bounds("fault.weight", weight, 0.0, 1e6)?;
        let times_f = times.map(|ends| ends.map(|end| end as f64));
        for (key, ends) in [("by", by), ("for_s", for_s), ("times", times_f)] {
            if let Some([from, to]) = ends.filter(|[from, to]| from > to || from.is_nan() || to.is_nan()) {
                return Err(CampaignError::Falls { fault: fault.name(), key, from, to });
            }
        }
        if stages.is_empty() {
            stages.extend(fault.entry().target.implied().map(str::to_owned));
        }
        // Both ends must hold for every stage; then all between does.
        let named: Vec<Option<&String>> =
            if stages.is_empty() { vec![None] } else { stages.iter().map(Some).collect() };
        for stage in named {
            for end in 0..2 {
                let mut planned = Planned::usual(fault, 0.0, stage.cloned(), 0);
                planned.argument = by.map(|ends| ends[end]).or(planned.argument);
                planned.for_s = for_s.map(|ends| ends[end]).or(planned.for_s);
                planned.times = times.map(|ends| ends[end]).or(planned.times);
                planned.checked()?;
            }
        }
        Ok(Kind { fault, weight, stages, by, for_s, times })
    }
}

impl StepFile {
    fn checked(self) -> Result<Planned, CampaignError> {
        let Self { at_s, fault, stage, by, for_s, times } = self;
        bounds("script.at_s", at_s, 0.0, 1e7)?;
        let mut planned = Planned::usual(known(&fault)?, at_s, stage, 0);
        planned.argument = by.or(planned.argument);
        planned.for_s = for_s.or(planned.for_s);
        planned.times = times.or(planned.times);
        Ok(planned.checked()?)
    }
}

fn known(name: &str) -> Result<Fault, CampaignError> {
    Fault::from_name(name).ok_or_else(|| CampaignError::Unknown(name.to_owned()))
}

fn bounds(key: &'static str, is: f64, least: f64, most: f64) -> Result<(), CampaignError> {
    if (least..=most).contains(&is) { Ok(()) } else { Err(CampaignError::Bounds { key, is, least, most }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RANDOM: &str = "[random]\nevery_s = 60.0\nspacing = \"poisson\"\nafter_s = 30.0\nquiet_s = 30.0\n";

    fn refused(text: &str) -> String {
        Campaign::parse(text).unwrap_err().to_string()
    }

    #[test]
    fn what_does_not_hold_is_refused_with_both_sides() {
        let fault = |lines: &str| format!("{RANDOM}[[fault]]\n{lines}");
        let cases = [
            (String::new(), "no fault: write [random] with [[fault]], or [[script]]"),
            (RANDOM.to_owned(), "[random] stands without a [[fault]] of a weight above 0"),
            ("[[fault]]\nname = \"kill-all\"\nweight = 1.0".to_owned(), "[[fault]] stands without [random]"),
            (fault("name = \"joy\"\nweight = 1.0"), "no fault \"joy\"; `encke inject --help` lists them"),
            (fault("name = \"kill\"\nweight = 1.0"), "kill hits a stage or the tape: name one"),
            (fault("name = \"dust\"\nweight = -1.0"), "fault.weight is -1, must be 0 to 1000000"),
            (fault("name = \"dust\"\nweight = 1.0\nby = [1, 4]"), "dust: level is 4, must be 1 to 3"),
            (fault("name = \"dust\"\nweight = 1.0\nby = [3, 1]"), "dust: by goes from 3 to 1, must not fall"),
            ("[[script]]\nat_s = -1.0\nfault = \"dust\"".to_owned(), "script.at_s is -1, must be 0 to 10000000"),
            (
                format!("{}{}", RANDOM.replace("60.0", "0.0"), "[[fault]]\nname = \"dust\"\nweight = 1.0"),
                "random.every_s is 0, must be 0.1 to 86400",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(refused(&text), expected, "{text}");
        }
        assert!(refused("[random]\nevery = 1").contains("unknown field `every`"));
    }

    #[test]
    fn a_script_is_put_in_the_order_of_its_times() {
        let text = "[[script]]\nat_s = 20.0\nfault = \"dust\"\nby = 2.0\n[[script]]\nat_s = 10.0\nfault = \"kill\"\nstage = \"recorder\"";
        let campaign = Campaign::parse(text).unwrap();
        let names: Vec<_> = campaign.script.iter().map(|planned| planned.fault.name()).collect();
        assert_eq!(names, ["kill", "dust"]);
        assert_eq!(campaign.script[1].argument, Some(2.0));
    }
}
