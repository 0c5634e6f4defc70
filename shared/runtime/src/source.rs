use messages::{Hop, Part, Sweep, SweepHeader, Trace, Truth, Verdict};
use stage::{Next, Source};
use transport::{Loan, Outlet};

use crate::pacer::Pacer;
use crate::page::State;
use crate::window::Window;
use crate::{Pace, Shell, ShellError, clock};

/// Between two looks at the other pages while the window is shut [ns].
const WINDOW_LOOK_NS: u64 = 100_000;
/// Between two looks at the flags while there is nothing to do [ns].
const LOOK_NS: u64 = 20_000_000;

/// The main loop of the source. Returns when it was asked to leave; at the end of the data it waits for that, because
/// what it has sent lives in its shared memory.
pub fn run_source<S: Source>(mut source: S, shell: &Shell) -> Result<(), ShellError> {
    let node = shell.join()?;
    let mut out = Out {
        shell,
        sweeps: node.outlet()?,
        truths: node.outlet()?,
        pacer: Pacer::default(),
        free_ns: clock::now_ns(),
    };
    let window = Window::open(shell)?;
    shell.running();
    // Nothing is sent before everybody listens.
    wait_while(shell, LOOK_NS, || shell.page.may_start.get() == 0);

    // A successor goes on where its predecessor stopped.
    let mut ordinal = shell.page.next_ordinal_out.get();
    if ordinal > 0 {
        let (mut sweep, mut truth) = (out.sweeps.loan()?, out.truths.loan()?);
        source.skip(ordinal, sweep.message_mut(), truth.message_mut())?;
    }
    while shell.plan.sweeps.is_none_or(|sweeps| ordinal < sweeps) {
        match shell.plan.pace {
            Pace::Fast => wait_while(shell, WINDOW_LOOK_NS, || !window.has_room(shell.page.published.get())),
            // The stages first: whoever makes the next sweep at once keeps the core from the one it has just woken.
            Pace::Realtime => out.wait_until(out.pacer.quiet_until_ns()),
        }
        if shell.leaving() || !out.make_and_send(&mut source, ordinal)? {
            break;
        }
        ordinal += 1;
    }
    shell.page.set_state(State::Ended);
    wait_while(shell, LOOK_NS, || true);
    shell.left();
    Ok(())
}

/// Sleeps as long as `holds`, alive, or until asked to leave.
fn wait_while(shell: &Shell, look_ns: u64, holds: impl Fn() -> bool) {
    while holds() && !shell.leaving() {
        shell.page.beat(clock::now_ns());
        clock::sleep_ns(look_ns);
    }
}

/// The way out of the source.
struct Out<'a> {
    shell: &'a Shell,
    sweeps: Outlet<Sweep>,
    truths: Outlet<Truth>,
    pacer: Pacer,
    free_ns: u64,
}

impl Out<'_> {
    /// One part: in hand → made → due → sent → published → out of hand. False at the end of the data, or when asked to
    /// leave before the part was due.
    fn make_and_send<S: Source>(&mut self, source: &mut S, ordinal: u64) -> Result<bool, ShellError> {
        let shell = self.shell;
        let received_ns = clock::now_ns();
        shell.page.make_in_hand(ordinal);
        let (mut sweep, mut truth) = (self.sweeps.loan()?, self.truths.loan()?);
        let started_ns = clock::now_ns();
        let next = source.next(sweep.message_mut(), truth.message_mut())?;
        shell.slow_down();
        let header = sweep.message_mut().header;
        if next == Next::End || self.is_over(&header) {
            shell.page.put_down();
            return Ok(false);
        }
        let due_ns = match shell.plan.pace {
            Pace::Fast => clock::now_ns(),
            Pace::Realtime => self.pacer.due_ns(header.sensor_time_ns, header.period_ns, received_ns),
        };
        self.wait_until(due_ns);
        if clock::now_ns() < due_ns {
            shell.page.put_down();
            return Ok(false);
        }
        if shell.page.swallow.take_one() {
            shell.page.put_down();
            return Ok(true);
        }
        let part = Part {
            ordinal,
            sweep: ordinal,
            sector: 0,
            sectors: 1,
            sensor_time_ns: header.sensor_time_ns,
            step: 0,
            reserved: 0,
        };
        let mut trace = Trace { part, due_ns, ..Trace::default() };
        trace.push(self.hop(received_ns, started_ns));
        send(shell, sweep, truth, trace)?;
        self.free_ns = clock::now_ns();
        Ok(true)
    }

    fn hop(&self, received_ns: u64, started_ns: u64) -> Hop {
        Hop {
            sequence: self.shell.page.published.get(),
            free_ns: self.free_ns,
            received_ns,
            started_ns,
            finished_ns: clock::now_ns(),
            taken_before_ns: 0,
            taken_busy_ns: 0,
            incarnation: self.shell.incarnation,
            stage: self.shell.position,
            verdict: Verdict::Complete,
            reserved: 0,
        }
    }

    /// Whether the sweep ends after the sensor time that was asked for; the first sweep of the run begins it, whichever
    /// life of the source made it.
    fn is_over(&self, header: &SweepHeader) -> bool {
        let began = &self.shell.page.began_sensor_ns;
        if began.get() == 0 {
            began.set(header.sensor_time_ns + 1);
        }
        let end_ns = header.sensor_time_ns + header.period_ns;
        let passed_ns = (end_ns + 1).saturating_sub(began.get());
        self.shell.plan.duration_ns.is_some_and(|duration_ns| passed_ns > duration_ns)
    }

    /// Sleeps until host time `until_ns`, alive, or until asked to leave.
    fn wait_until(&self, until_ns: u64) {
        while clock::now_ns() < until_ns && !self.shell.leaving() {
            self.shell.page.beat(clock::now_ns());
            clock::sleep_until_ns(until_ns.min(clock::now_ns() + LOOK_NS));
        }
    }
}

fn send(shell: &Shell, mut sweep: Loan<'_, Sweep>, mut truth: Loan<'_, Truth>, trace: Trace) -> Result<(), ShellError> {
    *sweep.trace_mut() = trace;
    *truth.trace_mut() = trace;
    truth.send()?;
    sweep.send()?;
    shell.page.count_sent(trace.part);
    shell.page.put_down();
    shell.page.beat(clock::now_ns());
    Ok(())
}
