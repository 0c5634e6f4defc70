use events::EventId;
use messages::{Part, Verdict};

use crate::clock;
use crate::page::{Page, Said};

/// What a stage refuses of a sweep: said once, with the sweep's last part.
#[derive(Debug, Default)]
pub(crate) struct Refused {
    stale: u64,
    behind: u64,
    /// For other reasons, and the last of these.
    others: (u64, u64),
}

impl Refused {
    /// Notes what became of a part here. What is left out on purpose, came twice or passed a stand-in is no event.
    pub(crate) fn note(&mut self, page: &Page, part: &Part, verdict: Verdict) {
        match verdict {
            Verdict::RejectedStale => self.stale += 1,
            Verdict::RejectedSinkFull => self.behind += 1,
            Verdict::RejectedShed | Verdict::RejectedDown | Verdict::RejectedDouble | Verdict::RejectedAhead => {}
            verdict if verdict.is_rejected() => self.others = (self.others.0 + 1, verdict as u64),
            _ => {}
        }
        if part.is_last() {
            self.tell(page, part);
        }
    }

    fn tell(&mut self, page: &Page, part: &Part) {
        let Self { stale, behind, others: (parts, reason) } = std::mem::take(self);
        let told = [
            (EventId::StaleRefused, stale, part.ordinal),
            (EventId::SinkBehind, behind, part.ordinal),
            (EventId::PartsRejected, parts, reason),
        ];
        for (id, a, b) in told.into_iter().filter(|(_, parts, _)| *parts > 0) {
            page.say(Said { id, time_ns: clock::now_ns(), sweep: part.sweep, a, b });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::{Heard, PageMap};

    #[test]
    fn a_sweep_of_which_parts_are_refused_is_told_once_with_their_number() {
        let dir = tempfile::tempdir().unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        let (mut sut, mut heard) = (Refused::default(), Heard::default());
        let verdicts = [
            Verdict::RejectedStale,
            Verdict::RejectedMalformed,
            Verdict::RejectedShed,
            Verdict::RejectedStale,
            Verdict::Complete,
        ];
        for (sector, verdict) in verdicts.into_iter().enumerate() {
            let part =
                Part { ordinal: 35 + sector as u64, sweep: 7, sector: sector as u32, sectors: 5, ..Part::default() };
            sut.note(&page, &part, verdict);
        }
        let mut all = Vec::new();
        page.hear(&mut heard, |said| all.push((said.id, said.sweep, said.a, said.b)));
        let malformed = Verdict::RejectedMalformed as u64;
        assert_eq!(all, [(EventId::StaleRefused, 7, 2, 39), (EventId::PartsRejected, 7, 1, malformed)]);
    }
}
