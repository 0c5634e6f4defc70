//! `encke ctl events`: what happened in a run, and what can happen in any.

use std::path::Path;

use events::{DICTIONARY, Event, EventId, Reader, Severity};
use runtime::{Plan, clock};
use supervisor::Running;

use crate::cli::{EventsArgs, SeverityArg};
use crate::{Failure, instances};

/// Between two looks for more [ns].
const LOOK_NS: u64 = 50_000_000;

/// Prints the log of a running chain or of a file, or the dictionary.
pub(crate) fn events(instance: Option<&str>, json: bool, args: &EventsArgs) -> Result<(), Failure> {
    if args.dictionary {
        return crate::print(&if json { dictionary_json()? } else { dictionary() });
    }
    let least = args.severity.map_or(Severity::Info, Severity::from);
    if let Some(file) = &args.file {
        // A log that is not there yet is no reason to wait.
        std::fs::metadata(file).map_err(|cause| Failure::start(format!("{}: {cause}", file.display())))?;
        return show(file, json, args, least, || false);
    }
    let (instance, _) = instances::find(instance)?;
    show(&Plan::events_path(&instance), json, args, least, || Running::of(&instance).is_some())
}

/// Prints what is in the log; with --follow, then what comes as long as `goes_on`. What was cut away is told on stderr.
fn show(log: &Path, json: bool, args: &EventsArgs, least: Severity, goes_on: impl Fn() -> bool) -> Result<(), Failure> {
    let mut reader = Reader::new(log, args.since.unwrap_or(0));
    let mut missed = 0;
    loop {
        // Asked before the look: what was said until the end is read.
        let more = args.follow && goes_on();
        let mut text = String::new();
        reader.read(|event| {
            if event.severity >= least {
                text += &if json { serde_json::to_string(&event).unwrap_or_default() } else { line(&event) };
                text.push('\n');
            }
        });
        if reader.missed() > missed {
            eprintln!("encke: {} events are not in the log any more", reader.missed() - missed);
            missed = reader.missed();
        }
        if !text.is_empty() && !write(&text)? {
            return Ok(());
        }
        if !more {
            return Ok(());
        }
        clock::sleep_ns(LOOK_NS);
    }
}

/// Prints at once; false where nobody reads any more.
fn write(text: &str) -> Result<bool, Failure> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Ok(()) => Ok(true),
        Err(cause) if cause.kind() == std::io::ErrorKind::BrokenPipe => Ok(false),
        Err(cause) => Err(Failure::run(cause)),
    }
}

fn line(event: &Event) -> String {
    let Event { number, time_ns, severity, stage, sweep, name, text, unsaid, .. } = event;
    let (s, us) = (time_ns / 1_000_000_000, time_ns / 1_000 % 1_000_000);
    let unsaid = if *unsaid > 0 { format!(" ({unsaid} unsaid before)") } else { String::new() };
    let severity = word(*severity);
    format!("{number:>6}  {s:>7}.{us:06}  {severity:<8}  {stage:<10}  sweep {sweep:<6}  {name}: {text}{unsaid}")
}

fn word(severity: Severity) -> &'static str {
    match severity {
        Severity::Info => "info",
        Severity::Warning => "warning",
        Severity::Error => "error",
        Severity::Critical => "critical",
    }
}

impl From<SeverityArg> for Severity {
    fn from(arg: SeverityArg) -> Self {
        match arg {
            SeverityArg::Info => Self::Info,
            SeverityArg::Warning => Self::Warning,
            SeverityArg::Error => Self::Error,
            SeverityArg::Critical => Self::Critical,
        }
    }
}

/// What can happen, as a page of Markdown.
fn dictionary() -> String {
    let mut text = INTRODUCTION.to_owned();
    for entry in DICTIONARY {
        let (number, severity) = (entry.id as u32, word(entry.severity));
        let said = if entry.text.is_empty() { "supervisor" } else { "stage" };
        text += &format!("| {number} | `{}` | {severity} | {said} | {} |\n", entry.name, entry.meaning);
    }
    text
}

fn dictionary_json() -> Result<String, Failure> {
    let entry = |id: EventId| {
        let entry = id.entry();
        serde_json::json!({
            "id": id as u32,
            "name": entry.name,
            "severity": entry.severity,
            "text": entry.text,
            "meaning": entry.meaning,
        })
    };
    let all: Vec<_> = DICTIONARY.iter().map(|of| entry(of.id)).collect();
    Ok(serde_json::to_string_pretty(&all).map_err(Failure::run)? + "\n")
}

const INTRODUCTION: &str = "\
# Events

Everything that a chain says of itself, by number. This page is `encke ctl events --dictionary`; a test compares both.

The supervisor alone writes the log, one JSON object a line, with the fields
`number` (place in the log, from 0, without gaps), `time_ns` (the kernel's monotonic clock), `utc_ns` (time of day, since 1970), `id`,
`name`, `severity`, `stage` (the process that it is about, or `chain`), `sweep` (the sweep that it happened at), `text`, `unsaid`.

- `encke ctl events` shows the log of a running chain, `--follow` goes on with it. The log goes with the chain; `encke run --events
  FILE.jsonl` keeps a copy, which `encke ctl events --file FILE.jsonl` shows. Recordings have it in `/encke/events`.
- Of each event of each process so many are said at once and then so many a second (`executive.toml`, `[events]`). Errors and
  worse, and whatever is worse than all before of its kind, are always said. What is left unsaid is counted: in `unsaid` of the next
  of its kind, or in `events_unsaid` when the storm is over.
- The log is cut to its latest half when it reaches `log_mib`. A reader sees by the numbers what he missed.
- Each process keeps what it says in two rings on its page, one for errors and worse, and the supervisor reads them every 5 ms.
  What was overwritten before that is told by `events_unread`.

Severities, beside those of ECSS-E-ST-70-41C (PUS, service 5), of F´ and of cFS (EVS):

| severity | means | PUS | F´ | cFS |
|---|---|---|---|---|
| info | as it should be | TM[5,1] informative | ACTIVITY_HI | INFORMATION |
| warning | something is lost, late or left out, and the chain goes on | TM[5,2] low severity anomaly | WARNING_LO | ERROR |
| error | a process or a file does not work, and something is done about it | TM[5,3] medium severity anomaly | WARNING_HI | ERROR |
| critical | the chain does not do its task any more | TM[5,4] high severity anomaly | FATAL (which resets there; here it does not) | CRITICAL |

The number says what it is about: 1xx the run, 2xx processes and their health, 3xx parts, 4xx time, overload and limits, 5xx modes,
commands and tables, 6xx files, 7xx what the source sends, 8xx faults on purpose, 9xx the log itself. A number never changes
its meaning.

| id | name | severity | said by | meaning |
|---|---|---|---|---|
";
