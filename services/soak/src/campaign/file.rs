use serde::Deserialize;

use crate::SoakError;

/// What is done to the chain.
#[derive(Clone, Debug, Default)]
pub enum Campaign {
    /// Nothing.
    #[default]
    Nothing,
    /// Faults by a script, or drawn.
    Faults(faults::Campaign),
    /// Each stage killed, again and again.
    Kills(KillsFile),
    /// All processes killed in any order, and a new start.
    KillAll(KillAllFile),
    /// Starts and stops.
    Cycles(CyclesFile),
    /// Changes of mode.
    ModeChanges(ModeChangesFile),
    /// The day in the life.
    Day(DayFile),
}

/// `kind = "kills"`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct KillsFile {
    /// How often each stage is killed.
    pub times: usize,
    /// From one kill to the next [s].
    pub spacing_s: f64,
    /// Share of the kills after which the successor is killed, too, while it starts.
    pub again_share: f64,
    /// At any time until so long after the first [ms].
    pub again_within_ms: f64,
    /// Which stages; all where it is not there.
    pub stages: Option<Vec<String>>,
}

/// `kind = "kill-all"`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct KillAllFile {
    /// How often.
    pub times: usize,
    /// At any time until so long after the start [ms]: start-up included.
    pub within_ms: f64,
}

/// `kind = "cycles"`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CyclesFile {
    /// How often the chain is started and stopped.
    pub times: usize,
    /// How long it runs between, at any time until so long after it is up [ms].
    pub run_ms: f64,
}

/// `kind = "mode-changes"`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ModeChangesFile {
    /// How many.
    pub times: usize,
    /// Between one that is in effect and the next command, at any time until so long after it [ms].
    pub pause_ms: f64,
    /// How long a change may take before it counts as stuck [ms].
    pub stuck_ms: f64,
    /// The commands of `encke ctl`, of which one that leads to another mode is drawn each time.
    pub commands: Vec<String>,
}

/// `kind = "day"`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct DayFile {
    /// The table of the recordings (`tape.toml`) for this day; the chain's own where it is not there.
    pub tape: Option<String>,
    /// The steps in order.
    pub step: Vec<StepFile>,
}

/// One step of a day: a name, and one of the others.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct StepFile {
    /// What it is, for people.
    pub name: String,
    /// So many seconds in which every sweep is to be answered whole.
    pub nominal_s: Option<f64>,
    /// A command of `encke ctl` that is to be carried out.
    pub ctl: Option<Vec<String>>,
    /// A command of `encke` that is to be refused.
    pub refused: Option<Vec<String>>,
    /// A fault (`encke inject`), after which there is to be output again within the time that the bars allow kills.
    pub inject: Option<Vec<String>>,
    /// So many files of the recording, at least, are to be there.
    pub rotated: Option<usize>,
    /// The chain is stopped; it is to end in order.
    #[serde(default)]
    pub shutdown: bool,
    /// The recording is replayed as fast as it goes: the same detections to the byte, of each sweep that was answered whole and
    /// at full work.
    #[serde(default)]
    pub replay: bool,
}

impl StepFile {
    /// How many things it does.
    fn things(&self) -> usize {
        let Self { name: _, nominal_s, ctl, refused, inject, rotated, shutdown, replay } = self;
        let lists = [ctl, refused, inject].into_iter().filter(|list| list.is_some()).count();
        let others = [nominal_s.is_some(), rotated.is_some(), *shutdown, *replay];
        lists + others.into_iter().filter(|is| *is).count()
    }
}

/// The kinds that are no lists of faults.
#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
enum Kinds {
    Kills(KillsFile),
    KillAll(KillAllFile),
    Cycles(CyclesFile),
    ModeChanges(ModeChangesFile),
    Day(DayFile),
}

