//! How latency, misses, detections and the stages' shares went over the time of a run. Bounded, whatever its length.
//!
//! A sweep counts at the host time of its answer. Percentiles of a bucket of time come from bins of the latency, 16 an
//! octave, of which the middle is told: off by 3.1 % at most between 0.13 ms and 68 s. The maximum is exact.

use lidar::ObstacleClass;
use messages::MAX_HOPS;
use serde::{Deserialize, Serialize};

use crate::buckets::{Buckets, Merge};
use crate::segments::Segments;

/// Most buckets.
const MOST: usize = 600;
/// Length of a bucket at first [ns]: 600 of them are 150 s.
const WIDTH_NS: u64 = 250_000_000;
/// Bins an octave, as a power of two.
const FINE_BITS: u32 = 4;
/// Shortest latency told apart, as a power of two [ns]: 0.13 ms.
const LEAST_BITS: u32 = 17;
/// Longest, the same: 68.7 s.
const MOST_BITS: u32 = 36;
const BINS: usize = ((MOST_BITS - LEAST_BITS) << FINE_BITS) as usize + 2;

/// What the statistics had counted at a moment.
#[derive(Clone, Copy, Default)]
pub(crate) struct Counts {
    pub(crate) misses: u64,
    /// Sweeps of which no part came.
    pub(crate) missing: u64,
    pub(crate) detections: [u64; ObstacleClass::ALL.len()],
}

/// One bucket. All memory is in it.
#[derive(Clone)]
struct Bucket {
    /// Answered sweeps.
    sweeps: u64,
    misses: u64,
    missing: u64,
    max_ns: u64,
    source_late_ns: u64,
    /// By hop: sums over the answered sweeps' last parts of transport, queued and busy time.
    spent_ns: [[u64; 3]; MAX_HOPS],
    detections: [u64; ObstacleClass::ALL.len()],
    bins: [u32; BINS],
}

impl Default for Bucket {
    fn default() -> Self {
        Self {
            sweeps: 0,
            misses: 0,
            missing: 0,
            max_ns: 0,
            source_late_ns: 0,
            spent_ns: [[0; 3]; MAX_HOPS],
            detections: [0; ObstacleClass::ALL.len()],
            bins: [0; BINS],
        }
    }
}

fn add_all(sums: &mut [u64], more: &[u64]) {
    sums.iter_mut().zip(more).for_each(|(sum, more)| *sum = sum.saturating_add(*more));
}

impl Merge for Bucket {
    fn merge(&mut self, later: &Self) {
        self.sweeps += later.sweeps;
        self.misses += later.misses;
        self.missing += later.missing;
        self.max_ns = self.max_ns.max(later.max_ns);
        self.source_late_ns = self.source_late_ns.saturating_add(later.source_late_ns);
        add_all(self.spent_ns.as_flattened_mut(), later.spent_ns.as_flattened());
        add_all(&mut self.detections, &later.detections);
        self.bins.iter_mut().zip(&later.bins).for_each(|(sum, more)| *sum = sum.saturating_add(*more));
    }
}

/// The bin of a latency.
fn bin(ns: u64) -> usize {
    let Some(octave) = ns.checked_ilog2().filter(|&octave| octave >= LEAST_BITS) else { return 0 };
    let fine = (ns >> (octave - FINE_BITS)) & ((1 << FINE_BITS) - 1);
    (1 + (u64::from(octave - LEAST_BITS) << FINE_BITS) + fine).min(BINS as u64 - 1) as usize
}

/// The middle of a bin [ns].
fn middle_ns(bin: usize) -> u64 {
    let Some(place) = bin.checked_sub(1) else { return 1 << (LEAST_BITS - 1) };
    let (octave, fine) = (LEAST_BITS + (place as u32 >> FINE_BITS), place as u64 & ((1 << FINE_BITS) - 1));
    (2 * (fine + (1 << FINE_BITS)) + 1) << (octave - FINE_BITS - 1)
}

/// The timeline of one life.
pub(crate) struct Timeline {
    buckets: Buckets<Bucket>,
    /// Host time of the first part [ns]; none before it.
    first_ns: Option<u64>,
}

