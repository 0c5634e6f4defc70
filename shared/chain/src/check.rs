use messages::MAX_HOPS;
use serde::{Deserialize, Serialize};

use crate::overload::Overload;
use crate::{ChainFile, Realtime, SourceFile};

/// What the source writes.
const SWEEP: &str = "Sweep";
/// What the simulator writes beside it, for the ground alone.
const TRUTH: &str = "Truth";
/// Most sectors of a sweep. At 10 Hz a sector of 360 takes 0.3 ms, which is about what a hop through three stages costs.
const MAX_SECTORS: u32 = 360;
/// Most parts that may wait for a reader: each is a place for the largest message in (sparse) shared memory.
const MAX_QUEUE_PARTS: usize = 1_440;

/// A checked chain.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Chain {
    /// Sectors that a sweep travels as.
    pub sectors: u32,
    /// Sweeps that wait for a slow reader before the oldest part is dropped.
    pub queue_sweeps: usize,
    /// From the last return of a sweep to its last message [ms].
    pub deadline_ms: f64,
    /// Age of a part after its last return at which nobody may act on it any more [ms].
    pub allowed_age_ms: f64,
    /// What is left out under overload.
    pub overload: Overload,
    /// How often a stage may be restarted.
    pub restart_budget: RestartBudget,
    /// The default source: a path relative to chain.toml.
    pub default_source: String,
    /// Sweeps that a scene runs for by default.
    pub default_sweeps: u64,
    /// The stages in flow order; the last is the sink. The source is not among them.
    pub stages: Vec<Wired>,
    /// What is asked of the kernel.
    pub realtime: Realtime,
}

/// A stage in its place.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Wired {
    /// The stage's name.
    pub name: String,
    /// The message that it reads: what the stage before it writes.
    pub reads: String,
    /// The message that it writes; none for the sink.
    pub writes: Option<String>,
    /// Its parameters, relative to chain.toml.
    pub parameters: Option<String>,
    /// Time that it may be busy with a sweep [ms]; none for the sink, which the chain does not wait for.
    pub budget_ms: Option<f64>,
}

/// Restarts allowed to each stage within a sliding window.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub struct RestartBudget {
    /// Most restarts.
    pub restarts: u32,
    /// Within this time [s].
    pub window_s: f64,
}

/// Why a chain is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChainError {
    /// Not TOML, a key missing, or a key that nothing reads.
    #[error("{0}")]
    Syntax(String),
    /// A number outside its bounds.
    #[error("{key} is {value}, must be {expected}")]
    Number {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// Budgets that leave no time for the way between the stages.
    #[error("the budgets add up to {sum_ms} ms, must be at most deadline_ms = {deadline_ms}")]
    Budgets {
        /// Their sum [ms].
        sum_ms: f64,
        /// The deadline [ms].
        deadline_ms: f64,
    },
    /// An answer in time that nobody may act on.
    #[error("deadline_ms is {deadline_ms}, must be at most allowed_age_ms = {allowed_age_ms}")]
    Age {
        /// The deadline [ms].
        deadline_ms: f64,
        /// The allowed age [ms].
        allowed_age_ms: f64,
    },
    /// A stage that is waited for and may take for ever.
    #[error("stage {0:?} has no budget_ms, must have one: only the last stage has none")]
    NoBudget(String),
    /// A step of overload that there is none of.
    #[error(
        "overload.steps names {0:?}, must name \"fewer-starts\", \"paper-features\", \"clusters-only\" or \"every-second-sweep\""
    )]
    Step(String),
    /// Steps of overload out of order.
    #[error("overload.steps has {0:?} after a later step, must go from the gentlest to the last, each once")]
    StepOrder(String),
    /// A real-time setting outside its bounds.
    #[error("{process}: realtime.{key} is {value}, must be {expected}")]
    Realtime {
        /// The process.
        process: String,
        /// The key.
        key: &'static str,
        /// Its value.
        value: u32,
        /// What it must be.
        expected: &'static str,
    },
    /// Too few or too many stages for a chain.
    #[error("[[stage]] stands {0} times, must stand 1 to {max} times", max = MAX_HOPS - 1)]
    Length(usize),
    /// The same name twice.
    #[error("stage {0:?} stands twice, must stand once")]
    Twice(String),
    /// A stage that does not read what the one before it writes.
    #[error("stage {stage:?} reads {reads:?}, must read {expected:?}, which {before:?} writes")]
    Wire {
        /// The stage.
        stage: String,
        /// What it reads.
        reads: String,
        /// Who stands before it.
        before: String,
        /// What that one writes.
        expected: String,
    },
    /// A stage that would know the answer.
    #[error("stage {0:?} reads \"Truth\", which no stage may read: evaluation joins it offline")]
    Truth(String),
    /// A stage in the middle that writes nothing, or a sink that writes.
    #[error("stage {stage:?} {found}, must {expected}")]
    Ends {
        /// The stage.
        stage: String,
        /// What it does.
        found: &'static str,
        /// What it must do.
        expected: &'static str,
    },
}

