use std::time::Duration;

use chain::SUPERVISOR;
use crossbeam_channel::{Receiver, bounded, select, tick};
use events::{CHAIN, EventId, Log};
use messages::Step;
use runtime::page::{PageMap, State};
use runtime::realtime::{self, AsBefore};
use runtime::{Pace, Plan, clock, stop_signals};
use signal_hook::consts::SIGCHLD;
use signal_hook::iterator::Signals;
use transport::{Instance, Node};

use crate::SupervisorError;
use crate::control::Server;
use crate::control::commands::Refusals;
use crate::executive::{Executive, Signs};
use crate::house::House;
use crate::house::adopting::Household;
use crate::house::services::Services;
use crate::manager::Manager;
use crate::modes::Modes;
use crate::modes::overload::{Ladder, OverloadReport};
use crate::modes::steering::SafeReport;
use crate::processes::beside::Tape;
use crate::processes::child::Watched;
use crate::processes::machine::Machine;
use crate::processes::noise::Noise;
use crate::processes::usage::Usage;
use crate::report::Report;
use crate::report::progress::Progress;
use crate::report::timeline::Timeline;
use crate::restarts::budget::Restarts;
use crate::restarts::lives::Lives;
use crate::restarts::shared_memory::SharedMemory;
use crate::telling::{Ears, open_log};

/// Between two looks at the pages.
const LOOK: Duration = Duration::from_millis(5);
/// Between two looks at `/proc` [ns].
const SAMPLE_NS: u64 = 1_000_000_000;
/// How long the stages may take to come up [ns].
const START_PATIENCE_NS: u64 = 10_000_000_000;
/// How long nothing may move after the source has ended [ns].
const STALL_NS: u64 = 5_000_000_000;
/// Exit code of a stage that cannot start: restarting it would not help.
pub(crate) const CANNOT_START: i32 = 2;

/// What to run.
pub struct Settings<'a> {
    /// The instance.
    pub instance: Instance,
    /// The plan.
    pub plan: Plan,
    /// Template of the instance's iceoryx2 configuration.
    pub iceoryx2_config: &'a str,
    /// Start the stages; else they are started by somebody else.
    pub spawn: bool,
    /// Where the instance's supervisor died and its stages go on by the same plan: take them over.
    pub adopt: bool,
}

/// Runs a chain from its first process to its last, and reports.
pub fn run(settings: Settings<'_>) -> Result<Report, SupervisorError> {
    let signals = signals()?;
    let mut house = House::take(&settings)?;
    let plan = house.adopted().map(|adopted| adopted.plan.clone());
    let adopted = plan.as_ref().map(|plan| Watch::begin(&house, plan, settings.spawn, signals.clone()));
    let outcome = match adopted {
        Some(Ok(watch)) => watch.watch_through(),
        Some(Err(error)) => {
            tracing::error!(%error, "the chain could not be adopted: it is ended, and started anew");
            house = house.start_over(settings.iceoryx2_config)?;
            Watch::begin(&house, &settings.plan, settings.spawn, signals).and_then(Watch::watch_through)
        }
        None => Watch::begin(&house, &settings.plan, settings.spawn, signals).and_then(Watch::watch_through),
    };
    if let Err(error) = house.leave() {
        tracing::error!(%error, "the instance could not be removed");
    }
    outcome
}

/// Those that ask to stop, and SIGCHLD to look at once.
fn signals() -> Result<Receiver<i32>, SupervisorError> {
    let system = |cause| SupervisorError::System { what: "set up signals".to_owned(), cause };
    let mut signals = Signals::new(stop_signals().chain([SIGCHLD])).map_err(system)?;
    let (sender, receiver) = bounded(64);
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            for signal in signals.forever() {
                // Full of SIGCHLD: the looks by time will do. A stop must get through.
                if sender.try_send(signal).is_err() && signal != SIGCHLD && sender.send(signal).is_err() {
                    return;
                }
            }
        })
        .map_err(system)?;
    Ok(receiver)
}

