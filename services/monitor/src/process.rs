//! What a process uses, from `/proc`; and this one's place behind all others.

use std::fs;

use preempt_rt::sched::{Pid, Scheduler, SchedulerParams, set_scheduler};
use rustix::param::{clock_ticks_per_second, page_size};
use rustix::process::setpriority_process;

/// Nice value of a viewer: after everybody else.
const NICEST: i32 = 19;

/// What a process has used by now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Usage {
    /// CPU time of all its threads [s].
    pub(crate) cpu_s: f64,
    /// Memory resident [bytes].
    pub(crate) rss_bytes: u64,
    /// When it started [s], by the clock that counts from the machine's start.
    pub(crate) started_s: f64,
}

impl Usage {
    /// Of a process; none when it is gone.
    pub(crate) fn of(pid: u64) -> Option<Self> {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        parse(&stat, clock_ticks_per_second() as f64, page_size() as u64)
    }
}

/// proc(5): state is field 3, user and system time 14 and 15, the start 22, resident pages 24. A zombie uses nothing.
fn parse(stat: &str, ticks_per_s: f64, page_bytes: u64) -> Option<Usage> {
    // Field 2 is the name in parentheses and may hold anything.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    if fields.first().is_none_or(|state| matches!(*state, "Z" | "X")) {
        return None;
    }
    let field = |number: usize| fields.get(number - 3)?.parse::<u64>().ok();
    Some(Usage {
        cpu_s: (field(14)? + field(15)?) as f64 / ticks_per_s,
        rss_bytes: field(24)? * page_bytes,
        started_s: field(22)? as f64 / ticks_per_s,
    })
}

/// Puts this process behind all others. One that may not be nicer already is.
pub(crate) fn be_nice() {
    let _ = setpriority_process(None, NICEST);
}

/// Lets this thread run only when no other wants the core. The kernel grants that to everybody.
pub(crate) fn be_idle() {
    let _ = set_scheduler(Pid::current_thread(), Scheduler::SCHED_IDLE, SchedulerParams { priority: 0 });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_counted_after_the_name_whatever_it_holds() {
        let stat = "42 (a b) c) S 1 42 42 0 -1 4194304 100 0 0 0 70 50 0 0 20 0 1 0 900 1000 321 184 0";
        assert_eq!(parse(stat, 100.0, 4096), Some(Usage { cpu_s: 1.2, rss_bytes: 321 * 4096, started_s: 9.0 }));
        assert_eq!(parse("42 (short) S 1", 100.0, 4096), None);
    }

    #[test]
    fn the_dead_use_nothing() {
        let stat = "42 (a) Z 1 42 42 0 -1 4194304 100 0 0 0 70 50 0 0 20 0 1 0 900 1000 321 184 0";
        assert_eq!(parse(stat, 100.0, 4096), None);
        assert_eq!(Usage::of(0), None);
        assert!(Usage::of(u64::from(std::process::id())).is_some());
    }
}
