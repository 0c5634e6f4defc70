use events::EventId;
use messages::{Clusters, Descriptors, Message, Order, Place, Sweep, Trace, Tracks, Truth};
use stage::Tap;
use transport::Node;

use crate::page::{Page, PageMap, Said};
use crate::{Pace, Plan, SOURCE, Shell, ShellError, clock, realtime, tables};

/// Between two looks into the queues where the source waits for what is found [ns].
const LOOK_NS: u64 = 500_000;
/// Between two looks at what is asked meanwhile, and into the queues before the first sweep has come [ns].
const PAUSE_NS: u64 = 10_000_000;
/// Longest time between two looks into the queues [ns].
const MOST_PAUSE_NS: u64 = 100_000_000;
/// How long the source may stand still before it is asked to send again what is missing here [ns].
const STALL_NS: u64 = 500_000_000;
/// Between two ticks [ns].
const TICK_NS: u64 = 1_000_000_000;

/// The main loop of a process that reads along beside the chain. Returns when it was asked to leave, has taken all that
/// waited, and kept it.
pub fn run_tap<T: Tap>(mut tap: T, shell: &Shell) -> Result<(), ShellError> {
    let node = shell.join()?;
    let mut topics = Topics::open(&node, shell, tap.wants_between())?;
    if shell.plan.pace == Pace::Realtime {
        realtime::stand_back();
    }
    shell.running();
    let page = &shell.page;
    let (mut tick_ns, mut files) = (0, (1, 0));
    loop {
        topics.pause(shell);
        let leaving = shell.leaving();
        // Read before the look into the queues, so that an answer covers all that was sent by then.
        let request = page.drain_request.get();
        topics.drain(&mut tap, shell)?;
        page.drained_incarnation.set(request);
        if leaving {
            break;
        }
        if clock::now_ns() >= tick_ns {
            tick_ns = clock::now_ns() + TICK_NS;
            tables::acknowledge(page);
            tap.tick(clock::utc_ns());
            keep(&mut tap, shell);
            tell_files(&mut tap, shell, &mut files);
        }
    }
    let finished = tap.finish(clock::utc_ns());
    tell_files(&mut tap, shell, &mut files);
    shell.left();
    Ok(finished?)
}

/// Says which files were begun and which failed since it was told `before`.
fn tell_files<T: Tap>(tap: &mut T, shell: &Shell, before: &mut (u64, u64)) {
    let (begun, failed) = tap.files();
    let sectors = u64::from(shell.plan.chain.sectors.max(1));
    let say = |id, a| {
        let sweep = shell.page.next_ordinal_out.get() / sectors;
        shell.page.say(Said { id, time_ns: clock::now_ns(), sweep, a, b: failed });
    };
    if failed > before.1 {
        say(EventId::FileFailed, failed - before.1);
    }
    if begun > before.0 {
        say(EventId::FileRotated, begun);
    }
    *before = (begun.max(before.0), failed);
}

/// What was taken survives from here on, and whoever comes after this life begins behind it.
fn keep<T: Tap>(tap: &mut T, shell: &Shell) {
    tap.checkpoint(clock::utc_ns());
    let sectors = u64::from(shell.plan.chain.sectors.max(1));
    shell.page.next_ordinal_out.set(tap.done_sweeps().saturating_mul(sectors));
}

/// What is read: sweeps first, because what is said of them comes later.
struct Topics {
    sweeps: Topic<Sweep>,
    truths: Topic<Truth>,
    clusters: Option<Topic<Clusters>>,
    descriptors: Option<Topic<Descriptors>>,
    tracks: Topic<Tracks>,
    /// A sweep has ended since the last checkpoint, and the source waits for it.
    ended: bool,
    /// Where nothing may be lost.
    stall: Option<Stall>,
    /// When to look into the queues next [ns].
    look_ns: u64,
}

impl Topics {
    fn open(node: &Node, shell: &Shell, (clusters, descriptors): (bool, bool)) -> Result<Self, ShellError> {
        let lossless = shell.plan.pace == Pace::Fast;
        let order = lossless.then(|| Order::from_sweep(shell.answered_sweeps()));
        Ok(Self {
            sweeps: Topic::open(node, order)?,
            truths: Topic::open(node, None)?,
            clusters: clusters.then(|| Topic::open(node, None)).transpose()?,
            descriptors: descriptors.then(|| Topic::open(node, None)).transpose()?,
            tracks: Topic::open(node, order)?,
            ended: false,
            stall: if lossless { Some(Stall::new(shell)?) } else { None },
            look_ns: 0,
        })
    }

    /// Sleeps until it is time to look into the queues. Nobody wakes it: that would cost the stages a system call a part.
    fn pause(&self, shell: &Shell) {
        let page = &shell.page;
        loop {
            let now_ns = clock::now_ns();
            let asked = page.drain_request.get() != page.drained_incarnation.get() || shell.leaving();
            if now_ns >= self.look_ns || asked {
                return;
            }
            page.beat(now_ns);
            clock::sleep_until_ns(self.look_ns.min(now_ns + PAUSE_NS));
        }
    }

