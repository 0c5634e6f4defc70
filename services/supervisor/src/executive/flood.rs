//! Flooding: more comes than a source has to send, or than a log has to hold.

/// Sweeps beyond what is allowed, from which on it is a flood.
const SWEEPS: f64 = 3.0;
/// Longest time for which a source that stood still may catch up [periods].
const MOST_OWED: f64 = 100.0;
/// Seconds' worth of events beyond what is allowed, from which on it is a flood.
const EVENTS_S: f64 = 0.2;

/// A bucket that is filled by what comes and leaks at the rate that is allowed.
#[derive(Debug, Default)]
struct Bucket {
    level: f64,
    floods: bool,
}

impl Bucket {
    /// Whether it is over `most`, or was and is not empty yet.
    fn fill(&mut self, come: f64, leaked: f64, most: f64) -> bool {
        self.level = (self.level + come - leaked).max(0.0);
        self.floods = self.level > most || (self.floods && self.level > 0.0);
        self.floods
    }
}

/// Whether a source sends more sweeps than its sensor turns.
#[derive(Debug, Default)]
pub(crate) struct SweepFlood {
    last_ns: u64,
    sent: f64,
    /// Since it last sent anything [periods].
    stood: f64,
    /// Sweeps that came due while it stood still: it may send them late.
    owed: f64,
    bucket: Bucket,
}

impl SweepFlood {
    /// Begins when `sent` sweeps have been sent.
    pub(crate) fn begin(now_ns: u64, sent: f64) -> Self {
        Self { last_ns: now_ns, sent, ..Self::default() }
    }

    /// Looks when `sent` sweeps have been sent, parts of one included, by a sensor of `period_ns`; `ratio` times as many are
    /// allowed. Gives how many there are beyond, as long as it floods.
    pub(crate) fn look(&mut self, now_ns: u64, sent: f64, period_ns: u64, ratio: f64) -> Option<f64> {
        let passed = now_ns.saturating_sub(self.last_ns) as f64 / period_ns.max(1) as f64;
        let come = (sent - self.sent).max(0.0);
        (self.last_ns, self.sent) = (now_ns, sent);
        if come > 0.0 {
            // A source of whole sweeps stands for a period between any two.
            self.owed = (self.owed + (self.stood + passed - 1.0).max(0.0)).min(MOST_OWED);
            self.stood = 0.0;
        } else {
            self.stood += passed;
        }
        let late = come.min(self.owed);
        self.owed -= late;
        self.bucket.fill(come - late, passed * ratio, SWEEPS).then_some(self.bucket.level)
    }
}

/// Whether a process says more than can be read.
#[derive(Debug, Default)]
pub(crate) struct EventFlood {
    last_ns: u64,
    said: u64,
    bucket: Bucket,
}

impl EventFlood {
    /// Begins when `said` events have been said.
    pub(crate) fn begin(now_ns: u64, said: u64) -> Self {
        Self { last_ns: now_ns, said, bucket: Bucket::default() }
    }

    /// Looks when `said` events have been said, of which so many a second are allowed. Gives how many there are beyond, as
    /// long as it floods.
    pub(crate) fn look(&mut self, now_ns: u64, said: u64, per_s: f64) -> Option<f64> {
        let passed_s = now_ns.saturating_sub(self.last_ns) as f64 / 1e9;
        let come = said.saturating_sub(self.said) as f64;
        (self.last_ns, self.said) = (now_ns, said);
        self.bucket.fill(come, passed_s * per_s, per_s * EVENTS_S).then_some(self.bucket.level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 100_000_000;
    /// One look each tenth of a period.
    const LOOK_NS: u64 = PERIOD_NS / 10;

    /// Sends so many sweeps a period for so many periods, in parts; in which look it floods first.
    fn send(sut: &mut SweepFlood, per_period: f64, periods: u64) -> Option<u64> {
        let mut looks = 0..periods * 10;
        looks.find(|_| sut.look(sut.last_ns + LOOK_NS, sut.sent + per_period / 10.0, PERIOD_NS, 1.5).is_some())
    }

    #[test]
    fn who_sends_a_little_more_than_the_sensor_turns_does_not_flood_and_who_sends_ten_times_as_much_does_at_once() {
        assert_eq!(send(&mut SweepFlood::begin(0, 0.0), 1.0, 1000), None);
        assert_eq!(send(&mut SweepFlood::begin(0, 0.0), 1.49, 1000), None);
        let twice = send(&mut SweepFlood::begin(0, 0.0), 2.0, 1000).unwrap();
        assert!((55..=70).contains(&twice), "{twice}");
        assert!(send(&mut SweepFlood::begin(0, 0.0), 10.0, 1000).unwrap() < 10, "within a sweep");
    }

    #[test]
    fn a_source_that_stood_still_may_catch_up() {
        let mut sut = SweepFlood::begin(0, 0.0);
        assert_eq!(send(&mut sut, 1.0, 20), None);
        assert_eq!(send(&mut sut, 0.0, 20), None);
        assert_eq!(send(&mut sut, 200.0, 1).unwrap(), 1, "20 of them in the first look are owed");
        let mut sut = SweepFlood::begin(0, 0.0);
        assert_eq!(send(&mut sut, 0.0, 20), None);
        assert_eq!(send(&mut sut, 20.0, 1), None);
        assert_eq!(send(&mut sut, 1.0, 100), None);
    }

    #[test]
    fn whole_sweeps_are_no_flood() {
        let mut sut = SweepFlood::begin(0, 0.0);
        for look in 1..1000_u64 {
            let found = sut.look(look * LOOK_NS, (look / 10) as f64, PERIOD_NS, 1.5);
            assert_eq!(found, None, "{look}");
        }
        assert!(sut.owed < 1.0, "nothing is owed: {}", sut.owed);
    }

    #[test]
    fn a_flood_ends_when_what_was_too_much_has_run_off() {
        let mut sut = SweepFlood::begin(0, 0.0);
        assert!(send(&mut sut, 10.0, 10).is_some());
        assert!(sut.look(sut.last_ns + LOOK_NS, sut.sent, PERIOD_NS, 1.5).is_some());
        assert!(sut.look(sut.last_ns + 10 * PERIOD_NS, sut.sent, PERIOD_NS, 1.5).is_none());
    }

    #[test]
    fn a_storm_of_events_is_a_flood_and_a_burst_is_not() {
        let mut sut = EventFlood::begin(0, 0);
        assert_eq!(sut.look(5_000_000, 48, 500.0), None);
        for look in 2..400 {
            assert_eq!(sut.look(look * 5_000_000, 46 + 2 * look, 500.0), None, "400 a second");
        }
        assert!(sut.look(2_000_000_000, 2_000, 500.0).is_some());
        assert_eq!(sut.look(6_000_000_000, 2_000, 500.0), None);
    }
}
