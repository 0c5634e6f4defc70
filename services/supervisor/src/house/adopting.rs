//! A supervisor that follows one that died: it goes on with the processes, the pages and the log that it finds.

use events::{CHAIN, EventId};
use runtime::page::PageMap;
use runtime::{Plan, clock};

use crate::SupervisorError;
use crate::house::House;
use crate::modes::overload::Trouble;
use crate::processes::beside::Tape;
use crate::processes::child::Watched;
use crate::watch::Watch;

/// The processes that a supervisor looks after.
pub(crate) struct Household {
    pub(crate) stages: Vec<Watched>,
    pub(crate) tape: Option<Tape>,
    /// The supervisor's own page.
    pub(crate) page: PageMap,
}

impl Household {
    /// Fresh pages, or those that a dead supervisor left, with its living processes.
    pub(crate) fn of(house: &House, plan: &Plan, spawn: bool) -> Result<Self, SupervisorError> {
        let instance = house.instance();
        let path = Plan::page_path(instance, chain::SUPERVISOR);
        let household = match house.adopted() {
            None => Self {
                stages: (0..plan.stages().count())
                    .map(|position| Watched::new(instance, plan, position, spawn))
                    .collect::<Result<_, _>>()?,
                tape: Tape::new(instance, plan, spawn)?,
                page: PageMap::create(&path)?,
            },
            Some(adopted) => Self {
                stages: plan
                    .stages()
                    .map(|stage| Watched::adopt(instance, plan, stage, spawn, &adopted.living))
                    .collect::<Result<_, _>>()?,
                tape: Tape::adopt(instance, plan, spawn, &adopted.living)?,
                page: PageMap::open(&path)?,
            },
        };
        let page = &household.page;
        page.pid.set(u64::from(std::process::id()));
        page.incarnation.add(1);
        if page.run_began_ns.get() == 0 {
            page.run_began_ns.set(clock::now_ns());
        }
        Ok(household)
    }
}

impl Watch<'_> {
    /// Takes over what the pages say of the chain, and says so.
    pub(crate) fn take_over(&mut self, before: u32) {
        let source = &self.stages[0].page;
        self.begun = source.may_start.get() == 1;
        let sweeps = source.published.get() / u64::from(self.plan.chain.sectors.max(1));
        let step = self.take_over_modes();
        self.ladder.resume(step, sweeps, Trouble::of(self.stages.iter().map(|stage| &*stage.page)));
        for stage in &mut self.stages {
            stage.restarts.total = stage.page.incarnation.get().saturating_sub(1);
        }
        // What they used until now is theirs, and was not used since the last look.
        self.sample();
        let living = self.stages.iter().filter(|stage| stage.pid().is_some()).count();
        let all = self.stages.len();
        let text = format!("{living} of {all} stages live on after the death of supervisor {before}");
        self.say(EventId::SupervisorAdopted, CHAIN, &text);
    }
}
