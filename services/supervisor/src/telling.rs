//! What happens is said in the log of the run.

use events::EventId;
use runtime::clock;

use crate::watch::Watch;

impl Watch<'_> {
    /// Says that something happened to a process of the chain, or to [`events::CHAIN`].
    pub(crate) fn say(&mut self, id: EventId, stage: &str, text: &str) {
        let sectors = u64::from(self.plan.chain.sectors.max(1));
        let sweep = self.stages.first().map_or(0, |source| source.page.next_ordinal_out.get() / sectors);
        self.log.say((clock::now_ns(), clock::utc_ns()), id, stage, sweep, text);
    }
}
