//! New parameters while the chain runs: a stage builds its successor between two sweeps and hands over at a sweep's border.

use events::EventId;

use crate::clock;
use crate::page::{Page, Said};

/// A stage and, round a change of its parameters, the one before or after it.
///
/// Which of the two a sweep is processed with depends on the sweep's number alone, wherever the stage was when it heard of
/// the change: the bytes are the same at any pace, also of sweeps that are sent again.
pub(crate) struct Tables<'a, S> {
    page: &'a Page,
    /// The one in use.
    stage: S,
    /// The other one: the next as long as `from_sweep` has not come, then the one before, until nobody can ask for it.
    other: Option<S>,
    is_next_in_use: bool,
    /// Whether it was said that the next is in use.
    said: bool,
    /// Generation of the next, and the first sweep that is processed with it.
    generation: u64,
    from_sweep: u64,
    /// Generation that was built, or refused, last.
    tried: u64,
    /// Lets the next stage go on where the one before it stood.
    take_over: fn(&mut S, &S),
    /// Sweeps after which none before `from_sweep` is sent again.
    kept_sweeps: u64,
    /// The sweep of the last part; none before the first.
    sweep: Option<u64>,
    between: bool,
}

impl<'a, S> Tables<'a, S> {
    /// Begins with a stage built from the parameters that the page names as active; `kept_sweeps` may be sent again.
    pub(crate) fn new(page: &'a Page, stage: S, take_over: fn(&mut S, &S), kept_sweeps: u64) -> Self {
        let generation = page.table_active.get();
        Self {
            page,
            stage,
            other: None,
            is_next_in_use: false,
            said: true,
            generation,
            from_sweep: 0,
            tried: generation,
            take_over,
            kept_sweeps,
            sweep: None,
            between: true,
        }
    }

    /// The stage for a part of this sweep. Where the next stage is due and not built yet, it is built now.
    pub(crate) fn at(&mut self, sweep: u64, build: impl FnOnce() -> Result<S, String>) -> &mut S {
        if self.sweep != Some(sweep) {
            self.between = true;
            self.sweep = Some(sweep);
            self.build_if_wanted(build);
            self.hand_over(sweep);
        }
        self.between = false;
        &mut self.stage
    }

    /// The last part of a sweep has left.
    pub(crate) fn sweep_ended(&mut self) {
        self.between = true;
    }

    /// Builds the next stage where new parameters wait and no sweep is under way.
    pub(crate) fn build_if_wanted(&mut self, build: impl FnOnce() -> Result<S, String>) {
        let wanted = self.page.table_wanted.get();
        if !self.between || wanted <= self.tried {
            return;
        }
        self.tried = wanted;
        self.page.beat(clock::now_ns());
        let built = build();
        self.page.beat(clock::now_ns());
        match built {
            Ok(next) => {
                self.other = Some(next);
                (self.is_next_in_use, self.said) = (false, false);
                (self.generation, self.from_sweep) = (wanted, self.page.table_from_sweep.get());
            }
            Err(cause) => {
                tracing::error!(generation = wanted, cause, "new parameters do not hold; the old ones stay in use");
                self.say(EventId::TableRefused, wanted);
                self.page.table_refused.set(wanted);
            }
        }
    }

    /// Lets the stage process this sweep that is to.
    fn hand_over(&mut self, sweep: u64) {
        let Some(other) = &mut self.other else { return };
        let is_next_due = sweep >= self.from_sweep;
        if is_next_due != self.is_next_in_use {
            std::mem::swap(&mut self.stage, other);
            self.is_next_in_use = is_next_due;
            if is_next_due {
                (self.take_over)(&mut self.stage, other);
            }
        }
        if is_next_due && !self.said {
            self.said = true;
            self.say(EventId::TableActive, self.generation);
            self.page.table_active.set(self.generation);
        }
        if sweep >= self.from_sweep.saturating_add(self.kept_sweeps) {
            self.other = None;
        }
    }

    fn say(&self, id: EventId, generation: u64) {
        let sweep = self.sweep.unwrap_or(0);
        self.page.say(Said { id, time_ns: clock::now_ns(), sweep, a: generation, b: sweep });
    }
}

