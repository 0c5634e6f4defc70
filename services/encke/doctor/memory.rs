//! Memory that stays, and files that may be open.

use std::fs;

use chain::Chain;
use runtime::SOURCE;
use runtime::realtime::LockPlan;
use rustix::process::{Resource, getrlimit};

use super::Check;

const MIB: u64 = 1 << 20;
/// Files that a process of the chain has open at most: measured 48, in a stage between two others.
const OPEN_FILES: u64 = 128;

pub(super) fn checks(chain: &Chain) -> Vec<Check> {
    vec![locked(chain), swap(), open_files()]
}

/// RLIMIT_MEMLOCK against the process that would lock most.
fn locked(chain: &Chain) -> Check {
    let processes = std::iter::once(SOURCE).chain(chain.stages.iter().map(|stage| stage.name.as_str()));
    let plans = processes.map(|process| (process, LockPlan::foreseen(chain, process)));
    let Some((process, plan)) = plans.max_by_key(|(_, plan)| plan.bytes) else {
        return Check::ok("RLIMIT_MEMLOCK", "nothing to lock");
    };
    match plan.check() {
        Ok(()) => Check::ok(
            "RLIMIT_MEMLOCK",
            format!("lock_memory is permitted: {process} maps most, up to {} MiB", plan.bytes.div_ceil(MIB)),
        ),
        Err(refusal) => {
            let found = format!("lock_memory would be refused: {} ({process})", refusal.reason);
            Check::warn("RLIMIT_MEMLOCK", found, refusal.remedy)
        }
    }
}

fn swap() -> Check {
    let text = fs::read_to_string("/proc/swaps").unwrap_or_default();
    let areas: Vec<&str> = text.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    let remedy = "`swapoff -a`, or lock_memory in chain.toml: a page that was swapped out costs milliseconds";
    let found = if areas.is_empty() { "none".to_owned() } else { areas.join(", ") };
    Check::ok_if(areas.is_empty(), "swap", found, remedy)
}

fn open_files() -> Check {
    let limit = getrlimit(Resource::Nofile).current;
    let found = limit.map_or("unlimited".to_owned(), |limit| format!("{limit} a process"));
    let remedy = format!("`ulimit -n {OPEN_FILES}` or more (`LimitNOFILE=` in the systemd unit)");
    if limit.is_none_or(|limit| limit >= OPEN_FILES) {
        Check::ok("open files", found)
    } else {
        Check::fail("open files", format!("{found}, must be {OPEN_FILES}"), remedy)
    }
}
