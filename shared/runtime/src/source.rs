mod standing;

use events::EventId;
use messages::{Cutter, Hop, Part, Sweep, SweepHeader, Trace, Truth, Verdict};
use stage::{Next, Source};
use transport::{Loan, Outlet};

use crate::kept::Kept;
use crate::pacer::{Pacer, is_step};
use crate::page::Said;
use crate::run_delay::Laps;
use crate::window::Window;
use crate::{Pace, Shell, ShellError, clock, tables};
use standing::between_sweeps;

/// Between two looks at the other pages while the window is shut [ns].
const WINDOW_LOOK_NS: u64 = 100_000;
/// Between two looks at the flags while there is nothing to do [ns].
const LOOK_NS: u64 = 20_000_000;
/// Sensor time that leaps ahead by less is a gap in the recording [ns].
const LEAP_NS: u64 = 5_000_000_000;

/// The main loop of the source. Returns when it was asked to leave; at the end of the data it waits for that, because
/// what it has sent lives in its shared memory, and may have to be sent again.
pub fn run_source<S: Source>(mut source: S, shell: &Shell) -> Result<(), ShellError> {
    let node = shell.join()?;
    let (sweeps, truths) = (node.outlet()?, node.outlet()?);
    let mut out = Out::new(shell, &sweeps, &truths)?;
    shell.page.paused.set(0);
    shell.running();
    // Nothing is sent before everybody listens.
    wait_while(shell, LOOK_NS, || shell.page.may_start.get() == 0);

    out.begin(&mut source)?;
    while !(shell.leaving() && out.is_between_sweeps()) {
        tables::acknowledge(&shell.page);
        out.go_back_if_asked();
        out.pause_if_asked(&mut source);
        let next = if out.has_sweep() { Next::Sweep } else { out.make(&mut source)? };
        match next {
            Next::Sweep if !out.send()? => break,
            Next::Sweep | Next::Nothing => {}
            Next::End => {
                out.tell_end();
                out.wait_at_the_end();
            }
        }
    }
    shell.left();
    Ok(())
}

/// Sleeps as long as `holds`, alive, or until asked to leave.
fn wait_while(shell: &Shell, look_ns: u64, holds: impl Fn() -> bool) {
    while holds() && !shell.leaving() {
        tables::acknowledge(&shell.page);
        shell.beat();
        clock::sleep_ns(look_ns);
    }
}

/// The way out of the source: a sweep is made as a whole and leaves in sectors, each when the sensor would have it.
struct Out<'a> {
    shell: &'a Shell,
    sweeps: &'a Outlet<Sweep>,
    truths: &'a Outlet<Truth>,
    /// At [`Pace::Fast`] only.
    window: Option<Window>,
    pacer: Pacer,
    cutter: Cutter,
    kept: Kept,
    /// When the next sweep begins by the last one's header, sensor time [ns].
    next_sensor_ns: Option<u64>,
    /// It was said that the data end before this ordinal.
    end_told: Option<u64>,
    /// Of the part to be sent next.
    ordinal: u64,
    trace: Trace,
    free_ns: u64,
    taken_by_others: Laps,
    /// Header of the sweep made last; none before the first of this life.
    before: Option<SweepHeader>,
}

impl<'a> Out<'a> {
    fn new(shell: &'a Shell, sweeps: &'a Outlet<Sweep>, truths: &'a Outlet<Truth>) -> Result<Self, ShellError> {
        let plan = &shell.plan;
        let (window, keep) = match plan.pace {
            Pace::Realtime => (None, 1),
            Pace::Fast => (Some(Window::open(shell)?), plan.kept_sweeps()),
        };
        Ok(Self {
            shell,
            sweeps,
            truths,
            window,
            pacer: Pacer::at_rate(plan.source.rate),
            cutter: Cutter::new(plan.chain.sectors),
            kept: Kept::new(keep)?,
            next_sensor_ns: None,
            end_told: None,
            ordinal: 0,
            trace: Trace::default(),
            free_ns: clock::now_ns(),
            taken_by_others: Laps::of_this_thread(),
            before: None,
        })
    }

    fn sectors(&self) -> u64 {
        u64::from(self.shell.plan.chain.sectors.max(1))
    }

    /// A successor goes on where its predecessor stopped, in the middle of a sweep if need be; where parts are sent again
    /// if they are lost, with the first sweep that is not answered.
    fn begin<S: Source>(&mut self, source: &mut S) -> Result<(), ShellError> {
        let page = &self.shell.page;
        if self.window.is_some() && self.shell.incarnation > 1 {
            self.go_back();
        }
        self.ordinal = page.next_ordinal_out.get();
        self.kept.begin(self.ordinal / self.sectors(), source)
    }

    fn is_between_sweeps(&self) -> bool {
        self.ordinal.is_multiple_of(self.sectors())
    }

    fn is_asked_back(&self) -> bool {
        self.window.as_ref().is_some_and(|window| window.is_asked_back(self.shell.page.attempt.get()))
    }