/// A process that has no parameters has the new ones at once.
pub(crate) fn acknowledge(page: &Page) {
    let wanted = page.table_wanted.get();
    if wanted > page.table_active.get() {
        page.table_active.set(wanted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::{Heard, PageMap};

    fn page() -> (tempfile::TempDir, PageMap) {
        let dir = tempfile::tempdir().unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        (dir, page)
    }

    /// Wants the parameters of a generation from a sweep on.
    fn want(page: &Page, generation: u64, from_sweep: u64) {
        page.table_from_sweep.set(from_sweep);
        page.table_wanted.set(generation);
    }

    fn said(page: &Page) -> Vec<(EventId, u64, u64)> {
        let mut all = Vec::new();
        page.hear(&mut Heard::default(), |said| all.push((said.id, said.a, said.b)));
        all
    }

    /// The stages that process these sweeps, of two parts each; the next stage would be `next`.
    fn run(sut: &mut Tables<'_, u32>, sweeps: impl IntoIterator<Item = u64>, next: u32) -> Vec<u32> {
        let process = |sweep| {
            let first = *sut.at(sweep, || Ok(next));
            assert_eq!(*sut.at(sweep, || Ok(next)), first, "one stage for the whole sweep");
            sut.sweep_ended();
            first
        };
        sweeps.into_iter().map(process).collect()
    }

    #[test]
    fn the_next_stage_takes_over_at_its_sweep_wherever_the_change_was_heard_of() {
        for heard_at in 0..=5 {
            let (_dir, page) = page();
            let mut sut = Tables::new(&page, 0, |_, _| (), 2);
            let mut used = run(&mut sut, 0..heard_at, 1);
            want(&page, 1, 5);
            used.extend(run(&mut sut, heard_at..8, 1));
            assert_eq!(used, [0, 0, 0, 0, 0, 1, 1, 1], "heard of before sweep {heard_at}");
            assert_eq!((page.table_active.get(), page.table_refused.get()), (1, 0));
            assert_eq!(said(&page), [(EventId::TableActive, 1, 5)]);
        }
    }

    #[test]
    fn a_change_that_is_heard_of_too_late_counts_from_the_next_sweep_on() {
        let (_dir, page) = page();
        let mut sut = Tables::new(&page, 0, |_, _| (), 2);
        sut.at(7, || Ok(1));
        want(&page, 1, 5);
        sut.build_if_wanted(|| panic!("in the middle of a sweep"));
        assert_eq!(*sut.at(7, || Ok(1)), 0);
        sut.sweep_ended();
        assert_eq!(run(&mut sut, 8..10, 1), [1, 1]);
        assert_eq!(said(&page), [(EventId::TableActive, 1, 8)]);
    }

    #[test]
    fn the_next_stage_is_built_once_while_there_is_time_for_it() {
        let (_dir, page) = page();
        let mut sut = Tables::new(&page, 0, |_, _| (), 2);
        want(&page, 1, 5);
        sut.build_if_wanted(|| Ok(1));
        sut.build_if_wanted(|| panic!("twice"));
        assert_eq!(page.table_active.get(), 0, "not in use yet");
        assert_eq!(run(&mut sut, 4..6, 9), [0, 1]);
    }

    #[test]
    fn sweeps_that_are_sent_again_have_the_stage_that_they_had() {
        let (_dir, page) = page();
        let mut sut = Tables::new(&page, 0, |_, _| (), 3);
        want(&page, 1, 5);
        assert_eq!(run(&mut sut, [3, 4, 5, 6, 3, 4, 5, 6, 7], 1), [0, 0, 1, 1, 0, 0, 1, 1, 1]);
        assert!(sut.other.is_some());
        assert_eq!(run(&mut sut, [8, 9], 1), [1, 1]);
        assert!(sut.other.is_none(), "nobody can ask for it any more");
        assert_eq!(said(&page).len(), 1);
    }

    #[test]
    fn the_next_stage_goes_on_where_the_one_before_it_stood_also_when_sweeps_are_sent_again() {
        let (_dir, page) = page();
        // A stage that remembers the sum of what it has seen, and its parameter.
        let mut sut = Tables::new(&page, (0, 1), |next: &mut (u64, u64), before| next.0 = before.0, 3);
        want(&page, 1, 5);
        let mut sums = Vec::new();
        for sweep in [3, 4, 5, 6] {
            let stage = sut.at(sweep, || Ok((0, 100)));
            stage.0 += stage.1;
            sums.push(stage.0);
            sut.sweep_ended();
        }
        assert_eq!(sums, [1, 2, 102, 202]);
    }

    #[test]
    fn what_is_refused_leaves_the_stage_as_it_is_and_the_next_change_is_tried() {
        let (_dir, page) = page();
        let mut sut = Tables::new(&page, 0, |_, _| (), 1);
        want(&page, 1, 2);
        sut.build_if_wanted(|| Err("no".to_owned()));
        assert_eq!(run(&mut sut, 0..5, 9), [0; 5]);
        assert_eq!((page.table_active.get(), page.table_refused.get()), (0, 1));
        assert_eq!(said(&page), [(EventId::TableRefused, 1, 0)]);
        want(&page, 2, 6);
        assert_eq!(run(&mut sut, 5..8, 2), [0, 2, 2]);
        assert_eq!(page.table_active.get(), 2);
    }

    #[test]
    fn a_process_without_parameters_acknowledges_at_once() {
        let (_dir, page) = page();
        want(&page, 3, 9);
        acknowledge(&page);
        assert_eq!(page.table_active.get(), 3);
    }
}
