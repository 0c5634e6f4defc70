//! The only place where time is read. Host time is the kernel's monotonic clock, the same for all processes; the time of day is
//! for people.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

const NS_PER_S: u64 = 1_000_000_000;

/// Host time [ns].
pub fn now_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * NS_PER_S + now.tv_nsec as u64
}

/// Time of day [ns since 1970], as far as the machine knows it. Only for those who keep or show it: it may jump.
pub fn utc_ns() -> u64 {
    let now = clock_gettime(ClockId::Realtime);
    u64::try_from(now.tv_sec).unwrap_or(0) * NS_PER_S + now.tv_nsec as u64
}

/// Sleeps until host time `until_ns`, or until a signal arrives; returns at once when it is past.
pub fn sleep_until_ns(until_ns: u64) {
    let until = Timespec { tv_sec: (until_ns / NS_PER_S) as i64, tv_nsec: (until_ns % NS_PER_S) as _ };
    // Interrupted by a signal: the caller looks at its flags and comes back.
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &until);
}

/// Sleeps for `ns`, or until a signal arrives.
pub fn sleep_ns(ns: u64) {
    sleep_until_ns(now_ns() + ns);
}

/// Waits until `holds` or until `patience_ns` have passed, looking every millisecond; says which.
pub fn wait_for(patience_ns: u64, mut holds: impl FnMut() -> bool) -> bool {
    let end_ns = now_ns() + patience_ns;
    loop {
        if holds() {
            return true;
        }
        if now_ns() >= end_ns {
            return false;
        }
        sleep_ns(1_000_000);
    }
}
