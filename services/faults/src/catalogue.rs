//! Every fault there is: its name, whom it can hit, how it is measured, and what the chain is to do about it. Help texts,
//! the checks of campaigns and the table of the docs come from here.

use events::EventId;
use serde::{Deserialize, Serialize};

/// Whom a fault hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Any process of the chain but the supervisor, by name; the tape, too.
    Process,
    /// The shell round one stage of the chain, by name; the source and the recorder, too, the tape not.
    Stage,
    /// What the source sends.
    Source,
    /// A process that writes files: the recorder, which is meant where nobody is named, or the tape.
    Writer,
    /// A stage with parameters of its own, by name.
    Parameters,
    /// The stage that reads a model: the classifier.
    Model,
    /// The instance as a whole, or its supervisor: no name.
    Chain,
    /// The machine: no name, and no chain needs to run.
    Machine,
}

impl Target {
    /// What is to be named on the command line.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Process => "a stage or the tape",
            Self::Stage => "a stage",
            Self::Source => "the source, which need not be named",
            Self::Writer => "recorder or tape",
            Self::Parameters => "a stage with parameters",
            Self::Model => "the classifier, which need not be named",
            Self::Chain => "the chain: no name",
            Self::Machine => "the machine: no name",
        }
    }

    /// The stage that is meant where nobody is named.
    pub const fn implied(self) -> Option<&'static str> {
        match self {
            Self::Source => Some("source"),
            Self::Writer => Some("recorder"),
            Self::Model => Some("classifier"),
            _ => None,
        }
    }

    /// Whether a stage must be named.
    pub const fn needs_stage(self) -> bool {
        matches!(self, Self::Process | Self::Stage | Self::Parameters)
    }

    /// Whether a stage may be named.
    pub const fn takes_stage(self) -> bool {
        !matches!(self, Self::Chain | Self::Machine)
    }
}

/// What a fault's strength is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A whole number: a level, a factor, processes, lines a second.
    Count,
    /// A time [ms]; written as a time on the command line.
    Milliseconds,
    /// The same, forth or back.
    SignedMilliseconds,
}

/// How strong a fault is: `--by`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strength {
    /// What it is.
    pub what: &'static str,
    /// What it is measured in.
    pub unit: Unit,
    /// The least.
    pub least: f64,
    /// The most.
    pub most: f64,
    /// Where nothing is said.
    pub usual: f64,
}

/// How long a fault lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lasting {
    /// It is over at once.
    Once,
    /// For a number of times (`--times`): so many where nothing is said.
    Times(u64),
    /// For a time (`--for`) [s]: so long where nothing is said.
    Time(f64),
    /// For a time where one is said, else to the end of the run.
    Open,
}

/// What stands in the catalogue about a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// The fault.
    pub fault: Fault,
    /// Its word on the command line.
    pub name: &'static str,
    /// Whom it hits.
    pub target: Target,
    /// How strong it is, where it can be stronger or weaker.
    pub strength: Option<Strength>,
    /// How long it lasts.
    pub lasting: Lasting,
    /// The condition that the chain is to find the stage in; empty where there is none.
    pub condition: &'static str,
    /// The event that is to be said; none where nothing needs to be.
    pub event: Option<EventId>,
    /// What the chain is to do.
    pub action: &'static str,
    /// What it is, one line.
    pub help: &'static str,
}

const fn count(what: &'static str, least: f64, most: f64, usual: f64) -> Option<Strength> {
    Some(Strength { what, unit: Unit::Count, least, most, usual })
}

const LEVEL: Option<Strength> = count("level", 1.0, 3.0, 1.0);
const SLOWER: Option<Strength> =
    Some(Strength { what: "time added", unit: Unit::Milliseconds, least: 0.0, most: 60_000.0, usual: 20.0 });
const STEP: Option<Strength> = Some(Strength {
    what: "step",
    unit: Unit::SignedMilliseconds,
    least: -86_400_000.0,
    most: 86_400_000.0,
    usual: 3_600_000.0,
});
/// A number of times that never ends.
pub const FOR_EVER: u64 = u64::MAX;

macro_rules! catalogue {
    ($($fault:ident = $number:literal, $name:literal, $target:ident, $strength:expr, $lasting:expr,
       $condition:literal, $event:expr, $action:literal, $help:literal;)*) => {
        /// A fault on purpose. The number never changes its meaning.
        #[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord, Serialize)]
        #[repr(u64)]
        pub enum Fault {
            $(
                #[doc = $help]
                #[serde(rename = $name)]
                $fault = $number,
            )*
        }

        /// Every fault, by number.
        pub const CATALOGUE: &[Entry] = &[
            $(Entry {
                fault: Fault::$fault,
                name: $name,
                target: Target::$target,
                strength: $strength,
                lasting: $lasting,
                condition: $condition,
                event: $event,
                action: $action,
                help: $help,
            },)*
        ];
    };
}

use EventId::{
    ClockStep, CommandRefused, EventsUnread, FileFailed, SafeEntered, SharedMemoryGone, StageDied, StageHung,
    StageSlow, StageSpinning, StepTaken, SupervisorAdopted,
};
use Lasting::{Once, Open, Time, Times};

