//! Watched values: within their bounds, out of them, not coming, or no number. Out and in count only after so many in a row.

use chain::executive::{Action, LimitFile, Watch};

/// Where a watched value stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum LimitState {
    /// Within its bounds.
    #[default]
    Within,
    /// Out of them, for as many looks as the table asks.
    Violated,
    /// It does not come any more.
    Stale,
    /// What comes is no number.
    NoNumber,
}

/// A watched value has another state now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LimitChange {
    /// Place of the limit in the table.
    pub(crate) limit: usize,
    /// Place of the process whose value it is; none where it is the chain's.
    pub(crate) process: Option<usize>,
    /// The state.
    pub(crate) state: LimitState,
    /// The value that decided; the last that came, where none comes.
    pub(crate) value: f64,
    /// What is to be done.
    pub(crate) then: Option<Action>,
}

/// One watched value: a limit, for one process.
#[derive(Clone, Copy, Debug)]
struct Item {
    limit: usize,
    process: Option<usize>,
    state: LimitState,
    /// The state that the latest values speak for, and how many in a row.
    towards: (LimitState, u32),
    value: f64,
    last_ns: u64,
}

/// All watched values.
#[derive(Debug)]
pub(crate) struct Limits {
    limits: Vec<LimitFile>,
    items: Vec<Item>,
}

impl Limits {
    /// For processes of these names, from host time `now_ns` on.
    pub(crate) fn new(limits: &[LimitFile], names: &[String], now_ns: u64) -> Self {
        let mut items = Vec::new();
        for (limit, file) in limits.iter().enumerate() {
            let item = |process| Item {
                limit,
                process,
                state: LimitState::Within,
                towards: (LimitState::Within, 0),
                value: 0.0,
                last_ns: now_ns,
            };
            if file.watch.is_of_a_process() {
                let meant = |name: &String| file.stages.is_empty() || file.stages.contains(name);
                items.extend((0..names.len()).filter(|&place| meant(&names[place])).map(|place| item(Some(place))));
            } else {
                items.push(item(None));
            }
        }
        Self { limits: limits.to_vec(), items }
    }

    /// Other limits from now on. One that stays as it was goes on where it was.
    pub(crate) fn replace(&mut self, limits: &[LimitFile], names: &[String], now_ns: u64) {
        let before = std::mem::replace(self, Self::new(limits, names, now_ns));
        for item in &mut self.items {
            let same = |old: &&Item| before.limits[old.limit] == self.limits[item.limit] && old.process == item.process;
            if let Some(old) = before.items.iter().find(same) {
                *item = Item { limit: item.limit, ..*old };
            }
        }
    }

    /// The limit at a place of the table.
    pub(crate) fn file(&self, limit: usize) -> Option<&LimitFile> {
        self.limits.get(limit)
    }

    /// Whether anybody watches this.
    pub(crate) fn watches(&self, watch: Watch) -> bool {
        self.limits.iter().any(|limit| limit.watch == watch)
    }

    /// A new value has come.
    pub(crate) fn feed(
        &mut self,
        now_ns: u64,
        (watch, process): (Watch, Option<usize>),
        value: f64,
        mut tell: impl FnMut(LimitChange),
    ) {
        for item in &mut self.items {
            let file = &self.limits[item.limit];
            if file.watch == watch && item.process == process {
                (item.last_ns, item.value) = (now_ns, value);
                if let Some(state) = item.judge(file) {
                    tell(item.change(state, file));
                }
            }
        }
    }

    /// Looks for values that do not come any more. Those of the flow of sweeps need not while there is none.
    pub(crate) fn look(&mut self, now_ns: u64, flows: bool, mut tell: impl FnMut(LimitChange)) {
        for item in &mut self.items {
            let file = &self.limits[item.limit];
            if !flows && is_of_the_flow(file.watch) {
                item.last_ns = now_ns;
            }
            let stale_ns = (file.stale_after_s * 1e9) as u64;
            if item.state != LimitState::Stale && now_ns.saturating_sub(item.last_ns) > stale_ns {
                tell(item.change(LimitState::Stale, file));
            }
        }
    }
}

/// Whether a value comes only while sweeps do.
fn is_of_the_flow(watch: Watch) -> bool {
    watch.is_of_a_sweep() || matches!(watch, Watch::RateHz | Watch::DropRatio)
}

impl Item {
    /// The state after this value, where it is another one than before.
    fn judge(&mut self, file: &LimitFile) -> Option<LimitState> {
        if !self.value.is_finite() {
            self.towards.1 = 0;
            return (self.state != LimitState::NoNumber).then_some(LimitState::NoNumber);
        }
        let is_above = file.above.is_some_and(|above| self.value > above);
        let is_below = file.below.is_some_and(|below| self.value < below);
        let state = if is_above || is_below { LimitState::Violated } else { LimitState::Within };
        let before = if self.towards.0 == state { self.towards.1 } else { 0 };
        self.towards = (state, before.saturating_add(1));
        (state != self.state && self.towards.1 >= file.persist).then_some(state)
    }

