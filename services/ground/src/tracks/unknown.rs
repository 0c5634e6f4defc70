//! What can be said of tracks where no truth is known: of a sensor that hardly moves, among things that hardly do.

use std::collections::{BTreeMap, BTreeSet};

use messages::{Detections, MIN_FEATURE_POINTS, TrackState, TrackTable};
use stage::{Next, Source};

use super::chase::{Chase, Rooms};
use super::frame::is_believed;
use super::trails::Trails;
use crate::bars::quantile;
use crate::{EvaluateError, Share, View};

/// Sweeps after which births count: before, everything is new.
const SETTLED: u64 = 30;

/// Age from which a track's speed counts \[sweeps\].
const AGED: u32 = 10;

/// Clusters of two sweeps are taken for the same when each is nearest to the other, and so near \[m\].
const SAME_M: f64 = 0.3;

/// Tracks of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UnknownTracks {
    /// Sweeps of the recording.
    pub sweeps: u64,
    /// Sweeps that the tracker would not take.
    pub rejected: u64,
    /// Numbers that were ever confirmed, and that never were.
    pub confirmed: u32,
    /// Numbers that never were.
    pub unconfirmed: u32,
    /// Sweeps from the first appearance of a confirmed number to its last: first decile, quartile, median, quartile,
    /// ninth decile, most; none without a track.
    pub length_sweeps: Option<[f64; 6]>,
    /// Tracks that are believed, a sweep: median; none without a sweep.
    pub believed: Option<f64>,
    /// Of these, those seen in the sweep.
    pub seen: Share,
    /// Speed of tracks seen in the sweep and at least ten sweeps old \[m/s\]: first decile, quartile, median, quartile,
    /// ninth decile, 99th percentile.
    pub speed_mps: Option<[f64; 6]>,
    /// The same, of clusters of at least 50 points.
    pub large_speed_mps: Option<[f64; 6]>,
    /// Numbers that first appear after 30 sweeps, and sweeps after these.
    pub births: (u32, u64),
    /// Numbers first confirmed after 30 sweeps.
    pub confirmed_births: u32,
    /// Clusters of at least 5 points that belong to a track that is believed.
    pub covered: Share,
    /// Clusters of two sweeps in a row that are each other's nearest within 0.3 m and of believed tracks: those whose
    /// number changed.
    pub changed: Share,
    /// Ways of tracks that are believed.
    pub(crate) trails: Trails,
}

/// A cluster that a track was seen as.
struct Known {
    centroid_m: [f32; 3],
    track: Option<u64>,
}

impl UnknownTracks {
    /// Follows the source's sweeps to its end, at most `sweeps` of them. `scene` only lends its stages.
    ///
    /// # Errors
    /// A source that fails, or a classifier that rejects.
    pub(crate) fn of(
        source: &mut impl Source,
        sweeps: u64,
        scene: &str,
        rooms: Rooms<'_>,
    ) -> Result<Self, EvaluateError> {
        let mut chase = Chase::new(&View::of(scene), rooms)?;
        let mut tally = Tally::default();
        while tally.sum.sweeps < sweeps {
            let (next, verdict) = chase.follow(|sweep, truth| source.next(sweep, truth), &mut |work| work())?;
            if next.map_err(|cause| EvaluateError::Recording(cause.to_string()))? == Next::End {
                break;
            }
            let seen = chase.seen();
            tally.add(verdict.is_rejected() || seen.table.time_ns == 0, seen.detections, seen.table);
        }
        Ok(tally.finish())
    }
}

#[derive(Default)]
struct Tally {
    sum: UnknownTracks,
    /// First and last sweep of each number, and the first in which it was believed.
    lives: BTreeMap<u64, (u64, u64, Option<u64>)>,
    believed: Vec<f64>,
    speeds_mps: Vec<f64>,
    large_speeds_mps: Vec<f64>,
    last: Vec<Known>,
}

impl Tally {
    fn add(&mut self, is_rejected: bool, detections: &Detections, table: &TrackTable) {
        let sweep = self.sum.sweeps;
        self.sum.sweeps += 1;
        if is_rejected {
            self.sum.rejected += 1;
            self.last.clear();
            return;
        }
        let points: BTreeMap<u32, u32> =
            detections.detections.iter().map(|one| (one.summary.key, one.summary.points)).collect();
        let mut track_of = BTreeMap::new();
        let mut believed = 0;
        for track in &table.tracks {
            let life = self.lives.entry(track.id).or_insert((sweep, sweep, None));
            life.1 = sweep;
            if !is_believed(track) {
                continue;
            }
            life.2.get_or_insert(sweep);
            believed += 1;
            self.sum.trails.note(track);
            let keys = table.keys_of(track);
            track_of.extend(keys.iter().map(|&key| (key, track.id)));
            let is_seen = track.state == TrackState::Confirmed;
            self.sum.seen.add(is_seen);
            if is_seen && track.age_sweeps >= AGED {
                let speed_mps = track.velocity_mps.map(|one| f64::from(one).powi(2)).iter().sum::<f64>().sqrt();
                self.speeds_mps.push(speed_mps);
                if keys.iter().filter_map(|key| points.get(key)).sum::<u32>() >= 50 {
                    self.large_speeds_mps.push(speed_mps);
                }
            }
        }
        self.believed.push(f64::from(believed));
        let large = detections.detections.iter().filter(|one| one.summary.points as usize >= MIN_FEATURE_POINTS);
        let now: Vec<Known> = large
            .map(|one| Known { centroid_m: one.summary.centroid_m, track: track_of.get(&one.summary.key).copied() })
            .collect();
        for (place, one) in now.iter().enumerate() {
            self.sum.covered.add(one.track.is_some());
            let Some(before) = nearest(&self.last, one) else { continue };
            if nearest(&now, &self.last[before]) != Some(place) {
                continue;
            }
            if let (Some(before), Some(track)) = (self.last[before].track, one.track) {
                self.sum.changed.add(before != track);
            }
        }
        self.last = now;
    }