catalogue! {
    // 10 to 99: had by the shell round a stage, asked for on its page.
    Panic = 10, "panic", Stage, None, Times(1), "dead", Some(StageDied), "stage restarted",
        "Panics while it holds a message and has another one loaned.";
    Deadlock = 11, "deadlock", Stage, None, Times(1), "hung", Some(StageHung), "stage restarted",
        "Waits for what never comes, with a part in hand.";
    Spin = 12, "spin", Stage, None, Times(1), "spinning", Some(StageSpinning), "stage restarted",
        "Computes without end, with a part in hand.";
    SlowTimes = 13, "slow-times", Stage, count("factor", 2.0, 100.0, 2.0), Open, "slow", Some(StageSlow),
        "steps down the ladder of overload",
        "Computes so many times as long on each part.";
    CrashLoop = 14, "crash-loop", Stage, count("last tier that dies: 0 configured, 1 built-in, 2 stand-in", 0.0, 2.0, 1.0),
        Times(FOR_EVER), "dead", Some(SafeEntered), "safe mode when the budget is spent; a stand-in answers",
        "Dies with the next part, and then at each start.";
    HeapExhaustion = 15, "heap-exhaustion", Stage, None, Times(1), "dead", Some(StageDied), "stage restarted",
        "Asks for memory until its own limit is reached.";
    EventStorm = 16, "event-storm", Stage, None, Time(2.0), "flooding", Some(EventsUnread),
        "events throttled and counted; none that is graver is lost",
        "Says 10,000 events a second.";

    // 100 to 199: sweeps as they should not be, asked for on the source's page, by sweeps.
    BeamsMissing = 100, "beams-missing", Source, LEVEL, Times(10), "", None, "answered",
        "Beams that give no returns: 2, 8 or 16 of 32.";
    Crosstalk = 101, "crosstalk", Source, LEVEL, Times(10), "", None, "answered",
        "Ranges that are another laser's: 1, 4 or 10 % of the returns.";
    Dust = 102, "dust", Source, LEVEL, Times(10), "", None, "answered",
        "Echoes of dust nearby, and fewer of what is behind it: 2, 10 or 25 %.";
    MotionBlur = 103, "motion-blur", Source, LEVEL, Times(10), "", None, "answered",
        "Ranges and azimuths that are smeared: 2, 6 or 15 cm and up to 3 columns.";
    IncompleteEcho = 104, "incomplete-echo", Source, LEVEL, Times(10), "", None, "answered",
        "Dark surfaces that give no echo: 10, 30 or 60 % of the darker returns.";
    EmptySweep = 110, "empty-sweep", Source, None, Times(1), "", None, "answered, empty",
        "A sweep without a return.";
    OnePoint = 111, "one-point", Source, None, Times(1), "", None, "answered",
        "A sweep of a single return.";
    AllNan = 112, "all-nan", Source, None, Times(1), "", None, "rejected as malformed; the next one is answered",
        "A sweep of which no coordinate is a number.";
    DuplicatePoints = 113, "duplicate-points", Source, None, Times(1), "", None, "answered",
        "A sweep with each return twice.";
    GiantCluster = 114, "giant-cluster", Source, None, Times(1), "", None, "answered, late perhaps",
        "A sweep in which all returns are one surface round the sensor.";
    OversizedSweep = 115, "oversized-sweep", Source, None, Times(1), "", None,
        "answered, late perhaps; what does not fit is counted as over_capacity",
        "A sweep with as many returns as the message holds, and one more.";
    DuplicatedSweep = 120, "duplicated-sweep", Source, None, Times(1), "", Some(ClockStep), "answered twice",
        "A sweep that comes twice.";
    SkippedSweep = 121, "skipped-sweep", Source, None, Times(1), "", Some(ClockStep), "answered; the gap is sensor time",
        "A sweep that does not come.";
    ReorderedSweeps = 122, "reordered-sweeps", Source, None, Times(1), "", Some(ClockStep), "answered in the order in which they came",
        "Two sweeps that change places.";
    ClockStepped = 123, "clock-step", Source, STEP, Once, "", Some(ClockStep), "answered; the latency is never negative",
        "The sensor's clock steps, and goes on from there.";

    // From 200 on: from outside.
    Kill = 200, "kill", Process, None, Once, "dead", Some(StageDied), "stage restarted",
        "Ended at once (SIGKILL).";
    Stop = 201, "stop", Process, None, Time(0.5), "hung", Some(StageHung), "old parts refused; restarted where it lasts",
        "Stands still (SIGSTOP, then SIGCONT).";
    Slow = 202, "slow", Stage, SLOWER, Open, "slow", Some(StepTaken), "steps down the ladder of overload",
        "Takes a time more on each sweep: sleeps, or computes from 100 ms on.";
    Swallow = 203, "swallow", Stage, None, Times(1), "", None, "the ledger is OPEN, the run ends with 1",
        "Loses a part and says nothing. Not survivable: it shows that the ledger is true.";
    KillSupervisor = 210, "kill-supervisor", Chain, None, Once, "", Some(SupervisorAdopted),
        "the stages go on; the next supervisor adopts them",
        "The supervisor is ended at once (SIGKILL).";
    KillAll = 211, "kill-all", Chain, None, Once, "", None, "the next start is clean, by itself",
        "All processes are ended at once, the supervisor too, in an order drawn by the seed.";
    DiskFull = 220, "disk-full", Writer, None, Time(2.0), "", Some(FileFailed), "that file is closed and counted; the chain goes on",
        "Files do not grow any more (RLIMIT_FSIZE).";
    ReadOnly = 221, "read-only", Writer, None, Time(2.0), "", Some(FileFailed), "that file is closed and counted; the chain goes on",
        "The folder of its outputs is mounted read-only, and it is killed. Only where one may mount.";
    ConfigCorruption = 222, "config-corruption", Parameters, count("bytes", 1.0, 64.0, 8.0), Time(1.0), "dead",
        Some(StageDied), "restarted, with built-in parameters where its own do not hold",
        "Bytes of its parameters are flipped in the plan of the run, and it is killed; it is put right later.";
    ModelCorruption = 223, "model-corruption", Model, count("bytes", 1.0, 64.0, 8.0), Time(1.0), "dead",
        Some(StageDied), "restarted, with the built-in model where its own does not hold",
        "Bytes of its model are flipped, in a copy that this chain alone reads, and it is killed; it is put right later.";
    CommandFlood = 230, "command-flood", Chain, count("lines a second", 1.0, 100_000.0, 10_000.0), Time(2.0), "",
        Some(CommandRefused), "refused and counted",
        "A client sends commands without end.";
    SharedMemoryLost = 240, "shared-memory-gone", Chain, None, Once, "", Some(SharedMemoryGone),
        "all processes leave in order and come back with new files; beyond the chain's budget the run ends with 1",
        "Somebody deletes the chain's files in shared memory.";
    CpuHog = 250, "cpu-hog", Machine, count("workers", 1.0, 64.0, 1.0), Time(5.0), "", Some(StepTaken),
        "steps down the ladder where cores are short",
        "Other programs compute.";
    MemoryHog = 251, "memory-hog", Machine, count("workers", 1.0, 64.0, 1.0), Time(5.0), "", Some(StepTaken),
        "steps down the ladder where it is slowed",
        "Other programs copy memory, 64 MiB each.";
    IoHog = 252, "io-hog", Machine, count("workers", 1.0, 64.0, 1.0), Time(5.0), "", None, "the chain goes on",
        "Other programs write files and wait for the disk.";
}

