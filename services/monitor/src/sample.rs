use runtime::clock;
use runtime::page::Counts;

use crate::attached::Attached;
use crate::process::Usage;

/// One look at the pages and at `/proc`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sample {
    /// Host time [ns].
    pub(crate) at_ns: u64,
    /// The stages in flow order.
    pub(crate) stages: Vec<StageSample>,
    pub(crate) supervisor: Option<Usage>,
    /// This process.
    pub(crate) viewer: Option<Usage>,
}

/// One stage at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct StageSample {
    pub(crate) counts: Counts,
    /// None while no process of it lives.
    pub(crate) usage: Option<Usage>,
}

impl Sample {
    /// Looks now.
    pub(crate) fn take(chain: &Attached) -> Self {
        // The last stage first: what the stage before has published is read later, so that no queue seems negative.
        let mut stages: Vec<StageSample> = chain.pages.iter().rev().map(|page| stage(page.counts())).collect();
        stages.reverse();
        Self {
            at_ns: clock::now_ns(),
            stages,
            supervisor: Usage::of(u64::from(chain.facts.supervisor_pid)),
            viewer: Usage::of(u64::from(std::process::id())),
        }
    }
}

fn stage(counts: Counts) -> StageSample {
    let lives = counts.incarnation > counts.settled_incarnation;
    StageSample { counts, usage: if lives { Usage::of(counts.pid) } else { None } }
}