/// A chain being watched.
pub(crate) struct Watch<'a> {
    pub(crate) house: &'a House,
    pub(crate) instance: &'a Instance,
    /// As it was last written.
    pub(crate) plan: Plan,
    pub(crate) spawn: bool,
    pub(crate) stages: Vec<Watched>,
    pub(crate) tape: Option<Tape>,
    /// The supervisor's own page.
    pub(crate) page: PageMap,
    pub(crate) log: Log,
    pub(crate) executive: Executive,
    /// Of all processes at the last look, the tape's last.
    pub(crate) signs: Vec<Signs>,
    /// The sample that watched values were taken from last.
    pub(crate) sampled_ns: u64,
    pub(crate) manager: Manager,
    pub(crate) ears: Ears,
    // Services before the node: they are its guests.
    pub(crate) services: Services,
    pub(crate) node: Node,
    pub(crate) signals: Receiver<i32>,
    pub(crate) looks: Receiver<std::time::Instant>,
    pub(crate) started_ns: u64,
    pub(crate) next_sample_ns: u64,
    pub(crate) usage: Usage,
    pub(crate) shared_memory: SharedMemory,
    pub(crate) machine: Machine,
    pub(crate) noise: Noise,
    pub(crate) timeline: Timeline,
    /// What the kernel refused, and the seat before it was asked.
    pub(crate) refused: Vec<String>,
    pub(crate) as_before: Option<AsBefore>,
    pub(crate) progress: Progress,
    pub(crate) ladder: Ladder,
    /// Where it stood when that was last told.
    pub(crate) ladder_stood: Step,
    pub(crate) overload: OverloadReport,
    pub(crate) modes: Modes,
    pub(crate) safe_entered: Option<SafeReport>,
    /// Of each stage, in flow order.
    pub(crate) lives: Vec<Lives>,
    pub(crate) chain_budget: Restarts,
    pub(crate) control: Server,
    pub(crate) refusals: Refusals,
    /// Every stage was up once.
    pub(crate) begun: bool,
    pub(crate) stop_asked: bool,
    /// All processes leave in order, and come back.
    pub(crate) renewing: bool,
    pub(crate) failed: Option<String>,
    /// What the pages counted when they last changed, and when that was.
    pub(crate) moved: u64,
    pub(crate) moved_ns: u64,
}

impl<'a> Watch<'a> {
    /// Creates services and pages, then starts the stages: readers before writers, the source last. Where a chain is
    /// adopted, all of it that is there is taken as it is.
    fn begin(house: &'a House, plan: &'a Plan, spawn: bool, signals: Receiver<i32>) -> Result<Self, SupervisorError> {
        let instance = house.instance();
        let node = Node::join(instance, "supervisor", plan.chain.queue_parts())?;
        let adopts = house.adopted();
        let services = if adopts.is_some() { Services::reopen(&node, plan)? } else { Services::create(&node, plan)? };
        let Household { stages, tape, page } = Household::of(house, plan, spawn)?;
        let log = open_log(plan, &Plan::events_path(instance))?;
        let beside = tape.iter().map(|tape: &Tape| &tape.process);
        let ears = Ears::new(stages.iter().chain(beside).map(|process: &Watched| &*process.page), &log);
        plan.write(instance)?;
        let now_ns = clock::now_ns();
        let count = plan.stages().count();
        let names = plan.stages().chain(plan.tape()).map(str::to_owned).collect();
        let budget = plan.chain.restart_budget;
        let started_ns = page.run_began_ns.get();
        let mut watch = Self {
            executive: Executive::new(&plan.executive, names, plan.chain.sectors, now_ns),
            signs: Vec::new(),
            sampled_ns: now_ns + SAMPLE_NS,
            house,
            instance,
            plan: plan.clone(),
            spawn,
            stages,
            tape,
            page,
            log,
            manager: Manager::of_environment(),
            ears,
            services,
            node,
            signals,
            looks: tick(LOOK),
            started_ns,
            next_sample_ns: now_ns + SAMPLE_NS,
            usage: Usage::default(),
            shared_memory: SharedMemory::default(),
            progress: Progress::new(started_ns, plan),
            ladder: Ladder::new(plan.chain.overload.clone()),
            ladder_stood: Step::Nominal,
            overload: OverloadReport::default(),
            modes: Modes::new(plan.chain.sectors, plan.pace == Pace::Realtime),
            safe_entered: None,
            lives: (0..count).map(|position| Lives::new(budget, position > 0)).collect(),
            chain_budget: Restarts::of_chain(plan.executive.chain_budget),
            control: Server::start(instance)?,
            refusals: Refusals::default(),
            machine: Machine::default(),
            noise: Noise::start(plan.chain.realtime.seat(SUPERVISOR).priority),
            timeline: Timeline::new(started_ns),
            refused: Vec::new(),
            as_before: None,
            begun: false,
            stop_asked: false,
            renewing: false,
            failed: None,
            moved: 0,
            moved_ns: now_ns,
        };
        match adopts {
            Some(adopted) => watch.take_over(adopted.before),
            None => drop(watch.machine.look(now_ns, 0.0)),
        }
        let started = watch.start_all();
        if started.is_err() {
            watch.kill_all();
        }
        started.map(|()| watch)
    }