impl Campaign {
    /// Reads a campaign.
    ///
    /// # Errors
    /// It is no TOML, lacks a key, has one too many, or one out of its bounds.
    pub fn parse(file: &str, text: &str) -> Result<Self, SoakError> {
        let refused = |cause: String| SoakError::Table { file: file.to_owned(), cause };
        // A list of faults has no kind.
        if !text.parse::<toml::Table>().is_ok_and(|table| table.contains_key("kind")) {
            return faults::Campaign::parse(text).map(Self::Faults).map_err(|cause| refused(cause.to_string()));
        }
        let kinds: Kinds = toml::from_str(text).map_err(|cause| refused(cause.to_string().trim_end().to_owned()))?;
        let within = |key: &str, value: f64, least: f64, most: f64| {
            let holds = (least..=most).contains(&value);
            if holds { Ok(()) } else { Err(refused(format!("{key} is {value}, must be {least} to {most}"))) }
        };
        let times = match &kinds {
            Kinds::Kills(KillsFile { times, spacing_s, again_share, again_within_ms, .. }) => {
                within("spacing_s", *spacing_s, 1.0, 3600.0)?;
                within("again_share", *again_share, 0.0, 1.0)?;
                within("again_within_ms", *again_within_ms, 0.0, 10_000.0)?;
                *times
            }
            Kinds::KillAll(KillAllFile { times, within_ms }) => {
                within("within_ms", *within_ms, 0.0, 60_000.0)?;
                *times
            }
            Kinds::Cycles(CyclesFile { times, run_ms }) => {
                within("run_ms", *run_ms, 0.0, 60_000.0)?;
                *times
            }
            Kinds::ModeChanges(ModeChangesFile { times, pause_ms, stuck_ms, commands }) => {
                within("pause_ms", *pause_ms, 0.0, 60_000.0)?;
                within("stuck_ms", *stuck_ms, 1.0, 60_000.0)?;
                within("commands", commands.len() as f64, 2.0, 16.0)?;
                *times
            }
            Kinds::Day(DayFile { step, .. }) => {
                for (place, step) in step.iter().enumerate() {
                    within(&format!("things done in step {place} ({})", step.name), step.things() as f64, 1.0, 1.0)?;
                }
                step.len()
            }
        };
        within("times", times as f64, 1.0, 1e6)?;
        Ok(match kinds {
            Kinds::Kills(file) => Self::Kills(file),
            Kinds::KillAll(file) => Self::KillAll(file),
            Kinds::Cycles(file) => Self::Cycles(file),
            Kinds::ModeChanges(file) => Self::ModeChanges(file),
            Kinds::Day(file) => Self::Day(file),
        })
    }

    /// Its name in verdicts.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Nothing => "no faults",
            Self::Faults(_) => "faults",
            Self::Kills(_) => "kills",
            Self::KillAll(_) => "kill-all",
            Self::Cycles(_) => "cycles",
            Self::ModeChanges(_) => "mode-changes",
            Self::Day(_) => "day",
        }
    }

    /// Whether it has a length of its own.
    pub fn has_length(&self) -> bool {
        !matches!(self, Self::Nothing | Self::Faults(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHIPPED: [(&str, &str, &str); 5] = [
        ("kills", "kills", include_str!("../../../../config/faults/kills.toml")),
        ("kill-all", "kill-all", include_str!("../../../../config/faults/kill-all.toml")),
        ("cycles", "cycles", include_str!("../../../../config/faults/cycles.toml")),
        ("mode-changes", "mode-changes", include_str!("../../../../config/faults/mode-changes.toml")),
        ("day", "day", include_str!("../../../../config/faults/day.toml")),
    ];

    #[test]
    fn the_shipped_campaigns_hold() {
        for (file, kind, text) in SHIPPED {
            let campaign = Campaign::parse(file, text).unwrap();
            assert_eq!((campaign.kind(), campaign.has_length()), (kind, true));
        }
        let list = "[[script]]\nat_s = 2.0\nfault = \"kill\"\nstage = \"extractor\"";
        let campaign = Campaign::parse("list", list).unwrap();
        assert_eq!((campaign.kind(), campaign.has_length()), ("faults", false));
    }

    #[test]
    fn what_does_not_hold_is_refused_by_name() {
        let refused = |text: &str| Campaign::parse("c.toml", text).unwrap_err().to_string();
        let cycles = "kind = \"cycles\"\ntimes = 0\nrun_ms = 1.0";
        assert_eq!(refused(cycles), "c.toml: times is 0, must be 1 to 1000000");
        assert!(refused("kind = \"parties\"\ntimes = 1").contains("parties"));
        assert!(refused(&(cycles.to_owned() + "\nmore = 1")).contains("more"));
        let step = "kind = \"day\"\n[[step]]\nname = \"both\"\nshutdown = true\nreplay = true";
        assert_eq!(refused(step), "c.toml: things done in step 0 (both) is 2, must be 1 to 1");
    }
}
