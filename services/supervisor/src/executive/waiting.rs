//! Silent: awake, and nothing comes of it.

use super::evidence::Evidence;
use super::signs::Signs;
use super::times::Times;

/// What is remembered of one stage.
#[derive(Debug, Default)]
pub(crate) struct Waiting {
    /// What it had let through when that last changed, and since when it has had something to do since then [ns].
    taken: u64,
    since_ns: u64,
    /// The life of the stage before, and what had been published when that began. What an earlier life sent last may never come.
    offerer: u64,
    offered_before: u64,
}

impl Waiting {
    /// Whether the stage is awake, has input or should have something to send, and has let nothing through for too long.
    pub(crate) fn look(&mut self, now_ns: u64, signs: &Signs, times: &Times) -> Option<Evidence> {
        if signs.offerer != self.offerer {
            (self.offerer, self.offered_before) = (signs.offerer, signs.offered.unwrap_or(0));
        }
        let is_awake = signs.up && now_ns.saturating_sub(signs.heartbeat_ns) < times.asked_ns;
        let parts = signs.offered.unwrap_or(0).saturating_sub(signs.taken.max(self.offered_before));
        let has_to_do = match signs.offered {
            Some(_) => self.offerer > 0 && parts > 0 && !signs.in_hand,
            None => !signs.idle,
        };
        if !is_awake || !has_to_do || signs.taken != self.taken {
            (self.taken, self.since_ns) = (signs.taken, now_ns);
            return None;
        }
        let for_ns = now_ns.saturating_sub(self.since_ns);
        let evidence = match signs.offered {
            // What was published before is not counted among those that wait.
            Some(_) => Evidence::NotTaken { parts, for_ns },
            None => Evidence::NotSent { for_ns },
        };
        (for_ns >= times.silent_ns).then_some(evidence)
    }
}
