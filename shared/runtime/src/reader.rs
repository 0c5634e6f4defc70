use events::EventId;
use messages::{Message, Trace};
use transport::{Inlet, Taken};

use crate::page::{Gap, GapKind};
use crate::shell::IDLE;
use crate::{Shell, ShellError, clock};

/// What a reader does with its parts.
pub(crate) trait Reader<T: Message> {
    /// Handles one part.
    fn take(&mut self, taken: &Taken<T>) -> Result<(), ShellError>;

    /// Called between waits.
    fn idle(&mut self) -> Result<(), ShellError> {
        Ok(())
    }
}

/// The loop of everyone who reads: wait, take all there is, look at what is asked. Returns when the stage was asked to
/// leave and its input is drained.
pub(crate) fn serve<T: Message>(
    shell: &Shell,
    inlet: &Inlet<T>,
    reader: &mut impl Reader<T>,
) -> Result<(), ShellError> {
    loop {
        let leaving = shell.leaving();
        if !leaving {
            inlet.wait(IDLE)?;
        }
        drain(shell, inlet, reader)?;
        if leaving {
            return Ok(());
        }
        reader.idle()?;
    }
}

/// Takes all there is, then answers what the supervisor asks.
fn drain<T: Message>(shell: &Shell, inlet: &Inlet<T>, reader: &mut impl Reader<T>) -> Result<(), ShellError> {
    let page = &shell.page;
    loop {
        shell.beat();
        // Read before the look into the queue, so that an answer covers all that was sent by then.
        let (request, lose_below) = (page.drain_request.get(), page.lose_below.get());
        let Some(taken) = inlet.take()? else {
            let lost = page.lose_below(lose_below);
            if lost > 0 {
                // It was sent before this life was connected.
                shell.say(EventId::PartsLost, page.next_ordinal_in.get(), lost);
            }
            page.drained_incarnation.set(request);
            return Ok(());
        };
        reader.take(&taken)?;
    }
}

/// What a reader remembers from part to part.
pub(crate) struct Arrivals<'a> {
    shell: &'a Shell,
    /// Life of the stage before that sent the last part; none before the first part of this life.
    sender: Option<u32>,
    /// When the part before was done.
    pub(crate) free_ns: u64,
    /// Parts of this life.
    pub(crate) parts: u64,
}

impl<'a> Arrivals<'a> {
    pub(crate) fn new(shell: &'a Shell) -> Self {
        Self { shell, sender: None, free_ns: clock::now_ns(), parts: 0 }
    }

    /// Takes a part in hand and says what is missing before it. False when a fault on purpose swallows it here.
    pub(crate) fn receive(&mut self, trace: &Trace) -> bool {
        // Every sender stamps its hop; what has none is not the chain's and leaves the ledger OPEN.
        let sent = trace.hops().last().copied().unwrap_or_default();
        let page = &self.shell.page;
        let fresh = self.sender != Some(sent.incarnation);
        self.sender = Some(sent.incarnation);
        if let Some(gap) = page.take_in_hand(trace.part, sent.sequence, fresh) {
            self.tell(gap);
        }
        if page.swallow.take_one() {
            page.put_down();
            return false;
        }
        true
    }

    fn tell(&self, gap: Gap) {
        let id = match gap.kind {
            GapKind::Dropped => EventId::PartsDropped,
            GapKind::Lost => EventId::PartsLost,
        };
        self.shell.say(id, gap.end_ordinal, gap.parts);
    }
}
