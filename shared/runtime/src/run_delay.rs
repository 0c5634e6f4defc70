use std::fs::File;

use rustix::io::pread;

/// Reads how long this thread was ready to run and did not: another thread had the core.
///
/// Source: the second number of `/proc/thread-self/schedstat` (Documentation/scheduler/sched-stats.rst). It grows when
/// the thread gets a core back. What a hypervisor takes away is not in it: that is steal time.
#[derive(Debug)]
pub struct RunDelay {
    /// Kept open: the path is looked up once, for the thread that opened it.
    schedstat: Option<File>,
}

impl RunDelay {
    /// Opens the figure of the calling thread, the only one that it is about. Never fails: a kernel without it gives
    /// none.
    pub fn of_this_thread() -> Self {
        let mut this = Self { schedstat: File::open("/proc/thread-self/schedstat").ok() };
        // A kernel that counts nothing says "0 0 0".
        if this.read().is_none_or(|[running, waiting, slices]| running + waiting + slices == 0) {
            this.schedstat = None;
        }
        this
    }

    /// Total so far [ns]; none where the kernel does not count it. One system call, no allocation.
    pub fn total_ns(&self) -> Option<u64> {
        self.read().map(|[_, waiting_ns, _]| waiting_ns)
    }

    fn read(&self) -> Option<[u64; 3]> {
        // Three numbers of at most 20 digits.
        let mut text = [0; 64];
        let len = pread(self.schedstat.as_ref()?, &mut text[..], 0).ok()?;
        parse(text.get(..len)?)
    }
}

/// The same from lap to lap.
pub(crate) struct Laps {
    delay: RunDelay,
    seen_ns: u64,
}

impl Laps {
    pub(crate) fn of_this_thread() -> Self {
        let delay = RunDelay::of_this_thread();
        Self { seen_ns: delay.total_ns().unwrap_or(0), delay }
    }

    /// Time since the last lap in which another thread had the core [ns]; 0 where the kernel does not count it.
    pub(crate) fn lap_ns(&mut self) -> u32 {
        let now_ns = self.delay.total_ns().unwrap_or(self.seen_ns);
        let lap_ns = now_ns.saturating_sub(self.seen_ns);
        self.seen_ns = now_ns;
        u32::try_from(lap_ns).unwrap_or(u32::MAX)
    }
}

/// `RUNNING_NS WAITING_NS SLICES`
fn parse(text: &[u8]) -> Option<[u64; 3]> {
    let mut numbers = std::str::from_utf8(text).ok()?.split_ascii_whitespace().map(str::parse);
    let mut next = || numbers.next()?.ok();
    Some([next()?, next()?, next()?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock;

    #[test]
    fn three_numbers_are_read_and_nothing_else() {
        assert_eq!(parse(b"123 45 6\n"), Some([123, 45, 6]));
        assert_eq!(parse(b"123 45\n"), None);
        assert_eq!(parse(b"a b c\n"), None);
        assert_eq!(parse(b""), None);
    }

    #[test]
    fn the_total_never_falls() {
        let sut = RunDelay::of_this_thread();
        let Some(mut before_ns) = sut.total_ns() else { return };
        for _ in 0..100 {
            clock::sleep_ns(100_000);
            let now_ns = sut.total_ns().unwrap();
            assert!(now_ns >= before_ns, "{before_ns} then {now_ns}");
            before_ns = now_ns;
        }
    }

    /// `cargo test --release -p runtime one_reading -- --nocapture` shows it.
    #[test]
    fn one_reading_costs_so_much() {
        const READINGS: u64 = 10_000;
        let sut = RunDelay::of_this_thread();
        let round = || {
            let began_ns = clock::now_ns();
            for _ in 0..READINGS {
                std::hint::black_box(sut.total_ns());
            }
            (clock::now_ns() - began_ns) / READINGS
        };
        let fastest_ns = (0..20).map(|_| round()).min().unwrap();
        println!("one reading of the run delay: {fastest_ns} ns");
        assert!(sut.total_ns().is_none() || fastest_ns > 0);
    }
}
