//! How the kernel's scheduler treated the threads of a process, from `/proc/PID/task`.

use std::fs;
use std::path::Path;

/// The sum over a process's threads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Scheduling {
    /// Ready to run, and another thread had the core [ns]; none where the kernel does not count it.
    pub(crate) run_delay_ns: Option<u64>,
    /// Gave up the core to wait.
    pub(crate) voluntary: u64,
    /// Was made to give up the core.
    pub(crate) involuntary: u64,
}

impl Scheduling {
    /// Reads it. Threads that have ended are not in it.
    pub(crate) fn of(pid: u32) -> Self {
        let threads = fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
        threads.fold(Self::default(), |sum, thread| sum.plus(Self::of_thread(&thread.path())))
    }

    fn of_thread(thread: &Path) -> Self {
        let text = |file: &str| fs::read_to_string(thread.join(file)).unwrap_or_default();
        let (schedstat, status) = (text("schedstat"), text("status"));
        Self {
            run_delay_ns: parse_run_delay_ns(&schedstat),
            voluntary: parse_count(&status, "voluntary_ctxt_switches:"),
            involuntary: parse_count(&status, "nonvoluntary_ctxt_switches:"),
        }
    }

    pub(crate) fn plus(self, other: Self) -> Self {
        let run_delay_ns = match (self.run_delay_ns, other.run_delay_ns) {
            (None, None) => None,
            (one, other) => Some(one.unwrap_or(0) + other.unwrap_or(0)),
        };
        Self {
            run_delay_ns,
            voluntary: self.voluntary + other.voluntary,
            involuntary: self.involuntary + other.involuntary,
        }
    }
}

/// The second of `RUNNING_NS WAITING_NS SLICES`; a kernel that counts nothing says `0 0 0`.
fn parse_run_delay_ns(schedstat: &str) -> Option<u64> {
    let numbers: Vec<u64> = schedstat.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    let [running_ns, waiting_ns, slices] = numbers[..] else { return None };
    (running_ns + waiting_ns + slices > 0).then_some(waiting_ns)
}

fn parse_count(status: &str, key: &str) -> u64 {
    let line = status.lines().find_map(|line| line.strip_prefix(key));
    line.and_then(|count| count.trim().parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernels_words_are_read() {
        assert_eq!(parse_run_delay_ns("123 45 6\n"), Some(45));
        assert_eq!(parse_run_delay_ns("0 0 0\n"), None);
        assert_eq!(parse_run_delay_ns(""), None);
        let status = "Name:\tx\nvoluntary_ctxt_switches:\t7\nnonvoluntary_ctxt_switches:\t3\n";
        assert_eq!(parse_count(status, "voluntary_ctxt_switches:"), 7);
        assert_eq!(parse_count(status, "nonvoluntary_ctxt_switches:"), 3);
        assert_eq!(parse_count("", "voluntary_ctxt_switches:"), 0);
    }

    #[test]
    fn all_threads_of_this_process_are_in_the_sum() {
        let thread = std::thread::Builder::new().spawn(|| {
            for _ in 0..5 {
                runtime::clock::sleep_ns(1_000_000);
            }
            let own = Scheduling::of_thread(Path::new("/proc/thread-self"));
            (own, Scheduling::of(std::process::id()))
        });
        // Not held against an earlier sum: threads of other tests end meanwhile.
        let (own, all) = thread.unwrap().join().unwrap();
        assert!(own.voluntary >= 5 && all.voluntary >= own.voluntary, "{own:?} of {all:?}");
    }

    #[test]
    fn lives_add_up_and_what_is_not_counted_stays_unknown() {
        let one = Scheduling { run_delay_ns: Some(5), voluntary: 1, involuntary: 2 };
        let none = Scheduling { run_delay_ns: None, ..one };
        assert_eq!(one.plus(one), Scheduling { run_delay_ns: Some(10), voluntary: 2, involuntary: 4 });
        assert_eq!(one.plus(none).run_delay_ns, Some(5));
        assert_eq!(none.plus(none).run_delay_ns, None);
    }
}
