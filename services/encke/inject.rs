use runtime::page::PageMap;
use runtime::{Plan, clock};
use rustix::process::{Signal, kill_process};
use transport::Instance;

use crate::cli::{Fault, InjectArgs};
use crate::{Failure, instances};

/// Puts one fault into a running chain.
pub(crate) fn inject(args: &InjectArgs) -> Result<(), Failure> {
    let (instance, _) = instances::find(args.instance.as_deref())?;
    let plan = Plan::read(&instance).map_err(Failure::start)?;
    let stages: Vec<_> = plan.stages().chain(plan.tape()).collect();
    if !stages.contains(&args.stage.as_str()) {
        return Err(Failure::start(format!("no stage {:?}; there are {}", args.stage, stages.join(", "))));
    }
    let page = PageMap::open(&Plan::page_path(&instance, &args.stage)).map_err(Failure::start)?;
    match args.fault {
        // These two are for the shell round a stage.
        Fault::Slow | Fault::Swallow if plan.tape() == Some(&args.stage) => {
            return Err(Failure::start("the tape can only be killed or stopped: name a stage of the chain"));
        }
        Fault::Slow => page.slow_ns.set(args.by.as_nanos() as u64),
        Fault::Swallow => page.swallow.give(1),
        Fault::Kill => signal(&instance, &page, args, Signal::KILL)?,
        Fault::Stop => {
            signal(&instance, &page, args, Signal::STOP)?;
            let end_ns = clock::now_ns() + args.length.as_nanos() as u64;
            while clock::now_ns() < end_ns {
                clock::sleep_until_ns(end_ns);
            }
            signal(&instance, &page, args, Signal::CONT)?;
        }
    }
    Ok(())
}

fn signal(instance: &Instance, page: &PageMap, args: &InjectArgs, signal: Signal) -> Result<(), Failure> {
    let pid = supervisor::stage_process(instance, page);
    let pid = pid.ok_or_else(|| Failure::run(format!("stage {:?} has no process", args.stage)))?;
    kill_process(pid, signal).map_err(|cause| Failure::run(format!("stage {:?}: {cause}", args.stage)))
}
