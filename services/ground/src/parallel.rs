//! Independent jobs on all cores.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

/// What `work` makes of each job, in the order of the jobs whatever the number of cores.
pub(crate) fn map<J: Sync, R: Send>(jobs: &[J], work: impl Fn(&J) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(jobs.len()));
    let take_all = || {
        while let Some((place, job)) = take(&next, jobs) {
            let result = work(job);
            done.lock().unwrap_or_else(PoisonError::into_inner).push((place, result));
        }
    };
    let helpers = thread::available_parallelism().map_or(1, usize::from).min(jobs.len()).saturating_sub(1);
    thread::scope(|scope| {
        for number in 0..helpers {
            // Where no thread is to be had, this one does all.
            let _ = thread::Builder::new().name(format!("ground-{number}")).spawn_scoped(scope, take_all);
        }
        take_all();
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_unstable_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, result)| result).collect()
}

fn take<'a, J>(next: &AtomicUsize, jobs: &'a [J]) -> Option<(usize, &'a J)> {
    let place = next.fetch_add(1, Ordering::Relaxed);
    jobs.get(place).map(|job| (place, job))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_the_order_of_jobs() {
        for count in [0, 1, 2, 1_000] {
            let jobs: Vec<u64> = (0..count).collect();
            let expected: Vec<u64> = jobs.iter().map(|job| job * job).collect();
            assert_eq!(map(&jobs, |job| job * job), expected);
        }
    }
}
