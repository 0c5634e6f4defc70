//! The values that limits are held against: with each answered sweep, and once a second.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use chain::executive::Watch;
use runtime::page::Page;
use runtime::{Pace, Plan};
use transport::Instance;

use super::Executive;
use crate::processes::child::Watched;

const MIB: f64 = 1024.0 * 1024.0;
/// The unit of a file's allocated blocks, whatever the file system's own (stat(2)).
const BLOCK: u64 = 512;
/// Where shared memory has its names.
const SHARED_MEMORY: &str = "/dev/shm";

/// What the values of the last look were taken from.
#[derive(Debug)]
pub(crate) struct Values {
    /// Host time of the last answered sweep [ns].
    answered_ns: u64,
    /// The last look: when [ns], sweeps answered, parts dropped, parts sent.
    last: Option<(u64, u64, u64, u64)>,
    /// The same of each process: which one, and its CPU time [s].
    cpu: Vec<(u32, f64)>,
}

/// Where the values come from.
pub(crate) struct Sources<'a> {
    pub(crate) instance: &'a Instance,
    pub(crate) plan: &'a Plan,
    pub(crate) stages: &'a [Watched],
    pub(crate) tape: Option<&'a Watched>,
}

impl Values {
    pub(crate) fn new(processes: usize) -> Self {
        Self { answered_ns: 0, last: None, cpu: vec![(0, 0.0); processes] }
    }
}

impl Executive {
    /// Takes the latest answered sweep into account, once. Where no sensor's clock paces the sweeps, there is no time that
    /// they could be late by.
    pub(crate) fn take_sweep(&mut self, now_ns: u64, plan: &Plan, sink: &Page) {
        let answered_ns = sink.answered_ns.get();
        if answered_ns == self.values.answered_ns || plan.pace == Pace::Fast {
            return;
        }
        self.values.answered_ns = answered_ns;
        let latency_ms = sink.latency_ns.get() as f64 / 1e6;
        let deadline_ms = plan.chain.deadline_ms;
        self.feed(now_ns, (Watch::LatencyMs, None), latency_ms);
        self.feed(now_ns, (Watch::MarginPct, None), 100.0 * (deadline_ms - latency_ms) / deadline_ms);
    }

    /// Takes what comes once a second: each process's usage has been read just before. Only what is watched is read beyond that.
    pub(crate) fn take_second(&mut self, now_ns: u64, sources: &Sources<'_>, flows: bool) {
        let passed_s = self.take_flow(now_ns, sources, flows);
        let processes = sources.stages.iter().chain(sources.tape);
        for (place, process) in processes.enumerate().take(self.names.len()) {
            if process.is_up() {
                self.take_process(now_ns, (place, process), passed_s);
            }
        }
        if self.limits.watches(Watch::SharedMemoryMib) {
            self.feed(now_ns, (Watch::SharedMemoryMib, None), shared_memory_mib(sources.instance));
        }
        if self.limits.watches(Watch::DiskFreeMib) {
            let recorded = sources.plan.outputs.record.as_deref().and_then(Path::parent);
            let folder = recorded.filter(|folder| !folder.as_os_str().is_empty());
            let folder = folder.map_or_else(|| sources.instance.dir().to_owned(), Path::to_owned);
            // Where nothing can be asked no value comes, and the limit is stale.
            if let Ok(found) = rustix::fs::statvfs(&folder) {
                self.feed(now_ns, (Watch::DiskFreeMib, None), (found.f_bavail * found.f_frsize) as f64 / MIB);
            }
        }
    }

    /// Rate and drops since the last look; the time since then [s], 0 at the first.
    fn take_flow(&mut self, now_ns: u64, sources: &Sources<'_>, flows: bool) -> f64 {
        let (Some(source), Some(sink)) = (sources.stages.first(), sources.stages.last()) else { return 0.0 };
        let answered = sink.page.next_ordinal_out.get() / self.sectors;
        let dropped = sources.stages.iter().map(|stage| stage.page.dropped.get()).sum::<u64>();
        let sent = source.page.published.get();
        let before = self.values.last.replace((now_ns, answered, dropped, sent));
        let Some((last_ns, answered_before, dropped_before, sent_before)) = before else { return 0.0 };
        let passed_s = now_ns.saturating_sub(last_ns) as f64 / 1e9;
        if flows && passed_s > 0.0 {
            let answered = answered.saturating_sub(answered_before) as f64;
            self.feed(now_ns, (Watch::RateHz, None), answered / passed_s);
            let (dropped, sent) = (dropped.saturating_sub(dropped_before), sent.saturating_sub(sent_before));
            if sent > 0 {
                self.feed(now_ns, (Watch::DropRatio, None), dropped as f64 / sent as f64);
            }
        }
        passed_s
    }

    fn take_process(&mut self, now_ns: u64, (place, process): (usize, &Watched), passed_s: f64) {
        let pid = process.page.pid.get() as u32;
        let usage = &process.usage;
        self.feed(now_ns, (Watch::RssMib, Some(place)), usage.rss_kib() as f64 / 1024.0);
        self.feed(now_ns, (Watch::Threads, Some(place)), usage.threads() as f64);
        let cpu_s = usage.cpu_s();
        let (pid_before, cpu_before_s) = std::mem::replace(&mut self.values.cpu[place], (pid, cpu_s));
        if pid == pid_before && passed_s > 0.0 {
            self.feed(now_ns, (Watch::CpuPct, Some(place)), 100.0 * (cpu_s - cpu_before_s) / passed_s);
        }
        if self.limits.watches(Watch::OpenFiles)
            && let Ok(files) = fs::read_dir(format!("/proc/{pid}/fd"))
        {
            self.feed(now_ns, (Watch::OpenFiles, Some(place)), files.count() as f64);
        }
    }
}

/// What the instance's files in shared memory hold of it; they are sparse.
fn shared_memory_mib(instance: &Instance) -> f64 {
    let names = instance.shared_memory();
    let held = names.iter().filter_map(|name| fs::metadata(Path::new(SHARED_MEMORY).join(name)).ok());
    held.map(|file| file.blocks() * BLOCK).sum::<u64>() as f64 / MIB
}
