//! Scheduling that the kernel permits, and what chain.toml asks of it.

use chain::{Chain, SUPERVISOR};
use runtime::SOURCE;
use runtime::realtime::{Refusal, in_words, try_core, try_lock, try_priority};
use rustix::process::{Resource, getrlimit};

use super::{Check, line_of};

/// Tried where the chain asks for none.
const TYPICAL_PRIORITY: u32 = 50;

pub(super) fn checks(chain: &Chain) -> Vec<Check> {
    let mut checks = vec![permitted(chain), limit(), throttle()];
    checks.extend(order(chain));
    checks.extend(asked(chain));
    checks
}

fn permitted(chain: &Chain) -> Check {
    let highest = chain.realtime.seats.values().map(|seat| seat.priority).max().filter(|priority| *priority > 0);
    let priority = highest.unwrap_or(TYPICAL_PRIORITY);
    match try_priority(priority) {
        Ok(()) => Check::ok("real-time", format!("SCHED_FIFO up to priority {priority} is permitted")),
        Err(refusal) => {
            Check::warn("real-time", format!("priority {priority} is refused: {}", refusal.reason), refusal.remedy)
        }
    }
}

fn limit() -> Check {
    let limit = getrlimit(Resource::Rtprio).current;
    let limit = limit.map_or("unlimited".to_owned(), |limit| limit.to_string());
    Check::ok("RLIMIT_RTPRIO", format!("{limit} (CAP_SYS_NICE overrides it)"))
}

/// A real-time thread that never sleeps is stopped for a part of each period.
fn throttle() -> Check {
    let read = |file: &str| line_of(&format!("/proc/sys/kernel/{file}"))?.parse::<i64>().ok();
    match (read("sched_rt_runtime_us"), read("sched_rt_period_us")) {
        (Some(runtime), Some(period)) if runtime >= 0 => Check::ok(
            "real-time throttle",
            format!("real-time threads may have {runtime} of {period} µs; a stage that never sleeps leaves the rest"),
        ),
        (Some(_), Some(_)) => Check::warn(
            "real-time throttle",
            "off: a real-time thread that never sleeps keeps its core for ever",
            "`sysctl kernel.sched_rt_runtime_us=950000`, or a supervisor on a core of its own",
        ),
        _ => Check::ok("real-time throttle", "not visible"),
    }
}

/// Who makes or stores sweeps must not keep the core from those who answer them; who watches must get in.
fn order(chain: &Chain) -> Option<Check> {
    let priority = |process: &str| chain.realtime.seat(process).priority;
    let inner = chain.stages.split_last().map_or(&[][..], |(_, inner)| inner);
    let lowest = inner.iter().map(|stage| priority(&stage.name)).min()?;
    let highest = inner.iter().map(|stage| priority(&stage.name)).max()?;
    if chain.realtime.seats.values().all(|seat| seat.priority == 0) {
        return None;
    }
    let too_high: Vec<&str> =
        [SOURCE, chain.sink()].into_iter().filter(|name| priority(name) >= lowest.max(1)).collect();
    Some(if !too_high.is_empty() {
        let found = format!("{} not below every stage, of which the lowest has {lowest}", too_high.join(" and "));
        Check::warn("priorities", found, "give source and recorder less than any stage between them")
    } else if priority(SUPERVISOR) <= highest {
        let found = format!("the supervisor has {}, a stage has {highest}", priority(SUPERVISOR));
        Check::warn("priorities", found, "give the supervisor most: it must get in when a stage never sleeps")
    } else {
        Check::ok("priorities", "source and recorder below the stages, the supervisor above them")
    })
}

/// What the chain asks for and this process, which has the same rights, is refused.
fn asked(chain: &Chain) -> Vec<Check> {
    if !chain.realtime.asks() {
        return vec![Check::ok("chain.toml asks", "for no real-time setting")];
    }
    let processes = [SUPERVISOR, SOURCE].into_iter().chain(chain.stages.iter().map(|stage| stage.name.as_str()));
    let mut refusals = Vec::new();
    for process in processes {
        let seat = chain.realtime.seat(process);
        let tried = [
            if seat.priority > 0 { try_priority(seat.priority) } else { Ok(()) },
            seat.core.map_or(Ok(()), try_core),
            if chain.realtime.lock_memory { try_lock(chain, process) } else { Ok(()) },
        ];
        let refused = tried.into_iter().filter_map(Result::err);
        refusals.extend(refused.map(|refusal| Refusal { process: process.to_owned(), ..refusal }));
    }
    if refusals.is_empty() {
        return vec![Check::ok("chain.toml asks", "for real-time settings, and all are granted")];
    }
    let lines = in_words(&refusals).into_iter();
    lines.map(|line| Check::warn("chain.toml asks", line.found, line.remedy)).collect()
}