    fn finish(mut self) -> UnknownTracks {
        let confirmed: BTreeSet<u64> = self.lives.iter().filter(|one| one.1.2.is_some()).map(|one| *one.0).collect();
        let lengths = confirmed.iter().filter_map(|id| self.lives.get(id)).map(|life| (life.1 + 1 - life.0) as f64);
        let quantiles = |values: &Vec<f64>, last: f64| -> Option<[f64; 6]> {
            let found = [0.1, 0.25, 0.5, 0.75, 0.9, last].map(|at| quantile(values.clone(), at));
            found[0].map(|_| found.map(Option::unwrap_or_default))
        };
        self.sum.length_sweeps = quantiles(&lengths.collect(), 1.0);
        self.sum.speed_mps = quantiles(&self.speeds_mps, 0.99);
        self.sum.large_speed_mps = quantiles(&self.large_speeds_mps, 0.99);
        self.sum.believed = quantile(self.believed, 0.5);
        self.sum.confirmed = confirmed.len() as u32;
        self.sum.unconfirmed = (self.lives.len() - confirmed.len()) as u32;
        let born = self.lives.values().filter(|life| life.0 >= SETTLED).count() as u32;
        self.sum.births = (born, self.sum.sweeps.saturating_sub(SETTLED));
        let late = |life: &&(u64, u64, Option<u64>)| life.2.is_some_and(|sweep| sweep >= SETTLED);
        self.sum.confirmed_births = self.lives.values().filter(late).count() as u32;
        self.sum
    }
}

/// Place of the cluster nearest to another, within reach; the first of equals.
fn nearest(among: &[Known], to: &Known) -> Option<usize> {
    let square =
        |one: &Known| -> f64 { (0..3).map(|axis| f64::from(one.centroid_m[axis] - to.centroid_m[axis]).powi(2)).sum() };
    let near = among.iter().map(square).enumerate().filter(|(_, square)| *square <= SAME_M * SAME_M);
    near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(place, _)| place)
}

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, Detection, Message, Track};
    use zerocopy::FromZeros;

    use super::super::TracksNote;
    use super::*;
    use crate::RunNote;

    /// Two clusters side by side, and a track on each by these numbers.
    fn sweep(detections: &mut Detections, table: &mut TrackTable, ids: [u64; 2], age_sweeps: u32) {
        detections.clear();
        table.clear();
        table.time_ns = 1;
        for (place, id) in (0..).zip(ids) {
            let summary =
                ClusterSummary { key: place, points: 5, centroid_m: [place as f32, 0.0, 0.0], ..Default::default() };
            detections.detections.push(Detection { summary, ..Detection::default() }).unwrap();
            table.keys.push(place).unwrap();
            let state = if age_sweeps > 2 { TrackState::Confirmed } else { TrackState::Tentative };
            let velocity_mps = [0.0, 0.3, 0.4];
            let track = Track { id, first_key: place, keys: 1, state, age_sweeps, velocity_mps, ..Track::default() };
            table.tracks.push(track).unwrap();
        }
    }

    #[test]
    fn births_changes_of_number_and_speeds_are_counted() {
        let mut detections = Detections::new_box_zeroed().unwrap();
        let mut table = TrackTable::new_box_zeroed().unwrap();
        let mut tally = Tally::default();
        for number in 0..40_u64 {
            // One number changes in the 36th sweep.
            sweep(&mut detections, &mut table, [1, if number < 35 { 2 } else { 3 }], number as u32 + 1);
            tally.add(false, &detections, &table);
        }
        detections.clear();
        table.clear();
        tally.add(true, &detections, &table);
        let sut = tally.finish();
        assert_eq!((sut.sweeps, sut.rejected, sut.confirmed, sut.unconfirmed), (41, 1, 3, 0));
        assert_eq!((sut.births, sut.confirmed_births), ((1, 11), 1));
        assert_eq!(sut.changed, Share { count: 1, of: 2 * 37 });
        assert_eq!(sut.covered, Share { count: 2 * 38, of: 2 * 40 });
        assert_eq!(sut.length_sweeps.map(|lengths| (lengths[0], lengths[5])), Some((5.0, 40.0)));
        assert!((sut.speed_mps.unwrap()[2] - 0.5).abs() < 1e-6 && sut.large_speed_mps.is_none());
        assert_eq!((sut.believed, sut.seen), (Some(2.0), Share { count: 76, of: 76 }));
        let run = RunNote { plan_file: String::new(), machine: String::new(), cores: 2, duration_s: 1.0 };
        let page = sut.to_html(&TracksNote { classifier: String::new(), recording: Some("<a>.pcap".to_owned()), run });
        assert!(
            page.contains("<dd>&lt;a&gt;.pcap</dd>") && page.contains("<td class=\"n\">1.4 % (1 of 74)</td>"),
            "{page}"
        );
        assert_eq!(page.matches("<polyline").count(), 3);
        assert_eq!(Tally::default().finish(), UnknownTracks::default());
    }
}
