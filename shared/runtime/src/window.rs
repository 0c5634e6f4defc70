use crate::page::PageMap;
use crate::{Plan, Shell, ShellError};

/// How far the source may run ahead of the chain at [`Pace::Fast`](crate::Pace::Fast), and when it has to go back.
///
/// A part is in flight from its publication until it is counted once, somewhere: dropped or lost on a hop, or settled
/// or rejected by the sink. With no more than half a queue in flight no queue can overflow.
///
/// What is lost on the way is sent again (go-back-N): the sink takes parts in order only, and the source goes back to the
/// first sweep that is not answered when a part was counted as lost or the sink says that one is missing.
pub(crate) struct Window {
    /// All readers of the chain, the sink last.
    readers: Vec<PageMap>,
    /// Who keeps sweeps beside the sink, and must have them all.
    tape: Option<PageMap>,
    parts: u64,
    sectors: u64,
    /// Parts lost when the source went back last.
    lost: u64,
}

impl Window {
    pub(crate) fn open(shell: &Shell) -> Result<Self, ShellError> {
        let page = |name: &str| PageMap::open(&Plan::page_path(&shell.instance, name));
        let readers = shell.plan.stages().skip(1).map(page).collect::<Result<_, _>>()?;
        let tape = shell.plan.tape().map(page).transpose()?;
        let sectors = u64::from(shell.plan.chain.sectors.max(1));
        Ok(Self { readers, tape, parts: shell.plan.window_parts(), sectors, lost: 0 })
    }

    /// Whether the part of this ordinal may be sent, `published` being those published so far.
    pub(crate) fn has_room(&self, published: u64, ordinal: u64) -> bool {
        let missing: u64 = self.readers.iter().map(|page| page.dropped.get() + page.lost.get()).sum();
        let ended = self.readers.last().map_or(0, |sink| sink.processed.get() + sink.rejected_total());
        let on_tape =
            self.tape.as_ref().is_none_or(|tape| ordinal < tape.next_ordinal_out.get().saturating_add(self.parts));
        published < missing + ended + self.parts && on_tape
    }

    /// Whether something that was sent at `attempt` is missing where it is needed.
    pub(crate) fn is_asked_back(&self, attempt: u64) -> bool {
        self.lost_parts() > self.lost || self.wanted_attempt() > attempt
    }

    /// The source goes back: what is lost by now will be sent again. The attempt that was asked for.
    pub(crate) fn go_back(&mut self) -> u64 {
        self.lost = self.lost_parts();
        self.wanted_attempt()
    }

    /// Sweeps that need never be sent again.
    pub(crate) fn answered_sweeps(&self) -> u64 {
        self.keepers().map(|page| page.next_ordinal_out.get() / self.sectors).min().unwrap_or(0)
    }

    fn lost_parts(&self) -> u64 {
        self.readers.iter().map(|page| page.lost.get()).sum()
    }

    fn wanted_attempt(&self) -> u64 {
        self.keepers().map(|page| page.wanted_attempt.get()).max().unwrap_or(0)
    }

    fn keepers(&self) -> impl Iterator<Item = &PageMap> {
        self.readers.last().into_iter().chain(&self.tape)
    }
}
