//! The account of every hop, read from the pages. Nothing is a remainder: each number is counted on its own, and
//! `open` says by how much they contradict each other.

use std::collections::BTreeMap;

use messages::Verdict;
use runtime::page::{GapKind, Page};
use serde::{Deserialize, Serialize};

/// All hops.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct LedgerReport {
    /// Whether every part published is accounted for, once, on every hop.
    pub closed: bool,
    /// The hops in flow order, by the stage that reads.
    pub hops: Vec<HopReport>,
    /// Parts that are missing, by name.
    pub gaps: Vec<GapReport>,
}

/// One hop: what one stage published and the next made of it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct HopReport {
    /// The reading stage.
    pub stage: String,
    /// Parts that the stage before published.
    pub published: u64,
    /// Parts that came.
    pub received: u64,
    /// Parts processed.
    pub processed: u64,
    /// Parts rejected, by reason; `resent`: they died with a process, and were sent again until they were answered.
    pub rejected: BTreeMap<String, u64>,
    /// Parts that never came, by reason.
    pub dropped: BTreeMap<String, u64>,
    /// Parts that died with a process.
    pub lost: u64,
    /// Parts on their way.
    pub in_flight: u64,
    /// Parts in no category, or in two.
    pub open: u64,
}

/// Missing parts by name.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct GapReport {
    /// The stage that did not get them.
    pub stage: String,
    /// `dropped`, `lost`, or `resent`.
    pub kind: String,
    /// First sweep of the gap.
    pub first_sweep: u64,
    /// Last sweep of the gap.
    pub last_sweep: u64,
    /// Parts missing on this hop.
    pub parts: u64,
}

/// The account as the pages stand at the end of a run, `pages` in flow order with their stages' names, the source
/// first. By then nothing may be on its way any more.
pub(crate) fn account(pages: &[(&str, &Page)], sectors: u32) -> LedgerReport {
    let sink = pages.len().saturating_sub(2);
    let made_good = is_made_good(pages);
    let mut hops: Vec<HopReport> =
        pages.windows(2).enumerate().map(|(place, pair)| hop(pair[0].1, pair[1].0, pair[1].1, place == sink)).collect();
    if made_good {
        hops.iter_mut().for_each(HopReport::make_good);
    }
    // What a source made and never published stands in no category of any hop.
    if let (Some((_, source)), Some(first)) = (pages.first(), hops.first_mut()) {
        first.open += (source.next_ordinal_out.get() + source.resent.get()).abs_diff(source.published.get());
    }
    let sectors = u64::from(sectors.max(1));
    let gaps = pages
        .iter()
        .flat_map(|(stage, page)| page.gaps().into_iter().map(move |gap| (stage, gap)))
        .map(|(stage, gap)| GapReport {
            stage: (*stage).to_owned(),
            kind: match gap.kind {
                GapKind::Dropped => "dropped",
                GapKind::Lost if made_good => RESENT,
                GapKind::Lost => "lost",
            }
            .to_owned(),
            first_sweep: gap.first_ordinal / sectors,
            last_sweep: gap.end_ordinal.saturating_sub(1).max(gap.first_ordinal) / sectors,
            parts: gap.parts,
        })
        .collect();
    LedgerReport { closed: hops.iter().all(|hop| hop.open == 0 && hop.in_flight == 0), hops, gaps }
}

/// Why a part is rejected that was lost and sent again.
const RESENT: &str = "resent";

/// Whether the source has sent again what was lost, and the sink has answered all that was ever sent.
fn is_made_good(pages: &[(&str, &Page)]) -> bool {
    let (Some((_, source)), Some((_, sink))) = (pages.first(), pages.last()) else { return false };
    source.attempt.get() > 0 && sink.next_ordinal_out.get() >= source.next_ordinal_out.get()
}

impl HopReport {
    /// Nothing is lost of what was answered in the end.
    fn make_good(&mut self) {
        let lost = std::mem::take(&mut self.lost);
        if lost > 0 {
            *self.rejected.entry(RESENT.to_owned()).or_default() += lost;
        }
    }
}

