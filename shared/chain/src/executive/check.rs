use serde::{Deserialize, Serialize};

use super::file::{ChainBudgetFile, EventsFile, ExecutiveFile, HealthFile, LimitFile, RuleFile, SupervisorFile, Watch};
use crate::Chain;

/// A checked table of what is watched and what is done about it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Executive {
    /// How a stage that is well is told from one that is not.
    pub health: HealthFile,
    /// Restarts of all stages together.
    pub chain_budget: ChainBudgetFile,
    /// What becomes of the stages without their supervisor.
    pub supervisor: SupervisorFile,
    /// How much is said.
    pub events: EventsFile,
    /// What is done about a condition; the first that fits counts.
    pub rules: Vec<RuleFile>,
    /// Values that are watched.
    pub limits: Vec<LimitFile>,
}

/// Why a table is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExecutiveError {
    /// Not TOML, a key missing, or a key that nothing reads.
    #[error("{0}")]
    Syntax(String),
    /// A number outside its bounds.
    #[error("{key} is {value}, must be {expected}")]
    Number {
        /// The key.
        key: String,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: &'static str,
    },
    /// A stage that the chain does not have.
    #[error("{key} names {stage:?}, must name stages of the chain: {known}")]
    Stage {
        /// The key.
        key: String,
        /// The name.
        stage: String,
        /// The chain's stages.
        known: String,
    },
    /// A limit that nothing can violate, or one of what no process has.
    #[error("limit {name:?} {found}, must {expected}")]
    Limit {
        /// Its name.
        name: String,
        /// What it does.
        found: &'static str,
        /// What it must do.
        expected: &'static str,
    },
    /// The same name twice.
    #[error("limit {0:?} stands twice, must stand once")]
    Twice(String),
    /// A rule that an earlier one leaves nothing to do.
    #[error("rule {place} ({when}) never counts: rule {before} fits whatever it fits")]
    Shadowed {
        /// Its place, from 1.
        place: usize,
        /// Its condition.
        when: String,
        /// The earlier rule's place, from 1.
        before: usize,
    },
}

impl ExecutiveFile {
    /// Reads the text of an `executive.toml`.
    pub fn parse(text: &str) -> Result<Self, ExecutiveError> {
        toml::from_str(text).map_err(|cause| ExecutiveError::Syntax(cause.to_string().trim_end().to_owned()))
    }

    /// The table that the file describes, for this chain.
    pub fn checked(self, chain: &Chain) -> Result<Executive, ExecutiveError> {
        self.check_numbers()?;
        self.check_rules(chain)?;
        self.check_limits(chain)?;
        let Self { health, chain_budget, supervisor, events, rules, limits } = self;
        Ok(Executive { health, chain_budget, supervisor, events, rules, limits })
    }

    fn check_numbers(&self) -> Result<(), ExecutiveError> {
        let HealthFile { hung_sweeps, spinning_ms, silent_sweeps, slow_overruns, flood_ratio, flood_events_per_s } =
            self.health;
        within("health.hung_sweeps", hung_sweeps, 0.5, 1e4, "0.5 to 10000")?;
        within("health.spinning_ms", spinning_ms, 10.0, 3.6e6, "10 to 3600000")?;
        within("health.silent_sweeps", silent_sweeps, 0.5, 1e4, "0.5 to 10000")?;
        within("health.slow_overruns", f64::from(slow_overruns), 1.0, 10.0, "1 to 10")?;
        within("health.flood_ratio", flood_ratio, 1.1, 1e3, "1.1 to 1000")?;
        within("health.flood_events_per_s", flood_events_per_s, 1.0, 1e6, "1 to 1000000")?;
        within("chain_budget.restarts", f64::from(self.chain_budget.restarts), 0.0, 1e3, "at most 1000")?;
        within("chain_budget.window_s", self.chain_budget.window_s, 1.0, 86_400.0, "1 to 86400")?;
        within("supervisor.orphan_s", self.supervisor.orphan_s, 0.0, 86_400.0, "0 to 86400")?;
        within("events.burst", f64::from(self.events.burst), 1.0, 1e4, "1 to 10000")?;
        within("events.per_s", self.events.per_s, 0.1, 1e4, "0.1 to 10000")?;
        within("events.log_mib", self.events.log_mib as f64, 1.0, 1024.0, "1 to 1024")
    }

    fn check_rules(&self, chain: &Chain) -> Result<(), ExecutiveError> {
        for (place, rule) in self.rules.iter().enumerate() {
            let key = |what: &str| format!("rule {} ({}).{what}", place + 1, word(&rule.when));
            within(&key("after_ms"), rule.after_ms, 0.0, 3.6e6, "0 to 3600000")?;
            known(&key("stages"), &rule.stages, chain)?;
            let covers = |earlier: &RuleFile| {
                let all = rule.stages.iter().all(|stage| earlier.stages.contains(stage)) && !rule.stages.is_empty();
                earlier.when == rule.when && (earlier.stages.is_empty() || all)
            };
            if let Some(before) = self.rules[..place].iter().position(covers) {
                return Err(ExecutiveError::Shadowed { place: place + 1, when: word(&rule.when), before: before + 1 });
            }
        }
        Ok(())
    }

