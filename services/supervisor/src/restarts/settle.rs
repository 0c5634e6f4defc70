//! After a death: what the dead stage had sent is drained, what it had in hand is accounted for, what it held is freed,
//! and only then may its successor start.

use std::time::Duration;

use runtime::clock;
use runtime::page::State;
use transport::Node;

use crate::house::services::Services;
use crate::processes::child::{Ended, Watched};

/// How long the next stage may take to drain what the dead one had sent [ns].
const DRAIN_PATIENCE_NS: u64 = 300_000_000;
/// How long another cleaner may take.
pub(crate) const CLEAN_PATIENCE: Duration = Duration::from_millis(100);

/// Settles the account of the stage at `position`, whose process has ended.
pub(crate) fn settle(node: &Node, services: &Services, stages: &mut [Watched], position: usize, ended: Ended) {
    let dead = stages[position].page.incarnation.get();
    let page = &stages[position].page;
    if stages[position].told && page.state() == State::Stopped {
        // It left in order and has counted everything itself.
        page.settled_incarnation.set(dead);
        return;
    }
    if dead == page.settled_incarnation.get() {
        // It died before it took its page: nothing was counted, but shared memory may be held.
        node.clean_dead(CLEAN_PATIENCE);
        return;
    }
    let stage = &stages[position];
    let settlement = match stages.get(position + 1) {
        Some(next) => {
            let in_doubt = next.is_alive() && !drains(services, next, position, dead);
            if in_doubt {
                tracing::warn!(stage = next.name, "did not drain what {:?} had sent", stage.name);
            }
            stage.page.settle_stage(next.page.next_sequence.get(), in_doubt, position == 0)
        }
        None => stage.page.settle_sink(),
    };
    let (cleaned, uncleaned) = node.clean_dead(CLEAN_PATIENCE);
    if uncleaned > 0 {
        // A process killed while it joined leaves a stub that holds no messages; it goes with the instance.
        tracing::debug!(stage = stage.name, uncleaned, "shared memory of a dead process could not be freed");
    }
    tracing::debug!(
        stage = stage.name,
        life = dead,
        ended = ?ended,
        lost_in_hand = settlement.lost,
        cleaned,
        "died; account settled"
    );
    stage.page.settled_incarnation.set(dead);
}

/// Whether the stage after takes what life `dead` of the stage at `position` had sent.
fn drains(services: &Services, next: &Watched, position: usize, dead: u64) -> bool {
    next.page.drain_request.set(dead);
    services.wake_readers_of(position);
    clock::wait_for(DRAIN_PATIENCE_NS, || next.page.drained_incarnation.get() >= dead)
}
