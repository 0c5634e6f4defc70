use crate::page::PageMap;
use crate::{Plan, Shell, ShellError};

/// How far the source may run ahead of the chain at [`Pace::Fast`](crate::Pace::Fast).
///
/// A part is in flight from its publication until it is counted once, somewhere: dropped or lost on a hop, or settled
/// or rejected by the sink. With no more than half a queue in flight no queue can overflow.
pub(crate) struct Window {
    /// All readers, the sink last.
    readers: Vec<PageMap>,
    parts: u64,
}

impl Window {
    pub(crate) fn open(shell: &Shell) -> Result<Self, ShellError> {
        let readers = shell.plan.stages().skip(1).map(|stage| PageMap::open(&Plan::page_path(&shell.instance, stage)));
        Ok(Self { readers: readers.collect::<Result<_, _>>()?, parts: shell.plan.window_parts() })
    }

    /// Whether one more part fits, `published` being those published so far.
    pub(crate) fn has_room(&self, published: u64) -> bool {
        let missing: u64 = self.readers.iter().map(|page| page.dropped.get() + page.lost.get()).sum();
        let ended = self.readers.last().map_or(0, |sink| sink.processed.get() + sink.rejected_total());
        published < missing + ended + self.parts
    }
}
