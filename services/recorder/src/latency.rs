use hdrhistogram::{CreationError, Histogram};
use serde::{Deserialize, Serialize};

/// Finest and longest time told apart [ns]: 1 µs and 1 h.
const BOUNDS_NS: (u64, u64) = (1_000, 3_600_000_000_000);
const SIGNIFICANT_DIGITS: u8 = 3;
/// Values that a snapshot has room for at once: so many are told apart over four octaves.
const ROOM: usize = 4_096;

/// A distribution of times. All memory is made with it.
pub(crate) struct Latency {
    histogram: Histogram<u64>,
    /// Values over an hour; counted there as an hour.
    beyond: u64,
}

impl Latency {
    pub(crate) fn new() -> Result<Self, CreationError> {
        let (low, high) = BOUNDS_NS;
        let mut histogram = Histogram::new_with_bounds(low, high, SIGNIFICANT_DIGITS)?;
        // Zeroed memory is the process's own only once it is written to: now, not when a rare latency comes.
        std::hint::black_box(&mut histogram).clear();
        Ok(Self { histogram, beyond: 0 })
    }

    pub(crate) fn record(&mut self, value_ns: u64) {
        self.record_n(value_ns, 1);
    }

    /// Records the same value `count` times.
    pub(crate) fn record_n(&mut self, value_ns: u64, count: u64) {
        self.beyond += if Self::is_beyond(value_ns) { count } else { 0 };
        self.histogram.saturating_record_n(value_ns.min(BOUNDS_NS.1), count);
    }

    /// Whether a value counts as an hour only.
    pub(crate) fn is_beyond(value_ns: u64) -> bool {
        value_ns > BOUNDS_NS.1
    }

    pub(crate) fn snapshot_into(&self, snapshot: &mut LatencySnapshot) {
        snapshot.beyond = self.beyond;
        snapshot.values_ns.reserve(ROOM.saturating_sub(snapshot.values_ns.len()));
        snapshot.values_ns.clear();
        snapshot.values_ns.extend(self.histogram.iter_recorded().map(|step| {
            let value = step.value_iterated_to();
            // The first bucket holds what is shorter than can be told: nothing, not half a microsecond.
            let value = if self.histogram.lowest_equivalent(value) == 0 { 0 } else { value };
            [value, step.count_since_last_iteration()]
        }));
    }
}

/// A distribution of times.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LatencySnapshot {
    /// Value [ns] and how often, by rising value; values are told apart to three digits.
    pub values_ns: Vec<[u64; 2]>,
    /// How many of them were over an hour; they count as an hour.
    pub beyond: u64,
}

/// What reports show of a distribution. All null where nothing was measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Number of values.
    pub count: u64,
    /// Median [ms].
    pub p50: Option<f64>,
    /// As its name says [ms].
    pub p99: Option<f64>,
    /// As its name says [ms].
    pub p999: Option<f64>,
    /// As its name says [ms].
    pub max: Option<f64>,
}

impl LatencySnapshot {
    /// Number of values.
    pub fn count(&self) -> u64 {
        self.values_ns.iter().map(|[_, count]| count).sum()
    }

    /// The smallest value that at least the share `quantile` of all reaches not beyond [ns]; none without values.
    pub fn quantile_ns(&self, quantile: f64) -> Option<u64> {
        let rank = ((quantile * self.count() as f64).ceil() as u64).max(1);
        let mut seen = 0;
        for &[value, count] in &self.values_ns {
            seen += count;
            if seen >= rank {
                return Some(value);
            }
        }
        self.values_ns.last().map(|&[value, _]| value)
    }

    /// The distribution in at most a few hundred points, closer towards its end: value [ns], and how many values are not
    /// beyond it. The last one is the longest of all.
    ///
    /// A point is given where the share of longer ones has become 10 % less than at the point before.
    pub fn points(&self) -> Vec<[u64; 2]> {
        let all = self.count();
        let (mut seen, mut next_beyond) = (0, all as f64);
        let mut points = Vec::new();
        for &[value, count] in &self.values_ns {
            seen += count;
            let beyond = (all - seen) as f64;
            if beyond <= next_beyond {
                points.push([value, seen]);
                next_beyond = 0.9 * beyond;
            }
        }
        points
    }

    /// What reports show.
    pub fn percentiles(&self) -> Percentiles {
        let ms = |quantile| self.quantile_ns(quantile).map(|ns| ns as f64 / 1e6);
        Percentiles { count: self.count(), p50: ms(0.5), p99: ms(0.99), p999: ms(0.999), max: ms(1.0) }
    }

    /// Adds the values of another distribution.
    pub fn merge(&mut self, other: &Self) {
        self.beyond += other.beyond;
        self.values_ns.extend_from_slice(&other.values_ns);
        self.values_ns.sort_unstable();
        self.values_ns.dedup_by(|later, kept| {
            let same = later[0] == kept[0];
            kept[1] += if same { later[1] } else { 0 };
            same
        });
    }
}