impl Timeline {
    pub(crate) fn new() -> Self {
        Self { buckets: Buckets::new(WIDTH_NS, MOST), first_ns: None }
    }

    /// Notes at host time `at_ns` what a part added to the counts, and its sweep's last part if that was an answer.
    pub(crate) fn note(&mut self, at_ns: u64, before: &Counts, after: &Counts, answer: Option<&Segments>) {
        self.first_ns.get_or_insert(at_ns);
        let bucket = self.buckets.at(at_ns);
        bucket.misses += after.misses - before.misses;
        bucket.missing += after.missing - before.missing;
        for (place, sum) in bucket.detections.iter_mut().enumerate() {
            *sum += after.detections[place] - before.detections[place];
        }
        let Some(segments) = answer else { return };
        bucket.sweeps += 1;
        bucket.max_ns = bucket.max_ns.max(segments.end_to_end_ns);
        bucket.source_late_ns = bucket.source_late_ns.saturating_add(segments.source_late_ns);
        for (sums, hop) in bucket.spent_ns.iter_mut().zip(&segments.hops[..segments.hop_count]).skip(1) {
            add_all(sums, &[hop.transport_ns, hop.queued_ns, hop.busy_ns]);
        }
        let bin = &mut bucket.bins[bin(segments.end_to_end_ns)];
        *bin = bin.saturating_add(1);
    }

    pub(crate) fn snapshot_into(&self, snapshot: &mut TimelineSnapshot, stages: usize) {
        snapshot.bucket_ns = self.buckets.width_ns();
        snapshot.first_ns = self.first_ns.unwrap_or(0);
        let mut used = 0;
        for (begin_ns, bucket) in self.buckets.iter() {
            if used == 0 {
                snapshot.begin_ns = begin_ns;
            }
            if used == snapshot.buckets.len() {
                snapshot.buckets.push(BucketSnapshot::with_room());
            }
            bucket.snapshot_into(&mut snapshot.buckets[used], stages);
            used += 1;
        }
        snapshot.buckets.truncate(used);
    }
}

impl Bucket {
    fn snapshot_into(&self, snapshot: &mut BucketSnapshot, stages: usize) {
        snapshot.sweeps = self.sweeps;
        snapshot.misses = self.misses;
        snapshot.missing = self.missing;
        snapshot.max_ns = self.max_ns;
        snapshot.source_late_ns = self.source_late_ns;
        snapshot.spent_ns.clear();
        if self.sweeps > 0 {
            snapshot.spent_ns.extend_from_slice(&self.spent_ns[..stages.min(MAX_HOPS)]);
        }
        snapshot.detections.clear();
        if self.detections.iter().any(|&count| count > 0) {
            snapshot.detections.extend_from_slice(&self.detections);
        }
        let bins = self.bins.iter().zip(0_u32..).filter(|(count, _)| **count > 0);
        snapshot.bins.clear();
        snapshot.bins.extend(bins.map(|(&count, place)| [place, count]));
    }

    fn of(snapshot: &BucketSnapshot) -> Self {
        let mut bucket = Self {
            sweeps: snapshot.sweeps,
            misses: snapshot.misses,
            missing: snapshot.missing,
            max_ns: snapshot.max_ns,
            source_late_ns: snapshot.source_late_ns,
            ..Self::default()
        };
        bucket.spent_ns.iter_mut().zip(&snapshot.spent_ns).for_each(|(to, from)| *to = *from);
        add_all(&mut bucket.detections, &snapshot.detections);
        for &[place, count] in &snapshot.bins {
            if let Some(bin) = bucket.bins.get_mut(place as usize) {
                *bin = count;
            }
        }
        bucket
    }
}

/// A timeline, as files hold it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimelineSnapshot {
    /// Host time at which the first bucket begins [ns].
    pub begin_ns: u64,
    /// Host time of the first part [ns]: sweeps that are missing before it are found then.
    pub first_ns: u64,
    /// Length of a bucket [ns].
    pub bucket_ns: u64,
    /// The buckets in order.
    pub buckets: Vec<BucketSnapshot>,
}

