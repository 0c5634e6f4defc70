//! How late this machine wakes a thread that asks for nothing but the time.

use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;

use hdrhistogram::Histogram;
use recorder::Percentiles;
use runtime::{clock, realtime};
use rustix::thread::set_current_timer_slack;

/// Between two wakes during a run [ns]: often enough for a figure, and seldom enough to cost little (README.md).
const TICK_NS: u64 = 10_000_000;
/// Between two wakes where nothing else is measured [ns].
const SHORT_TICK_NS: u64 = 1_000_000;
/// Finest and longest lateness told apart [ns]: 1 µs and 1 min.
const BOUNDS_NS: (u64, u64) = (1_000, 60_000_000_000);
const SIGNIFICANT_DIGITS: u8 = 2;

/// A thread that sleeps to ticks and notes how late it wakes: it waits for interrupts, for the hypervisor, and for
/// threads that go first. It has the supervisor's priority (none: ordinary scheduling) and no core of its own.
pub(crate) struct Noise {
    stop: Arc<AtomicBool>,
    /// Latest wake since it was last asked for [ns].
    latest_ns: Arc<AtomicU64>,
    thread: Option<JoinHandle<Option<Histogram<u64>>>>,
}

impl Noise {
    /// Starts it. A machine that has no thread for it gets no figure.
    pub(crate) fn start(priority: u32) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let latest_ns = Arc::new(AtomicU64::new(0));
        let (asked, latest) = (Arc::clone(&stop), Arc::clone(&latest_ns));
        let probe = move || {
            if priority > 0 {
                // A refusal is the supervisor's as well, which warns of it.
                let _ = realtime::raise(priority);
            }
            let note = |late_ns| _ = latest.fetch_max(late_ns, Ordering::Relaxed);
            listen(TICK_NS, note, |_| asked.load(Ordering::Relaxed))
        };
        let thread = std::thread::Builder::new().name("noise".to_owned()).spawn(probe).ok();
        Self { stop, latest_ns, thread }
    }

    /// The latest wake since this was last asked [ns].
    pub(crate) fn take_latest_ns(&self) -> u64 {
        self.latest_ns.swap(0, Ordering::Relaxed)
    }

    /// Ends it; what it found.
    pub(crate) fn finish(&mut self) -> Percentiles {
        self.stop.store(true, Ordering::Relaxed);
        let histogram = self.thread.take().and_then(|thread| thread.join().ok()).flatten();
        histogram.as_ref().map_or(Percentiles::default(), percentiles)
    }
}

impl Drop for Noise {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// How late the calling thread wakes when it sleeps to ticks of 1 ms for `for_ns`. Afterwards its timer slack is 1 ns.
pub fn measure_noise(for_ns: u64) -> Percentiles {
    let end_ns = clock::now_ns() + for_ns;
    listen(SHORT_TICK_NS, |_| (), |now_ns| now_ns >= end_ns).as_ref().map_or(Percentiles::default(), percentiles)
}

/// Sleeps from tick to tick [ns] until `done` at this host time; tells `note` how late each wake was [ns].
fn listen(period_ns: u64, note: impl Fn(u64), done: impl Fn(u64) -> bool) -> Option<Histogram<u64>> {
    let (low_ns, high_ns) = BOUNDS_NS;
    let mut late = Histogram::new_with_bounds(low_ns, high_ns, SIGNIFICANT_DIGITS).ok()?;
    // The kernel may wake ordinary threads up to 50 µs late on purpose; that is no noise.
    let _ = set_current_timer_slack(NonZeroU64::new(1));
    let mut tick_ns = clock::now_ns() + period_ns;
    loop {
        clock::sleep_until_ns(tick_ns);
        let now_ns = clock::now_ns();
        note(now_ns.saturating_sub(tick_ns));
        // Open-loop: whoever sleeps through many ticks is late for each of them.
        while tick_ns <= now_ns {
            late.saturating_record(now_ns - tick_ns);
            tick_ns += period_ns;
        }
        if done(now_ns) {
            return Some(late);
        }
    }
}

fn percentiles(late: &Histogram<u64>) -> Percentiles {
    let ms = |quantile| (!late.is_empty()).then(|| late.value_at_quantile(quantile) as f64 / 1e6);
    Percentiles { count: late.len(), p50: ms(0.5), p99: ms(0.99), p999: ms(0.999), max: ms(1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tick_that_has_passed_is_counted_once() {
        let began_ns = clock::now_ns();
        let noise = measure_noise(40 * SHORT_TICK_NS);
        let passed = (clock::now_ns() - began_ns) / SHORT_TICK_NS;
        assert!((40..=passed).contains(&noise.count), "{} of {passed} ticks", noise.count);
        assert!(noise.p50 <= noise.p99 && noise.p99 <= noise.p999 && noise.p999 <= noise.max);
    }

    #[test]
    fn the_probe_says_how_late_it_woke_and_ends_when_told_to() {
        let mut sut = Noise::start(0);

        while sut.take_latest_ns() == 0 {
            clock::sleep_ns(SHORT_TICK_NS);
        }
        assert!(sut.finish().count > 0, "it looks at least once");
        assert_eq!(sut.finish(), Percentiles::default(), "there is one answer");
    }
}
