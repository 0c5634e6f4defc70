use messages::{Cutter, Hop, Message, Part, Sweep, SweepHeader, Trace, Truth, Verdict};
use stage::{Next, Source};
use transport::{Loan, Outlet};
use zerocopy::FromZeros;

use crate::pacer::Pacer;
use crate::page::State;
use crate::run_delay::Laps;
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
    let (sweeps, truths) = (node.outlet()?, node.outlet()?);
    let mut out = Out::new(shell, &sweeps)?;
    shell.running();
    // Nothing is sent before everybody listens.
    wait_while(shell, LOOK_NS, || shell.page.may_start.get() == 0);

    // A successor goes on where its predecessor stopped, in the middle of a sweep if need be.
    let sectors = u64::from(shell.plan.chain.sectors.max(1));
    let mut ordinal = shell.page.next_ordinal_out.get();
    if ordinal >= sectors {
        source.skip(ordinal / sectors, &mut out.whole, truths.loan()?.message_mut())?;
    }
    while !shell.leaving() && shell.plan.sweeps.is_none_or(|sweeps| ordinal / sectors < sweeps) {
        let mut truth = truths.loan()?;
        if !out.make(&mut source, truth.message_mut())? {
            break;
        }
        let end = (ordinal / sectors + 1) * sectors;
        while ordinal < end && out.send(ordinal)? {
            ordinal += 1;
        }
        if ordinal < end {
            break;
        }
        *truth.trace_mut() = out.trace;
        truth.send()?;
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

/// The way out of the source: a sweep is made as a whole and leaves in sectors, each when the sensor would have it.
struct Out<'a> {
    shell: &'a Shell,
    sweeps: &'a Outlet<Sweep>,
    window: Window,
    pacer: Pacer,
    cutter: Cutter,
    whole: Box<Sweep>,
    /// Host time at which the sweep's first firing is due [ns].
    start_ns: u64,
    began_ns: u64,
    step: u32,
    trace: Trace,
    free_ns: u64,
    taken_by_others: Laps,
}

impl<'a> Out<'a> {
    fn new(shell: &'a Shell, sweeps: &'a Outlet<Sweep>) -> Result<Self, ShellError> {
        Ok(Self {
            shell,
            sweeps,
            window: Window::open(shell)?,
            pacer: Pacer::default(),
            cutter: Cutter::new(shell.plan.chain.sectors),
            whole: Sweep::new_box_zeroed().map_err(|_| ShellError::Memory("a sweep"))?,
            start_ns: 0,
            began_ns: 0,
            step: 0,
            trace: Trace::default(),
            free_ns: clock::now_ns(),
            taken_by_others: Laps::of_this_thread(),
        })
    }

    /// Makes the next sweep. False at the end of the data.
    fn make<S: Source>(&mut self, source: &mut S, truth: &mut Truth) -> Result<bool, ShellError> {
        let began_ns = clock::now_ns();
        self.whole.clear();
        let next = source.next(&mut self.whole, truth)?;
        self.shell.slow_down(Part { sectors: 1, ..Part::default() });
        if next == Next::End || self.is_over(&self.whole.header) {
            return Ok(false);
        }
        self.cutter.measure(&mut self.whole);
        self.start_ns = self.pacer.start_ns(self.whole.header.sensor_time_ns, began_ns);
        self.began_ns = began_ns;
        // One step for the whole sweep. At --pace fast results do not depend on how busy the machine is.
        self.step = if self.shell.plan.pace == Pace::Realtime { self.shell.page.step.get() as u32 } else { 0 };
        Ok(true)
    }

    /// One part: room → in hand → cut → due → sent → published → out of hand. False when asked to leave before: a sweep
    /// that has begun is sent to its end, unless the window stays shut or the supervisor is gone.
    fn send(&mut self, ordinal: u64) -> Result<bool, ShellError> {
        let shell = self.shell;
        let sectors = shell.plan.chain.sectors.max(1);
        let sector = (ordinal % u64::from(sectors)) as u32;
        if shell.plan.pace == Pace::Fast {
            let is_shut = || !self.window.has_room(shell.page.published.get());
            wait_while(shell, WINDOW_LOOK_NS, is_shut);
            if is_shut() {
                return Ok(false);
            }
        }
        // A sweep's first part had to wait for the sweep to be made.
        let received_ns = if sector == 0 { self.began_ns } else { clock::now_ns() };
        shell.page.make_in_hand(ordinal);
        let mut loan = self.sweeps.loan()?;
        self.cutter.fill(&self.whole, sector, loan.message_mut());
        let started_ns = clock::now_ns();
        let due_ns = match shell.plan.pace {
            Pace::Fast => clock::now_ns(),
            Pace::Realtime => self.start_ns + self.cutter.end_offset_ns(&self.whole, sector),
        };
        // What was taken while it was made is the sweep's own time; only its time to leave counts.
        self.taken_by_others.lap_ns();
        self.wait_until(due_ns, || shell.shutdown.orphaned() || (sector == 0 && shell.leaving()));
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
            sweep: ordinal / u64::from(sectors),
            sector,
            sectors,
            sensor_time_ns: self.whole.header.sensor_time_ns,
            step: self.step,
            reserved: 0,
        };
        self.trace = Trace { part, due_ns, sweep_start_ns: self.start_ns, ..Trace::default() };
        let taken_busy_ns = self.taken_by_others.lap_ns();
        self.trace.push(Hop { taken_busy_ns, ..self.hop(received_ns, started_ns) });
        self.publish(loan)?;
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

    fn publish(&mut self, mut loan: Loan<'_, Sweep>) -> Result<(), ShellError> {
        *loan.trace_mut() = self.trace;
        loan.send()?;
        let page = &self.shell.page;
        page.count_sent(self.trace.part);
        page.put_down();
        self.free_ns = clock::now_ns();
        page.beat(self.free_ns);
        Ok(())
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

    /// Sleeps until host time `until_ns`, alive, unless it is to be `cut_short`.
    fn wait_until(&self, until_ns: u64, cut_short: impl Fn() -> bool) {
        while clock::now_ns() < until_ns && !cut_short() {
            self.shell.page.beat(clock::now_ns());
            clock::sleep_until_ns(until_ns.min(clock::now_ns() + LOOK_NS));
        }
    }
}
