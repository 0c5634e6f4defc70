//! Which core, and before whom.

use preempt_rt::sched::{
    Pid, PreemptRtError, Scheduler, SchedulerParams, get_scheduler, get_scheduler_params, set_scheduler,
};
use rustix::process::{Resource, getrlimit, setpriority_process};
use rustix::thread::CapabilitySet;
use rustix::thread::CpuSet;
use rustix::thread::capabilities;
use rustix::thread::sched_getaffinity;
use rustix::thread::sched_setaffinity;

use super::{Refusal, Setting};

/// Nice value of those who stand back: each step is a quarter.
const NICER: i32 = 10;

/// The calling thread, for the scheduler's calls.
const THIS: Pid = Pid::current_thread();

/// Whether this process has a capability [capabilities(7)].
pub(super) fn may(capability: CapabilitySet) -> bool {
    capabilities(None).is_ok_and(|sets| sets.effective.contains(capability))
}

/// Puts the calling thread under SCHED_FIFO, or says why the kernel does not.
pub fn raise(priority: u32) -> Result<(), Refusal> {
    let params = SchedulerParams { priority: priority as i32 };
    set_scheduler(THIS, Scheduler::SCHED_FIFO, params).map_err(|cause| {
        let limit = getrlimit(Resource::Rtprio).current;
        let refused = |reason, remedy| Refusal::new(Setting::Priority, u64::from(priority), reason, remedy);
        let allowed = limit.is_none_or(|limit| limit >= u64::from(priority)) || may(CapabilitySet::SYS_NICE);
        match (allowed, limit, cause) {
            (false, Some(limit), _) => refused(
                format!("RLIMIT_RTPRIO is {limit}"),
                format!(
                    "set `LimitRTPRIO={priority}` in the systemd unit, `rtprio {priority}` in \
                     /etc/security/limits.conf, or `setcap cap_sys_nice+ep` on the executable"
                ),
            ),
            (_, _, PreemptRtError::Errno(errno)) if errno == rustix::io::Errno::PERM.raw_os_error() => refused(
                "the control group has no real-time time".to_owned(),
                "give it some (cpu.rt_runtime_us), or start outside of it".to_owned(),
            ),
            (_, _, cause) => refused(
                cause.to_string(),
                "take the priority out of chain.toml: this kernel has no SCHED_FIFO for it".to_owned(),
            ),
        }
    })
}

/// Puts this process behind the others, with a tenth of their share of a core where they want all of it.
pub fn stand_back() {
    // One that may not be nicer already is.
    let _ = setpriority_process(None, NICER);
}

/// Lets the calling thread run on one core alone.
pub(super) fn pin(core: u32) -> Result<(), Refusal> {
    let mut set = CpuSet::new();
    if (core as usize) < CpuSet::MAX_CPU {
        set.set(core as usize);
    }
    sched_setaffinity(None, &set).map_err(|_| {
        let cores = allowed_cores();
        Refusal::new(
            Setting::Core,
            u64::from(core),
            format!("this process may use core {}", in_ranges(&cores)),
            "name one of these in chain.toml, or widen the process's cpuset".to_owned(),
        )
    })
}

/// Cores that the calling thread may use, rising; none where the kernel does not say.
pub fn allowed_cores() -> Vec<usize> {
    sched_getaffinity(None).map_or(Vec::new(), |set| (0..CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect())
}

/// `0-3,6`.
fn in_ranges(cores: &[usize]) -> String {
    let mut text = String::new();
    for run in cores.chunk_by(|one, next| one + 1 == *next) {
        let comma = if text.is_empty() { "" } else { "," };
        text += &match run {
            [first, .., last] => format!("{comma}{first}-{last}"),
            _ => format!("{comma}{}", run[0]),
        };
    }
    text
}

/// Whether the kernel would grant a priority; nothing is changed.
pub fn try_priority(priority: u32) -> Result<(), Refusal> {
    let _as_before = AsBefore::remember();
    raise(priority)
}

/// Whether the kernel would grant a core; nothing is changed.
pub fn try_core(core: u32) -> Result<(), Refusal> {
    let _as_before = AsBefore::remember();
    pin(core)
}

/// The calling thread's seat, to which it returns when this is dropped.
pub struct AsBefore {
    scheduler: Option<(Scheduler, SchedulerParams)>,
    cores: Option<CpuSet>,
}

impl AsBefore {
    /// Remembers the seat that the calling thread has.
    pub fn remember() -> Self {
        let scheduler = get_scheduler(THIS).ok().zip(get_scheduler_params(THIS).ok());
        Self { scheduler, cores: sched_getaffinity(None).ok() }
    }

    /// Goes back to that seat until the guard is dropped. Children that are started meanwhile inherit it.
    pub fn for_a_moment(&self) -> Self {
        let now = Self::remember();
        self.restore();
        now
    }

    fn restore(&self) {
        // Back to what was granted before; there is nothing to say where the kernel changes its mind.
        if let Some((scheduler, params)) = self.scheduler {
            let _ = set_scheduler(THIS, scheduler, params);
        }
        if let Some(cores) = &self.cores {
            let _ = sched_setaffinity(None, cores);
        }
    }
}

impl Drop for AsBefore {
    fn drop(&mut self) {
        self.restore();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_tried_leaves_the_thread_as_it_was() {
        let before = (allowed_cores(), get_scheduler(THIS).unwrap(), get_scheduler_params(THIS).unwrap());
        for priority in [1, 99] {
            if let Err(refusal) = try_priority(priority) {
                assert!(!refusal.reason.is_empty() && !refusal.remedy.is_empty(), "{refusal:?}");
            }
        }
        try_core(before.0[0] as u32).unwrap();
        assert_eq!(before, (allowed_cores(), get_scheduler(THIS).unwrap(), get_scheduler_params(THIS).unwrap()));
    }

    #[test]
    fn a_core_that_is_not_there_is_a_refusal_that_names_those_that_are() {
        let refusal = pin(1023).unwrap_err();
        assert!(refusal.reason.contains(&in_ranges(&allowed_cores())), "{refusal:?}");
    }

    #[test]
    fn cores_are_written_as_ranges() {
        assert_eq!(in_ranges(&[0, 1, 2, 5]), "0-2,5");
        assert_eq!(in_ranges(&[3]), "3");
        assert_eq!(in_ranges(&[]), "");
    }
}