impl Fault {
    /// What the catalogue says of it.
    pub fn entry(self) -> &'static Entry {
        // Each variant stands in the catalogue: one macro makes both.
        CATALOGUE.iter().find(|entry| entry.fault == self).unwrap_or(&CATALOGUE[0])
    }

    /// Its word on the command line.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// The fault of a word.
    pub fn from_name(name: &str) -> Option<Self> {
        CATALOGUE.iter().find(|entry| entry.name == name).map(|entry| entry.fault)
    }

    /// The fault of a number.
    pub fn from_number(number: u64) -> Option<Self> {
        CATALOGUE.iter().map(|entry| entry.fault).find(|fault| *fault as u64 == number)
    }

    /// Its number on a stage's page, where it is asked for there.
    pub fn page_number(self) -> Option<u64> {
        Some(self as u64).filter(|&number| number < FIRST_FROM_OUTSIDE)
    }

    /// Whether it changes what the source sends.
    pub fn is_of_sweeps(self) -> bool {
        (FIRST_OF_SWEEPS..FIRST_FROM_OUTSIDE).contains(&(self as u64))
    }
}

const FIRST_OF_SWEEPS: u64 = 100;
const FIRST_FROM_OUTSIDE: u64 = 200;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_are_given_once_and_numbers_rise() {
        for (place, entry) in CATALOGUE.iter().enumerate() {
            let name = entry.name;
            assert_eq!(Fault::from_name(name), Some(entry.fault));
            assert_eq!(Fault::from_number(entry.fault as u64), Some(entry.fault), "{name}");
            let before = &CATALOGUE[..place];
            assert!(before.iter().all(|other| other.name != name && other.fault < entry.fault), "{name}");
            assert!(name.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'-'), "{name}");
            assert!(entry.help.ends_with('.') && !entry.action.is_empty(), "{name}");
        }
        assert_eq!(Fault::from_name("kindness"), None);
    }

    #[test]
    fn what_is_usual_is_within_the_bounds() {
        for entry in CATALOGUE {
            if let Some(Strength { least, most, usual, .. }) = entry.strength {
                assert!(least < most && (least..=most).contains(&usual), "{}", entry.name);
            }
            let lasting = match entry.lasting {
                Lasting::Times(times) => times > 0,
                Lasting::Time(time_s) => time_s > 0.0,
                Lasting::Once | Lasting::Open => true,
            };
            assert!(lasting, "{}", entry.name);
        }
    }
}