    /// When to look next. Where a sensor's clock paces the sweeps, that is in the middle of one: at its end the stages are
    /// busiest, and what this process does on the other core slows them down.
    fn next_look_ns(&self, shell: &Shell) -> u64 {
        let now_ns = clock::now_ns();
        let (due_ns, period_ns) = self.tracks.ended;
        if shell.plan.pace == Pace::Fast {
            return now_ns + LOOK_NS;
        }
        if period_ns == 0 {
            return now_ns + PAUSE_NS;
        }
        let middle_ns = due_ns + period_ns / 2;
        let turns = (now_ns.saturating_sub(middle_ns) / period_ns) + 1;
        (middle_ns + turns * period_ns).min(now_ns + MOST_PAUSE_NS)
    }

    /// Takes all there is.
    fn drain<T: Tap>(&mut self, tap: &mut T, shell: &Shell) -> Result<(), ShellError> {
        let (page, sectors) = (&shell.page, u64::from(shell.plan.chain.sectors.max(1)));
        loop {
            page.beat(clock::now_ns());
            let mut any = self.sweeps.take(tap, shell, T::sweep)?;
            any |= self.truths.take(tap, shell, T::truth)?;
            if let Some(clusters) = &mut self.clusters {
                any |= clusters.take(tap, shell, T::clusters)?;
            }
            if let Some(descriptors) = &mut self.descriptors {
                any |= descriptors.take(tap, shell, T::descriptors)?;
            }
            let before = self.tracks.ended_sweeps();
            any |= self.tracks.take(tap, shell, T::tracks)?;
            self.ended |= self.tracks.ended_sweeps() > before;
            if !any && !self.ended {
                if let Some(stall) = &mut self.stall {
                    stall.look(page, sectors);
                }
                self.look_ns = self.next_look_ns(shell);
                return Ok(());
            }
            let wanted = self.sweeps.wanted_attempt().max(self.tracks.wanted_attempt());
            page.wanted_attempt.set(page.wanted_attempt.get().max(wanted.into()));
            if !any && std::mem::take(&mut self.ended) {
                keep(tap, shell);
            }
        }
    }
}

/// Finds out that the source waits for a sweep of which nothing is on its way any more: a life before this one had it, or
/// it went with a stage that died. A gap shows itself; the end of what was sent does not.
struct Stall {
    source: PageMap,
    /// What the source had sent at the last change, and when that was.
    sent: u64,
    since_ns: u64,
    patience_ns: u64,
}

impl Stall {
    fn new(shell: &Shell) -> Result<Self, ShellError> {
        let source = PageMap::open(&Plan::page_path(&shell.instance, SOURCE))?;
        // A new life asks at once: what the one before had and did not keep is missing.
        let patience_ns = if shell.incarnation > 1 { 0 } else { STALL_NS };
        Ok(Self { source, sent: 0, since_ns: clock::now_ns(), patience_ns })
    }

    fn look(&mut self, page: &Page, sectors: u64) {
        let (now_ns, sent) = (clock::now_ns(), self.source.published.get());
        let is_behind = page.next_ordinal_out.get() / sectors < self.source.next_ordinal_out.get() / sectors;
        if self.patience_ns > 0 && (sent != self.sent || !is_behind) {
            (self.sent, self.since_ns) = (sent, now_ns);
        } else if now_ns - self.since_ns >= self.patience_ns {
            (self.since_ns, self.patience_ns) = (now_ns, STALL_NS);
            page.wanted_attempt.set(self.source.attempt.get() + 1);
        }
    }
}

struct Topic<M: Message> {
    tap: transport::Tap<M>,
    /// Host time at which the latest sweep ended, and the time from sweep to sweep [ns]; zeros before there are two.
    ended: (u64, u64),
    /// Where nothing may be lost.
    order: Option<Order>,
    /// Number that the sender gives its next part; none before the first.
    next_sequence: Option<u64>,
}

impl<M: Message> Topic<M> {
    fn open(node: &Node, order: Option<Order>) -> Result<Self, ShellError> {
        Ok(Self { tap: node.tap()?, ended: (0, 0), order, next_sequence: None })
    }

    fn wanted_attempt(&self) -> u32 {
        self.order.map_or(0, |order| order.wanted_attempt())
    }

    /// Sweeps of which nothing more is to come; 0 where parts are taken as they come.
    fn ended_sweeps(&self) -> u64 {
        self.order.map_or(0, |order| order.next_sweep())
    }

    /// Takes the oldest message that waits. False when there is none.
    fn take<T: Tap>(
        &mut self,
        tap: &mut T,
        shell: &Shell,
        give: fn(&mut T, &Trace, &M, u64),
    ) -> Result<bool, ShellError> {
        let Some(taken) = self.tap.take()? else { return Ok(false) };
        let trace = taken.trace();
        if trace.part.is_last() {
            let (before_ns, _) = self.ended;
            let period_ns = if before_ns == 0 { 0 } else { trace.due_ns.saturating_sub(before_ns) };
            self.ended = (trace.due_ns, period_ns);
        }
        // Truth goes out once a sweep, under the number of the sweep's last part: its gaps say nothing.
        if M::TYPE != Truth::TYPE {
            let sequence = trace.hops().last().map_or(0, |hop| hop.sequence);
            let missed = self.next_sequence.map_or(0, |next| sequence.saturating_sub(next));
            self.next_sequence = Some(sequence + 1);
            if missed > 0 {
                shell.page.dropped.add(missed);
                shell.say(EventId::PartsDropped, trace.part.ordinal, missed);
            }
            shell.page.received.add(1);
        }
        let place = self.order.as_mut().map_or(Place::Next, |order| order.take(trace));
        if matches!(place, Place::Next | Place::Again) {
            give(tap, trace, taken.message(), clock::utc_ns());
        }
        Ok(true)
    }
}
