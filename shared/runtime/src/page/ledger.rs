//! How parts are counted, in the order that lets a sudden death be settled afterwards.

use messages::{Part, Verdict};

use super::words::{GapWords, MAX_GAPS, Page};

/// Why parts of a hop are missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u64)]
pub enum GapKind {
    /// The queue overflowed.
    Dropped = 1,
    /// A process died.
    Lost = 2,
}

/// Missing parts by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Why.
    pub kind: GapKind,
    /// First ordinal of the gap.
    pub first_ordinal: u64,
    /// One past its last. Ordinals in between that the stage before never published are not this hop's.
    pub end_ordinal: u64,
    /// Parts missing on this hop.
    pub parts: u64,
}

/// What a settlement found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Settlement {
    /// The dead stage had sent a part and not yet counted it.
    pub sent_uncounted: bool,
    /// Parts that died in its hands.
    pub lost: u64,
}

impl Page {
    /// A part has come from the stage before: a gap before it is counted, then it is in hand, then received.
    ///
    /// `fresh` says that a life began on either side since the part before, so that missing parts were lost with a
    /// process; else they overflowed the queue. Returns the gap, if there is one.
    pub(crate) fn take_in_hand(&self, part: Part, sequence: u64, fresh: bool) -> Option<Gap> {
        let missing = sequence.saturating_sub(self.next_sequence.get());
        let gap = (missing > 0).then(|| Gap {
            kind: if fresh { GapKind::Lost } else { GapKind::Dropped },
            first_ordinal: self.next_ordinal_in.get(),
            end_ordinal: part.ordinal,
            parts: missing,
        });
        if let Some(gap) = gap {
            self.count_gap(gap, sequence);
        }
        self.in_hand_sequence.set(sequence);
        self.in_hand_received.set(self.received.get());
        self.open_journal(part.ordinal);
        self.receive(part.ordinal, sequence);
        gap
    }

    fn receive(&self, ordinal: u64, sequence: u64) {
        self.next_sequence.set(sequence + 1);
        self.next_ordinal_in.set(ordinal + 1);
        self.received.add(1);
    }

    /// A source has begun to make a part.
    pub(crate) fn make_in_hand(&self, ordinal: u64) {
        self.open_journal(ordinal);
    }

    fn open_journal(&self, ordinal: u64) {
        self.in_hand_published.set(self.published.get());
        self.in_hand_counted.set(self.counted());
        self.in_hand_rejected.set(self.rejected_total());
        self.in_hand_verdict.set(Verdict::Complete as u64);
        self.in_hand.set(ordinal + 1);
    }

    /// The part in hand is about to be sent with this verdict.
    pub(crate) fn note_verdict(&self, verdict: Verdict) {
        self.in_hand_verdict.set(verdict as u64);
    }

    /// A source goes back to an earlier ordinal. A death on the way is made good by whoever settles it.
    pub(crate) fn go_back(&self, ordinal: u64) {
        let again = self.next_ordinal_out.get().saturating_sub(ordinal);
        self.back_resent.set(self.resent.get() + again);
        self.back_to.set(ordinal + 1);
        self.finish_going_back();
    }

    fn finish_going_back(&self) {
        if let Some(ordinal) = self.back_to.get().checked_sub(1) {
            self.resent.set(self.back_resent.get());
            self.next_ordinal_out.set(ordinal);
            self.back_to.set(0);
        }
    }

    /// The part in hand has been sent.
    pub(crate) fn count_sent(&self, part: Part) {
        self.published.add(1);
        self.next_ordinal_out.set(part.ordinal + 1);
    }

    /// The part in hand has come to its end.
    pub(crate) fn count_verdict(&self, verdict: Verdict) {
        if verdict.is_rejected() { self.rejected[verdict as usize].add(1) } else { self.processed.add(1) }
    }

    /// The part leaves the hand.
    pub(crate) fn put_down(&self) {
        self.in_hand.set(0);
    }