    fn go_back_if_asked(&mut self) {
        if self.is_asked_back() {
            self.go_back();
            self.ordinal = self.shell.page.next_ordinal_out.get();
        }
    }

    /// The next part is the first of the first sweep that is not answered.
    fn go_back(&mut self) {
        let sectors = self.sectors();
        let Some(window) = &mut self.window else { return };
        let page = &self.shell.page;
        let attempt = window.go_back().max(page.attempt.get() + 1);
        // The window is such that all that may be asked for is kept.
        let sweep = window.answered_sweeps().max(self.kept.first());
        let ordinal = (sweep * sectors).min(page.next_ordinal_out.get());
        page.go_back(ordinal);
        page.attempt.set(attempt);
        self.say(EventId::SentAgain, ordinal / sectors, attempt);
    }

    fn say(&self, id: EventId, a: u64, b: u64) {
        let sweep = self.ordinal / self.sectors();
        self.shell.page.say(Said { id, time_ns: clock::now_ns(), sweep, a, b });
    }

    /// Says once where the data end; whoever is asked back after that comes to the same end again.
    fn tell_end(&mut self) {
        if self.end_told.replace(self.ordinal) != Some(self.ordinal) {
            self.say(EventId::SourceEnded, (self.ordinal / self.sectors()).saturating_sub(1), 0);
        }
    }

    /// Says where sensor time does not go on as the last sweep had promised.
    fn tell_clock(&mut self, header: &SweepHeader) {
        let due_ns = self.next_sensor_ns.replace(header.sensor_time_ns.saturating_add(header.period_ns));
        let Some(due_ns) = due_ns else { return };
        let (ahead_ns, back_ns) =
            (header.sensor_time_ns.saturating_sub(due_ns), due_ns.saturating_sub(header.sensor_time_ns));
        // Key frames of a recording may lie far apart; a sensor's turns are never the same to the nanosecond.
        if ahead_ns > LEAP_NS.max(10 * header.period_ns) || back_ns >= header.period_ns {
            self.say(EventId::ClockStep, ahead_ns / 1_000_000, back_ns / 1_000_000);
        }
    }

    fn has_sweep(&self) -> bool {
        self.kept.has(self.ordinal / self.sectors())
    }

    /// Makes the next sweep; [`Next::End`] also where no more was asked for, [`Next::Nothing`] when it is to stand still.
    fn make<S: Source>(&mut self, source: &mut S) -> Result<Next, ShellError> {
        let plan = &self.shell.plan;
        if plan.sweeps.is_some_and(|sweeps| self.ordinal / self.sectors() >= sweeps) {
            return Ok(Next::End);
        }
        let mut began_ns = clock::now_ns();
        let shell = self.shell;
        let (made, next) = self.kept.make(source, || {
            shell.beat();
            between_sweeps(shell);
            !shell.leaving() && shell.page.pause.get() == 0
        })?;
        self.shell.slow_down(Part { sectors: 1, ..Part::default() });
        self.shell.toil(began_ns);
        if next == Next::Sweep {
            note_step(shell, &mut self.before, &made.whole.header);
        }
        match next {
            Next::Sweep if is_over(self.shell, &made.whole.header) => return Ok(Next::End),
            Next::Sweep => {}
            Next::End | Next::Nothing => return Ok(next),
        }
        self.cutter.measure(&mut made.whole);
        let header = made.whole.header;
        made.start_ns = if source.is_live() {
            // Due now as a whole: its last return came just before.
            began_ns = clock::now_ns();
            began_ns.saturating_sub(header.period_ns)
        } else {
            self.pacer.start_ns(header.sensor_time_ns, began_ns)
        };
        made.began_ns = began_ns;
        if plan.pace == Pace::Realtime {
            self.shell.page.period_ns.set(self.pacer.host_ns(header.period_ns));
        }
        // For a life that begins within the sweep.
        made.step = self.shell.page.step.get() as u32;
        self.kept.keep();
        self.tell_clock(&header);
        Ok(Next::Sweep)
    }

