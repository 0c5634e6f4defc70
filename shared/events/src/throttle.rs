//! Which events are said aloud, so that a storm of one kind neither fills the log nor hides another kind.

use std::collections::BTreeMap;

use crate::{EventId, Severity};

/// Time without an event of a kind after which its storm is over [ns].
const CALM_NS: u64 = 1_000_000_000;

/// A token bucket for each event of each process.
///
/// An event costs a token; tokens come back with time. Errors and worse cost none and are always said, and so is whatever is
/// worse than all before of its kind. What is left unsaid is counted, and the count goes out with the next of its kind, or
/// by [`Throttle::over`].
#[derive(Debug)]
pub struct Throttle {
    burst: f64,
    per_s: f64,
    kinds: BTreeMap<(EventId, String), Kind>,
}

#[derive(Debug)]
struct Kind {
    tokens: f64,
    at_ns: u64,
    worst: Option<u64>,
    unsaid: u64,
}

impl Throttle {
    /// So many of a kind at once, then so many a second.
    pub fn new(burst: u32, per_s: f64) -> Self {
        Self { burst: f64::from(burst), per_s, kinds: BTreeMap::new() }
    }

    /// Sets other bounds; what was counted stays.
    pub fn set(&mut self, burst: u32, per_s: f64) {
        (self.burst, self.per_s) = (f64::from(burst), per_s);
    }

    /// An event of `stage` at host time `now_ns`, as bad as `size` (how long, how many; the unit is the event's own). Gives
    /// how many of its kind were left unsaid before it, where it is to be said.
    pub fn admit(&mut self, now_ns: u64, id: EventId, stage: &str, size: u64) -> Option<u64> {
        if id.severity() >= Severity::Error {
            return Some(0);
        }
        let burst = self.burst;
        let key = (id, stage.to_owned());
        let new = || Kind { tokens: burst, at_ns: now_ns, worst: None, unsaid: 0 };
        let kind = self.kinds.entry(key).or_insert_with(new);
        let passed_s = now_ns.saturating_sub(kind.at_ns) as f64 / 1e9;
        kind.tokens = (kind.tokens + passed_s * self.per_s).min(burst);
        kind.at_ns = kind.at_ns.max(now_ns);
        let worse = kind.worst.is_some_and(|worst| size > worst);
        kind.worst = kind.worst.max(Some(size));
        if kind.tokens >= 1.0 {
            kind.tokens -= 1.0;
        } else if !worse {
            kind.unsaid = kind.unsaid.saturating_add(1);
            return None;
        }
        Some(std::mem::take(&mut kind.unsaid))
    }

    /// Kinds whose storm is over by `now_ns`, with how many of each were left unsaid. Each is told once. With `all`, those
    /// that go on, too.
    pub fn over(&mut self, now_ns: u64, all: bool) -> Vec<(EventId, String, u64)> {
        let mut over = Vec::new();
        for ((id, stage), kind) in &mut self.kinds {
            if kind.unsaid > 0 && (all || now_ns.saturating_sub(kind.at_ns) >= CALM_NS) {
                over.push((*id, stage.clone(), std::mem::take(&mut kind.unsaid)));
            }
        }
        over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn a_burst_is_said_then_so_many_a_second_and_the_number_of_the_rest_is_not_lost() {
        let mut sut = Throttle::new(3, 2.0);
        let said: Vec<_> = (0..6).map(|_| sut.admit(0, EventId::PartsDropped, "sut", 1)).collect();
        assert_eq!(said, [Some(0), Some(0), Some(0), None, None, None]);
        assert_eq!(sut.admit(S / 2, EventId::PartsDropped, "sut", 1), Some(3));
        assert_eq!(sut.admit(S / 2, EventId::PartsDropped, "sut", 1), None);
        assert_eq!(sut.over(S, false), []);
        assert_eq!(sut.over(3 * S, false), [(EventId::PartsDropped, "sut".to_owned(), 1)]);
        assert_eq!(sut.over(9 * S, false), [], "told once");
        // However long it was calm, no more than a burst comes at once.
        let said = (0..9).filter(|_| sut.admit(90 * S, EventId::PartsDropped, "sut", 1).is_some()).count();
        assert_eq!(said, 3);
    }

    #[test]
    fn what_is_worse_than_all_before_is_said() {
        let mut sut = Throttle::new(1, 0.1);
        assert_eq!(sut.admit(0, EventId::BudgetOverrun, "sut", 10), Some(0));
        assert_eq!(sut.admit(1, EventId::BudgetOverrun, "sut", 10), None, "as bad as the worst");
        assert_eq!(sut.admit(2, EventId::BudgetOverrun, "sut", 11), Some(1));
        assert_eq!(sut.admit(3, EventId::BudgetOverrun, "sut", 4), None);
    }

    #[test]
    fn errors_are_never_held_back_and_each_process_has_its_own_bucket() {
        let mut sut = Throttle::new(1, 0.1);
        for _ in 0..1_000 {
            assert_eq!(sut.admit(0, EventId::PartsLost, "sut", 0), Some(0));
            sut.admit(0, EventId::PartsDropped, "sut", 0);
        }
        assert_eq!(sut.admit(0, EventId::PartsDropped, "another", 0), Some(0));
        assert_eq!(sut.admit(0, EventId::StaleRefused, "sut", 0), Some(0));
    }

    #[test]
    fn a_clock_that_stands_or_goes_back_gives_no_tokens_and_takes_none() {
        let mut sut = Throttle::new(1, 1.0);
        assert_eq!(sut.admit(5 * S, EventId::PartsDropped, "sut", 0), Some(0));
        assert_eq!(sut.admit(0, EventId::PartsDropped, "sut", 0), None);
        assert_eq!(sut.admit(6 * S, EventId::PartsDropped, "sut", 0), Some(1));
    }
}