    /// A sink has taken over the part in hand, or rejected it.
    pub(crate) fn count_accepted(&self, verdict: Verdict) {
        if verdict.is_rejected() { self.rejected[verdict as usize].add(1) } else { self.published.add(1) }
    }

    /// A sink has finished a part for good.
    pub(crate) fn count_settled(&self, part: Part) {
        self.processed.add(1);
        self.next_ordinal_out.set(part.ordinal + 1);
    }

    /// Parts of the stage before that stand in a category here.
    pub fn counted(&self) -> u64 {
        let missing = self.dropped.get().saturating_add(self.lost.get());
        self.processed.get().saturating_add(self.rejected_total()).saturating_add(missing)
    }

    /// Names and counts a gap that ends before `next_sequence`, so that a death on the way neither loses nor doubles it.
    fn count_gap(&self, gap: Gap, next_sequence: u64) {
        self.gap_lost_unsettled.set(self.lost_unsettled.get());
        self.gap_in_hand.set(0);
        self.count_gap_as_journalled(gap, next_sequence);
    }

    /// The same for the gap of a sink that died: with it go the part in hand, and `unsettled` that it had accepted.
    fn count_gap_of_sink(&self, gap: Gap, unsettled: u64) {
        self.gap_lost_unsettled.set(self.lost_unsettled.get() + unsettled);
        self.gap_in_hand.set(1);
        self.count_gap_as_journalled(gap, self.next_sequence.get());
    }

    fn count_gap_as_journalled(&self, gap: Gap, next_sequence: u64) {
        let words = self.gap_words(self.gap_count.get());
        words.kind.set(gap.kind as u64);
        words.first_ordinal.set(gap.first_ordinal);
        words.end_ordinal.set(gap.end_ordinal);
        words.parts.set(gap.parts);
        self.gap_missing_before.set(self.missing());
        self.gap_sequence.set(next_sequence);
        self.gap_pending.set(1);
        self.finish_gap();
    }

    fn finish_gap(&self) {
        if self.gap_pending.get() == 0 {
            return;
        }
        let number = self.gap_count.get();
        if self.missing() == self.gap_missing_before.get() {
            let gap = self.gap_words(number).read();
            match gap.kind {
                GapKind::Dropped => self.dropped.add(gap.parts),
                GapKind::Lost => self.lost.add(gap.parts),
            }
        }
        self.next_sequence.set(self.gap_sequence.get());
        self.lost_unsettled.set(self.gap_lost_unsettled.get());
        if self.gap_in_hand.get() > 0 {
            self.put_down();
        }
        // A death between the two costs the gap its name, not its count.
        self.gap_pending.set(0);
        self.gap_count.set(number + 1);
    }

    fn missing(&self) -> u64 {
        self.dropped.get().saturating_add(self.lost.get())
    }

    fn gap_words(&self, number: u64) -> &GapWords {
        &self.gaps[number as usize % MAX_GAPS]
    }

    /// The latest gaps, oldest first.
    pub fn gaps(&self) -> Vec<Gap> {
        let count = self.gap_count.get();
        let from = count.saturating_sub(MAX_GAPS as u64);
        (from..count).map(|number| self.gap_words(number).read()).collect()
    }

