use messages::TrackState;

use crate::params::LifecycleParams;

/// Whether a track is believed in: confirmed by M sightings in N sweeps, given up when it is missed too often where it
/// should have been seen. Sweeps that could not show it do not count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Life {
    confirmed: bool,
    /// The last sweeps that counted, the latest in the lowest bit: 1 where it was seen.
    history: u32,
    /// How many of them there are, at most 32.
    watched: u32,
    /// Misses in a row.
    missed: u32,
    first_sweep: u64,
    last_sweep: u64,
    /// The last sweep that told where it is.
    measured_sweep: u64,
}

impl Life {
    /// Of a track that was seen for the first time.
    pub(crate) fn born(sweep: u64, params: &LifecycleParams) -> Self {
        let mut life = Self {
            confirmed: false,
            history: 0,
            watched: 0,
            missed: 0,
            first_sweep: sweep,
            last_sweep: sweep,
            measured_sweep: sweep,
        };
        life.seen(sweep, params);
        life
    }

    /// It was seen.
    pub(crate) fn seen(&mut self, sweep: u64, params: &LifecycleParams) {
        self.count(1);
        self.missed = 0;
        self.last_sweep = sweep;
        self.confirmed |= self.hits(params.confirm_sweeps) >= params.confirm_hits;
    }

    /// What was seen of it told where it is.
    pub(crate) fn measured(&mut self, sweep: u64) {
        self.measured_sweep = sweep;
    }

    /// It should have been seen, and was not.
    pub(crate) fn missed(&mut self) {
        self.count(0);
        self.missed = self.missed.saturating_add(1);
    }

    fn count(&mut self, seen: u32) {
        self.history = self.history << 1 | seen;
        self.watched = (self.watched + 1).min(32);
    }

    /// Sightings in the last `sweeps` that counted.
    fn hits(&self, sweeps: u32) -> u32 {
        let latest = u32::MAX.checked_shr(32_u32.saturating_sub(sweeps)).unwrap_or(0);
        (self.history & latest).count_ones()
    }

    /// Whether it was missed too often: a tentative track when it can no more be confirmed in time, a confirmed one after
    /// so many misses in a row.
    pub(crate) fn is_over(&self, params: &LifecycleParams) -> bool {
        if self.confirmed {
            return self.missed >= params.lost_misses;
        }
        let sweeps = self.watched.min(params.confirm_sweeps);
        sweeps - self.hits(sweeps) > params.confirm_sweeps - params.confirm_hits
    }

    pub(crate) fn is_confirmed(&self) -> bool {
        self.confirmed
    }

    /// What is said of it in a sweep.
    pub(crate) fn state(&self, sweep: u64) -> TrackState {
        match (self.confirmed, self.measured_sweep == sweep) {
            (false, _) => TrackState::Tentative,
            (true, true) => TrackState::Confirmed,
            (true, false) => TrackState::Coasting,
        }
    }

    /// Sweeps since its birth, 1 in the sweep of its birth; and since it was seen.
    pub(crate) fn ages(&self, sweep: u64) -> (u32, u32) {
        let since = |then: u64| u32::try_from(sweep.saturating_sub(then)).unwrap_or(u32::MAX);
        (since(self.first_sweep).saturating_add(1), since(self.last_sweep))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMS: LifecycleParams = LifecycleParams {
        confirm_hits: 3,
        confirm_sweeps: 5,
        lost_misses: 4,
        unseen_s: 1.0,
        lost_sigma_m: 1.0,
        gap_s: 1.0,
        valid_s: 1.0,
    };

    /// Plays sightings that tell where it is (`x`) and that do not (`o`), misses (`.`) and sweeps that could not show it
    /// (` `); gives what it is after each.
    fn play(sweeps: &str) -> String {
        let mut life = Life::born(0, &PARAMS);
        let after = |(sweep, what): (usize, char)| {
            match what {
                'x' => {
                    life.seen(sweep as u64 + 1, &PARAMS);
                    life.measured(sweep as u64 + 1);
                }
                'o' => life.seen(sweep as u64 + 1, &PARAMS),
                '.' => life.missed(),
                _ => {}
            }
            match (life.is_over(&PARAMS), life.state(sweep as u64 + 1)) {
                (true, _) => '-',
                (_, TrackState::Tentative) => 't',
                (_, TrackState::Confirmed) => 'C',
                (_, TrackState::Coasting) => 'c',
            }
        };
        sweeps.chars().enumerate().map(after).collect()
    }

    // verifies TRA-013
    #[test]
    fn a_track_is_confirmed_by_three_sightings_in_five_sweeps() {
        assert_eq!(play("xx"), "tC");
        assert_eq!(play(".x.x"), "tttC");
        assert_eq!(play("..."), "tt-");
        assert_eq!(play(".x.."), "ttt-");
        // The first has left the window of five.
        assert_eq!(play("x..x.x"), "tttCcC");
    }

    // verifies TRA-014
    #[test]
    fn a_confirmed_track_is_given_up_after_so_many_misses_in_a_row() {
        assert_eq!(play("xx...x...."), "tCcccCccc-");
    }

    // verifies TRA-009
    #[test]
    fn sweeps_that_could_not_show_it_do_not_count() {
        assert_eq!(play("   x   x"), "ttttttt".to_owned() + "C");
        assert_eq!(play("xx          x"), "tCccccccccccC");
        assert_eq!(play("xx. . . ."), "tCcccccc-");
    }

    #[test]
    fn what_is_seen_and_tells_nothing_of_where_it_is_coasts_and_is_not_missed() {
        assert_eq!(play("xxoooooox"), "tCccccccC");
    }

    #[test]
    fn ages_count_sweeps_by_number() {
        let mut life = Life::born(10, &PARAMS);
        assert_eq!(life.ages(10), (1, 0));
        life.seen(12, &PARAMS);
        assert_eq!(life.ages(15), (6, 3));
        assert_eq!(life.ages(u64::MAX), (u32::MAX, u32::MAX));
    }

    #[test]
    fn a_window_of_any_length_that_is_allowed_holds() {
        for sweeps in 1..=32 {
            let params = LifecycleParams { confirm_hits: sweeps, confirm_sweeps: sweeps, ..PARAMS };
            let mut life = Life::born(0, &params);
            for sweep in 1..u64::from(sweeps) {
                assert!(!life.is_confirmed() && !life.is_over(&params));
                life.seen(sweep, &params);
            }
            assert!(life.is_confirmed());
        }
    }
}
