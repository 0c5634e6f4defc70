//! What this machine allows the chain, and what to do about the rest.

mod figures;
mod house;
mod machine;
mod memory;
mod realtime;
mod shared_memory;

use serde::Serialize;

use crate::assets::Assets;
use crate::cli::{DoctorArgs, RunArgs};
use crate::{Failure, dispatch, run};

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum State {
    /// As it should be.
    Ok,
    /// The chain runs, and would run better with the remedy.
    Warn,
    /// The chain cannot run.
    Fail,
}

/// One thing that was looked at.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Check {
    check: &'static str,
    state: State,
    found: String,
    /// What to do; none where all is well.
    remedy: Option<String>,
}

impl Check {
    fn ok(check: &'static str, found: impl ToString) -> Self {
        Self { check, state: State::Ok, found: found.to_string(), remedy: None }
    }

    fn warn(check: &'static str, found: impl ToString, remedy: impl ToString) -> Self {
        Self { check, state: State::Warn, found: found.to_string(), remedy: Some(remedy.to_string()) }
    }

    fn fail(check: &'static str, found: impl ToString, remedy: impl ToString) -> Self {
        Self { check, state: State::Fail, found: found.to_string(), remedy: Some(remedy.to_string()) }
    }

    /// Well where `holds`, else a warning.
    fn ok_if(holds: bool, check: &'static str, found: impl ToString, remedy: impl ToString) -> Self {
        if holds { Self::ok(check, found) } else { Self::warn(check, found, remedy) }
    }
}

/// The whole examination.
#[derive(Serialize)]
struct Report {
    encke: &'static str,
    can_run: bool,
    checks: Vec<Check>,
    shared_memory: Vec<shared_memory::HopBill>,
}

/// Examines the machine; fails when the chain cannot run.
pub(crate) fn doctor(args: &DoctorArgs) -> Result<(), Failure> {
    runtime::logging::install("warn");
    let assets = Assets::beside(args.chain.as_deref());
    let plan = run::plan(&RunArgs { chain: args.chain.clone(), ..RunArgs::default() }, &assets)?;
    let chain = &plan.chain;
    let bill = shared_memory::bill(chain);
    let mut checks = vec![match dispatch::check(&plan, &assets) {
        Ok(_) => Check::ok("chain", format!("{} stages and a source, all can be built", chain.stages.len())),
        Err(Failure::CannotStart(cause) | Failure::Failed(cause)) => {
            Check::fail("chain", cause, "set right what it names")
        }
    }];
    checks.extend(machine::checks());
    checks.extend(realtime::checks(chain));
    checks.extend(memory::checks(chain));
    checks.extend(shared_memory::checks(&bill));
    checks.extend(house::checks());
    checks.extend(figures::checks());
    let can_run = checks.iter().all(|check| check.state != State::Fail);
    let report = Report { encke: env!("CARGO_PKG_VERSION"), can_run, checks, shared_memory: bill };
    let text =
        if args.json { serde_json::to_string_pretty(&report).map_err(Failure::run)? + "\n" } else { table(&report) };
    crate::print(&text)?;
    if can_run { Ok(()) } else { Err(Failure::Failed("the chain cannot run on this machine".to_owned())) }
}

fn table(report: &Report) -> String {
    let mut text = String::new();
    for check in &report.checks {
        let state = match check.state {
            State::Ok => "ok",
            State::Warn => "warn",
            State::Fail => "fail",
        };
        text += &format!("{state:<5} {:<20} {}\n", check.check, check.found);
        if let Some(remedy) = &check.remedy {
            text += &format!("{:<26} → {remedy}\n", "");
        }
    }
    text + &shared_memory::table(&report.shared_memory)
}

/// The text of a small file of the kernel's, without the line's end; none where it is not there.
fn line_of(path: &str) -> Option<String> {
    std::fs::read_to_string(path).ok().map(|text| text.trim_end().to_owned())
}