    fn check_limits(&self, chain: &Chain) -> Result<(), ExecutiveError> {
        for (place, limit) in self.limits.iter().enumerate() {
            let name = limit.name.as_str();
            let refused = |found, expected| Err(ExecutiveError::Limit { name: name.to_owned(), found, expected });
            if self.limits[..place].iter().any(|other| other.name == name) {
                return Err(ExecutiveError::Twice(name.to_owned()));
            }
            let bounds = [limit.above, limit.below];
            if bounds.iter().all(Option::is_none) {
                return refused("has neither above nor below", "have one of them or both");
            }
            if bounds.iter().flatten().any(|bound| !bound.is_finite()) {
                return refused("has a bound that is no number", "have finite bounds");
            }
            if let (Some(above), Some(below)) = (limit.above, limit.below)
                && below >= above
            {
                return refused("has below at or over above", "leave room between them");
            }
            if !limit.stages.is_empty() && !limit.watch.is_of_a_process() {
                return refused("names stages of a value that is the chain's own", "leave stages out");
            }
            if limit.then == super::Action::RestartStage && !limit.watch.is_of_a_process() {
                return refused("restarts a stage for a value that is the chain's own", "do something else then");
            }
            known(&format!("limit {name:?}.stages"), &limit.stages, chain)?;
            within(&format!("limit {name:?}.persist"), f64::from(limit.persist), 1.0, 1e5, "1 to 100000")?;
            within(&format!("limit {name:?}.stale_after_s"), limit.stale_after_s, 0.1, 86_400.0, "0.1 to 86400")?;
        }
        Ok(())
    }
}

impl Watch {
    /// Its word in files and events.
    pub fn word(self) -> String {
        word(&self)
    }
}

/// The word of a choice, as the file has it.
fn word(choice: &impl Serialize) -> String {
    toml::Value::try_from(choice).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

fn within(key: &str, value: f64, least: f64, most: f64, expected: &'static str) -> Result<(), ExecutiveError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(ExecutiveError::Number { key: key.to_owned(), value, expected })
}

fn known(key: &str, stages: &[String], chain: &Chain) -> Result<(), ExecutiveError> {
    let known: Vec<&str> = ["source"].into_iter().chain(chain.stages.iter().map(|stage| stage.name.as_str())).collect();
    match stages.iter().find(|stage| !known.contains(&stage.as_str())) {
        Some(stage) => {
            Err(ExecutiveError::Stage { key: key.to_owned(), stage: stage.clone(), known: known.join(", ") })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ChainFile;

    const SHIPPED: &str = include_str!("../../../../config/executive.toml");

    fn chain() -> Chain {
        let text = include_str!("../../../../config/chain.toml");
        ChainFile::parse(text).unwrap().checked().unwrap()
    }

    fn refused(from: &str, to: &str) -> String {
        let text = SHIPPED.replacen(from, to, 1);
        assert_ne!(text, SHIPPED, "{from:?} stands in executive.toml");
        match ExecutiveFile::parse(&text).and_then(|file| file.checked(&chain())) {
            Ok(_) => panic!("{to:?} was accepted"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn the_shipped_table_holds() {
        let table = ExecutiveFile::parse(SHIPPED).unwrap().checked(&chain()).unwrap();
        assert_eq!((table.rules.len(), table.limits.len()), (7, 4));
    }

    #[test]
    fn what_is_out_of_bounds_is_refused_by_key() {
        assert!(refused("hung_sweeps = 1.5", "hung_sweeps = nan").contains("health.hung_sweeps is NaN, must be 0.5"));
        assert!(refused("slow_overruns = 3", "slow_overruns = 11").contains("health.slow_overruns is 11"));
        assert!(refused("orphan_s = 10.0", "orphan_s = -1.0").contains("supervisor.orphan_s is -1"));
        assert!(refused("burst = 32", "burst = 0").contains("events.burst is 0"));
        assert!(refused("after_ms = 1000.0", "after_ms = -1.0").contains("rule 2 (hung).after_ms is -1"));
        assert!(refused("persist = 3", "persist = 0").contains("limit \"deadline\".persist is 0"));
        assert!(refused("burst = 32", "bursts = 32").contains("unknown field `bursts`"));
    }

    #[test]
    fn a_rule_that_could_never_count_is_refused() {
        assert!(refused("stages = [\"source\"]\n", "").contains("rule 5 (silent) never counts: rule 4"));
        assert!(
            refused("[\"source\"]", "[\"sauce\"]").contains("names \"sauce\", must name stages of the chain: source")
        );
        assert!(refused("then = \"event\"", "then = \"pray\"").contains("pray"));
    }

    #[test]
    fn a_limit_that_means_nothing_is_refused_by_name() {
        assert!(refused("below = 0.0\n", "").contains("limit \"deadline\" has neither above nor below"));
        assert!(refused("above = 0.05", "above = inf").contains("no number"));
        assert!(refused("above = 512.0", "above = 512.0\nbelow = 600.0").contains("leave room between them"));
        assert!(
            refused("watch = \"drop_ratio\"", "watch = \"drop_ratio\"\nstages = [\"source\"]")
                .contains("leave stages out")
        );
        assert!(refused("watch = \"rss_mib\"", "watch = \"rate_hz\"").contains("the chain's own"));
        assert!(refused("name = \"drops\"", "name = \"deadline\"").contains("stands twice"));
    }
}
