//! The timeline and the distributions as reports hold them: rows and columns of a few hundred entries.

use std::collections::BTreeMap;

use lidar::ObstacleClass;
use serde::{Deserialize, Serialize};

use crate::{BucketSnapshot, LatencySnapshot, Snapshot, TimelineSnapshot};

/// How sweeps went over time, which counts from a start [s]; the first bucket may begin before it.
///
/// Buckets are of equal length; empty ones are left out.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct SweepTimeline {
    /// Length of a bucket [s]: 0.25, doubled as often as the run needs.
    pub bucket_s: f64,
    /// Latency end to end, by bucket.
    pub latency_ms: Vec<LatencyBucket>,
    /// Where the time of the answered sweeps' last parts went, by stage: one entry for each of `latency_ms`.
    pub spent_ms: Vec<SpentTime>,
    /// Detections by class: one entry for each of `latency_ms`.
    pub detections: BTreeMap<ObstacleClass, Vec<u64>>,
}

/// Sweeps of one bucket of time, counted at their answers.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct LatencyBucket {
    /// Begin [s].
    pub t_s: f64,
    /// Answered sweeps.
    pub sweeps: u64,
    /// Median [ms], to 3.1 %; null without answers.
    pub p50: Option<f64>,
    /// As its name says [ms], to 3.1 %.
    pub p99: Option<f64>,
    /// As its name says [ms], exact.
    pub max: Option<f64>,
    /// Sweeps answered after the deadline, and rejected ones.
    pub misses: u64,
    /// Sweeps that never came, found when the next one came.
    pub missing: u64,
}

/// One stage's share of the way of the sweeps' last parts: means [ms]; 0 without answers. All stages' shares add up to
/// the mean latency.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct SpentTime {
    /// The stage.
    pub stage: String,
    /// The source only: how late it sent.
    pub late: Vec<f64>,
    /// Sent and free until started.
    pub transport: Vec<f64>,
    /// Sent, and the stage busy with parts before.
    pub queued: Vec<f64>,
    /// In `process`.
    pub busy: Vec<f64>,
}

/// Distributions in points: latency [ms], and how many values are not beyond it; the last is the longest.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct LatencyPoints {
    /// Of every sweep that was answered.
    pub end_to_end: Vec<(f64, u64)>,
    /// With those that were not.
    pub end_to_end_corrected: Vec<(f64, u64)>,
    /// Of obstacles.
    pub obstacle: Vec<(f64, u64)>,
    /// Of obstacles on the seam.
    pub seam: Vec<(f64, u64)>,
}

impl LatencyPoints {
    /// Those of a recorder.
    pub fn of(snapshot: &Snapshot) -> Self {
        let points = |latency: &LatencySnapshot| -> Vec<(f64, u64)> {
            latency.points().into_iter().map(|[ns, count]| (ns as f64 / 1e6, count)).collect()
        };
        Self {
            end_to_end: points(&snapshot.end_to_end),
            end_to_end_corrected: points(&snapshot.end_to_end_corrected),
            obstacle: points(&snapshot.obstacle),
            seam: points(&snapshot.seam),
        }
    }
}

fn rounded(value: f64, digits: i32) -> f64 {
    let scale = 10_f64.powi(digits);
    (value * scale).round() / scale
}

impl SweepTimeline {
    /// The sweeps of `timeline`, in time from host time `started_ns` on; `stages` are the names by position.
    pub fn of(timeline: &TimelineSnapshot, stages: &[&str], started_ns: u64) -> Self {
        let from_start_s = |at_ns: u64| rounded((i128::from(at_ns) - i128::from(started_ns)) as f64 / 1e9, 3);
        let ms = |ns: u64| ns as f64 / 1e6;
        let mut report = Self { bucket_s: timeline.bucket_ns as f64 / 1e9, ..Self::default() };
        report
            .spent_ms
            .extend(stages.iter().map(|&stage| SpentTime { stage: stage.to_owned(), ..SpentTime::default() }));
        let something = |bucket: &BucketSnapshot| *bucket != BucketSnapshot::default();
        for (begin_ns, bucket) in timeline.iter().filter(|(_, bucket)| something(bucket)) {
            report.latency_ms.push(LatencyBucket {
                t_s: from_start_s(begin_ns),
                sweeps: bucket.sweeps,
                p50: bucket.quantile_ns(0.5).map(|ns| rounded(ms(ns), 3)),
                p99: bucket.quantile_ns(0.99).map(|ns| rounded(ms(ns), 3)),
                max: (bucket.sweeps > 0).then_some(ms(bucket.max_ns)),
                misses: bucket.misses,
                missing: bucket.missing,
            });
            let mean_ms = |sum_ns: u64| rounded(ms(sum_ns) / bucket.sweeps.max(1) as f64, 4);
            for (place, spent) in report.spent_ms.iter_mut().enumerate() {
                let [transport, queued, busy] = bucket.spent_ns.get(place).copied().unwrap_or_default();
                if place == 0 {
                    spent.late.push(mean_ms(bucket.source_late_ns));
                    continue;
                }
                spent.transport.push(mean_ms(transport));
                spent.queued.push(mean_ms(queued));
                spent.busy.push(mean_ms(busy));
            }
            for class in ObstacleClass::ALL {
                let count = bucket.detections.get(class as usize).copied().unwrap_or(0);
                report.detections.entry(class).or_default().push(count);
            }
        }
        report
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeps_stand_in_the_time_since_the_start_and_empty_buckets_are_left_out() {
        let bucket = |sweeps: u64, max_ns: u64| BucketSnapshot {
            sweeps,
            max_ns,
            misses: 1,
            source_late_ns: 2_000_000,
            spent_ns: vec![[0; 3], [1_000_000, 0, 4_000_000]],
            detections: vec![3, 0, 0, 0, 1],
            ..BucketSnapshot::default()
        };
        let buckets = vec![bucket(2, 5_000_000), BucketSnapshot::default(), bucket(1, 9_000_000)];
        let timeline =
            TimelineSnapshot { begin_ns: 10_000_000_000, first_ns: 10_000_000_000, bucket_ns: 250_000_000, buckets };
        let report = SweepTimeline::of(&timeline, &["source", "clusterer"], 10_100_000_000);
        let times: Vec<f64> = report.latency_ms.iter().map(|bucket| bucket.t_s).collect();
        assert_eq!((report.bucket_s, times), (0.25, vec![-0.1, 0.4]));
        assert_eq!(report.latency_ms[1].max, Some(9.0));
        assert_eq!(report.spent_ms[0].late, [1.0, 2.0]);
        assert_eq!(report.spent_ms[1].busy, [2.0, 4.0]);
        assert_eq!(report.detections[&ObstacleClass::ALL[0]].len(), 2);
    }
}
