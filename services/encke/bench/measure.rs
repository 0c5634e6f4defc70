//! Repeating and summing up; knows nothing of stages.

/// Runs before the first that counts: they fill caches and touch memory for the first time.
const WARM_UP: u32 = 3;

/// One run of a piece of work.
#[derive(Clone, Copy, Debug)]
pub(super) struct Once {
    /// What it took [ns].
    pub(super) ns: u64,
    /// Fingerprint of its output.
    pub(super) output: u64,
}

/// What the runs of a piece of work took [ms].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Times {
    pub(super) median_ms: f64,
    pub(super) min_ms: f64,
}

/// Why the runs say nothing.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(super) enum MeasureError<E> {
    /// The work itself failed.
    #[error(transparent)]
    Work(E),
    /// The same input gave another output.
    #[error("run {0} gave another output than run 1, must give the same")]
    Unlike(u32),
}

/// Does the work [`WARM_UP`] times, then `runs` times (at least once), and sums up the latter.
pub(super) fn repeat<E>(runs: u32, mut work: impl FnMut() -> Result<Once, E>) -> Result<Times, MeasureError<E>> {
    let first = work().map_err(MeasureError::Work)?.output;
    let mut ns = Vec::with_capacity(runs as usize);
    for run in 2..=WARM_UP.saturating_add(runs.max(1)) {
        let once = work().map_err(MeasureError::Work)?;
        if once.output != first {
            return Err(MeasureError::Unlike(run));
        }
        if run > WARM_UP {
            ns.push(once.ns);
        }
    }
    ns.sort_unstable();
    // The two in the middle are the same one where the number is odd.
    let (low, high) = (ns[(ns.len() - 1) / 2], ns[ns.len() / 2]);
    Ok(Times { median_ms: (low as f64 + high as f64) / 2e6, min_ms: ns[0] as f64 / 1e6 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Work that takes these times after the warm-up.
    fn times_of(ms: &[u64]) -> Times {
        let slow = [999; WARM_UP as usize];
        let mut left = slow.iter().chain(ms);
        let times = repeat::<()>(ms.len() as u32, || Ok(Once { ns: left.next().unwrap() * 1_000_000, output: 7 }));
        assert_eq!(left.next(), None, "every run was asked for");
        times.unwrap()
    }

    #[test]
    fn the_median_lies_in_the_middle_and_the_warm_up_does_not_count() {
        assert_eq!(times_of(&[5]), Times { median_ms: 5.0, min_ms: 5.0 });
        assert_eq!(times_of(&[9, 2, 4]), Times { median_ms: 4.0, min_ms: 2.0 });
        assert_eq!(times_of(&[9, 2, 4, 5]), Times { median_ms: 4.5, min_ms: 2.0 });
    }

    #[test]
    fn an_output_unlike_the_first_is_named_by_its_run() {
        let mut run = 0;
        let unlike = repeat::<()>(10, || {
            run += 1;
            Ok(Once { ns: 1, output: u64::from(run == 6) })
        });
        assert_eq!(unlike, Err(MeasureError::Unlike(6)));
    }

    #[test]
    fn work_that_fails_is_not_repeated() {
        let mut runs = 0;
        let failed = repeat(10, || {
            runs += 1;
            Err("no")
        });
        assert_eq!((failed, runs), (Err(MeasureError::Work("no")), 1));
    }
}
