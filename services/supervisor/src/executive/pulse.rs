//! Hung, spinning, or long at one part: told apart by what the kernel says of a process that makes no progress.

use chain::executive::Condition;

use super::activity::Activity;
use super::evidence::Evidence;
use super::signs::Signs;
use super::times::Times;

/// Of the time since the last look; less than this is a thread that wakes to see that nothing has come.
const LEAST_SHARE: u64 = 50;
/// The same of a short time [ns].
const LEAST_NS: u64 = 200_000;

/// What is remembered of one stage.
#[derive(Debug, Default)]
pub(crate) struct Pulse {
    /// The heartbeat that everything below is about [ns].
    heartbeat_ns: u64,
    /// CPU time when the heartbeat was first found old [ns].
    first_cpu_ns: u64,
    /// When it was last seen to do something, and the CPU time and run-queue delay by then [ns]; none while it is not asked.
    moved: Option<(u64, u64)>,
    /// When it was last found hung [ns]. Whoever is ended in that state runs once more.
    hung: Option<(u64, Evidence)>,
}

impl Pulse {
    /// What is the matter with the stage. A process without a core is none of these: it is not its own fault, and a successor
    /// would fare no better.
    pub(crate) fn look(&mut self, now_ns: u64, signs: &Signs, times: &Times) -> Option<(Condition, Evidence)> {
        let Some(activity) = signs.activity.filter(|_| signs.up) else {
            *self = Self::default();
            return None;
        };
        let moved_ns = self.moved_ns(now_ns, signs.heartbeat_ns, activity);
        let (age_ns, still_ns) = (now_ns.saturating_sub(signs.heartbeat_ns), now_ns - moved_ns);
        if age_ns < times.hung_ns {
            return None;
        }
        // Whoever waits for a disk may wait longer.
        let patience_ns = if activity.blocked { times.spinning_ns } else { times.hung_ns };
        if activity.stopped {
            self.hung = Some((now_ns, Evidence::Stopped { age_ns }));
        } else if age_ns >= patience_ns && still_ns >= times.asked_ns {
            self.hung = Some((now_ns, Evidence::Still { age_ns }));
        }
        if let Some((_, evidence)) = self.hung.filter(|(last_ns, _)| now_ns - last_ns < times.asked_ns) {
            return Some((Condition::Hung, evidence));
        }
        let cpu_ns = activity.cpu_ns.saturating_sub(self.first_cpu_ns);
        let computes = Evidence::Computes { age_ns, cpu_ns };
        if age_ns >= times.spinning_ns && cpu_ns >= times.spinning_ns / 2 {
            return Some((Condition::Spinning, computes));
        }
        (times.paced && cpu_ns >= times.hung_ns / 4).then_some((Condition::Slow, computes))
    }

    /// When it last did something.
    fn moved_ns(&mut self, now_ns: u64, heartbeat_ns: u64, activity: Activity) -> u64 {
        let used_ns = activity.cpu_ns + activity.run_delay_ns;
        if self.heartbeat_ns != heartbeat_ns || self.moved.is_none() {
            *self = Self { heartbeat_ns, first_cpu_ns: activity.cpu_ns, moved: Some((now_ns, used_ns)), hung: None };
        }
        let moved = self.moved.get_or_insert((now_ns, used_ns));
        let least_ns = now_ns.saturating_sub(moved.0) / LEAST_SHARE + LEAST_NS;
        if activity.runnable || used_ns.saturating_sub(moved.1) > least_ns {
            *moved = (now_ns, used_ns);
        }
        moved.0
    }
}
