//! What a process uses, from `/proc` (proc(5)).

use std::fs;

use rustix::param::{clock_ticks_per_second, page_size};
use transport::Instance;

/// What a process uses at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Use {
    /// The process.
    pub(crate) pid: u64,
    /// Memory resident.
    pub(crate) rss_kib: u64,
    /// Of that, what is its own: neither shared memory nor files.
    pub(crate) own_kib: u64,
    /// File descriptors open.
    pub(crate) files: u64,
    /// Threads.
    pub(crate) threads: u64,
    /// CPU time so far [s].
    pub(crate) cpu_s: f64,
}

impl Use {
    /// Of a process; none when it is gone.
    pub(crate) fn of(pid: u64) -> Option<Self> {
        let (cpu_s, threads, rss_kib) = parse(&fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)?;
        let own_kib = parse_own(&fs::read_to_string(format!("/proc/{pid}/statm")).ok()?)?;
        let files = fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count() as u64;
        // A process that has ended and was not waited for yet has none of all this.
        (threads > 0 && rss_kib > 0).then_some(Self { pid, rss_kib, own_kib, files, threads, cpu_s })
    }
}

/// CPU time [s], threads and resident memory [KiB] of a `/proc/PID/stat`: fields 14, 15, 20 and 24.
fn parse(stat: &str) -> Option<(f64, u64, u64)> {
    // Field 2 is the name in parentheses and may hold anything.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let field = |number: usize| fields.get(number - 3)?.parse::<u64>().ok();
    let cpu_s = (field(14)? + field(15)?) as f64 / clock_ticks_per_second() as f64;
    Some((cpu_s, field(20)?, field(24)? * page_size() as u64 / 1024))
}

/// Resident memory that is neither shared nor of files [KiB], of a `/proc/PID/statm`: field 2 less field 3, in pages.
fn parse_own(statm: &str) -> Option<u64> {
    let mut fields = statm.split_whitespace().skip(1).map(str::parse::<u64>);
    let (resident, shared) = (fields.next()?.ok()?, fields.next()?.ok()?);
    Some(resident.saturating_sub(shared) * page_size() as u64 / 1024)
}

/// CPU time of this process so far [s].
pub(crate) fn own_cpu_s() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    parse(&stat).map_or(0.0, |(cpu_s, ..)| cpu_s)
}

/// All stages of an instance that live, by the words they were started with.
pub(crate) fn processes_of(instance: &Instance) -> Vec<u64> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let pids = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u64>().ok());
    pids.filter(|pid| is_stage_of(*pid, instance)).collect()
}

fn is_stage_of(pid: u64, instance: &Instance) -> bool {
    let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let words: Vec<&[u8]> = line.split(|byte| *byte == 0).collect();
    words.contains(&b"stage".as_slice()) && words.contains(&instance.name().as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_counted_after_the_name_whatever_it_holds() {
        let stat = "42 (a b) c) S 1 42 42 0 -1 4194304 100 0 0 0 700 500 0 0 20 0 3 0 99 1000 321 184 0";
        let (cpu_s, threads, rss_kib) = parse(stat).unwrap();
        assert_eq!((threads, rss_kib), (3, 321 * page_size() as u64 / 1024));
        assert!((cpu_s - 1200.0 / clock_ticks_per_second() as f64).abs() < 1e-9);
        assert_eq!(parse("42 (short) S 1"), None);
    }

    #[test]
    fn this_process_can_be_looked_at() {
        let sut = Use::of(u64::from(std::process::id())).unwrap();
        assert_eq!(parse_own("900 300 100 5 0 40 0"), Some(200 * page_size() as u64 / 1024));
        assert!(sut.rss_kib >= sut.own_kib && sut.own_kib > 0 && sut.files >= 3 && sut.threads >= 1);
        assert_eq!(Use::of(u64::from(u32::MAX)), None);
    }
}
