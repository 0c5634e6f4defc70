//! Kernel, cores, clock.

use std::fs;

use runtime::realtime::allowed_cores;

use super::{Check, line_of};

/// Features that our code is built for or that say what kind of processor it is.
const FEATURES: [&str; 8] = ["sse4_2", "avx", "avx2", "fma", "avx512f", "asimd", "neon", "sve"];
/// Clocks that are read without a system call.
const FAST_CLOCKS: [&str; 4] = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"];
/// The chain was designed for so many cores.
const CORES: usize = 2;

pub(super) fn checks() -> Vec<Check> {
    vec![kernel(), cores(), quota(), processor(), governor(), clocksource(), huge_pages()]
}

fn kernel() -> Check {
    let system = rustix::system::uname();
    let (release, version) = (system.release().to_string_lossy(), system.version().to_string_lossy());
    let realtime = version.contains("PREEMPT_RT") || line_of("/sys/kernel/realtime").as_deref() == Some("1");
    let found = format!("Linux {release}, {}", if realtime { "PREEMPT_RT" } else { "not PREEMPT_RT" });
    Check::ok_if(realtime, "kernel", found, "for latency with a bound, boot a PREEMPT_RT kernel")
}

fn cores() -> Check {
    let (allowed, online) = (allowed_cores().len(), line_of("/sys/devices/system/cpu/online").unwrap_or_default());
    let isolated = line_of("/sys/devices/system/cpu/isolated").unwrap_or_default();
    let mut found = format!("{allowed} of the online cores {online} may be used");
    if !isolated.is_empty() {
        found += &format!(", isolated: {isolated}");
    }
    Check::ok_if(allowed >= CORES, "cores", found, "give it two cores: the affinity or the cpuset of this process")
}

/// Share of the cores that control groups allow, the tightest on the way up.
fn quota() -> Check {
    let remedy = "lift `cpu.max` (`CPUQuota=` in the systemd unit, `--cpus` of the container)";
    match tightest_quota() {
        None => Check::ok("CPU quota", "none"),
        Some(quota) => {
            Check::ok_if(quota >= CORES as f64, "CPU quota", format!("{quota:.2} cores by control group"), remedy)
        }
    }
}

fn tightest_quota() -> Option<f64> {
    let groups = line_of("/proc/self/cgroup")?;
    let quotas = groups.lines().filter_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?);
        if controllers.is_empty() {
            return on_the_way_up("/sys/fs/cgroup", path, |dir| parse_max(&line_of(&format!("{dir}/cpu.max"))?));
        }
        let has_cpu = controllers.split(',').any(|controller| controller == "cpu");
        let quota = |dir: &str| {
            let read = |file: &str| line_of(&format!("{dir}/{file}"))?.parse::<f64>().ok();
            Some(read("cpu.cfs_quota_us").filter(|quota| *quota > 0.0)? / read("cpu.cfs_period_us")?)
        };
        if has_cpu { on_the_way_up("/sys/fs/cgroup/cpu", path, quota) } else { None }
    });
    quotas.min_by(f64::total_cmp)
}

/// The smallest quota of a group and of those above it.
fn on_the_way_up(root: &str, path: &str, quota: impl Fn(&str) -> Option<f64>) -> Option<f64> {
    let mut path = path.trim_end_matches('/');
    let mut tightest: Option<f64> = None;
    loop {
        if let Some(quota) = quota(&format!("{root}{path}")) {
            tightest = Some(tightest.map_or(quota, |other| other.min(quota)));
        }
        let Some((above, _)) = path.rsplit_once('/') else { return tightest };
        path = above;
    }
}

/// `QUOTA PERIOD` or `max PERIOD` [µs].
fn parse_max(line: &str) -> Option<f64> {
    let (quota, period) = line.split_once(' ')?;
    Some(quota.parse::<f64>().ok()? / period.parse::<f64>().ok()?)
}

fn processor() -> Check {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |names: [&str; 2]| {
        let line = text.lines().find(|line| names.iter().any(|name| line.starts_with(name)));
        line.and_then(|line| line.split_once(':')).map(|(_, value)| value.trim())
    };
    let model = field(["model name", "CPU implementer"]).unwrap_or("unknown");
    let has: Vec<&str> = field(["flags", "Features"]).unwrap_or_default().split_whitespace().collect();
    let found: Vec<&str> = FEATURES.into_iter().filter(|feature| has.contains(feature)).collect();
    Check::ok("processor", format!("{model}; {}", found.join(" ")))
}

fn governor() -> Check {
    let cpu = "/sys/devices/system/cpu";
    let turbo = match (line_of(&format!("{cpu}/intel_pstate/no_turbo")), line_of(&format!("{cpu}/cpufreq/boost"))) {
        (Some(off), _) => {
            if off == "0" {
                ", turbo on"
            } else {
                ", turbo off"
            }
        }
        (_, Some(on)) => {
            if on == "0" {
                ", turbo off"
            } else {
                ", turbo on"
            }
        }
        _ => "",
    };
    let of_core = |core| line_of(&format!("{cpu}/cpu{core}/cpufreq/scaling_governor"));
    let mut governors: Vec<String> = allowed_cores().into_iter().filter_map(of_core).collect();
    governors.sort();
    governors.dedup();
    if governors.is_empty() {
        return Check::ok("frequency", format!("governed by the host or fixed: no governor is visible{turbo}"));
    }
    let remedy = "`cpupower frequency-set -g performance`: else a core is slow when a sweep wakes it";
    let found = format!("governor {}{turbo}", governors.join(", "));
    Check::ok_if(governors == ["performance"], "frequency", found, remedy)
}

fn clocksource() -> Check {
    let path = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
    let Some(source) = line_of(path) else { return Check::ok("clocksource", "not visible") };
    let remedy = "boot with `clocksource=tsc` if the processor's is stable: this one costs a system call a reading";
    Check::ok_if(FAST_CLOCKS.contains(&source.as_str()), "clocksource", &source, remedy)
}

fn huge_pages() -> Check {
    let Some(modes) = line_of("/sys/kernel/mm/transparent_hugepage/enabled") else {
        return Check::ok("huge pages", "transparent huge pages are not built in");
    };
    let mode =
        modes.split_once('[').and_then(|(_, rest)| rest.split_once(']')).map_or(modes.as_str(), |(mode, _)| mode);
    let remedy =
        "`echo madvise > /sys/kernel/mm/transparent_hugepage/enabled`: else the kernel stops threads to merge pages";
    Check::ok_if(mode != "always", "huge pages", format!("transparent huge pages: {mode}"), remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quota_is_a_number_of_cores_and_the_tightest_on_the_way_up_counts() {
        assert_eq!(parse_max("150000 100000"), Some(1.5));
        assert_eq!(parse_max("max 100000"), None);
        let quota = |dir: &str| match dir {
            "r/a" => Some(0.5),
            "r/a/b" => Some(2.0),
            _ => None,
        };
        assert_eq!(on_the_way_up("r", "/a/b/c", quota), Some(0.5));
        assert_eq!(on_the_way_up("r", "/", quota), None);
    }
}