    /// Goes over into this state.
    fn change(&mut self, state: LimitState, file: &LimitFile) -> LimitChange {
        (self.state, self.towards.1) = (state, 0);
        let then = (state == LimitState::Violated && file.then != Action::Event).then_some(file.then);
        LimitChange { limit: self.limit, process: self.process, state, value: self.value, then }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;
    const LATENCY: (Watch, Option<usize>) = (Watch::LatencyMs, None);

    fn file(watch: Watch) -> LimitFile {
        LimitFile {
            name: "sut".to_owned(),
            watch,
            stages: Vec::new(),
            above: Some(100.0),
            below: Some(10.0),
            persist: 3,
            stale_after_s: 2.0,
            then: Action::Degrade,
        }
    }

    fn sut(file: LimitFile) -> Limits {
        Limits::new(&[file], &["source".to_owned(), "clusterer".to_owned()], 0)
    }

    /// Feeds one value a second; the states that it comes to.
    fn feed(sut: &mut Limits, from_s: u64, values: &[f64]) -> Vec<(LimitState, Option<Action>)> {
        let mut told = Vec::new();
        for (number, value) in values.iter().enumerate() {
            let now_ns = (from_s + number as u64) * S;
            sut.feed(now_ns, LATENCY, *value, |change| told.push((change.state, change.then)));
            sut.look(now_ns, true, |change| told.push((change.state, change.then)));
        }
        told
    }

    const VIOLATED: (LimitState, Option<Action>) = (LimitState::Violated, Some(Action::Degrade));
    const WITHIN: (LimitState, Option<Action>) = (LimitState::Within, None);
    const STALE: (LimitState, Option<Action>) = (LimitState::Stale, None);

    #[test]
    fn three_in_a_row_out_of_bounds_violate_it_once_and_three_within_restore_it() {
        let mut sut = sut(file(Watch::LatencyMs));
        assert_eq!(feed(&mut sut, 0, &[101.0, 101.0, 100.0, 101.0, 9.9]), [], "the bounds themselves are within");
        assert_eq!(feed(&mut sut, 5, &[101.0, 101.0, 101.0, 101.0, 5.0]), [VIOLATED]);
        assert_eq!(feed(&mut sut, 10, &[50.0, 50.0, 101.0, 50.0, 50.0]), []);
        assert_eq!(feed(&mut sut, 15, &[10.0, 101.0]), [WITHIN]);
        assert_eq!(feed(&mut sut, 17, &[101.0, 101.0]), [VIOLATED], "again, with the one before");
    }

    #[test]
    fn a_value_that_does_not_come_is_stale_and_counts_anew_when_it_does() {
        let mut sut = sut(file(Watch::LatencyMs));
        assert_eq!(feed(&mut sut, 0, &[101.0, 101.0]), []);
        let mut told = Vec::new();
        for half_s in 2..20 {
            sut.look(half_s * S / 2, true, |change| told.push((half_s, change.state)));
        }
        assert_eq!(told, [(7, LimitState::Stale)], "once, beyond two seconds after the last value");
        assert_eq!(feed(&mut sut, 10, &[101.0, 50.0, 50.0]), []);
        assert_eq!(feed(&mut sut, 13, &[50.0]), [WITHIN]);
    }

    #[test]
    fn while_no_sweeps_are_to_come_what_comes_with_them_is_not_stale_and_the_rest_is() {
        let told = |watch| {
            let mut told = 0;
            let mut sut = sut(file(watch));
            (0..10).for_each(|s| sut.look(s * S, false, |_| told += 1));
            told
        };
        assert_eq!([Watch::LatencyMs, Watch::MarginPct, Watch::RateHz, Watch::DropRatio].map(told), [0; 4]);
        assert_eq!(told(Watch::RssMib), 2, "of both processes");
        assert_eq!(told(Watch::DiskFreeMib), 1);
    }

    #[test]
    fn what_is_no_number_is_neither_in_nor_out_of_bounds() {
        let mut sut = sut(file(Watch::LatencyMs));
        let told = feed(&mut sut, 0, &[f64::NAN, f64::NAN, f64::INFINITY, 101.0, 101.0]);
        assert_eq!(told, [(LimitState::NoNumber, None)]);
        assert_eq!(feed(&mut sut, 5, &[f64::NAN, 101.0, 101.0, 101.0]), [VIOLATED]);
        assert_eq!(feed(&mut sut, 12, &[]), []);
        let mut told = Vec::new();
        sut.look(20 * S, true, |change| told.push((change.state, change.then)));
        assert_eq!(told, [STALE]);
    }

    #[test]
    fn each_process_has_its_own_state_and_those_not_named_have_none() {
        let mut sut = sut(LimitFile { persist: 1, ..file(Watch::RssMib) });
        let mut told = Vec::new();
        sut.feed(0, (Watch::RssMib, Some(1)), 101.0, |change| told.push((change.process, change.state)));
        sut.feed(0, (Watch::RssMib, Some(0)), 50.0, |change| told.push((change.process, change.state)));
        sut.feed(0, (Watch::CpuPct, Some(0)), 101.0, |change| told.push((change.process, change.state)));
        assert_eq!(told, [(Some(1), LimitState::Violated)]);
        let named = LimitFile { stages: vec!["source".to_owned()], ..file(Watch::RssMib) };
        assert_eq!(self::sut(named).items.len(), 1);
    }

    #[test]
    fn a_limit_that_stays_in_the_table_keeps_its_state() {
        let mut sut = sut(LimitFile { persist: 1, ..file(Watch::LatencyMs) });
        assert_eq!(feed(&mut sut, 0, &[101.0]), [VIOLATED]);
        let other = LimitFile { name: "other".to_owned(), ..sut.limits[0].clone() };
        let table = [other, sut.limits[0].clone()];
        sut.replace(&table, &["source".to_owned()], S);
        assert_eq!(feed(&mut sut, 1, &[101.0]), [VIOLATED], "the new one alone");
        assert_eq!(feed(&mut sut, 2, &[50.0]), [WITHIN, WITHIN]);
    }
}
