//! Other parameters for a chain that runs: checked as far as the supervisor can, written into the plan, announced to the
//! stages, which check them again and go on with the old ones where they do not hold.

use chain::executive::{Executive, ExecutiveFile};
use events::{CHAIN, EventId};
use runtime::clock;

use crate::control::{Answer, Tables};
use crate::restarts::budget::Restarts;
use crate::telling::bounds;
use crate::watch::Watch;

/// The new parameters count from so many sweeps after the one under way.
const SWEEPS_AHEAD: u64 = 3;

impl Watch<'_> {
    /// Takes new tables, or says why not.
    pub(crate) fn reload(&mut self, tables: &Tables) -> Answer {
        let answer = self.try_reload(tables);
        let id = if answer.accepted { EventId::TableAccepted } else { EventId::TableRefused };
        self.say(id, CHAIN, &answer.text);
        answer
    }

    fn try_reload(&mut self, tables: &Tables) -> Answer {
        let known = &self.plan.parameters;
        if let Some(stage) = tables.parameters.keys().find(|stage| !known.contains_key(*stage)) {
            return Answer::no(format!("stage {stage:?} has no parameters"));
        }
        if let Some(stage) = known.keys().find(|stage| !tables.parameters.contains_key(*stage)) {
            return Answer::no(format!("the parameters of stage {stage:?} are missing"));
        }
        let executive = ExecutiveFile::parse(&tables.executive).and_then(|file| file.checked(&self.plan.chain));
        let executive = match executive {
            Ok(executive) => executive,
            Err(cause) => return Answer::no(format!("executive.toml: {cause}")),
        };
        let mut plan = self.plan.clone();
        plan.generation += 1;
        plan.parameters.clone_from(&tables.parameters);
        plan.executive = executive.clone();
        // Written first: whoever is told of it finds it.
        if let Err(error) = plan.write(self.instance) {
            return Answer::no(error.to_string());
        }
        self.plan = plan;
        self.replace_executive(&executive);
        let (generation, sweep) = (self.plan.generation, self.sweeps_sent() + SWEEPS_AHEAD);
        for stage in self.stages.iter().filter(|stage| self.plan.parameters.contains_key(&stage.name)) {
            stage.page.table_from_sweep.set(sweep);
            stage.page.table_wanted.set(generation);
        }
        Answer::yes(format!("parameters {generation} from sweep {sweep} on"))
    }

    /// The executive goes by another table from now on; restarts of the chain so far do not count in it.
    fn replace_executive(&mut self, executive: &Executive) {
        self.chain_budget = Restarts::of_chain(executive.chain_budget);
        self.executive.replace(executive, clock::now_ns());
        self.log.set_bounds(bounds(&self.plan));
    }
}
