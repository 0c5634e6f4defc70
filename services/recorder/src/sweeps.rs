//! Which sweeps were seen, and how they ended.

use messages::{Part, Verdict};

/// Who rejected a part, by position (the recorder stands behind the last stage), and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rejection {
    pub(crate) stage: usize,
    pub(crate) verdict: Verdict,
}

/// How a sweep ended of which every part came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// Every part was used.
    Answered,
    /// Some were not; this was the first.
    Rejected(Rejection),
}

/// Which sweeps were seen, and how well.
#[derive(Default)]
pub(crate) struct Sweeps {
    pub(crate) seen: u64,
    pub(crate) complete: u64,
    /// Sweeps between the first and the last of which no part came.
    pub(crate) missing: u64,
    pub(crate) first: Option<u64>,
    pub(crate) last: Option<u64>,
    /// Parts between the first and the last that did not come.
    pub(crate) missing_parts: u64,
    pub(crate) first_ordinal: Option<u64>,
    pub(crate) last_ordinal: Option<u64>,
    /// Sectors of the last sweep that came, and the first of them that was rejected.
    came: u32,
    rejection: Option<Rejection>,
}

impl Sweeps {
    /// Notes a part; whether it begins a sweep, and how the sweep ended if it did with this part.
    pub(crate) fn add(&mut self, part: &Part, complete: bool, rejection: Option<Rejection>) -> (bool, Option<Ending>) {
        let after =
            |last: Option<u64>, number: u64| last.map_or(0, |last| number.saturating_sub(last.saturating_add(1)));
        self.missing_parts += after(self.last_ordinal, part.ordinal);
        self.first_ordinal.get_or_insert(part.ordinal);
        self.last_ordinal = self.last_ordinal.max(Some(part.ordinal));
        let begins = self.last != Some(part.sweep);
        if begins {
            self.missing += after(self.last, part.sweep);
            self.seen += 1;
            self.first.get_or_insert(part.sweep);
            self.last = self.last.max(Some(part.sweep));
            (self.came, self.rejection) = (0, None);
        }
        self.came += 1;
        self.rejection = self.rejection.or(rejection);
        if !part.is_last() || self.came != part.sectors.max(1) {
            return (begins, None);
        }
        self.complete += u64::from(complete && self.rejection.is_none());
        (begins, Some(self.rejection.map_or(Ending::Answered, Ending::Rejected)))
    }
}
