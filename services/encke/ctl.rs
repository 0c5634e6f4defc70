use runtime::page::PageMap;
use runtime::{Plan, SOURCE};
use rustix::process::{Pid, Signal, kill_process};
use supervisor::{Command, Status, Tables, Word};
use transport::Instance;

use crate::assets::Assets;
use crate::cli::{CtlArgs, EventsArgs, Request};
use crate::{Failure, dispatch, events, instances, run};

/// Looks at a running chain, or commands it.
pub(crate) fn ctl(args: &CtlArgs) -> Result<(), Failure> {
    if args.request == Request::Events {
        return events::events(args.instance.as_deref(), args.json, &args.events);
    }
    if args.events != EventsArgs::default() {
        return Err(Failure::start(
            "--follow, --since, --severity, --file and --dictionary are for `encke ctl events`",
        ));
    }
    if let Some(contradiction) = args.contradiction() {
        return Err(Failure::start(contradiction));
    }
    let (instance, running) = instances::find(args.instance.as_deref())?;
    let command = match args.request {
        Request::Events => return Ok(()),
        Request::Status => {
            let status = supervisor::status(&instance).map_err(Failure::start)?;
            let text = if args.json {
                serde_json::to_string_pretty(&status).map_err(Failure::run)? + "\n"
            } else {
                table(&status)
            };
            return crate::print(&text);
        }
        Request::Stop => {
            let supervisor = Pid::from_raw(running.pid as i32);
            let supervisor = supervisor.ok_or_else(|| Failure::start("the supervisor's process is not known"))?;
            return kill_process(supervisor, Signal::TERM).map_err(Failure::run);
        }
        Request::Step => return step(&instance),
        Request::Pause => Command::of(Word::Pause),
        Request::Resume => Command::of(Word::Resume),
        Request::Degrade => Command::of(Word::Degrade),
        Request::Safe => Command::of(Word::Safe),
        Request::Restart => Command { stage: args.stage.clone(), ..Command::of(Word::Restart) },
        Request::RestartChain => Command::of(Word::RestartChain),
        Request::Reload => Command { tables: Some(tables(&instance)?), ..Command::of(Word::Reload) },
    };
    let (mut answer, mut failed) = (supervisor::command(&instance, &command).map_err(Failure::start)?, "refused");
    if answer.accepted && args.request == Request::Reload {
        (answer, failed) = (supervisor::await_tables(&instance, &answer), "not in use everywhere");
    }
    if args.json {
        crate::print(&(serde_json::to_string(&answer).map_err(Failure::run)? + "\n"))?;
    }
    match (answer.accepted, args.json) {
        (true, true) => Ok(()),
        (true, false) => crate::print(&(answer.text + "\n")),
        (false, _) => Err(Failure::run(format!("{failed}: {}", answer.text))),
    }
}

fn step(instance: &Instance) -> Result<(), Failure> {
    let plan = Plan::read(instance).map_err(Failure::start)?;
    if !plan.source.single_step {
        return Err(Failure::start("the chain goes by itself: start it with --pace step to go by steps"));
    }
    let page = PageMap::open(&Plan::page_path(instance, SOURCE)).map_err(Failure::start)?;
    page.steps.give(1);
    Ok(())
}

/// The chain's files as they are now, all of them checked as at a start.
fn tables(instance: &Instance) -> Result<Tables, Failure> {
    let mut plan = Plan::read(instance).map_err(Failure::start)?;
    let assets = Assets::in_dirs(plan.config_dirs.clone());
    plan.parameters = run::parameters(&plan.chain, &assets)?;
    run::executive(&plan.chain, &assets)?;
    dispatch::check_stages(&plan, &assets)?;
    Ok(Tables { parameters: plan.parameters, executive: assets.text("executive.toml").map_err(Failure::start)? })
}

fn table(status: &Status) -> String {
    let waits = if status.mode_took_ms.is_none() { " (not yet in effect)" } else { "" };
    let mut text =
        format!("{} {}{waits}, step {}, sweep {}\n", status.instance, status.mode, status.step, status.sweep);
    text += "stage            pid  state     restarts  heartbeat [ms]    received   published  build\n";
    for stage in &status.stages {
        text += &format!(
            "{:<12}{:>8}  {:<10}{:>8}{:>16.1}{:>12}{:>12}  {}\n",
            stage.stage,
            stage.pid,
            stage.state,
            stage.restarts,
            stage.heartbeat_age_ms,
            stage.received,
            stage.published,
            stage.tier
        );
    }
    text
}
