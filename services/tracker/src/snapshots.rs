use crate::tracking::Tracks;

/// Sweeps that can be gone back: where parts are sent again, all sweeps in flight may come once more, and there are fewer
/// of them than a queue of the chain holds (`queue_sweeps`, 8 as shipped).
pub(crate) const SNAPSHOTS: usize = 16;

/// The tracks as they were before each of the latest sweeps.
#[derive(Debug)]
pub(crate) struct Snapshots {
    /// From the oldest to the latest; those beyond `count` are spare memory.
    ring: Vec<Snapshot>,
    count: usize,
    /// Whether all sweeps since the begin are here.
    complete: bool,
}

#[derive(Clone, Debug)]
struct Snapshot {
    sweep: u64,
    before: Tracks,
}

impl Snapshots {
    /// Takes all memory; it is touched only as far as there are tracks.
    pub(crate) fn new() -> Self {
        let ring = (0..SNAPSHOTS).map(|_| Snapshot { sweep: 0, before: Tracks::new() }).collect();
        Self { ring, count: 0, complete: true }
    }

    /// Begins with tracks that somebody else followed before: nothing earlier can be gone back to.
    pub(crate) fn forget(&mut self) {
        (self.count, self.complete) = (0, false);
    }

    /// Keeps the tracks as they are before a sweep later than all kept.
    pub(crate) fn keep(&mut self, sweep: u64, before: &Tracks) {
        if self.count == SNAPSHOTS {
            self.ring.rotate_left(1);
            self.count -= 1;
            self.complete = false;
        }
        let snapshot = &mut self.ring[self.count];
        snapshot.sweep = sweep;
        snapshot.before.copy_from(before);
        self.count += 1;
    }

    /// Makes the tracks those before a sweep, where it, or a later one, was processed. Where that was too long ago, all
    /// begins anew.
    pub(crate) fn go_back(&mut self, sweep: u64, tracks: &mut Tracks) {
        let kept = self.ring[..self.count].partition_point(|snapshot| snapshot.sweep < sweep);
        let Some(first_after) = self.ring[..self.count].get(kept) else { return };
        if kept > 0 || self.complete || first_after.sweep == sweep {
            tracks.copy_from(&first_after.before);
        } else {
            tracks.begin_anew();
        }
        self.count = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(clock: u64) -> Tracks {
        let mut tracks = Tracks::new();
        tracks.set_next_id(clock);
        tracks
    }

    /// What the tracks are after going back to a sweep, when sweeps 10, 12, 14 … were processed.
    fn back(processed: u64, sweep: u64) -> u64 {
        let mut sut = Snapshots::new();
        for number in 0..processed {
            sut.keep(10 + 2 * number, &at(100 + number));
        }
        let mut tracks = at(99_999);
        sut.go_back(sweep, &mut tracks);
        tracks.next_id()
    }

    // verifies TRA-016
    #[test]
    fn the_tracks_are_again_what_they_were_before_a_sweep() {
        assert_eq!(back(5, 14), 102);
        // Left out at first, and sent now: before the next that was there.
        assert_eq!(back(5, 13), 102);
        assert_eq!(back(5, 3), 100);
        assert_eq!(back(5, 19), 99_999);
        // The oldest that is kept is the 16th last.
        assert_eq!(back(20, 10 + 2 * 4), 104);
    }

    #[test]
    fn a_sweep_that_is_too_long_ago_begins_all_anew_with_numbers_that_were_never_given() {
        assert_eq!(back(20, 10), 99_999);
    }
}
