//! `encke`: one executable, many processes.
//!
//! The only place that knows every stage by name, and the only one that turns results into exit codes:
//! 0 done, 1 the run itself failed, 2 could not start.

mod assets;
mod bench;
mod cli;
mod ctl;
mod dispatch;
mod doctor;
mod evaluate;
mod events;
mod inject;
mod instances;
mod live;
mod metrics;
mod outputs;
mod report;
mod run;
mod simulate;
mod soak;
mod sources;
mod spoiling;
mod taping;
mod top;
mod train;
mod view;

use std::alloc::System;
use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use cli::{Cli, Command};
use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

/// Counts heap allocations, so that a stage can show that it makes none.
#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Heap allocations of this process so far.
fn heap_allocations() -> u64 {
    let stats = ALLOCATOR.stats();
    (stats.allocations + stats.reallocations) as u64
}

/// How a command ended, when not well.
#[derive(Debug)]
pub(crate) enum Failure {
    /// It ran and failed: exit code 1.
    Failed(String),
    /// It could not start: exit code 2.
    CannotStart(String),
}

impl Failure {
    /// Something that must be right before anything starts was not.
    pub(crate) fn start(cause: impl ToString) -> Self {
        Self::CannotStart(cause.to_string())
    }

    /// Something went wrong on the way.
    pub(crate) fn run(cause: impl ToString) -> Self {
        Self::Failed(cause.to_string())
    }
}

/// Prints a result. A reader that has seen enough (`| head`) is no failure.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(cause) if cause.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::run(cause)),
        _ => Ok(()),
    }
}

fn main() -> ExitCode {
    runtime::logging::abort_on_panic();
    runtime::ignore_file_limit();
    let outcome = match Cli::parse().chosen() {
        Command::Run(args) => run::run(&args),
        Command::Stage(args) => dispatch::stage(&args),
        Command::Simulate(args) => simulate::simulate(&args),
        Command::Train(args) => train::train(&args),
        Command::Evaluate(args) => evaluate::evaluate(&args),
        Command::Bench(args) => bench::bench(&args),
        Command::BenchHopPeer(args) => bench::hop::peer(&args),
        Command::Inject(args) => inject::inject(&args),
        Command::Soak(args) => soak::soak(&args),
        Command::Ctl(args) => ctl::ctl(&args),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Report(args) => report::report(&args),
        Command::Top(args) => top::top(&args),
        Command::Metrics(args) => metrics::metrics(&args),
        Command::Live(args) => live::live(&args),
        Command::View(args) => view::view(&args),
    };
    let (cause, code) = match outcome {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Failed(cause)) => (cause, 1),
        Err(Failure::CannotStart(cause)) => (cause, 2),
    };
    // A terminal that has closed is no reason to end by a panic.
    let _ = writeln!(std::io::stderr(), "encke: {cause}");
    ExitCode::from(code)
}
