//! CPU time and memory of each process, from `/proc`.

use std::fs;

use rustix::param::{clock_ticks_per_second, page_size};
use serde::{Deserialize, Serialize};

use crate::processes::child::Watched;
use crate::processes::scheduling::Scheduling;

/// Resident memory counts as the first after this time and so many sweeps, whichever is later.
pub(crate) const SETTLE_NS: u64 = 5_000_000_000;
pub(crate) const SETTLE_SWEEPS: u64 = 20;

/// What a process has used.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sample {
    cpu_s: f64,
    rss_kib: u64,
    rss_peak_kib: u64,
    threads: u64,
    scheduling: Scheduling,
}

impl Sample {
    /// Reads it; none when the process is gone.
    pub(crate) fn of(pid: u32) -> Option<Self> {
        let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
        let (cpu_ticks, threads, rss_pages) = parse_stat(&stat)?;
        Some(Self {
            cpu_s: cpu_ticks as f64 / clock_ticks_per_second() as f64,
            rss_kib: rss_pages * page_size() as u64 / 1024,
            rss_peak_kib: parse_peak_kib(&status).unwrap_or(0),
            threads,
            scheduling: Scheduling::of(pid),
        })
    }
}

/// CPU time [s] and resident memory [KiB] of a process by now; none when it is gone.
pub(crate) fn cpu_and_memory(pid: u32) -> Option<(f64, u64)> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let (cpu_ticks, _, rss_pages) = parse_stat(&stat)?;
    Some((cpu_ticks as f64 / clock_ticks_per_second() as f64, rss_pages * page_size() as u64 / 1024))
}

/// Ticks of user and system time, threads, and resident pages, of a `/proc/PID/stat` (proc(5): fields 14, 15, 20 and 24).
fn parse_stat(stat: &str) -> Option<(u64, u64, u64)> {
    // Field 2 is the name in parentheses and may hold anything.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let field = |number: usize| fields.get(number - 3)?.parse::<u64>().ok();
    Some((field(14)? + field(15)?, field(20)?, field(24)?))
}

fn parse_peak_kib(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// What a stage has used in all its lives.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Usage {
    cpu_of_earlier_lives_s: f64,
    scheduling_of_earlier_lives: Scheduling,
    life: Option<u32>,
    last: Sample,
    rss_peak_kib: u64,
    rss_first_kib: Option<u64>,
}

impl Usage {
    /// Adds what process `pid` has used by now; `settled` says that start-up is over.
    pub(crate) fn update(&mut self, pid: u32, settled: bool) {
        let Some(sample) = Sample::of(pid) else { return };
        if self.life.is_some_and(|life| life != pid) {
            self.cpu_of_earlier_lives_s += self.last.cpu_s;
            self.scheduling_of_earlier_lives = self.scheduling();
        }
        self.life = Some(pid);
        self.last = sample;
        self.rss_peak_kib = self.rss_peak_kib.max(sample.rss_peak_kib);
        if settled {
            self.rss_first_kib.get_or_insert(sample.rss_kib);
        }
    }

    /// CPU time of all lives [s].
    pub(crate) fn cpu_s(&self) -> f64 {
        self.cpu_of_earlier_lives_s + self.last.cpu_s
    }

    /// Memory resident at the last look.
    pub(crate) fn rss_kib(&self) -> u64 {
        self.last.rss_kib
    }

    /// Threads at the last look.
    pub(crate) fn threads(&self) -> u64 {
        self.last.threads
    }

    fn scheduling(&self) -> Scheduling {
        self.scheduling_of_earlier_lives.plus(self.last.scheduling)
    }
}

/// One process of the chain, through all its lives.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct ProcessReport {
    /// The stage, or `supervisor`.
    pub stage: String,
    /// Its last process.
    pub pid: u32,
    /// All its processes.
    pub pids: Vec<u32>,
    /// Restarts.
    pub restarts: u64,
    /// CPU time over the run's time; 100 = one core.
    pub cpu_pct: f64,
    /// Most memory resident at any time.
    pub rss_peak_kib: u64,
    /// Memory resident once start-up was over (5 s or 20 sweeps, whichever is later); the last, in a shorter run.
    pub rss_first_kib: u64,
    /// Memory resident at the last look.
    pub rss_last_kib: u64,
    /// Time that its threads were ready to run and another had the core [ms], the sum over threads that live at the last
    /// look of each life; null where the kernel does not count it. Steal time is not in it.
    pub run_delay_ms: Option<f64>,
    /// Times that its threads gave up the core to wait.
    pub voluntary_switches: u64,
    /// Times that its threads were made to give up the core.
    pub involuntary_switches: u64,
    /// Heap allocations inside `process`, after warm-up; null where none was counted.
    pub heap_allocations_per_sweep: Option<f64>,
    /// Heap allocations of the shell round it.
    pub shell_heap_allocations_per_sweep: Option<f64>,
}

impl ProcessReport {
    pub(crate) fn of_stage(stage: &Watched, run_s: f64) -> Self {
        let page = &stage.page;
        let parts = page.counted_parts.get();
        let per_part = |count: u64| (parts > 0).then(|| count as f64 / parts as f64);
        Self {
            pid: stage.pids.last().copied().unwrap_or(0),
            pids: stage.pids.clone(),
            restarts: page.incarnation.get().saturating_sub(1),
            heap_allocations_per_sweep: per_part(page.process_allocations.get()),
            shell_heap_allocations_per_sweep: per_part(page.shell_allocations.get()),
            ..Self::of_usage(&stage.name, &stage.usage, run_s)
        }
    }

    pub(crate) fn of_supervisor(usage: &Usage, run_s: f64) -> Self {
        let pid = std::process::id();
        Self { pid, pids: vec![pid], ..Self::of_usage("supervisor", usage, run_s) }
    }

    fn of_usage(stage: &str, usage: &Usage, run_s: f64) -> Self {
        let scheduling = usage.scheduling();
        Self {
            stage: stage.to_owned(),
            pid: 0,
            pids: Vec::new(),
            restarts: 0,
            cpu_pct: if run_s > 0.0 { (usage.cpu_s() / run_s * 1e4).round() / 100.0 } else { 0.0 },
            rss_peak_kib: usage.rss_peak_kib,
            rss_first_kib: usage.rss_first_kib.unwrap_or(usage.last.rss_kib),
            rss_last_kib: usage.last.rss_kib,
            run_delay_ms: scheduling.run_delay_ns.map(|ns| (ns as f64 / 1e3).round() / 1e3),
            voluntary_switches: scheduling.voluntary,
            involuntary_switches: scheduling.involuntary,
            heap_allocations_per_sweep: None,
            shell_heap_allocations_per_sweep: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_counted_after_the_name_whatever_it_holds() {
        let stat = "42 (a b) c) S 1 42 42 0 -1 4194304 100 0 0 0 7 5 0 0 20 0 1 0 99 1000 321 184 0";
        assert_eq!(parse_stat(stat), Some((12, 1, 321)));
        assert_eq!(parse_stat("42 (short) S 1"), None);
    }

    #[test]
    fn this_process_can_be_sampled() {
        let sample = Sample::of(std::process::id()).unwrap();
        assert!(sample.rss_kib > 0);
        assert!(sample.rss_peak_kib >= sample.rss_kib / 2);
    }
}
