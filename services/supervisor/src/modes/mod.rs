//! What the chain as a whole is to do, and since when it does: from what was commanded and where the ladder of overload
//! stands, to what the source is told.

pub(crate) mod overload;
pub(crate) mod steering;

use chain::Mode;
use messages::Step;
use serde::{Deserialize, Serialize};

/// Sweeps within which a change is to take effect.
const SWEEPS: u64 = 2;
/// Least time that a change may take at the sensor's pace [ns]: two sweeps at 10 Hz. Of a faster sensor the sweeps count.
const LEAST_NS: u64 = 200_000_000;

/// Whose wish something was.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum By {
    /// Somebody's, by `encke ctl`.
    Command,
    /// The executive's, by its table or because a budget was spent.
    Executive,
}

/// What is wished.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wish {
    /// The ladder of overload stands here.
    Ladder(Step),
    /// No less than this is left out, until [`Wish::Resume`].
    Degrade(Step),
    /// The least that is useful.
    Safe,
    /// Nothing is sent.
    Pause,
    /// Out of the pause; where there is none, all of its work again.
    Resume,
}

/// What the source's page says.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// When [ns].
    pub(crate) now_ns: u64,
    /// From one sweep to the next [ns]; 0 where nothing paces it.
    pub(crate) period_ns: u64,
    /// Parts published so far.
    pub(crate) published: u64,
    pub(crate) step_sent: Step,
    pub(crate) paused: bool,
}

/// What there is to say about a change of mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Passed {
    /// It is in effect, after so long [ns].
    Entered(Mode, u64),
    /// It is not, though two sweeps have passed.
    Late(Mode),
}

/// Changes of mode in a run.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct ModesReport {
    /// Those that took effect.
    pub changes: u64,
    /// Those that did not within two sweeps.
    pub late: u64,
    /// The longest that one took [ms].
    pub took_max_ms: f64,
}

/// A mode that was asked for and is not in effect yet.
#[derive(Clone, Copy, Debug)]
struct Change {
    asked_ns: u64,
    asked_published: u64,
    is_late: bool,
}

/// The mode of a chain.
#[derive(Debug)]
pub(crate) struct Modes {
    sectors: u64,
    /// Whether a sensor's time passes: else only sweeps count.
    paced: bool,
    ladder: Step,
    floor: Step,
    safe: bool,
    paused: bool,
    mode: Mode,
    change: Option<Change>,
    pub(crate) report: ModesReport,
}

impl Modes {
    pub(crate) fn new(sectors: u32, paced: bool) -> Self {
        Self {
            sectors: u64::from(sectors.max(1)),
            paced,
            ladder: Step::Nominal,
            floor: Step::Nominal,
            safe: false,
            paused: false,
            mode: Mode::Nominal,
            change: None,
            report: ModesReport::default(),
        }
    }

    /// Goes on in `mode`, where one supervisor follows another; the source is at `step`. The share of the step that is the
    /// ladder's: safe mode explains `clusters-only`, and without a sensor's time there is no ladder.
    ///
    /// Whether it was safe mode behind a pause is not known: then the step tells.
    pub(crate) fn take_over(&mut self, mode: Mode, step: Step) -> Step {
        self.mode = mode;
        self.paused = mode == Mode::Paused;
        self.safe = mode == Mode::Safe || (self.paused && step >= Step::ClustersOnly);
        if self.safe && step <= Step::ClustersOnly {
            return Step::Nominal;
        }
        *(if self.paced { &mut self.ladder } else { &mut self.floor }) = step;
        self.ladder
    }

    /// The mode that was asked for last.
    pub(crate) fn mode(&self) -> Mode {
        self.mode
    }

    /// The step at which the source is to have sweeps processed.
    pub(crate) fn step(&self) -> Step {
        let safe = if self.safe { Step::ClustersOnly } else { Step::Nominal };
        self.ladder.max(self.floor).max(safe)
    }

    /// Whether the source is to stand still.
    pub(crate) fn is_paused(&self) -> bool {
        self.paused
    }

    /// Whether it is safe mode, be it behind a pause.
    pub(crate) fn is_safe(&self) -> bool {
        self.safe
    }

    /// Whether another [`Wish::Resume`] would lead to a mode that leaves out less.
    pub(crate) fn is_held_down(&self) -> bool {
        self.safe || self.floor > Step::Nominal
    }

    /// Whether a mode was asked for that is not in effect yet.
    #[cfg(test)]
    fn is_changing(&self) -> bool {
        self.change.is_some()
    }