fn hop(before: &Page, stage: &str, page: &Page, is_sink: bool) -> HopReport {
    let published = before.published.get();
    let waiting = published.saturating_sub(page.next_sequence.get());
    let in_hand = page.held(is_sink);
    let counted = page.counted();
    let dropped = page.dropped.get();
    HopReport {
        stage: stage.to_owned(),
        published,
        received: page.received.get(),
        processed: page.processed.get(),
        rejected: page
            .rejected_by_reason()
            .map(|(verdict, parts)| (Verdict::name(verdict).to_owned(), parts))
            .collect(),
        dropped: if dropped > 0 { BTreeMap::from([("overflow".to_owned(), dropped)]) } else { BTreeMap::new() },
        lost: page.lost.get(),
        in_flight: waiting + in_hand,
        open: published.abs_diff(counted + waiting + in_hand),
    }
}

#[cfg(test)]
mod tests {
    use runtime::page::PageMap;

    use super::*;

    fn pages() -> (tempfile::TempDir, [PageMap; 3]) {
        let dir = tempfile::tempdir().unwrap();
        let before = PageMap::create(&dir.path().join("before")).unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        let sink = PageMap::create(&dir.path().join("sink")).unwrap();
        before.published.set(10);
        before.next_ordinal_out.set(10);
        page.next_sequence.set(10);
        page.received.set(7);
        page.processed.set(6);
        page.rejected[Verdict::RejectedMalformed as usize].set(1);
        page.dropped.set(2);
        page.lost.set(1);
        (dir, [before, page, sink])
    }

    #[test]
    fn a_ledger_in_which_every_part_has_its_place_is_closed() {
        let (_dir, [before, page, sink]) = pages();
        let report = account(&[("source", &before), ("clusterer", &page), ("recorder", &sink)], 1);
        assert!(report.closed);
        assert_eq!(report.hops[0].rejected["malformed"], 1);
        assert_eq!(report.hops[0].dropped["overflow"], 2);
    }

    #[test]
    fn a_part_in_no_place_or_in_two_leaves_it_open() {
        for processed in [5, 7] {
            let (_dir, [before, page, sink]) = pages();
            page.processed.set(processed);
            let report = account(&[("source", &before), ("clusterer", &page), ("recorder", &sink)], 1);
            assert!(!report.closed);
            assert_eq!(report.hops[0].open, 1);
        }
    }

    #[test]
    fn what_still_waits_at_the_end_is_in_flight_and_leaves_it_open() {
        let (_dir, [before, page, sink]) = pages();
        before.published.set(13);
        before.next_ordinal_out.set(13);
        let report = account(&[("source", &before), ("clusterer", &page), ("recorder", &sink)], 1);
        assert!(!report.closed);
        assert_eq!((report.hops[0].in_flight, report.hops[0].open), (3, 0));
    }

    #[test]
    fn what_was_lost_and_answered_in_the_end_is_resent() {
        let (_dir, [before, page, sink]) = pages();
        before.attempt.set(1);
        // Nine ordinals, of which one was sent twice.
        before.next_ordinal_out.set(9);
        before.resent.set(1);
        for (answered, expected) in [(8, (1, None)), (9, (0, Some(1)))] {
            sink.next_ordinal_out.set(answered);
            let report = account(&[("source", &before), ("clusterer", &page), ("recorder", &sink)], 1);
            let hop = &report.hops[0];
            assert!(report.closed);
            assert_eq!((hop.lost, hop.rejected.get(RESENT).copied()), expected);
        }
    }

    #[test]
    fn what_a_source_made_and_never_published_leaves_it_open() {
        let (_dir, [before, page, sink]) = pages();
        before.next_ordinal_out.set(11);
        let report = account(&[("source", &before), ("clusterer", &page), ("recorder", &sink)], 1);
        assert_eq!(report.hops[0].open, 1);
    }
}
