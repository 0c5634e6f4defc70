use serde::{Deserialize, Serialize};

/// How grave an event is.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// As it should be.
    Info,
    /// Something is lost, late or left out, and the chain goes on.
    Warning,
    /// A process or a file does not work, and something is done about it.
    Error,
    /// The chain does not do its task any more.
    Critical,
}

/// What stands in the dictionary about an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The event.
    pub id: EventId,
    /// Its word in logs.
    pub name: &'static str,
    /// How grave it is.
    pub severity: Severity,
    /// What a stage says of it: `{a}` and `{b}` stand for its two numbers. The supervisor words its own.
    pub text: &'static str,
    /// What it means, and what to do about it.
    pub meaning: &'static str,
}

macro_rules! dictionary {
    ($($id:ident = $number:literal, $severity:ident, $name:literal, $text:literal, $meaning:literal;)*) => {
        /// Something that can happen. The number never changes its meaning.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[repr(u32)]
        pub enum EventId {
            $(
                #[doc = $meaning]
                $id = $number,
            )*
        }

        /// Everything that can happen, by number.
        pub const DICTIONARY: &[Entry] = &[
            $(Entry {
                id: EventId::$id,
                name: $name,
                severity: Severity::$severity,
                text: $text,
                meaning: $meaning,
            },)*
        ];
    };
}

dictionary! {
    // 1xx: the run
    RunBegan = 101, Info, "run_began", "", "All processes are up and the source may send.";
    RunEnds = 102, Info, "run_ends", "", "The chain is drained and its processes leave.";
    SupervisorAdopted = 103, Warning, "supervisor_adopted", "",
        "A supervisor had died; its successor took over the stages that went on without it. Look for what killed it.";
    WatchdogHeld = 104, Warning, "watchdog_held", "",
        "The service manager's watchdog was not fed, because a stage is not well. It restarts the chain if that lasts.";

    // 2xx: processes and their health
    StageStarted = 201, Info, "stage_started", "", "A process of a stage is connected.";
    StageDied = 202, Error, "stage_died", "", "A process ended that should not have. What it had in hand is in the ledger.";
    StageHung = 203, Error, "stage_hung", "",
        "A process lives, computes nothing and makes no progress: it was stopped, or waits for what never comes.";
    StageSpinning = 204, Error, "stage_spinning", "",
        "A process computes and makes no progress for longer than the table allows.";
    StageSlow = 205, Warning, "stage_slow", "", "A stage overruns its budget again and again, or stays in one part for long.";
    StageSilent = 206, Error, "stage_silent", "",
        "A process is awake and takes no input though some waits; the source: sends nothing though it should.";
    StageFlooding = 207, Warning, "stage_flooding", "", "A source sends more sweeps than its sensor turns, or a process more events than are read.";
    StageWell = 208, Info, "stage_well", "", "A stage that was not well is well again.";
    StageRestarted = 209, Warning, "stage_restarted", "", "A process was started in place of one that ended.";
    StageKilled = 210, Warning, "stage_killed", "", "A process that was not well was ended, so that its successor can start.";
    BudgetSpent = 211, Critical, "budget_spent", "",
        "A stage used up its restarts. It goes on with built-in parameters, then as a stand-in; `encke ctl resume` gives it another chance.";
    StandIn = 212, Critical, "stand_in", "", "A stand-in answers for a stage: parts pass through it empty, rejected as `down`.";
    StageGivenUp = 213, Critical, "stage_given_up", "", "A stage is not started any more. `encke ctl restart` tries again.";
    ChainRestarted = 214, Error, "chain_restarted", "", "All stages were ended and started again.";
    CannotStart = 215, Error, "cannot_start", "", "A successor refused to start: its parameters, its model or its files are not what they were. Its own line on stderr says why.";
    TapeStopped = 216, Error, "tape_stopped", "", "Nothing more is recorded.";

    // 3xx: parts
    PartsDropped = 301, Warning, "parts_dropped", "{a} parts overflowed the queue before part {b}",
        "A stage was too slow for its input; what did not fit into the queue is in the ledger.";
    PartsLost = 302, Error, "parts_lost", "{a} parts before part {b} died with a process",
        "What a process had sent or had in hand when it died, and nobody received.";
    SentAgain = 303, Warning, "sent_again", "from sweep {a} on, attempt {b}",
        "At --pace fast: the source sends again what died on the way.";
    SinkBehind = 304, Warning, "sink_behind", "{a} parts refused, the last is {b}", "The disk under the recorder is too slow; rows are missing in its files.";
    StaleRefused = 305, Warning, "stale_refused", "{a} parts older than allowed, the last is {b}",
        "Parts were too old to act on when they came; they are rejected.";
    PartsRejected = 306, Warning, "parts_rejected", "{a} parts, reason {b}",
        "A stage could not use parts: they were incomplete, malformed, or more than it holds. The ledger has them by reason.";

    // 4xx: time, overload, limits
    BudgetOverrun = 401, Warning, "budget_overrun", "busy for {a} µs of {b}", "A stage was busy with a sweep for longer than its budget.";
    DeadlineMissed = 402, Warning, "deadline_missed", "answered {a} µs after its last return, {b} allowed", "A sweep was answered late.";
    StepTaken = 403, Warning, "step_taken", "", "The chain leaves out more of its work: it was overloaded.";
    StepReturned = 404, Info, "step_returned", "", "The chain leaves out less of its work.";
    LimitViolated = 405, Warning, "limit_violated", "", "A watched value left its bounds for as many looks as the table asks.";
    LimitRestored = 406, Info, "limit_restored", "", "A watched value is within its bounds again.";
    LimitStale = 407, Warning, "limit_stale", "", "A watched value does not come any more.";
    LimitNoNumber = 408, Error, "limit_no_number", "", "A watched value is no number: what it is made from is wrong.";

    // 5xx: modes, commands, tables
    ModeEntered = 501, Info, "mode_entered", "", "The mode changed as it should, within two sweeps.";
    SafeEntered = 502, Critical, "safe_entered", "",
        "The chain does the least that is useful: obstacles are located, not classified. Only a command leads out.";
    ModeLate = 503, Error, "mode_late", "", "A change of mode did not take effect within two sweeps.";
    CommandAccepted = 504, Info, "command_accepted", "", "A command was carried out.";
    CommandRefused = 505, Warning, "command_refused", "", "A command was not carried out: it was wrong, or came in a flood.";
    TableAccepted = 506, Info, "table_accepted", "", "New parameters hold and will be used from the sweep named on.";
    TableRefused = 507, Error, "table_refused", "generation {a} of the parameters does not hold", "New parameters do not hold; the old ones stay in use.";
    TableActive = 508, Info, "table_active", "parameters {a} are in use from sweep {b} on", "A stage uses its new parameters.";

    // 6xx: files
    FileFailed = 601, Error, "file_failed", "{a} files could not be written, {b} by now", "A file could not be written and is closed; what it lacks is counted.";
    FileRotated = 602, Info, "file_rotated", "file {a} of the recording is begun", "The recording goes on in the next file.";
    SharedMemoryGone = 603, Error, "shared_memory_gone", "", "Somebody deleted files of the chain in shared memory: whoever starts later could not join. All processes leave in order and come back with new ones; beyond the budget of the chain, or where others start the stages, the chain is stopped.";

    // 7xx: what the source sends, and what is in it
    SourceEnded = 701, Info, "source_ended", "after sweep {a}", "The recording, or what was asked for, has come to its end.";
    ClockStep = 702, Warning, "clock_step", "sensor time leapt {a} ms ahead, {b} ms back", "Sensor time went back or leapt ahead; the sweeps go on.";

    CollisionAlert = 703, Warning, "collision_alert", "track {a}, {b}",
        "An obstacle is likelier to be met within the horizon than the tracker's parameters allow. Said once, until that has passed.";

    // 8xx: faults on purpose
    FaultInjected = 801, Info, "fault_injected", "fault {a} of the catalogue, by {b}", "Somebody put a fault into the chain with `encke inject`.";

    // 9xx: the log itself
    EventsUnread = 901, Warning, "events_unread", "", "A stage said more than was read; the gravest are kept.";
    EventsUnsaid = 902, Info, "events_unsaid", "", "Events of one kind came so often that only their number is told.";
}