    /// Settles the account of a stage that died: was the part in hand sent, and is it counted?
    ///
    /// `seen_by_next` is the sequence number that the stage after expects next: a part that it saw was sent, whatever
    /// this page says. With `in_doubt` the stage after has not drained what was sent, so it may see the part yet: then
    /// it counts as sent, its number is not used again, and the reader names it as lost if it never comes.
    /// A part that was not sent died in hand; a source will make it again, so it is not lost.
    pub fn settle_stage(&self, seen_by_next: u64, in_doubt: bool, is_source: bool) -> Settlement {
        self.finish_gap();
        self.finish_going_back();
        let mut settlement = Settlement::default();
        let Some(ordinal) = self.in_hand.get().checked_sub(1) else {
            return settlement;
        };
        if !is_source && self.received.get() == self.in_hand_received.get() {
            self.receive(ordinal, self.in_hand_sequence.get());
        }
        let before = self.in_hand_published.get();
        let sent = self.published.get() > before || seen_by_next > before || in_doubt;
        if sent {
            settlement.sent_uncounted = self.published.get() == before;
            self.published.set(before + 1);
            self.next_ordinal_out.set(ordinal + 1);
        }
        let counted = self.counted() > self.in_hand_counted.get();
        if !is_source && !counted {
            if sent {
                self.count_verdict(Verdict::ALL[self.in_hand_verdict.get() as usize % Verdict::ALL.len()]);
            } else {
                let gap = Gap { kind: GapKind::Lost, first_ordinal: ordinal, end_ordinal: ordinal + 1, parts: 1 };
                self.count_gap(gap, self.next_sequence.get());
                settlement.lost = 1;
            }
        }
        self.put_down();
        settlement
    }

    /// Settles the account of a sink that died: what it had in hand, or had accepted and not finished, is lost.
    pub fn settle_sink(&self) -> Settlement {
        self.finish_gap();
        let unsettled = self.accepted_unsettled();
        let mut lost = unsettled;
        if let Some(ordinal) = self.in_hand.get().checked_sub(1) {
            if self.received.get() == self.in_hand_received.get() {
                self.receive(ordinal, self.in_hand_sequence.get());
            }
            // Settled by the writer before this page said that it was accepted.
            let settled_early = self.processed.get() + self.lost_unsettled.get() > self.published.get();
            if settled_early {
                self.published.add(1);
            }
            let accepted = self.published.get() > self.in_hand_published.get();
            let rejected = self.rejected_total() > self.in_hand_rejected.get();
            lost += u64::from(!accepted && !rejected);
        }
        if lost > 0 {
            let end_ordinal = self.next_ordinal_in.get();
            let first_ordinal = self.next_ordinal_out.get().min(end_ordinal);
            let gap = Gap { kind: GapKind::Lost, first_ordinal, end_ordinal, parts: lost };
            self.count_gap_of_sink(gap, unsettled);
        } else {
            self.put_down();
        }
        Settlement { sent_uncounted: false, lost }
    }

    /// A sink's parts that are accepted and not settled.
    fn accepted_unsettled(&self) -> u64 {
        self.published.get().saturating_sub(self.processed.get() + self.lost_unsettled.get())
    }

    /// Parts in the hands of this stage.
    pub fn held(&self, is_sink: bool) -> u64 {
        let in_hand = u64::from(self.in_hand.get() > 0);
        if is_sink { in_hand + self.accepted_unsettled() } else { in_hand }
    }

    /// Names as lost what the stage before sent with a number below `sequence` and what never came, nor will: it was
    /// sent before this life was connected, or this was the last life. Returns how many parts.
    pub fn lose_below(&self, sequence: u64) -> u64 {
        let parts = sequence.saturating_sub(self.next_sequence.get());
        if parts > 0 {
            let first_ordinal = self.next_ordinal_in.get();
            let gap = Gap { kind: GapKind::Lost, first_ordinal, end_ordinal: first_ordinal + parts, parts };
            self.count_gap(gap, sequence);
        }
        parts
    }
}

