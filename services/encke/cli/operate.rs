//! Options of the commands that act on a running chain.

use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use faults::{CATALOGUE, Entry, Fault};

use super::{EventsArgs, parse_duration};

/// Options of `encke inject`.
#[derive(Args, Clone, Debug)]
pub(crate) struct InjectArgs {
    /// The fault.
    #[arg(value_parser = faults())]
    pub(crate) fault: Fault,
    /// The stage, where the fault hits one.
    pub(crate) stage: Option<String>,
    /// How strong: a level, a factor, workers, bytes, lines a second; slow and clock-step: a time.
    #[arg(long, value_name = "STRENGTH", visible_aliases = ["level", "workers"], allow_hyphen_values = true)]
    pub(crate) by: Option<String>,
    /// For how long, where it lasts.
    #[arg(long = "for", value_name = "TIME", value_parser = parse_duration)]
    pub(crate) length: Option<Duration>,
    /// How often, or for how many sweeps.
    #[arg(long, value_name = "N")]
    pub(crate) times: Option<u64>,
    /// Of all that is random in it.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u32,
    /// The chain. [default: the only one that runs]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Print when it was put in, and what, as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// This process is one worker of a hog.
    #[arg(long, hide = true)]
    pub(crate) as_worker: bool,
}

/// The words of the catalogue, with a line of help each.
fn faults() -> impl TypedValueParser<Value = Fault> {
    let word = |entry: &Entry| PossibleValue::new(entry.name).help(entry.help);
    PossibleValuesParser::new(CATALOGUE.iter().map(word))
        .try_map(|name| Fault::from_name(&name).ok_or_else(|| format!("no fault {name:?}")))
}

/// What to ask of a running chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Request {
    /// Its mode, its stages and their counts.
    Status,
    /// Stand still between two sweeps; all processes wait.
    Pause,
    /// Go on after a pause; else do all of the work again, with a fresh chance for stages that were replaced.
    Resume,
    /// Leave out one step of the ladder of overload more.
    Degrade,
    /// Do the least that is useful: locate obstacles, do not classify them.
    Safe,
    /// End a stage's process and start it again, as configured.
    Restart,
    /// The same with all stages.
    RestartChain,
    /// Read stage parameters and executive.toml again; they are checked first, and used from one sweep on. Waits until each
    /// stage uses them.
    Reload,
    /// Stop in order, drain, report.
    Stop,
    /// With --pace step: one more sweep.
    Step,
    /// What happened, from the log of the run.
    Events,
}

/// Options of `encke ctl`.
#[derive(Args, Clone, Debug)]
pub(crate) struct CtlArgs {
    /// What to do.
    #[arg(value_enum)]
    pub(crate) request: Request,
    /// restart: the stage.
    pub(crate) stage: Option<String>,
    /// The chain. [default: the only one that runs]
    #[arg(long, value_name = "NAME")]
    pub(crate) instance: Option<String>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) events: EventsArgs,
}

impl CtlArgs {
    /// An argument that would change nothing, if there is one, or one that is missing.
    pub(crate) fn contradiction(&self) -> Option<String> {
        let word = self.request.to_possible_value()?.get_name().to_owned();
        match (&self.stage, self.request) {
            (None, Request::Restart) => {
                Some("restart needs a stage; `encke ctl restart-chain` restarts all of them".to_owned())
            }
            (Some(stage), request) if request != Request::Restart => {
                Some(format!("{word} takes no stage: leave {stage:?} out"))
            }
            _ if self.json && matches!(self.request, Request::Stop | Request::Step) => {
                Some(format!("{word} prints nothing: leave --json out"))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Bare {
        #[command(flatten)]
        args: CtlArgs,
    }

    fn contradiction(args: &[&str]) -> Option<String> {
        let args = ["ctl"].iter().chain(args);
        Bare::parse_from(args).args.contradiction()
    }

    #[test]
    fn arguments_that_change_nothing_are_refused() {
        for args in [["restart", "clusterer"].as_slice(), &["pause"], &["restart-chain"], &["status", "--json"]] {
            assert_eq!(contradiction(args), None);
        }
        for args in [["pause", "clusterer"].as_slice(), &["restart"], &["stop", "--json"], &["reload", "clusterer"]] {
            assert!(contradiction(args).is_some(), "{args:?}");
        }
    }
}