    fn start_all(&mut self) -> Result<(), SupervisorError> {
        if let Some(tape) = &mut self.tape {
            tape.process.start()?;
        }
        for position in (1..self.stages.len()).rev() {
            self.stages[position].start()?;
        }
        self.await_up(1)?;
        if !self.stop_asked {
            self.stages[0].page.may_start.set(1);
            self.stages[0].start()?;
            self.await_up(0)?;
        }
        if !std::mem::replace(&mut self.begun, true) {
            self.say(EventId::RunBegan, CHAIN, "all processes are up");
        }
        self.take_seat();
        Ok(())
    }

    /// Asks the kernel for what the chain wants for this process, and warns once of what it refused to any.
    fn take_seat(&mut self) {
        let mut refused = realtime::refused_to_stages(self.instance, &self.plan.chain);
        if self.plan.chain.realtime.asks() {
            self.as_before = Some(AsBefore::remember());
            refused.extend(realtime::take_seat(&self.plan.chain, SUPERVISOR));
        }
        self.refused = realtime::in_words(&refused).iter().map(ToString::to_string).collect();
        for line in &self.refused {
            tracing::warn!("{line}");
        }
    }

    /// Waits until the stages from `first` on are connected, restarting those that die on the way.
    pub(crate) fn await_up(&mut self, first: usize) -> Result<(), SupervisorError> {
        // Somebody who starts stages by hand takes the time he takes.
        let patience_ns = if self.spawn { START_PATIENCE_NS } else { u64::MAX / 2 };
        let end_ns = clock::now_ns() + patience_ns;
        loop {
            self.look_once()?;
            let beside = self.tape.iter().filter(|tape| !tape.is_up()).map(|tape| &tape.process);
            // Whoever was given up in the run so far is not to come.
            let stays_away = |position: usize| self.begun && self.lives[position].is_given_up();
            let awaited = (first..self.stages.len()).filter(|position| !stays_away(*position));
            let awaited = awaited.map(|position| &self.stages[position]);
            let missing: Vec<_> = awaited.filter(|stage| !stage.is_up()).chain(beside).collect();
            if self.stop_asked || missing.is_empty() {
                return Ok(());
            }
            if clock::now_ns() > end_ns {
                return Err(SupervisorError::NotUp(missing.iter().map(|stage| stage.name.clone()).collect()));
            }
        }
    }