impl ChainFile {
    /// Reads the text of a `chain.toml`.
    pub fn parse(text: &str) -> Result<Self, ChainError> {
        toml::from_str(text).map_err(|cause| ChainError::Syntax(cause.to_string().trim_end().to_owned()))
    }

    /// The chain that the file describes.
    pub fn checked(self) -> Result<Chain, ChainError> {
        number("sectors", f64::from(self.sectors), "1 to 360", (1..=MAX_SECTORS).contains(&self.sectors))?;
        let queue_parts = self.queue_sweeps.saturating_mul(self.sectors as usize);
        number(
            "queue_sweeps",
            self.queue_sweeps as f64,
            "2 to 256, and at most 1440 parts in all",
            (2..=256).contains(&self.queue_sweeps) && queue_parts <= MAX_QUEUE_PARTS,
        )?;
        number(
            "deadline_ms",
            self.deadline_ms,
            "within (0, 60000]",
            self.deadline_ms > 0.0 && self.deadline_ms <= 6e4,
        )?;
        number(
            "allowed_age_ms",
            self.allowed_age_ms,
            "within (0, 3600000]",
            self.allowed_age_ms > 0.0 && self.allowed_age_ms <= 3.6e6,
        )?;
        self.check_times()?;
        number("restarts", f64::from(self.restarts), "at most 1000", self.restarts <= 1_000)?;
        let window = self.restart_window_s;
        number("restart_window_s", window, "within (0, 86400]", window > 0.0 && window <= 86_400.0)?;
        number("source.sweeps", self.source.sweeps as f64, "1 or more", self.source.sweeps >= 1)?;
        self.check_wires()?;
        let realtime = Realtime::checked(&self)?;
        let SourceFile { from: default_source, sweeps: default_sweeps, .. } = self.source;
        Ok(Chain {
            sectors: self.sectors,
            queue_sweeps: self.queue_sweeps,
            deadline_ms: self.deadline_ms,
            allowed_age_ms: self.allowed_age_ms,
            overload: self.overload.checked()?,
            restart_budget: RestartBudget { restarts: self.restarts, window_s: self.restart_window_s },
            default_source,
            default_sweeps,
            stages: self
                .stages
                .into_iter()
                .map(|stage| Wired {
                    name: stage.name,
                    reads: stage.reads,
                    writes: stage.writes,
                    parameters: stage.parameters,
                    budget_ms: stage.budget_ms,
                })
                .collect(),
            realtime,
        })
    }

    /// Budgets add up, and an answer in time is young enough to act on.
    fn check_times(&self) -> Result<(), ChainError> {
        let Self { deadline_ms, allowed_age_ms, .. } = *self;
        if deadline_ms > allowed_age_ms {
            return Err(ChainError::Age { deadline_ms, allowed_age_ms });
        }
        let mut sum_ms = 0.0;
        for (place, stage) in self.stages.iter().enumerate() {
            let last = place + 1 == self.stages.len();
            let Some(budget_ms) = stage.budget_ms else {
                if last {
                    continue;
                }
                return Err(ChainError::NoBudget(stage.name.clone()));
            };
            number("stage.budget_ms", budget_ms, "within (0, 60000]", budget_ms > 0.0 && budget_ms <= 6e4)?;
            if last {
                return Err(ends(
                    stage.name.clone(),
                    "has a budget_ms",
                    "have none, because the chain does not wait for it",
                ));
            }
            sum_ms += budget_ms;
        }
        if sum_ms > deadline_ms { Err(ChainError::Budgets { sum_ms, deadline_ms }) } else { Ok(()) }
    }

    fn check_wires(&self) -> Result<(), ChainError> {
        if self.stages.is_empty() || self.stages.len() >= MAX_HOPS {
            return Err(ChainError::Length(self.stages.len()));
        }
        let (mut before, mut written) = ("source", SWEEP);
        for (place, stage) in self.stages.iter().enumerate() {
            let name = stage.name.clone();
            if name == "source" || self.stages[..place].iter().any(|other| other.name == name) {
                return Err(ChainError::Twice(name));
            }
            if stage.reads == TRUTH {
                return Err(ChainError::Truth(name));
            }
            if stage.reads != written {
                return Err(ChainError::Wire {
                    stage: name,
                    reads: stage.reads.clone(),
                    before: before.to_owned(),
                    expected: written.to_owned(),
                });
            }
            let last = place + 1 == self.stages.len();
            match &stage.writes {
                Some(message) if !last => (before, written) = (&stage.name, message),
                None if last => {}
                Some(_) => return Err(ends(name, "writes", "write nothing, because it is the last")),
                None => return Err(ends(name, "writes nothing", "write, because another stage follows")),
            }
        }
        Ok(())
    }
}