impl GapWords {
    fn read(&self) -> Gap {
        Gap {
            kind: if self.kind.get() == GapKind::Dropped as u64 { GapKind::Dropped } else { GapKind::Lost },
            first_ordinal: self.first_ordinal.get(),
            end_ordinal: self.end_ordinal.get(),
            parts: self.parts.get(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::PageMap;

    fn page() -> (tempfile::TempDir, PageMap) {
        let dir = tempfile::tempdir().unwrap();
        let page = PageMap::create(&dir.path().join("page")).unwrap();
        (dir, page)
    }

    fn part(ordinal: u64) -> Part {
        Part { ordinal, sweep: ordinal, sectors: 1, ..Part::default() }
    }

    /// The steps of one part; a death may come between any two of them.
    const STEPS: usize = 6;

    fn steps(page: &Page, ordinal: u64, sequence: u64, verdict: Verdict, upto: usize) -> bool {
        let mut sent = false;
        for step in 0..upto {
            match step {
                0 => drop(page.take_in_hand(part(ordinal), sequence, false)),
                1 => page.note_verdict(verdict),
                2 => sent = true, // the message is out; nothing in the page says so
                3 => page.count_sent(part(ordinal)),
                4 => page.count_verdict(verdict),
                _ => page.put_down(),
            }
        }
        sent
    }

    #[test]
    fn a_death_between_any_two_steps_leaves_each_part_in_one_category() {
        for verdict in [Verdict::Complete, Verdict::RejectedMalformed] {
            for upto in 0..=STEPS {
                let (_dir, page) = page();
                steps(&page, 0, 0, Verdict::Complete, STEPS);
                let sent = steps(&page, 1, 1, verdict, upto);
                let seen_by_next = if sent { 2 } else { 1 };
                let settlement = page.settle_stage(seen_by_next, false, false);

                assert_eq!(page.published.get(), seen_by_next, "after {upto} steps");
                let arrived = u64::from(upto > 0);
                assert_eq!(page.received.get(), 1 + arrived);
                assert_eq!(page.counted(), 1 + arrived, "after {upto} steps");
                assert_eq!(page.lost.get(), settlement.lost);
                assert_eq!(settlement.lost, arrived * u64::from(!sent));
                assert_eq!(page.in_hand.get(), 0);
                assert_eq!(
                    page.settle_stage(seen_by_next, false, false),
                    Settlement::default(),
                    "settling twice adds nothing"
                );
            }
        }
    }

    #[test]
    fn a_part_in_doubt_counts_as_sent_and_its_number_is_not_used_again() {
        for sent in [false, true] {
            let (_dir, page) = page();
            steps(&page, 0, 0, Verdict::Complete, 3); // in hand, perhaps sent, not counted
            assert_eq!(page.settle_stage(0, true, false).lost, 0);
            assert_eq!((page.published.get(), page.counted()), (1, 1));
            // The reader gets it after all, or sees a gap before the successor's first part.
            let (_other, reader) = self::page();
            if sent {
                steps(&reader, 0, 0, Verdict::Complete, STEPS);
            }
            let gap = reader.take_in_hand(part(1), 1, true);
            assert_eq!(gap.map(|gap| gap.parts), (!sent).then_some(1));
        }
    }

    #[test]
    fn a_gap_within_one_life_was_dropped_and_across_two_was_lost() {
        let (_dir, page) = page();
        steps(&page, 0, 0, Verdict::Complete, STEPS);
        let dropped = page.take_in_hand(part(5), 3, false).unwrap();
        assert_eq!(dropped, Gap { kind: GapKind::Dropped, first_ordinal: 1, end_ordinal: 5, parts: 2 });
        page.count_sent(part(5));
        page.count_verdict(Verdict::Complete);
        page.put_down();
        let lost = page.take_in_hand(part(9), 7, true).unwrap();
        assert_eq!(lost, Gap { kind: GapKind::Lost, first_ordinal: 6, end_ordinal: 9, parts: 3 });
        assert_eq!(page.gaps(), [dropped, lost]);
        // The part in hand dies too: the gap before it must not pass for it.
        assert_eq!(page.settle_stage(2, false, false).lost, 1);
        assert_eq!(page.counted(), 8);
    }

    #[test]
    fn a_source_makes_again_what_it_had_not_sent() {
        let (_dir, page) = page();
        page.make_in_hand(0);
        assert_eq!(page.settle_stage(0, false, true), Settlement::default());
        assert_eq!((page.published.get(), page.next_ordinal_out.get()), (0, 0));
        page.make_in_hand(0);
        assert!(page.settle_stage(1, false, true).sent_uncounted);
        assert_eq!((page.published.get(), page.next_ordinal_out.get()), (1, 1));
    }

    #[test]
    fn a_sink_loses_what_it_had_accepted_and_not_settled() {
        for in_hand in [false, true] {
            let (_dir, page) = page();
            for ordinal in 0..5 {
                page.take_in_hand(part(ordinal), ordinal, false);
                page.count_accepted(Verdict::Complete);
                page.put_down();
            }
            page.count_settled(part(0));
            page.count_settled(part(1));
            assert_eq!(page.held(true), 3);
            page.take_in_hand(part(5), 5, false);
            page.count_accepted(Verdict::RejectedSinkFull);
            page.put_down();
            if in_hand {
                page.take_in_hand(part(6), 6, false);
            }
            let lost = 3 + u64::from(in_hand);
            assert_eq!(page.settle_sink().lost, lost);
            assert_eq!(page.settle_sink().lost, 0);
            assert_eq!(page.counted(), 3 + lost);
            assert_eq!(page.held(true), 0);
        }
    }

    /// The settler may die too: what it journalled and did not finish is finished by the next.
    #[test]
    fn a_sinks_account_is_settled_once_whenever_the_settler_dies() {
        // One part accepted and not written, one in hand.
        let died = || {
            let (dir, page) = page();
            let _ = page.take_in_hand(part(0), 0, false);
            page.count_accepted(Verdict::Complete);
            page.put_down();
            let _ = page.take_in_hand(part(1), 1, false);
            (dir, page)
        };
        let gap = Gap { kind: GapKind::Lost, first_ordinal: 0, end_ordinal: 2, parts: 2 };
        for upto in 0..=5 {
            let (_dir, page) = died();
            for step in 0..upto {
                match step {
                    0 => {
                        // Journalled: the gap is pending and nothing of it counted.
                        page.count_gap_of_sink(gap, 1);
                        page.lost.set(0);
                        page.lost_unsettled.set(0);
                        page.in_hand.set(2);
                        page.gap_count.set(0);
                        page.gap_pending.set(1);
                    }
                    1 => page.lost.set(2),
                    2 => page.lost_unsettled.set(1),
                    3 => page.put_down(),
                    _ => page.gap_pending.set(0),
                }
            }
            page.settle_sink();
            assert_eq!((page.lost.get(), page.held(true)), (2, 0), "after {upto} steps");
            assert_eq!(page.settle_sink(), Settlement::default(), "settling twice adds nothing");
        }
    }

    #[test]
    fn a_part_that_a_sink_settled_before_it_was_counted_as_accepted_is_not_lost() {
        let (_dir, page) = page();
        page.take_in_hand(part(0), 0, false);
        page.count_settled(part(0));
        assert_eq!(page.settle_sink().lost, 0);
        assert_eq!((page.published.get(), page.counted(), page.held(true)), (1, 1, 0));
    }

    #[test]
    fn what_waited_for_a_stage_that_died_for_good_is_lost() {
        let (_dir, page) = page();
        steps(&page, 0, 0, Verdict::Complete, STEPS);
        assert_eq!(page.lose_below(4), 3);
        assert_eq!(page.lose_below(4), 0);
        assert_eq!(page.counted(), 4);
    }

    #[test]
    fn a_page_of_another_size_or_kind_is_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("page");
        std::fs::write(&path, b"short").unwrap();
        assert!(PageMap::open(&path).err().unwrap().to_string().contains("is 5 bytes, must be"));
        std::fs::write(&path, vec![0; size_of::<Page>()]).unwrap();
        assert!(PageMap::open(&path).err().unwrap().to_string().contains("not a page of this version"));
    }
}
