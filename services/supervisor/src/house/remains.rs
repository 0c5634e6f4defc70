//! What a dead supervisor left behind: living stages, a folder, shared memory. Living stages wait to be adopted.

use std::fs;
use std::os::unix::fs::MetadataExt;

use runtime::page::Page;
use runtime::{Plan, clock};
use rustix::process::{Pid, Signal, getuid, kill_process};
use transport::Instance;

/// How long a stage may take to leave in order before it is killed [ns].
const LEAVE_PATIENCE_NS: u64 = 2_000_000_000;
/// How long the kernel may take to end a killed process [ns].
const KILL_PATIENCE_NS: u64 = 1_000_000_000;

/// The living processes of an instance's stages, by name: of all processes of this user, because one that has just been
/// started does not stand on its page yet.
pub(crate) fn living(instance: &Instance) -> Vec<(String, Pid)> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let numbers = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    let stages = numbers.filter_map(Pid::from_raw).filter_map(|pid| Some((stage_of(pid, instance)?, pid)));
    stages.collect()
}

/// The process of a stage of an instance, if it lives and is one.
pub fn stage_process(instance: &Instance, page: &Page) -> Option<Pid> {
    Pid::from_raw(page.pid.get() as i32).filter(|pid| stage_of(*pid, instance).is_some())
}

/// Which stage of the instance a process is: `encke stage STAGE … --instance NAME`. None where it is none, or is dead and
/// nobody has waited for it yet; process numbers are used again.
pub(crate) fn stage_of(pid: Pid, instance: &Instance) -> Option<String> {
    let path = format!("/proc/{}/cmdline", pid.as_raw_nonzero());
    let line = fs::read(&path).ok()?;
    let mut words = line.split(|byte| *byte == 0).skip(1);
    let is_stage = words.next() == Some(b"stage");
    let words: Vec<&[u8]> = words.collect();
    let name = instance.name();
    let is_here = words.windows(2).any(|pair| pair == [b"--instance".as_slice(), name.as_bytes()])
        || words.contains(&format!("--instance={name}").as_bytes());
    if !is_stage || !is_here || fs::metadata(&path).ok()?.uid() != getuid().as_raw() {
        return None;
    }
    words.first().map(|name| String::from_utf8_lossy(name).into_owned())
}

/// Ends what still lives of an instance whose supervisor is dead: in flow order, each when it has drained its input; who
/// does not leave is killed. Returns how many there were.
pub(crate) fn take_down(instance: &Instance) -> usize {
    // Where there is no plan yet, they are stages that somebody has just started for the run to come.
    if !Plan::exists(instance) {
        return 0;
    }
    let mut living = living(instance);
    let order: Vec<String> = Plan::read(instance).map_or(Vec::new(), |plan| plan.stages().map(str::to_owned).collect());
    // What is no stage of the chain, the tape, reads to the end.
    living.sort_by_key(|(name, _)| order.iter().position(|stage| stage == name).unwrap_or(order.len()));
    for (_, pid) in &living {
        let is_gone = || stage_of(*pid, instance).is_none();
        let _ = kill_process(*pid, Signal::TERM); // it may have left by itself
        if !clock::wait_for(LEAVE_PATIENCE_NS, is_gone) {
            let _ = kill_process(*pid, Signal::KILL);
            clock::wait_for(KILL_PATIENCE_NS, is_gone);
        }
    }
    living.len()
}
