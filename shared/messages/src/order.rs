use crate::{Part, Trace, Verdict};

/// What a part is to whom each sweep must come once, whole and in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The next one.
    Next,
    /// One that came before, of a sweep that is taken from its beginning again.
    Again,
    /// Of a sweep that was taken already.
    Double,
    /// Something before it is missing.
    Ahead,
}

/// Which part comes next where the source sends again what is missing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Order {
    sweep: u64,
    sector: u32,
    /// One more than the highest ordinal taken.
    end: u64,
    /// A part of the open sweep was no good by itself: that later ones lack it is no loss.
    spoiled: bool,
    wanted_attempt: u32,
}

impl Order {
    /// Begins with sweep `first`.
    pub fn from_sweep(first: u64) -> Self {
        Self { sweep: first, ..Self::default() }
    }

    /// The attempt of the source that is needed; 0 while nothing is missing.
    pub fn wanted_attempt(&self) -> u32 {
        self.wanted_attempt
    }

    /// The sweep that is open, or comes next.
    pub fn next_sweep(&self) -> u64 {
        self.sweep
    }

    /// Where the part stands; if it is taken, what comes after it is next.
    pub fn take(&mut self, trace: &Trace) -> Place {
        let part = &trace.part;
        if part.sweep < self.sweep {
            return Place::Double;
        }
        let begins = part.sector == 0;
        let follows = part.sweep == self.sweep && (begins || part.sector == self.sector);
        let is = |verdict| trace.hops().iter().any(|hop| hop.verdict == verdict);
        let spoiled = is(Verdict::RejectedMalformed) || (self.spoiled && !begins);
        // A stage that was restarted in the middle of a sweep cannot answer the rest of it.
        let torn = is(Verdict::RejectedIncomplete) && !spoiled;
        if !follows || torn {
            self.wanted_attempt = self.wanted_attempt.max(part.attempt.saturating_add(1));
            return Place::Ahead;
        }
        self.step_over(part, spoiled)
    }

    fn step_over(&mut self, part: &Part, spoiled: bool) -> Place {
        (self.sweep, self.sector, self.spoiled) =
            if part.is_last() { (part.sweep + 1, 0, false) } else { (part.sweep, part.sector + 1, spoiled) };
        let place = if part.ordinal < self.end { Place::Again } else { Place::Next };
        self.end = self.end.max(part.ordinal + 1);
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Hop;

    const SECTORS: u32 = 3;

    fn trace(sweep: u64, sector: u32, attempt: u32, verdict: Verdict) -> Trace {
        let ordinal = sweep * u64::from(SECTORS) + u64::from(sector);
        let part = Part { ordinal, sweep, sector, sectors: SECTORS, attempt, ..Part::default() };
        let mut trace = Trace { part, ..Trace::default() };
        trace.push(Hop { verdict, ..Hop::default() });
        trace
    }

    fn take(sut: &mut Order, sweep: u64, sector: u32, attempt: u32) -> Place {
        sut.take(&trace(sweep, sector, attempt, Verdict::Complete))
    }

    #[test]
    fn a_sweep_in_which_a_part_is_missing_is_taken_from_its_beginning_again() {
        let mut sut = Order::default();
        assert_eq!([0, 1, 2].map(|sector| take(&mut sut, 0, sector, 0)), [Place::Next; 3]);
        assert_eq!(take(&mut sut, 1, 0, 0), Place::Next);
        // Sector 1 is lost. Nothing that was sent in the same attempt follows any more, in this sweep or the next.
        assert_eq!(take(&mut sut, 1, 2, 0), Place::Ahead);
        assert_eq!([0, 1, 2].map(|sector| take(&mut sut, 2, sector, 0)), [Place::Ahead; 3]);
        assert_eq!(sut.wanted_attempt(), 1);
        // The source has gone back farther than need be.
        assert_eq!([0, 1, 2].map(|sector| take(&mut sut, 0, sector, 1)), [Place::Double; 3]);
        let again = [0, 1, 2].map(|sector| take(&mut sut, 1, sector, 1));
        assert_eq!(again, [Place::Again, Place::Next, Place::Next]);
        assert_eq!([0, 1, 2].map(|sector| take(&mut sut, 2, sector, 1)), [Place::Next; 3]);
        assert_eq!(sut.wanted_attempt(), 1);
    }

    #[test]
    fn a_part_that_a_restarted_stage_could_not_answer_is_missing_though_it_came() {
        let mut sut = Order::from_sweep(4);
        assert_eq!(take(&mut sut, 3, 2, 0), Place::Double);
        assert_eq!(take(&mut sut, 4, 0, 0), Place::Next);
        assert_eq!(sut.take(&trace(4, 1, 0, Verdict::RejectedIncomplete)), Place::Ahead);
        assert_eq!(sut.wanted_attempt(), 1);
    }

    #[test]
    fn what_is_malformed_by_itself_is_not_asked_for_again() {
        let mut sut = Order::default();
        assert_eq!(sut.take(&trace(0, 0, 0, Verdict::RejectedMalformed)), Place::Next);
        assert_eq!(sut.take(&trace(0, 1, 0, Verdict::RejectedIncomplete)), Place::Next);
        assert_eq!(sut.take(&trace(0, 2, 0, Verdict::RejectedIncomplete)), Place::Next);
        assert_eq!(sut.take(&trace(1, 0, 0, Verdict::RejectedIncomplete)), Place::Ahead);
    }
}