    /// One part: room → in hand → cut → due → sent → published → out of hand. False when asked to leave before: a sweep
    /// that has begun is sent to its end, unless the window stays shut.
    fn send(&mut self) -> Result<bool, ShellError> {
        let shell = self.shell;
        if shell.plan.source.single_step && self.is_between_sweeps() {
            let sweep = self.ordinal / self.sectors();
            wait_while(shell, LOOK_NS, || {
                between_sweeps(shell);
                shell.page.steps.get() <= sweep && !self.is_asked_back() && !self.is_to_pause()
            });
            if shell.leaving() || self.is_asked_back() || self.is_to_pause() {
                return Ok(!shell.leaving());
            }
        }
        if let Some(window) = &self.window {
            let is_shut = || !window.has_room(shell.page.published.get(), self.ordinal);
            wait_while(shell, WINDOW_LOOK_NS, || is_shut() && !self.is_asked_back() && !self.is_to_pause());
            if is_shut() || self.is_asked_back() || self.is_to_pause() {
                return Ok(!shell.leaving());
            }
        }
        let sectors = shell.plan.chain.sectors.max(1);
        let sector = (self.ordinal % u64::from(sectors)) as u32;
        let made = self.kept.get(self.ordinal / u64::from(sectors));
        // A sweep's first part had to wait for the sweep to be made.
        let received_ns = if sector == 0 { made.began_ns } else { clock::now_ns() };
        shell.page.make_in_hand(self.ordinal);
        let mut loan = self.sweeps.loan()?;
        self.cutter.fill(&made.whole, sector, loan.message_mut());
        shell.fault_in_hand();
        let started_ns = clock::now_ns();
        let due_ns = match shell.plan.pace {
            Pace::Fast => clock::now_ns(),
            Pace::Realtime => made.start_ns + self.pacer.host_ns(self.cutter.end_offset_ns(&made.whole, sector)),
        };
        let part = Part {
            ordinal: self.ordinal,
            sweep: self.ordinal / u64::from(sectors),
            sector,
            sectors,
            sensor_time_ns: made.whole.header.sensor_time_ns,
            step: made.step,
            attempt: shell.page.attempt.get() as u32,
        };
        self.trace = Trace { part, due_ns, sweep_start_ns: made.start_ns, ..Trace::default() };
        // What was taken while it was made is the sweep's own time; only its time to leave counts.
        self.taken_by_others.lap_ns();
        self.wait_until(due_ns, || {
            if sector == 0 {
                between_sweeps(shell);
            }
            sector == 0 && (shell.leaving() || self.is_to_pause())
        });
        if clock::now_ns() < due_ns {
            shell.page.put_down();
            return Ok(!shell.leaving());
        }
        if sector == 0 {
            // One step for the whole sweep, as late as can be. At --pace fast the ladder stands still, so that results do not
            // depend on how busy the machine is.
            let step = shell.page.step.get() as u32;
            self.kept.get(self.ordinal / u64::from(sectors)).step = step;
            self.trace.part.step = step;
        }
        self.ordinal += 1;
        if shell.page.swallow.take_one() {
            shell.page.put_down();
            return Ok(true);
        }
        let taken_busy_ns = self.taken_by_others.lap_ns();
        self.trace.push(Hop { taken_busy_ns, ..self.hop(received_ns, started_ns) });
        self.publish(loan)?;
        if part.is_last() {
            self.tell_truth(part.sweep)?;
        }
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
        self.shell.beat();
        page.sent_ns.set(self.free_ns);
        page.step_sent.set(self.trace.part.step.into());
        Ok(())
    }

    /// Sends what is known of a sweep, with the trace of its last part.
    fn tell_truth(&mut self, sweep: u64) -> Result<(), ShellError> {
        let mut truth = self.truths.loan()?;
        truth.message_mut().copy_from(&self.kept.get(sweep).truth);
        *truth.trace_mut() = self.trace;
        Ok(truth.send()?)
    }

    /// Sleeps until host time `until_ns`, alive, unless it is to be `cut_short`.
    fn wait_until(&self, until_ns: u64, cut_short: impl Fn() -> bool) {
        while clock::now_ns() < until_ns && !cut_short() {
            self.shell.beat();
            clock::sleep_until_ns(until_ns.min(clock::now_ns() + LOOK_NS));
        }
    }
}

/// Whether the sweep ends after the sensor time that was asked for; the first sweep of the run begins it, whichever life
/// of the source made it.
fn is_over(shell: &Shell, header: &SweepHeader) -> bool {
    let began = &shell.page.began_sensor_ns;
    if began.get() == 0 {
        began.set(header.sensor_time_ns + 1);
    }
    let end_ns = header.sensor_time_ns.wrapping_add(header.period_ns);
    // Modulo 2^64: steps of the clock may have moved the beginning below 0. A sweep before it has not passed.
    let passed_ns = end_ns.wrapping_add(1).wrapping_sub(began.get());
    let passed_ns = if passed_ns > u64::MAX / 2 { 0 } else { passed_ns };
    shell.plan.duration_ns.is_some_and(|duration_ns| passed_ns > duration_ns)
}

/// Where the sensor's clock was set, moves the run's beginning with it: an hour's step is no hour of
/// the run.
fn note_step(shell: &Shell, before: &mut Option<SweepHeader>, header: &SweepHeader) {
    let Some(last) = before.replace(*header) else { return };
    let (then_ns, now_ns) = (last.sensor_time_ns, header.sensor_time_ns);
    if !is_step(then_ns, now_ns) {
        return;
    }
    let expected_ns = then_ns.wrapping_add(last.period_ns);
    let began = &shell.page.began_sensor_ns;
    if began.get() > 0 {
        // 0 means that there is none.
        began.set(began.get().wrapping_add(now_ns.wrapping_sub(expected_ns)).max(1));
    }
}
