//! Whether a process does anything at all, from `/proc/PID/task`.

use std::fs;
use std::path::Path;

use rustix::param::clock_ticks_per_second;

/// What the kernel says of a process's threads together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Activity {
    /// A signal stopped it, or a debugger.
    pub(crate) stopped: bool,
    /// One of its threads computes, or would if it had a core.
    pub(crate) runnable: bool,
    /// One of its threads waits for a device, or for memory that must be read first.
    pub(crate) blocked: bool,
    /// CPU time so far [ns].
    pub(crate) cpu_ns: u64,
    /// Time so far that it was ready to run and another had the core [ns].
    pub(crate) run_delay_ns: u64,
}

impl Activity {
    /// Reads it; none when the process is gone.
    pub(crate) fn of(pid: u32) -> Option<Self> {
        let threads = fs::read_dir(format!("/proc/{pid}/task")).ok()?.flatten();
        threads.filter_map(|thread| Self::of_thread(&thread.path())).reduce(Self::plus)
    }

    fn of_thread(thread: &Path) -> Option<Self> {
        let stat = fs::read_to_string(thread.join("stat")).ok()?;
        let schedstat = fs::read_to_string(thread.join("schedstat")).unwrap_or_default();
        Self::parse(&stat, &schedstat)
    }

    /// Of a thread's `stat` (proc(5): fields 3, 14 and 15) and `schedstat` (`RUNNING_NS WAITING_NS SLICES`; a kernel that
    /// counts nothing says `0 0 0`, and CPU time has then the grain of a clock tick).
    fn parse(stat: &str, schedstat: &str) -> Option<Self> {
        // Field 2 is the name in parentheses and may hold anything.
        let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
        let state = fields.next()?;
        let mut times = schedstat.split_whitespace().map_while(|number| number.parse().ok());
        let (mut cpu_ns, run_delay_ns) = (times.next().unwrap_or(0), times.next().unwrap_or(0));
        if cpu_ns == 0 {
            let ticks: u64 = fields.skip(10).take(2).map_while(|ticks| ticks.parse::<u64>().ok()).sum();
            cpu_ns = ticks * 1_000_000_000 / clock_ticks_per_second().max(1);
        }
        let (stopped, runnable, blocked) = (matches!(state, "T" | "t"), state == "R", state == "D");
        Some(Self { stopped, runnable, blocked, cpu_ns, run_delay_ns })
    }

    fn plus(self, other: Self) -> Self {
        Self {
            stopped: self.stopped || other.stopped,
            runnable: self.runnable || other.runnable,
            blocked: self.blocked || other.blocked,
            cpu_ns: self.cpu_ns + other.cpu_ns,
            run_delay_ns: self.run_delay_ns + other.run_delay_ns,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAT: &str = "42 (a b) c) T 1 42 42 0 -1 4194304 100 0 0 0 7 5 0 0 20 0 1 0 99 1000 321 184 0";

    #[test]
    fn the_kernels_words_are_read() {
        let found = Activity::parse(STAT, "123 45 6\n").unwrap();
        assert_eq!(found, Activity { stopped: true, cpu_ns: 123, run_delay_ns: 45, ..Activity::default() });
        let running = Activity::parse(&STAT.replace(" T ", " R "), "1 2 3").unwrap();
        assert!(running.runnable && !running.stopped && !running.blocked);
        assert!(Activity::parse(&STAT.replace(" T ", " D "), "1 2 3").unwrap().blocked);
        assert_eq!(Activity::parse("42 (short", "1 2 3"), None);
    }

    #[test]
    fn a_kernel_without_schedstat_counts_in_ticks() {
        let found = Activity::parse(STAT, "0 0 0\n").unwrap();
        assert_eq!(found.cpu_ns, 12 * 1_000_000_000 / clock_ticks_per_second());
        assert_eq!(Activity::parse(STAT, "").unwrap().cpu_ns, found.cpu_ns);
    }

    #[test]
    fn who_computes_is_seen_to() {
        let before = Activity::of(std::process::id()).unwrap();
        assert!(before.runnable, "the thread that asks runs");
        let mut after = before;
        while after.cpu_ns <= before.cpu_ns {
            after = Activity::of(std::process::id()).unwrap();
        }
    }
}
