//! `encke inject`: puts one fault into a running chain, or into the machine.

mod files;
mod flood;
mod hogs;
mod page;
mod processes;
mod tables;

use faults::{Fault, Planned, Target, Unit};
use runtime::{Plan, clock};
use transport::Instance;

use crate::cli::InjectArgs;
use crate::{Failure, instances};

/// A running chain, and what is to happen to it.
struct Injection {
    instance: Instance,
    /// Process of its supervisor.
    supervisor: u32,
    plan: Plan,
    planned: Planned,
}

/// Puts one fault into a running chain; returns when it is over, or cannot be taken back any more.
pub(crate) fn inject(args: &InjectArgs) -> Result<(), Failure> {
    let planned = planned(args)?;
    if args.as_worker {
        return hogs::work(&planned);
    }
    if planned.fault.entry().target == Target::Machine {
        return hogs::run(&planned);
    }
    let (instance, running) = instances::find(args.instance.as_deref())?;
    let plan = Plan::read(&instance).map_err(Failure::start)?;
    let injection = Injection { instance, supervisor: running.pid, plan, planned };
    injection.check_stage()?;
    if args.json {
        let now = serde_json::json!({ "time_ns": clock::now_ns(), "planned": injection.planned });
        crate::print(&format!("{now}\n"))?;
    }
    injection.put()
}

/// What the options say, as the catalogue allows it.
fn planned(args: &InjectArgs) -> Result<Planned, Failure> {
    let mut planned = Planned::usual(args.fault, 0.0, args.stage.clone(), args.seed.into());
    if let Some(by) = &args.by {
        planned.argument = Some(strength(args.fault, by)?);
    }
    planned.for_s = args.length.map(|length| length.as_secs_f64()).or(planned.for_s);
    planned.times = args.times.or(planned.times);
    planned.checked().map_err(Failure::start)
}

/// `--by`, in the unit that the catalogue names.
fn strength(fault: Fault, text: &str) -> Result<f64, Failure> {
    let unit = fault.entry().strength.map_or(Unit::Count, |strength| strength.unit);
    let wrong = |cause: &dyn std::fmt::Display| Failure::start(format!("--by {text}: {cause}"));
    if unit == Unit::Count {
        return text.parse().map_err(|cause| wrong(&cause));
    }
    let (sign, length) = text.strip_prefix('-').map_or((1.0, text), |length| (-1.0, length));
    let length = crate::cli::parse_duration(length).map_err(|cause| wrong(&cause))?;
    Ok(sign * length.as_secs_f64() * 1e3)
}

impl Injection {
    /// Whether the chain has the stage, and the fault can hit it.
    fn check_stage(&self) -> Result<(), Failure> {
        let Some(stage) = &self.planned.stage else { return Ok(()) };
        let all: Vec<_> = self.plan.stages().chain(self.plan.tape()).collect();
        if !all.contains(&stage.as_str()) {
            return Err(Failure::start(format!("no stage {stage:?}; there are {}", all.join(", "))));
        }
        let (target, name) = (self.planned.fault.entry().target, self.planned.fault.name());
        let is_tape = self.plan.tape() == Some(stage.as_str());
        let sink = self.plan.stages().last();
        let possible: Vec<&str> = match target {
            // The shell's faults are for those who are in the ledger.
            Target::Stage => self.plan.stages().collect(),
            Target::Writer => sink.into_iter().chain(self.plan.tape()).collect(),
            Target::Parameters => self.plan.parameters.keys().map(String::as_str).collect(),
            _ => all.clone(),
        };
        match possible.contains(&stage.as_str()) {
            true => Ok(()),
            false if is_tape && target == Target::Stage => {
                Err(Failure::start("the tape can only be killed or stopped: name a stage of the chain"))
            }
            false => Err(Failure::start(format!("{name} cannot hit {stage:?}; it can hit {}", possible.join(", ")))),
        }
    }

    fn put(&self) -> Result<(), Failure> {
        match self.planned.fault {
            Fault::Kill | Fault::Stop | Fault::KillSupervisor | Fault::KillAll => self.signal(),
            Fault::Slow | Fault::Swallow => self.by_word(),
            Fault::DiskFull | Fault::ReadOnly | Fault::SharedMemoryLost => self.spoil_files(),
            Fault::ConfigCorruption | Fault::ModelCorruption => self.spoil_tables(),
            Fault::CommandFlood => self.flood(),
            _ => self.ask_on_page(),
        }
    }

    /// The stage that is meant.
    fn stage(&self) -> &str {
        self.planned.stage.as_deref().unwrap_or_default()
    }

    /// The fault's strength as a whole number.
    fn by(&self) -> i64 {
        self.planned.argument.unwrap_or(0.0) as i64
    }

    /// Waits as long as the fault lasts.
    fn wait(&self) {
        wait_s(self.planned.for_s.unwrap_or(0.0));
    }
}

/// Waits, whatever signals come meanwhile.
fn wait_s(time_s: f64) {
    let end_ns = clock::now_ns() + (time_s * 1e9) as u64;
    while clock::now_ns() < end_ns {
        clock::sleep_until_ns(end_ns);
    }
}