    /// Watches until the source has ended and everything has come through, or until asked to stop; then ends the chain.
    fn watch_through(mut self) -> Result<Report, SupervisorError> {
        while !self.stop_asked && self.failed.is_none() && !self.is_done() {
            if self.is_stalled() {
                if self.plan.pace == Pace::Fast {
                    self.failed = Some("nothing moved for 5 s: the chain was stopped".to_owned());
                }
                break;
            }
            if let Err(error) = self.look_once().and_then(|()| self.renew_shared_memory_if_lost()) {
                self.kill_all();
                return Err(error);
            }
        }
        self.say(EventId::RunEnds, CHAIN, if self.stop_asked { "asked to stop" } else { "all is done" });
        let stopped = self.stop_in_order();
        self.progress.end();
        if stopped.is_err() {
            self.kill_all();
        }
        stopped?;
        Ok(self.report())
    }

    fn is_done(&self) -> bool {
        self.stages[0].page.state() == State::Ended
            && self.stages[0].is_up()
            && (1..self.stages.len()).all(|position| self.is_drained(position))
            && (self.plan.pace == Pace::Realtime || self.is_answered())
            && self.is_on_tape()
    }

    /// Whether the sink has answered all that was sent, however often.
    pub(crate) fn is_answered(&self) -> bool {
        let (Some(source), Some(sink)) = (self.stages.first(), self.stages.last()) else { return true };
        sink.page.next_ordinal_out.get() >= source.page.next_ordinal_out.get()
    }

    /// Whether nothing has moved for a while, nor will: nothing is held and the source waits in vain (parts were
    /// swallowed), or it has ended and at real time nobody waits for a stage that hangs or a file that nobody reads.
    fn is_stalled(&mut self) -> bool {
        let moved = self.stages.iter().map(|stage| stage.page.received.get() + stage.page.processed.get()).sum();
        if moved != self.moved {
            (self.moved, self.moved_ns) = (moved, clock::now_ns());
        }
        let waits_for_step = self.plan.source.single_step && self.is_answered();
        if self.modes.is_paused() || self.stages[0].page.paused.get() > 0 {
            self.moved_ns = clock::now_ns();
        }
        if !self.begun || waits_for_step || clock::now_ns() - self.moved_ns < STALL_NS {
            return false;
        }
        let drained = (1..self.stages.len()).all(|position| self.is_drained(position));
        match self.plan.pace {
            Pace::Fast => drained && self.stages[0].page.in_hand.get() == 0,
            Pace::Realtime => self.stages[0].page.state() == State::Ended,
        }
    }

    /// Whether the stage has taken and finished everything that the one before published.
    pub(crate) fn is_drained(&self, position: usize) -> bool {
        let (before, stage) = (&self.stages[position - 1].page, &self.stages[position].page);
        stage.next_sequence.get() >= before.published.get() && stage.held(self.is_sink(position)) == 0
    }

    pub(crate) fn is_sink(&self, position: usize) -> bool {
        position + 1 == self.stages.len()
    }

    /// Sleeps until something happens, then looks at everything once.
    pub(crate) fn look_once(&mut self) -> Result<(), SupervisorError> {
        select! {
            recv(self.signals) -> signal => {
                // Once is enough: all waits of a stop have a limit of their own.
                self.stop_asked |= signal.is_ok_and(|signal| signal != SIGCHLD);
            }
            recv(self.control.asked) -> asked => {
                match asked {
                    Ok(asked) => self.carry_out(&asked)?,
                    Err(_) => self.control.asked = crossbeam_channel::never(),
                }
            }
            recv(self.looks) -> _ => {}
        }
        let ended: Vec<_> = self.stages.iter_mut().map(Watched::look).collect();
        self.recover_all(&ended)?;
        (0..self.stages.len()).rev().for_each(|position| self.name_losses(position));
        self.look_at_tape()?;
        self.listen();
        self.climb();
        if !self.renewing {
            self.look_at_mode();
        }
        let now_ns = clock::now_ns();
        if now_ns >= self.next_sample_ns {
            self.next_sample_ns = now_ns + SAMPLE_NS;
            self.sample();
        }
        for order in self.watch_health() {
            self.obey(&order)?;
        }
        self.tell_of_refusals(now_ns);
        self.look_for_files(now_ns);
        self.progress.show(now_ns, &self.stages);
        self.tell_manager();
        Ok(())
    }
}