    /// Takes a wish. Whether the mode is another one now, to be in effect soon.
    pub(crate) fn wish(&mut self, wish: Wish, seen: Seen) -> bool {
        match wish {
            Wish::Ladder(step) => self.ladder = step,
            Wish::Degrade(step) => self.floor = self.floor.max(step),
            Wish::Safe => self.safe = true,
            Wish::Pause => self.paused = true,
            Wish::Resume if self.paused => self.paused = false,
            Wish::Resume => (self.safe, self.floor) = (false, Step::Nominal),
        }
        let mode = self.wished();
        if mode == self.mode {
            return false;
        }
        self.mode = mode;
        // One that was not in effect yet is overtaken: nobody waits for it any more.
        self.change = Some(Change { asked_ns: seen.now_ns, asked_published: seen.published, is_late: false });
        true
    }

    fn wished(&self) -> Mode {
        match self.step() {
            _ if self.paused => Mode::Paused,
            _ if self.safe => Mode::Safe,
            Step::Nominal => Mode::Nominal,
            _ => Mode::Degraded,
        }
    }

    /// Looks whether a change has taken effect, or should have.
    pub(crate) fn look(&mut self, seen: Seen) -> Option<Passed> {
        let is_in_effect = if self.paused { seen.paused } else { !seen.paused && seen.step_sent == self.step() };
        let change = self.change.as_mut()?;
        let took_ns = seen.now_ns.saturating_sub(change.asked_ns);
        if is_in_effect {
            self.change = None;
            self.report.changes += 1;
            self.report.took_max_ms = self.report.took_max_ms.max(took_ns as f64 / 1e6);
            return Some(Passed::Entered(self.mode, took_ns));
        }
        let parts = seen.published.saturating_sub(change.asked_published);
        let by_sweeps = parts > SWEEPS * self.sectors;
        let by_time = self.paced && took_ns > LEAST_NS.max(SWEEPS * seen.period_ns);
        if change.is_late || !(by_sweeps || by_time) {
            return None;
        }
        change.is_late = true;
        self.report.late += 1;
        Some(Passed::Late(self.mode))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// A source that has sent so many parts, at this step.
    fn seen(at_ms: u64, published: u64, step_sent: Step) -> Seen {
        Seen { now_ns: at_ms * MS, period_ns: 100 * MS, published, step_sent, paused: false }
    }

    fn still(at_ms: u64) -> Seen {
        Seen { paused: true, ..seen(at_ms, 40, Step::Nominal) }
    }

    #[test]
    fn a_mode_is_in_effect_when_the_source_says_so() {
        let mut sut = Modes::new(4, true);
        assert!(sut.wish(Wish::Safe, seen(0, 10, Step::Nominal)));
        assert_eq!((sut.mode(), sut.step()), (Mode::Safe, Step::ClustersOnly));
        assert_eq!(sut.look(seen(60, 12, Step::Nominal)), None);
        assert_eq!(sut.look(seen(90, 13, Step::ClustersOnly)), Some(Passed::Entered(Mode::Safe, 90 * MS)));
        assert_eq!(sut.look(seen(95, 14, Step::ClustersOnly)), None, "said once");
        assert_eq!(sut.report, ModesReport { changes: 1, late: 0, took_max_ms: 90.0 });
    }

    #[test]
    fn a_change_that_two_sweeps_have_passed_without_is_late_once_and_still_counts() {
        let mut sut = Modes::new(4, false);
        sut.wish(Wish::Pause, seen(0, 10, Step::Nominal));
        assert_eq!(sut.look(seen(9_000, 18, Step::Nominal)), None, "two sweeps, however long they take");
        assert_eq!(sut.look(seen(9_001, 19, Step::Nominal)), Some(Passed::Late(Mode::Paused)));
        assert_eq!(sut.look(seen(9_002, 20, Step::Nominal)), None);
        assert!(matches!(sut.look(still(9_100)), Some(Passed::Entered(Mode::Paused, _))));
        assert_eq!((sut.report.changes, sut.report.late), (1, 1));
    }

    #[test]
    fn at_the_sensors_pace_time_counts_too_so_that_a_source_that_stands_still_is_late() {
        let mut sut = Modes::new(4, true);
        sut.wish(Wish::Pause, still(0));
        sut.look(still(1));
        sut.wish(Wish::Resume, still(10));
        assert_eq!(sut.look(still(210)), None);
        assert_eq!(sut.look(still(211)), Some(Passed::Late(Mode::Nominal)));
    }

    #[test]
    fn resume_leads_out_of_the_pause_first_and_then_out_of_safe_mode() {
        let mut sut = Modes::new(1, true);
        for wish in [Wish::Safe, Wish::Degrade(Step::FewerStarts), Wish::Pause] {
            sut.wish(wish, Seen::default());
        }
        assert_eq!(sut.mode(), Mode::Paused);
        assert!(sut.wish(Wish::Resume, Seen::default()));
        assert_eq!((sut.mode(), sut.step()), (Mode::Safe, Step::ClustersOnly));
        assert!(sut.wish(Wish::Resume, Seen::default()));
        assert_eq!((sut.mode(), sut.step()), (Mode::Nominal, Step::Nominal));
        assert!(!sut.wish(Wish::Resume, Seen::default()), "nothing to resume");
    }

    #[test]
    fn the_ladder_goes_on_below_a_commanded_step_and_shows_beyond_it() {
        let mut sut = Modes::new(1, true);
        sut.wish(Wish::Degrade(Step::PaperFeatures), Seen::default());
        assert!(!sut.wish(Wish::Ladder(Step::FewerStarts), Seen::default()));
        assert_eq!((sut.mode(), sut.step()), (Mode::Degraded, Step::PaperFeatures));
        sut.wish(Wish::Safe, Seen::default());
        sut.wish(Wish::Ladder(Step::EverySecondSweep), Seen::default());
        assert_eq!((sut.mode(), sut.step()), (Mode::Safe, Step::EverySecondSweep));
        sut.wish(Wish::Resume, Seen::default());
        assert_eq!((sut.mode(), sut.step()), (Mode::Degraded, Step::EverySecondSweep), "the ladder's own");
        sut.wish(Wish::Ladder(Step::Nominal), Seen::default());
        assert_eq!(sut.mode(), Mode::Nominal);
    }

    #[test]
    fn a_change_that_another_overtakes_is_neither_late_nor_counted() {
        let mut sut = Modes::new(1, true);
        sut.wish(Wish::Safe, seen(0, 0, Step::Nominal));
        sut.wish(Wish::Resume, seen(150, 1, Step::Nominal));
        assert_eq!(sut.look(seen(300, 2, Step::Nominal)), Some(Passed::Entered(Mode::Nominal, 150 * MS)));
        assert!(!sut.is_changing());
        assert_eq!((sut.report.changes, sut.report.late), (1, 0));
    }

    #[test]
    fn one_supervisor_follows_another_in_the_same_mode_at_the_same_step() {
        for (mode, step, ladder) in [
            (Mode::Nominal, Step::Nominal, Step::Nominal),
            (Mode::Degraded, Step::PaperFeatures, Step::PaperFeatures),
            (Mode::Safe, Step::ClustersOnly, Step::Nominal),
            (Mode::Safe, Step::EverySecondSweep, Step::EverySecondSweep),
            (Mode::Paused, Step::FewerStarts, Step::FewerStarts),
            (Mode::Paused, Step::ClustersOnly, Step::Nominal),
        ] {
            let mut sut = Modes::new(1, true);
            assert_eq!(sut.take_over(mode, step), ladder, "{mode:?}");
            assert_eq!((sut.mode(), sut.step()), (mode, step));
            assert!(!sut.wish(Wish::Ladder(ladder), Seen::default()), "no change of mode");
        }
        let mut sut = Modes::new(1, false);
        assert_eq!(sut.take_over(Mode::Degraded, Step::FewerStarts), Step::Nominal);
        assert_eq!(sut.step(), Step::FewerStarts);
    }

    /// What was wished, in any order, never leaves the modes in a state that its parts contradict.
    #[test]
    fn ten_thousand_wishes_leave_no_contradiction_and_none_stuck() {
        let mut sut = Modes::new(2, true);
        let mut state = 1_u64;
        for turn in 0..10_000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let wish = match state >> 61 {
                0 => Wish::Safe,
                1 | 2 => Wish::Pause,
                3 | 4 => Wish::Resume,
                5 => Wish::Degrade(Step::PaperFeatures),
                6 => Wish::Ladder(Step::FewerStarts),
                _ => Wish::Ladder(Step::Nominal),
            };
            sut.wish(wish, seen(turn, turn, Step::Nominal));
            let (paused, safe, step) = (sut.is_paused(), sut.is_safe(), sut.step());
            let expected = if paused {
                Mode::Paused
            } else if safe {
                Mode::Safe
            } else {
                sut.mode()
            };
            assert_eq!(sut.mode(), expected);
            assert_eq!(!paused && !safe && step == Step::Nominal, sut.mode() == Mode::Nominal);
            sut.look(Seen { paused, step_sent: step, ..seen(turn, turn, step) });
            assert!(!sut.is_changing());
        }
        assert_eq!(sut.report.late, 0);
        assert!(sut.report.changes > 1_000);
    }
}
