//! Half a second of listening, and which of the kernel's figures there are.

use runtime::{RunDelay, clock};
use supervisor::{CpuTimes, measure_noise};

use super::Check;

/// How long the machine is listened to [ns].
const LISTEN_NS: u64 = 500_000_000;
/// A thread that is woken later than this eats into a stage's time [ms].
const LATE_MS: f64 = 1.0;
/// Share of a core that a hypervisor may take [%].
const STEAL_PCT: f64 = 1.0;

pub(super) fn checks() -> Vec<Check> {
    let (before, began_ns) = (CpuTimes::now(), clock::now_ns());
    let noise = measure_noise(LISTEN_NS);
    let listened_s = (clock::now_ns() - began_ns) as f64 / 1e9;
    let ms = |value: Option<f64>| value.map_or("-".to_owned(), |ms| format!("{ms:.3}"));
    let found = format!(
        "woken late by p50 {} p99 {} max {} ms, of {} ticks of 1 ms",
        ms(noise.p50),
        ms(noise.p99),
        ms(noise.max),
        noise.count
    );
    let quiet = noise.p99.is_some_and(|late| late <= LATE_MS);
    let remedy = "stop other programs, give the chain cores of its own (`isolcpus=`), or real-time priorities";
    let mut checks = vec![Check::ok_if(quiet, "noise", found, remedy)];
    if let (Some(before), Some(after)) = (before, CpuTimes::now()) {
        let pct = |seconds: f64| seconds / listened_s * 100.0;
        let (busy, steal) = (pct(after.busy_s - before.busy_s), pct(after.steal_s - before.steal_s));
        checks.push(Check::ok_if(
            steal <= STEAL_PCT,
            "load",
            format!("programs had {busy:.0} %, a hypervisor took {steal:.0} % of a core"),
            "ask for dedicated cores: what a hypervisor takes no setting of this machine brings back",
        ));
    }
    checks.push(Check::ok_if(
        RunDelay::of_this_thread().total_ns().is_some(),
        "schedstat",
        if RunDelay::of_this_thread().total_ns().is_some() { "run-queue delay is counted" } else { "not there" },
        "a kernel with CONFIG_SCHEDSTATS: without it no report says how long a stage waited for a core",
    ));
    checks
}
