use messages::{Hop, Trace, Verdict};
use stage::Stage;
use transport::{Outlet, Taken};

use crate::deadline::Deadline;
use crate::reader::{Arrivals, Reader, serve};
use crate::refused::Refused;
use crate::run_delay::Laps;
use crate::shell::WARM_UP_PARTS;
use crate::tables::Tables;
use crate::{Plan, Shell, ShellError, clock};

/// The main loop of every stage in the middle of the chain, which `rebuild` builds anew from a plan with other
/// parameters. Returns when the stage was asked to leave and has drained its input.
pub fn run_stage<S: Stage>(
    stage: S,
    shell: &Shell,
    rebuild: impl Fn(&Plan) -> Result<S, String>,
) -> Result<(), ShellError> {
    let node = shell.join()?;
    let outlet = node.outlet::<S::Output>()?;
    let inlet = node.inlet::<S::Input>()?;
    shell.running();
    serve(shell, &inlet, &mut Cycle::new(stage, shell, outlet, rebuild))?;
    shell.left();
    Ok(())
}

struct Cycle<'a, S: Stage, B> {
    tables: Tables<'a, S>,
    rebuild: B,
    shell: &'a Shell,
    outlet: Outlet<S::Output>,
    arrivals: Arrivals<'a>,
    deadline: Deadline,
    refused: Refused,
    taken_by_others: Laps,
}

impl<'a, S: Stage, B> Cycle<'a, S, B> {
    fn new(stage: S, shell: &'a Shell, outlet: Outlet<S::Output>, rebuild: B) -> Self {
        let deadline = Deadline::of(&shell.plan, &shell.name);
        let taken_by_others = Laps::of_this_thread();
        let (arrivals, refused) = (Arrivals::new(shell), Refused::default());
        let tables = Tables::new(&shell.page, stage, S::take_over, shell.plan.kept_sweeps() as u64);
        Self { tables, rebuild, shell, outlet, arrivals, deadline, refused, taken_by_others }
    }
}

/// Builds a stage from the latest plan.
fn build<S>(shell: &Shell, rebuild: impl Fn(&Plan) -> Result<S, String>) -> Result<S, String> {
    rebuild(&Plan::read(&shell.instance).map_err(|cause| cause.to_string())?)
}

impl<S: Stage, B: Fn(&Plan) -> Result<S, String>> Reader<S::Input> for Cycle<'_, S, B> {
    /// One part: receive → in hand → process → send → published → counted → out of hand → release.
    fn take(&mut self, taken: &Taken<S::Input>) -> Result<(), ShellError> {
        let Self { tables, rebuild, shell, outlet, arrivals, deadline, refused, taken_by_others } = self;
        let page = &shell.page;
        let received_ns = clock::now_ns();
        let mut trace: Trace = *taken.trace();
        if !arrivals.receive(&trace) {
            return Ok(());
        }

        let stage = tables.at(trace.part.sweep, || build(shell, &*rebuild));
        let before_shell = (shell.allocations)();
        let mut loan = outlet.loan()?;
        let taken_before_ns = taken_by_others.lap_ns();
        let started_ns = clock::now_ns();
        shell.fault_in_hand();
        let before_process = (shell.allocations)();
        let verdict = if deadline.is_stale(&trace, started_ns) {
            Verdict::RejectedStale
        } else {
            stage.process(trace.part, taken.message(), loan.message_mut())
        };
        let in_process = (shell.allocations)() - before_process;
        shell.slow_down(trace.part);
        shell.toil(started_ns);
        let finished_ns = clock::now_ns();
        let taken_busy_ns = taken_by_others.lap_ns();

        page.note_verdict(verdict);
        let hop = Hop {
            sequence: page.published.get(),
            free_ns: arrivals.free_ns,
            received_ns,
            started_ns,
            finished_ns,
            taken_before_ns,
            taken_busy_ns,
            incarnation: shell.incarnation,
            stage: shell.position,
            verdict,
            reserved: 0,
        };
        deadline.judge(page, &trace, &hop);
        trace.push(hop);
        *loan.trace_mut() = trace;
        loan.send()?;
        page.count_sent(trace.part);
        page.count_verdict(verdict);
        page.put_down();
        refused.note(page, &trace.part, verdict);
        if trace.part.is_last() {
            tables.sweep_ended();
        }

        arrivals.parts += 1;
        if arrivals.parts > WARM_UP_PARTS {
            page.process_allocations.add(in_process);
            page.shell_allocations.add((shell.allocations)() - before_shell - in_process);
            page.counted_parts.add(1);
        }
        arrivals.free_ns = clock::now_ns();
        page.sent_ns.set(arrivals.free_ns);
        Ok(())
    }

    fn idle(&mut self) -> Result<(), ShellError> {
        self.tables.build_if_wanted(|| build(self.shell, &self.rebuild));
        Ok(())
    }
}
