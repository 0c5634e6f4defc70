use serde::{Deserialize, Serialize};

/// What was asked for.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Setting {
    /// A priority under SCHED_FIFO.
    Priority,
    /// A core of its own.
    Core,
    /// Memory that stays.
    LockMemory,
}

/// What the kernel refused to one process.
#[derive(Clone, Debug, Deserialize, PartialEq, Eq, Serialize)]
pub struct Refusal {
    /// The process: `source`, a stage, `supervisor`.
    pub process: String,
    /// What it asked for.
    pub setting: Setting,
    /// The priority, the core, the memory [MiB].
    pub value: u64,
    /// Why not.
    pub reason: String,
    /// What would help.
    pub remedy: String,
}

impl Refusal {
    pub(crate) fn new(setting: Setting, value: u64, reason: String, remedy: String) -> Self {
        Self { process: String::new(), setting, value, reason, remedy }
    }
}

/// What was refused of one setting, whatever the number of processes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{found}; {remedy}")]
pub struct Refused {
    /// What, to whom, and why.
    pub found: String,
    /// What would help all of them.
    pub remedy: String,
}

/// One line for each setting that was refused.
pub fn in_words(refusals: &[Refusal]) -> Vec<Refused> {
    let line = |setting| {
        let of: Vec<&Refusal> = refusals.iter().filter(|refusal| refusal.setting == setting).collect();
        let worst = of.iter().max_by_key(|refusal| refusal.value)?;
        let what = match setting {
            Setting::Priority => format!("real-time priority {}", span(&of)),
            Setting::Core => format!("core {}", span(&of)),
            Setting::LockMemory => "lock_memory".to_owned(),
        };
        let processes: Vec<&str> = of.iter().map(|refusal| refusal.process.as_str()).collect();
        let (count, names) = (count(processes.len()), processes.join(", "));
        let found = format!("{what} refused for {count} ({names}), which go on without: {}", worst.reason);
        Some(Refused { found, remedy: worst.remedy.clone() })
    };
    [Setting::Priority, Setting::Core, Setting::LockMemory].into_iter().filter_map(line).collect()
}

fn count(processes: usize) -> String {
    if processes == 1 { "1 process".to_owned() } else { format!("{processes} processes") }
}

/// `40`, or `10 to 50`.
fn span(refusals: &[&Refusal]) -> String {
    let values = || refusals.iter().map(|refusal| refusal.value);
    match (values().min(), values().max()) {
        (Some(low), Some(high)) if low < high => format!("{low} to {high}"),
        (_, high) => high.unwrap_or(0).to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(process: &str, setting: Setting, value: u64) -> Refusal {
        let (reason, remedy) = (format!("no {value}"), format!("allow {value}"));
        Refusal { process: process.to_owned(), ..Refusal::new(setting, value, reason, remedy) }
    }

    #[test]
    fn a_setting_refused_to_many_is_one_line_with_the_remedy_that_helps_all() {
        let refusals = [
            refusal("source", Setting::Priority, 20),
            refusal("clusterer", Setting::Priority, 40),
            refusal("clusterer", Setting::Core, 7),
        ];
        let lines: Vec<_> = in_words(&refusals).iter().map(ToString::to_string).collect();
        assert_eq!(lines.len(), 2);
        assert!(lines[0].starts_with("real-time priority 20 to 40 refused for 2 processes (source, clusterer)"));
        assert!(lines[0].ends_with("no 40; allow 40"));
        assert!(lines[1].starts_with("core 7 refused for 1 process (clusterer)"));
        assert!(in_words(&[]).is_empty());
    }
}