impl EventId {
    /// The event of a number.
    pub fn from_number(number: u32) -> Option<Self> {
        DICTIONARY.iter().map(|entry| entry.id).find(|id| *id as u32 == number)
    }

    /// What the dictionary says of it.
    pub fn entry(self) -> &'static Entry {
        // Each variant stands in the dictionary: one macro makes both.
        DICTIONARY.iter().find(|entry| entry.id == self).unwrap_or(&DICTIONARY[0])
    }

    /// How grave it is.
    pub fn severity(self) -> Severity {
        self.entry().severity
    }

    /// What a stage says of it, with its two numbers.
    pub fn text(self, a: u64, b: u64) -> String {
        self.entry().text.replace("{a}", &a.to_string()).replace("{b}", &b.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_are_given_once_and_rise() {
        for pair in DICTIONARY.windows(2) {
            assert!(pair[0].id < pair[1].id, "{:?} before {:?}", pair[0].id, pair[1].id);
        }
        for (place, entry) in DICTIONARY.iter().enumerate() {
            assert!(DICTIONARY[..place].iter().all(|other| other.name != entry.name), "{}", entry.name);
            assert_eq!(EventId::from_number(entry.id as u32), Some(entry.id));
            assert!(entry.meaning.ends_with('.'), "{}", entry.name);
        }
        assert_eq!(EventId::from_number(0), None);
    }

    #[test]
    fn a_stages_event_tells_its_numbers() {
        assert_eq!(EventId::PartsDropped.text(3, 40), "3 parts overflowed the queue before part 40");
    }
}
