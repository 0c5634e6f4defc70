use serde::{Deserialize, Serialize};

use crate::segments::Segment;

/// Sweeps that are kept by name.
const KEPT: usize = 10;

/// A sweep that took long.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorstSweep {
    /// Its number.
    pub sweep: u64,
    /// From its last return to its last detection sent [ms].
    pub end_to_end_ms: f64,
    /// The longest segment of its way: `source late`, or a stage and `queued`, `transport`, `busy`.
    pub cause: String,
}

/// The sweeps that took longest so far, longest first; of equals the earlier.
#[derive(Default)]
pub(crate) struct Worst {
    kept: [Option<(u64, u64, Segment)>; KEPT],
}

impl Worst {
    pub(crate) fn add(&mut self, sweep: u64, end_to_end_ns: u64, cause: Segment) {
        let longer = |kept: &Option<(u64, u64, Segment)>| kept.is_none_or(|(_, ns, _)| end_to_end_ns > ns);
        let Some(place) = self.kept.iter().position(longer) else { return };
        self.kept[place..].rotate_right(1);
        self.kept[place] = Some((sweep, end_to_end_ns, cause));
    }

    pub(crate) fn snapshot(&self, name: impl Fn(Segment) -> String) -> Vec<WorstSweep> {
        let kept = self.kept.iter().flatten();
        kept.map(|&(sweep, ns, cause)| WorstSweep { sweep, end_to_end_ms: ns as f64 / 1e6, cause: name(cause) })
            .collect()
    }
}

/// The longest of both.
pub(crate) fn merge(worst: &mut Vec<WorstSweep>, later: &[WorstSweep]) {
    worst.extend_from_slice(later);
    worst.sort_by(|a, b| b.end_to_end_ms.total_cmp(&a.end_to_end_ms).then(a.sweep.cmp(&b.sweep)));
    worst.truncate(KEPT);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ten_longest_are_kept_longest_first() {
        let mut sut = Worst::default();
        for sweep in 0..100_u64 {
            sut.add(sweep, (sweep * 37 % 100) * 1_000_000, Segment::SourceLate);
        }
        let worst = sut.snapshot(|_| String::new());
        let times: Vec<f64> = worst.iter().map(|worst| worst.end_to_end_ms).collect();
        assert_eq!(times, [99.0, 98.0, 97.0, 96.0, 95.0, 94.0, 93.0, 92.0, 91.0, 90.0]);
        assert!(worst.iter().all(|worst| worst.sweep * 37 % 100 == worst.end_to_end_ms as u64));
    }

    #[test]
    fn two_lives_keep_the_longest_of_both() {
        let of = |times: &[u64]| {
            let mut sut = Worst::default();
            times.iter().for_each(|&ms| sut.add(ms, ms * 1_000_000, Segment::SourceLate));
            sut.snapshot(|_| "source late".to_owned())
        };
        let mut one = of(&[1, 3, 5, 7, 9, 11, 13, 15]);
        merge(&mut one, &of(&[2, 4, 6, 8, 10, 12]));
        assert_eq!(one, of(&[15, 13, 12, 11, 10, 9, 8, 7, 6, 5]));
    }
}
