//! What a stage says: numbers of events in a ring on its page. The supervisor reads them and words them.

use events::{EventId, Severity};

use super::words::{Page, Word};

/// Events of ordinary gravity that wait for the supervisor's next look.
const ORDINARY: usize = 32;
/// Errors and worse that wait; apart, so that a storm of warnings cannot wash them away.
const GRAVE: usize = 16;

/// An event as a stage says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Said {
    /// What happened.
    pub id: EventId,
    /// Host time [ns].
    pub time_ns: u64,
    /// The sweep that the stage was at.
    pub sweep: u64,
    /// First number of the event's text.
    pub a: u64,
    /// Second number of the event's text.
    pub b: u64,
}

#[derive(Default)]
#[repr(C)]
struct SaidWords {
    /// Place in the ring's life plus one, written last: a reader that sees another number saw a torn event.
    turn: Word,
    id: Word,
    time_ns: Word,
    sweep: Word,
    a: Word,
    b: Word,
}

/// Both rings.
#[derive(Default)]
#[repr(C)]
pub(super) struct Rings {
    ordinary_count: Word,
    grave_count: Word,
    ordinary: [SaidWords; ORDINARY],
    grave: [SaidWords; GRAVE],
}

/// How far a reader has come in both rings of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heard {
    ordinary: u64,
    grave: u64,
    /// Events that were overwritten before they were read.
    pub missed: u64,
}

impl Page {
    /// Says that something happened. For the page's own process alone.
    pub fn say(&self, said: Said) {
        let rings = &self.rings;
        if said.id.severity() >= Severity::Error {
            put(&rings.grave, &rings.grave_count, said);
        } else {
            put(&rings.ordinary, &rings.ordinary_count, said);
        }
    }

    /// Events said so far, through all lives.
    pub fn said(&self) -> u64 {
        self.rings.grave_count.get() + self.rings.ordinary_count.get()
    }

    /// What was said since the last look, the grave first, each ring in its order.
    pub fn hear(&self, heard: &mut Heard, mut tell: impl FnMut(Said)) {
        let rings = &self.rings;
        heard.missed += take(&rings.grave, rings.grave_count.get(), &mut heard.grave, &mut tell);
        heard.missed += take(&rings.ordinary, rings.ordinary_count.get(), &mut heard.ordinary, &mut tell);
    }
}

fn put(ring: &[SaidWords], count: &Word, said: Said) {
    let turn = count.get();
    let words = &ring[turn as usize % ring.len()];
    words.turn.set(0);
    words.id.set(u64::from(said.id as u32));
    words.time_ns.set(said.time_ns);
    words.sweep.set(said.sweep);
    words.a.set(said.a);
    words.b.set(said.b);
    words.turn.set(turn + 1);
    count.set(turn + 1);
}

/// Tells what stands in the ring from `seen` on; how many had been overwritten.
fn take(ring: &[SaidWords], count: u64, seen: &mut u64, tell: &mut impl FnMut(Said)) -> u64 {
    let first = count.saturating_sub(ring.len() as u64).max(*seen);
    let mut missed = first - *seen;
    for turn in first..count {
        let words = &ring[turn as usize % ring.len()];
        let said = EventId::from_number(words.id.get() as u32).map(|id| Said {
            id,
            time_ns: words.time_ns.get(),
            sweep: words.sweep.get(),
            a: words.a.get(),
            b: words.b.get(),
        });
        match said.filter(|_| words.turn.get() == turn + 1) {
            Some(said) => tell(said),
            None => missed += 1,
        }
    }
    *seen = count.max(*seen);
    missed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::PageMap;

    fn said(id: EventId, a: u64) -> Said {
        Said { id, time_ns: 0, sweep: 0, a, b: 0 }
    }

    fn hear(page: &Page, heard: &mut Heard) -> Vec<u64> {
        let mut all = Vec::new();
        page.hear(heard, |said| all.push(said.a));
        all
    }

    #[test]
    fn what_is_said_is_heard_once_and_in_order() {
        let dir = tempfile::tempdir().unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        let mut heard = Heard::default();
        for a in 0..3 {
            page.say(said(EventId::PartsDropped, a));
        }
        assert_eq!(hear(&page, &mut heard), [0, 1, 2]);
        page.say(said(EventId::PartsDropped, 3));
        assert_eq!(hear(&page, &mut heard), [3]);
        assert_eq!(page.said(), 4);
        assert_eq!((hear(&page, &mut heard), heard.missed), (vec![], 0));
    }

    #[test]
    fn a_storm_of_warnings_is_counted_and_hides_no_error() {
        let dir = tempfile::tempdir().unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        let mut heard = Heard::default();
        page.say(said(EventId::PartsLost, 7));
        for a in 0..100 {
            page.say(said(EventId::PartsDropped, a));
        }
        let all = hear(&page, &mut heard);
        assert_eq!((all[0], all.len()), (7, 1 + ORDINARY));
        assert_eq!(all[1..], (68..100).collect::<Vec<_>>());
        assert_eq!(heard.missed, 68);
    }
}