impl Chain {
    /// Parts that wait for a slow reader before the oldest is dropped.
    pub fn queue_parts(&self) -> usize {
        self.queue_sweeps * self.sectors.max(1) as usize
    }

    /// Name of the sink.
    pub fn sink(&self) -> &str {
        self.stages.last().map_or("", |sink| &sink.name)
    }
}

pub(crate) fn number(key: &'static str, value: f64, expected: &'static str, holds: bool) -> Result<(), ChainError> {
    if holds { Ok(()) } else { Err(ChainError::Number { key, value, expected }) }
}

fn ends(stage: String, found: &'static str, expected: &'static str) -> ChainError {
    ChainError::Ends { stage, found, expected }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHIPPED: &str = include_str!("../../../config/chain.toml");

    fn refused(from: &str, to: &str) -> String {
        let text = SHIPPED.replacen(from, to, 1);
        assert_ne!(text, SHIPPED, "{from:?} stands in chain.toml");
        match ChainFile::parse(&text).and_then(ChainFile::checked) {
            Ok(_) => panic!("{to:?} was accepted"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn the_shipped_chain_holds() {
        let chain = ChainFile::parse(SHIPPED).unwrap().checked().unwrap();
        assert_eq!(chain.stages.len(), 5);
        assert_eq!(chain.sink(), "recorder");
    }

    #[test]
    fn a_stage_that_reads_anything_but_its_neighbour_is_refused_by_name() {
        assert!(refused(r#"reads = "Clusters""#, r#"reads = "Sweep""#).contains(r#"stage "extractor" reads "Sweep""#));
        assert!(refused(r#"reads = "Clusters""#, r#"reads = "Truth""#).contains("no stage may read"));
        assert!(refused(r#"name = "extractor""#, r#"name = "clusterer""#).contains("stands twice"));
        assert!(refused(r#"writes = "Descriptors""#, "").contains("writes nothing"));
    }

    #[test]
    fn each_number_out_of_bounds_is_refused_by_key() {
        assert!(refused("sectors = 36", "sectors = 0").contains("sectors is 0, must be 1"));
        assert!(refused("sectors = 36", "sectors = 361").contains("sectors is 361"));
        assert!(refused("queue_sweeps = 4", "queue_sweeps = 1").contains("queue_sweeps is 1"));
        assert!(refused("queue_sweeps = 4", "queue_sweeps = 41").contains("at most 1440 parts"));
        assert!(refused("allowed_age_ms = 1000.0", "allowed_age_ms = 0.0").contains("allowed_age_ms is 0"));
        assert!(refused("deadline_ms = 100.0", "deadline_ms = nan").contains("deadline_ms is NaN"));
        assert!(refused("restarts = 10", "restarts = 1001").contains("restarts is 1001"));
        assert!(refused("restart_window_s = 60.0", "restart_window_s = 0.0").contains("restart_window_s is 0"));
        assert!(refused("sweeps = 100", "sweeps = 0").contains("source.sweeps is 0"));
    }

    #[test]
    fn an_unknown_key_is_refused_with_its_line() {
        assert!(refused("sectors = 36", "sektors = 36").contains("unknown field `sektors`"));
    }

    #[test]
    fn budgets_fit_into_the_deadline_and_the_deadline_into_the_allowed_age() {
        assert!(refused("budget_ms = 60.0", "budget_ms = 96.0").contains("the budgets add up to"));
        assert!(refused("budget_ms = 60.0", "budget_ms = 0.0").contains("stage.budget_ms is 0"));
        assert!(refused("budget_ms = 60.0", "").contains(r#"stage "extractor" has no budget_ms"#));
        assert!(refused(r#"reads = "Tracks""#, "reads = \"Tracks\"\nbudget_ms = 1.0").contains("has a budget_ms"));
        assert!(refused("allowed_age_ms = 1000.0", "allowed_age_ms = 99.0").contains("at most allowed_age_ms = 99"));
    }

    #[test]
    fn the_ladder_has_known_steps_in_order() {
        assert!(refused(r#""clusters-only""#, r#""nominal""#).contains(r#"overload.steps names "nominal""#));
        assert!(refused(r#""clusters-only""#, r#""fewer-starts""#).contains("after a later step"));
        assert!(refused("troubled_sweeps = 3", "troubled_sweeps = 11").contains("troubled_sweeps is 11, must be 1 to"));
        assert!(refused("recover_sweeps = 10", "recover_sweeps = 0").contains("recover_sweeps is 0"));
    }
}
