use std::collections::BTreeMap;

use messages::{TrackState, TrackTable};

/// Time that a trail spans [ns].
pub(crate) const TRAIL_NS: u64 = 3_000_000_000;
/// Least time between two points of a trail [ns].
const STEP_NS: u64 = 150_000_000;

/// Where tracks were, sweep after sweep: what trails are drawn from.
#[derive(Debug, Default)]
pub(crate) struct Paths {
    sweeps: BTreeMap<u32, Places>,
}

/// Those of one sweep, in order of their numbers.
#[derive(Debug)]
struct Places {
    time_ns: u64,
    tracks: Vec<(u64, [f32; 3])>,
}

impl Places {
    fn of(&self, track: u64) -> Option<[f32; 3]> {
        let place = self.tracks.binary_search_by_key(&track, |(number, _)| *number).ok()?;
        self.tracks.get(place).map(|(_, at_m)| *at_m)
    }
}

impl Paths {
    /// Notes the table of a sweep. Tentative tracks leave no trail: most of them are clutter.
    pub(crate) fn note(&mut self, sweep: u32, table: &TrackTable) {
        let believed = table.tracks.iter().filter(|track| track.state != TrackState::Tentative);
        let mut tracks: Vec<_> = believed.map(|track| (track.id, track.position_m)).collect();
        tracks.sort_unstable_by_key(|(number, _)| *number);
        self.sweeps.insert(sweep, Places { time_ns: table.time_ns, tracks });
    }

    /// Forgets all but so many sweeps, the newest.
    pub(crate) fn keep(&mut self, sweeps: usize) {
        while self.sweeps.len() > sweeps {
            self.sweeps.pop_first();
        }
    }

    /// Where each track of a sweep's table was before [m], the latest first, each as the sensor saw it then; back to where
    /// the track began, was not known, or the sensor's clock was set.
    pub(crate) fn trails(&self, sweep: u32, table: &TrackTable) -> Vec<Vec<[f32; 3]>> {
        let mut before = Vec::new();
        let (mut last_ns, mut shown_ns) = (table.time_ns, table.time_ns);
        for places in self.sweeps.range(..sweep).rev().map(|(_, places)| places) {
            if places.time_ns >= last_ns || table.time_ns - places.time_ns > TRAIL_NS {
                break;
            }
            last_ns = places.time_ns;
            if shown_ns - last_ns >= STEP_NS {
                shown_ns = last_ns;
                before.push(places);
            }
        }
        let trail = |track: u64| before.iter().map_while(|places| places.of(track)).collect();
        table.tracks.iter().map(|track| trail(track.id)).collect()
    }
}

#[cfg(test)]
mod tests {
    use messages::Track;
    use zerocopy::FromZeros;

    use super::*;

    fn table(time_ms: u64, tracks: &[(u64, f32)]) -> Box<TrackTable> {
        let mut table = TrackTable::new_box_zeroed().unwrap();
        table.time_ns = time_ms * 1_000_000;
        for &(id, x) in tracks {
            let track = Track { id, position_m: [x, 0.0, 0.0], state: TrackState::Confirmed, ..Track::default() };
            table.tracks.push(track).unwrap();
        }
        table
    }

    /// The trails' x.
    fn trails(sut: &Paths, sweep: u32, table: &TrackTable) -> Vec<Vec<f32>> {
        let xs = |trail: Vec<[f32; 3]>| trail.into_iter().map(|[x, ..]| x).collect();
        sut.trails(sweep, table).into_iter().map(xs).collect()
    }

    #[test]
    fn a_trail_goes_back_three_seconds_in_steps_and_each_track_has_its_own() {
        let mut sut = Paths::default();
        let at = |sweep: u32| table(1_000 + 100 * u64::from(sweep), &[(9, sweep as f32), (2, -1.0)]);
        (0..=40).for_each(|sweep| sut.note(sweep, &at(sweep)));
        let [first, second] = &trails(&sut, 40, &at(40))[..] else { panic!("two tracks") };
        assert_eq!(first[..], (5..20).rev().map(|place| 2.0 * place as f32).collect::<Vec<_>>());
        assert_eq!(second[..], [-1.0; 15]);
        sut.keep(3);
        assert_eq!(trails(&sut, 40, &at(40))[0], [38.0]);
    }

    #[test]
    fn a_trail_ends_where_its_track_was_not_there_and_where_the_clock_was_set() {
        let mut sut = Paths::default();
        sut.note(0, &table(1_000, &[(7, 0.0)]));
        sut.note(1, &table(1_200, &[]));
        sut.note(2, &table(1_400, &[(7, 2.0)]));
        assert_eq!(trails(&sut, 3, &table(1_600, &[(7, 3.0), (8, 0.0)])), [vec![2.0], vec![]]);
        assert_eq!(trails(&sut, 3, &table(900, &[(7, 3.0)])), [vec![0.0; 0]], "the clock was set back");
        assert_eq!(trails(&sut, 3, &table(90_000, &[(7, 3.0)])), [vec![0.0; 0]], "or on");
    }

    #[test]
    fn tentative_tracks_leave_no_trail() {
        let mut sut = Paths::default();
        let mut early = table(1_000, &[(7, 0.0)]);
        early.tracks[0].state = TrackState::Tentative;
        sut.note(0, &early);
        assert_eq!(trails(&sut, 1, &table(1_200, &[(7, 1.0)])), [vec![0.0; 0]]);
    }
}
