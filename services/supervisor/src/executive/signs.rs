//! What is known of one process at one moment.

use runtime::page::{Page, State};
use runtime::{Pace, Plan};

use super::activity::Activity;
use crate::processes::child::Watched;

/// What is known of one process at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Signs {
    /// It is connected and was not told to leave. Only such a process is judged.
    pub(crate) up: bool,
    /// It lives, and is not connected.
    pub(crate) starts: bool,
    /// It was told to leave: whatever it does now is said of nobody.
    pub(crate) told: bool,
    /// Processes that it has been so far.
    pub(crate) processes: u64,
    /// Lives that began so far.
    pub(crate) life: u64,
    /// Host time at which its working thread last made progress [ns].
    pub(crate) heartbeat_ns: u64,
    /// A part is in its hands.
    pub(crate) in_hand: bool,
    /// Parts that it has let through: sequence number expected next; the source: parts published.
    pub(crate) taken: u64,
    /// Parts that the stage before has published; none for the source and the tape.
    pub(crate) offered: Option<u64>,
    /// The life of the stage before; 0 while that is not connected.
    pub(crate) offerer: u64,
    /// The source: nothing is to be sent now, for it has ended, was paused, waits for a step, or has no room.
    pub(crate) idle: bool,
    /// Parts sent by ordinal; the sink: settled.
    pub(crate) parts: u64,
    /// Sweeps over its budget.
    pub(crate) overruns: u64,
    /// Events that it has said.
    pub(crate) said: u64,
    /// What the kernel says of it. Read only where the heartbeat is old.
    pub(crate) activity: Option<Activity>,
}

impl Signs {
    /// Gathers them. `before` is the stage before, `asked_ns` the age of a heartbeat from which on the kernel is asked.
    pub(crate) fn of(watched: &Watched, before: Option<&Watched>, now_ns: u64, asked_ns: u64) -> Self {
        let page: &Page = &watched.page;
        let up = watched.is_up() && !watched.told;
        let heartbeat_ns = page.heartbeat_ns.get();
        let is_old = up && now_ns.saturating_sub(heartbeat_ns) >= asked_ns;
        let pid = if is_old { watched.pid().map(|pid| pid.as_raw_nonzero().get() as u32) } else { None };
        Self {
            up,
            starts: !up && watched.is_alive(),
            told: watched.told,
            processes: watched.pids.len() as u64,
            life: page.incarnation.get(),
            heartbeat_ns,
            // Read before what is taken: what comes in between would look as if it waited.
            offered: before.map(|before| before.page.published.get()),
            offerer: before.filter(|before| before.is_up()).map_or(0, |before| before.page.incarnation.get()),
            taken: if before.is_some() { page.next_sequence.get() } else { page.published.get() },
            in_hand: page.in_hand.get() > 0,
            idle: false,
            parts: page.next_ordinal_out.get(),
            overruns: page.overruns.get(),
            said: page.said(),
            activity: pid.and_then(Activity::of),
        }
    }
}

/// Whether the source is to send nothing now.
pub(crate) fn source_is_idle(plan: &Plan, stages: &[Watched], tape: Option<&Watched>) -> bool {
    let Some((source, readers)) = stages.split_first() else { return true };
    let page: &Page = &source.page;
    let stands = page.state() == State::Ended || page.paused.get() > 0 || page.pause.get() > 0;
    if stands || source.told || page.may_start.get() == 0 || plan.source.single_step {
        return true;
    }
    plan.pace == Pace::Fast && !has_room(plan, page, readers, tape)
}

/// Whether the source may run further ahead of its readers; as it sees it itself (`runtime::window`).
fn has_room(plan: &Plan, source: &Page, readers: &[Watched], tape: Option<&Watched>) -> bool {
    let missing: u64 = readers.iter().map(|reader| reader.page.dropped.get() + reader.page.lost.get()).sum();
    let ended = readers.last().map_or(0, |sink| sink.page.processed.get() + sink.page.rejected_total());
    let parts = plan.window_parts();
    let on_tape =
        tape.is_none_or(|tape| source.next_ordinal_out.get() < tape.page.next_ordinal_out.get().saturating_add(parts));
    source.published.get() < missing + ended + parts && on_tape
}