/// One bucket of a [`TimelineSnapshot`]; what is zero is left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BucketSnapshot {
    /// Answered sweeps.
    #[serde(skip_serializing_if = "is_zero")]
    pub sweeps: u64,
    /// Deadline misses.
    #[serde(skip_serializing_if = "is_zero")]
    pub misses: u64,
    /// Sweeps of which no part came, found when the next one came.
    #[serde(skip_serializing_if = "is_zero")]
    pub missing: u64,
    /// Longest latency end to end [ns].
    #[serde(skip_serializing_if = "is_zero")]
    pub max_ns: u64,
    /// Sum over the answered sweeps of how late the source sent their last part [ns].
    #[serde(skip_serializing_if = "is_zero")]
    pub source_late_ns: u64,
    /// By stage, the source (all zeros) first: the same sum of transport, queued and busy time [ns].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub spent_ns: Vec<[u64; 3]>,
    /// By the class's number.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub detections: Vec<u64>,
    /// Bins of the latency that hold something: number and count.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bins: Vec<[u32; 2]>,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

impl BucketSnapshot {
    /// An empty one with room for what a bucket usually holds: latencies of three octaves.
    fn with_room() -> Self {
        Self {
            spent_ns: Vec::with_capacity(MAX_HOPS),
            detections: Vec::with_capacity(ObstacleClass::ALL.len()),
            bins: Vec::with_capacity(3 << FINE_BITS),
            ..Self::default()
        }
    }

    /// The latency that the share `quantile` of the answered sweeps reach not beyond [ns], to 3.1 %; exact where that is
    /// the longest; none without answers.
    pub fn quantile_ns(&self, quantile: f64) -> Option<u64> {
        let rank = ((quantile * self.sweeps as f64).ceil() as u64).clamp(1, self.sweeps.max(1));
        if self.sweeps == 0 {
            return None;
        }
        let mut seen = 0;
        for &[place, count] in &self.bins {
            seen += u64::from(count);
            if seen >= rank {
                return Some(if rank == self.sweeps {
                    self.max_ns
                } else {
                    middle_ns(place as usize).min(self.max_ns)
                });
            }
        }
        Some(self.max_ns)
    }
}

impl TimelineSnapshot {
    /// Begin of each bucket [ns of host time], and what is in it.
    pub fn iter(&self) -> impl Iterator<Item = (u64, &BucketSnapshot)> {
        let begins = (0_u64..).map(|place| self.begin_ns.saturating_add(place.saturating_mul(self.bucket_ns)));
        begins.zip(&self.buckets)
    }

    /// Adds a later life's, of which `missing` sweeps came to neither life.
    pub(crate) fn merge(&mut self, later: &Self, missing: u64, stages: usize) {
        if later.buckets.is_empty() {
            return;
        }
        let mut both = Timeline::new();
        both.first_ns = Some(if self.buckets.is_empty() { later.first_ns } else { self.first_ns });
        for snapshot in [&*self, later] {
            both.buckets.coarsen_to(snapshot.bucket_ns);
            for (begin_ns, bucket) in snapshot.iter() {
                both.buckets.at(begin_ns).merge(&Bucket::of(bucket));
            }
        }
        both.buckets.at(later.first_ns).missing += missing;
        both.snapshot_into(self, stages);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn bins_rise_with_the_latency_and_their_middles_lie_in_them() {
        for place in 1..BINS - 1 {
            assert_eq!(bin(middle_ns(place)), place);
            assert!(middle_ns(place - 1) < middle_ns(place));
        }
        assert_eq!((bin(0), bin((1 << LEAST_BITS) - 1), bin(1 << LEAST_BITS)), (0, 0, 1));
        assert_eq!((bin(u64::MAX), bin(1 << MOST_BITS)), (BINS - 1, BINS - 1));
    }

    proptest! {
        #[test]
        fn the_middle_of_a_bin_is_off_by_a_thirty_second_at_most(ns in (1_u64 << LEAST_BITS)..(1 << MOST_BITS)) {
            prop_assert!(middle_ns(bin(ns)).abs_diff(ns) as f64 <= ns as f64 / 32.0);
        }
    }
}
