use runtime::page::PageMap;
use runtime::{Plan, SOURCE};
use rustix::process::{Pid, Signal, kill_process};
use supervisor::Status;

use crate::cli::{CtlArgs, Request};
use crate::{Failure, instances};

/// Looks at a running chain, lets it take a step, or stops it.
pub(crate) fn ctl(args: &CtlArgs) -> Result<(), Failure> {
    let (instance, running) = instances::find(args.instance.as_deref())?;
    match args.request {
        Request::Status => {
            let status = supervisor::status(&instance).map_err(Failure::start)?;
            let text = if args.json {
                serde_json::to_string_pretty(&status).map_err(Failure::run)? + "\n"
            } else {
                table(&status)
            };
            crate::print(&text)
        }
        Request::Stop => {
            let supervisor = Pid::from_raw(running.pid as i32);
            let supervisor = supervisor.ok_or_else(|| Failure::start("the supervisor's process is not known"))?;
            kill_process(supervisor, Signal::TERM).map_err(Failure::run)
        }
        Request::Step => {
            let plan = Plan::read(&instance).map_err(Failure::start)?;
            if !plan.source.single_step {
                return Err(Failure::start("the chain goes by itself: start it with --pace step to go by steps"));
            }
            let page = PageMap::open(&Plan::page_path(&instance, SOURCE)).map_err(Failure::start)?;
            page.steps.give(1);
            Ok(())
        }
    }
}

fn table(status: &Status) -> String {
    let mut text = format!("{} {}, sweep {}\n", status.instance, status.mode, status.sweep);
    text += "stage            pid  state     restarts  heartbeat [ms]    received   published\n";
    for stage in &status.stages {
        text += &format!(
            "{:<12}{:>8}  {:<10}{:>8}{:>16.1}{:>12}{:>12}\n",
            stage.stage,
            stage.pid,
            stage.state,
            stage.restarts,
            stage.heartbeat_age_ms,
            stage.received,
            stage.published
        );
    }
    text
}
