//! What is done about a condition: the first rule that fits, once it has lasted.

use chain::executive::{Action, Condition, RuleFile};

use super::health::Ailment;

/// The rules, and how far each stage's present condition has come with its own.
#[derive(Debug)]
pub(crate) struct Rules {
    rules: Vec<RuleFile>,
    /// Names of the processes, by place.
    names: Vec<String>,
    episodes: Vec<Option<Episode>>,
}

/// A stage has been in a condition since.
#[derive(Clone, Copy, Debug)]
struct Episode {
    ailment: Ailment,
    /// The rule's action, and when it is due [ns]; none where no rule fits, or what it asks is done.
    due: Option<(u64, Action)>,
    done: bool,
}

impl Rules {
    /// For processes of these names.
    pub(crate) fn new(rules: &[RuleFile], names: &[String]) -> Self {
        Self { rules: rules.to_vec(), names: names.to_vec(), episodes: vec![None; names.len()] }
    }

    /// Other rules from now on. They count for conditions that last, unless something was done about them already.
    pub(crate) fn replace(&mut self, rules: &[RuleFile]) {
        self.rules = rules.to_vec();
        for place in 0..self.episodes.len() {
            if let Some(Episode { ailment, done: false, .. }) = self.episodes[place] {
                self.begin(place, ailment);
            }
        }
    }

    /// The process at `place` is in a condition from now on.
    pub(crate) fn begin(&mut self, place: usize, ailment: Ailment) {
        let due = self.fitting(place, ailment.condition).map(|rule| {
            let after_ns = (rule.after_ms * 1e6) as u64;
            (ailment.since_ns.saturating_add(after_ns), rule.then)
        });
        if let Some(episode) = self.episodes.get_mut(place) {
            *episode = Some(Episode { ailment, due, done: false });
        }
    }

    /// It is well again.
    pub(crate) fn end(&mut self, place: usize) {
        if let Some(episode) = self.episodes.get_mut(place) {
            *episode = None;
        }
    }

    /// What is due now for the process at `place`; once for each time that it gets into the condition.
    pub(crate) fn look(&mut self, now_ns: u64, place: usize) -> Option<(Condition, Action)> {
        let episode = self.episodes.get_mut(place)?.as_mut()?;
        let (_, action) = episode.due.filter(|(due_ns, _)| now_ns >= *due_ns)?;
        (episode.due, episode.done) = (None, true);
        Some((episode.ailment.condition, action))
    }

    fn fitting(&self, place: usize, condition: Condition) -> Option<&RuleFile> {
        let name = self.names.get(place)?;
        self.rules.iter().find(|rule| rule.when == condition && (rule.stages.is_empty() || rule.stages.contains(name)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn rule(when: Condition, stages: &[&str], after_ms: f64, then: Action) -> RuleFile {
        RuleFile { when, stages: stages.iter().map(ToString::to_string).collect(), after_ms, then }
    }

    fn sut() -> Rules {
        let rules = [
            rule(Condition::Hung, &[], 1000.0, Action::RestartStage),
            rule(Condition::Silent, &["source"], 0.0, Action::Event),
            rule(Condition::Silent, &[], 500.0, Action::Safe),
        ];
        Rules::new(&rules, &["source".to_owned(), "clusterer".to_owned()])
    }

    fn hung(since_ns: u64) -> Ailment {
        Ailment { condition: Condition::Hung, since_ns }
    }

    #[test]
    fn a_rule_acts_when_its_condition_has_lasted_and_once() {
        let mut sut = sut();
        sut.begin(1, hung(5 * MS));
        assert_eq!(sut.look(1_004 * MS, 1), None);
        assert_eq!(sut.look(1_005 * MS, 0), None, "another stage");
        assert_eq!(sut.look(1_005 * MS, 1), Some((Condition::Hung, Action::RestartStage)));
        assert_eq!(sut.look(9_000 * MS, 1), None);
    }

    #[test]
    fn a_condition_that_ends_before_is_forgotten_and_one_that_comes_back_begins_anew() {
        let mut sut = sut();
        sut.begin(1, hung(0));
        sut.end(1);
        assert_eq!(sut.look(2_000 * MS, 1), None);
        sut.begin(1, hung(2_000 * MS));
        assert_eq!(sut.look(2_999 * MS, 1), None);
        assert!(sut.look(3_000 * MS, 1).is_some());
        sut.end(1);
        sut.begin(1, hung(4_000 * MS));
        assert!(sut.look(5_000 * MS, 1).is_some(), "a successor that hangs too is restarted too");
    }

    #[test]
    fn the_first_rule_that_fits_counts() {
        let mut sut = sut();
        let silent = Ailment { condition: Condition::Silent, since_ns: 0 };
        sut.begin(0, silent);
        sut.begin(1, silent);
        assert_eq!(sut.look(0, 0), Some((Condition::Silent, Action::Event)));
        assert_eq!(sut.look(499 * MS, 1), None);
        assert_eq!(sut.look(500 * MS, 1), Some((Condition::Silent, Action::Safe)));
        sut.begin(1, Ailment { condition: Condition::Slow, since_ns: 0 });
        assert_eq!(sut.look(u64::MAX, 1), None, "there is no rule");
    }

    #[test]
    fn new_rules_count_for_what_lasts_and_not_for_what_was_done() {
        let mut sut = sut();
        sut.begin(0, hung(0));
        sut.begin(1, hung(MS));
        assert!(sut.look(1_000 * MS, 0).is_some());
        sut.replace(&[rule(Condition::Hung, &[], 2000.0, Action::Safe)]);
        assert_eq!((sut.look(1_500 * MS, 0), sut.look(1_500 * MS, 1)), (None, None));
        assert_eq!(sut.look(2_001 * MS, 1), Some((Condition::Hung, Action::Safe)));
        assert_eq!(sut.look(9_000 * MS, 0), None);
    }
}
