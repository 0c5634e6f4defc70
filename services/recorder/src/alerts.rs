//! Which alerts have begun: each track is told of once, until it is no longer on alert. And how many tracks there were.

use messages::{MAX_TRACKS, TrackState, TrackTable};
use stage::Alert;

use crate::snapshot::TrackCounts;

/// Tracks on alert at the last table, and those that began with it. All memory is made with it.
pub(crate) struct Alerts {
    /// Numbers of tracks on alert, in rising order.
    known: Vec<u64>,
    begun: Vec<Alert>,
    counts: Option<TrackCounts>,
}

impl Alerts {
    pub(crate) fn new() -> Self {
        Self { known: Vec::with_capacity(MAX_TRACKS), begun: Vec::with_capacity(MAX_TRACKS), counts: None }
    }

    /// Those that began with the last part.
    pub(crate) fn begun(&self) -> &[Alert] {
        &self.begun
    }

    /// What all tables held; none where none came.
    pub(crate) fn counts(&self) -> Option<TrackCounts> {
        self.counts
    }

    /// A part comes that has no table.
    pub(crate) fn clear(&mut self) {
        self.begun.clear();
    }

    /// Notes a table, where there is one.
    pub(crate) fn note(&mut self, table: &TrackTable) {
        self.begun.clear();
        if table.time_ns == 0 {
            return;
        }
        let on_alert = || table.tracks.iter().filter(|track| track.alert != 0);
        let new = on_alert().filter(|track| self.known.binary_search(&track.id).is_err());
        self.begun.extend(new.map(|track| Alert {
            track: track.id,
            time_s: track.approach.time_s,
            collision_probability: track.approach.collision_probability,
        }));
        self.known.clear();
        self.known.extend(on_alert().map(|track| track.id));
        self.known.sort_unstable();
        let confirmed = table.tracks.iter().filter(|track| track.state != TrackState::Tentative).count() as u64;
        let alerts = self.begun.len() as u64;
        let counts = TrackCounts { confirmed_max: confirmed, confirmed_last: confirmed, alerts };
        self.counts.get_or_insert_default().merge(&counts);
    }
}

#[cfg(test)]
mod tests {
    use messages::Track;
    use zerocopy::FromZeros;

    use super::*;

    #[test]
    fn each_alert_is_told_once_until_it_has_ended() {
        let mut sut = Alerts::new();
        let mut told = |time_ns: u64, on_alert: &[u64]| {
            let mut table = TrackTable::new_box_zeroed().unwrap();
            table.time_ns = time_ns;
            for id in 0..4 {
                let alert = u8::from(on_alert.contains(&id));
                table.tracks.push(Track { id, alert, ..Track::default() }).unwrap();
            }
            sut.note(&table);
            sut.begun().iter().map(|alert| alert.track).collect::<Vec<_>>()
        };
        assert_eq!(told(1, &[2]), [2]);
        assert_eq!(told(2, &[1, 2]), [1]);
        assert_eq!(told(0, &[]), [0_u64; 0], "no table says nothing");
        assert_eq!(told(3, &[1]), [0_u64; 0]);
        assert_eq!(told(4, &[1, 2]), [2]);
    }
}
