/// The longest leap of sensor time that is a gap in the recording and passes as such [ns]: 10 s. Beyond it the sensor's clock was
/// set, and nobody waits for that.
pub(crate) const MOST_GAP_NS: u64 = 10_000_000_000;

/// Ties sensor time to host time at the first sweep; later sweeps begin when the sensor would have begun them, or so many
/// times sooner or later.
pub(crate) struct Pacer {
    /// Seconds of sensor time in a second of host time, above 0.
    rate: f64,
    anchor: Option<(u64, u64)>,
    /// Sensor time of the sweep before.
    last_ns: u64,
}

impl Pacer {
    /// For a sensor that turns `rate` times as fast as it did.
    pub(crate) fn at_rate(rate: f64) -> Self {
        Self { rate, anchor: None, last_ns: 0 }
    }

    /// The next sweep begins when it comes, whatever time has passed.
    pub(crate) fn start_anew(&mut self) {
        self.anchor = None;
    }

    /// Host time at which a sweep's first firing is due [ns]. The first sweep begins now.
    pub(crate) fn start_ns(&mut self, sensor_time_ns: u64, now_ns: u64) -> u64 {
        let goes_on = !is_step(self.last_ns, sensor_time_ns);
        self.last_ns = sensor_time_ns;
        let (sensor_ns, host_ns) = match self.anchor {
            Some((sensor_ns, host_ns)) if goes_on && sensor_time_ns >= sensor_ns => (sensor_ns, host_ns),
            // The first sweep, or the sensor's clock was set: start anew from here.
            _ => *self.anchor.insert((sensor_time_ns, now_ns)),
        };
        host_ns.saturating_add(self.host_ns(sensor_time_ns - sensor_ns))
    }

    /// Host time that a stretch of sensor time takes [ns].
    pub(crate) fn host_ns(&self, sensor_ns: u64) -> u64 {
        if self.rate == 1.0 { sensor_ns } else { (sensor_ns as f64 / self.rate) as u64 }
    }
}

/// Whether a sweep at `next_ns` after one at `last_ns` shows that the sensor's clock was set.
pub(crate) fn is_step(last_ns: u64, next_ns: u64) -> bool {
    next_ns <= last_ns || next_ns - last_ns > MOST_GAP_NS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeps_begin_by_the_sensors_clock_from_the_first_on() {
        let mut pacer = Pacer::at_rate(1.0);
        assert_eq!(pacer.start_ns(1_000, 50), 50);
        assert_eq!(pacer.start_ns(1_100, 170), 150);
        assert_eq!(pacer.start_ns(1_300, 260), 350, "a gap in the recording is a gap in time");
    }

    #[test]
    fn a_clock_set_back_starts_anew() {
        let mut pacer = Pacer::at_rate(1.0);
        pacer.start_ns(1_000_000, 50);
        assert_eq!(pacer.start_ns(7, 300), 300);
        // Back to a time after the first sweep's: what is due long ago already would be refused as stale.
        assert_eq!((pacer.start_ns(1_007, 310), pacer.start_ns(507, 1_400)), (1_300, 1_400));
        assert_eq!(pacer.start_ns(507, 1_500), 1_500, "a sweep that comes twice has a time of its own");
    }

    #[test]
    fn a_clock_set_forward_makes_nobody_wait_for_the_difference() {
        let mut pacer = Pacer::at_rate(1.0);
        pacer.start_ns(1_000, 50);
        assert_eq!(pacer.start_ns(1_000 + MOST_GAP_NS, 60), 50 + MOST_GAP_NS, "a gap");
        let hour_ns = 3_600_000_000_000;
        assert_eq!(pacer.start_ns(hour_ns, 300), 300);
        assert_eq!(pacer.start_ns(hour_ns + 100, 310), 400);
    }

    #[test]
    fn after_a_pause_the_next_sweep_begins_now_and_the_others_follow_at_their_distance() {
        let mut pacer = Pacer::at_rate(1.0);
        pacer.start_ns(1_000, 50);
        pacer.start_anew();
        assert_eq!((pacer.start_ns(1_100, 9_000), pacer.start_ns(1_200, 9_010)), (9_000, 9_100));
    }

    #[test]
    fn at_twice_the_rate_everything_comes_in_half_the_time() {
        let mut pacer = Pacer::at_rate(2.0);
        assert_eq!(pacer.start_ns(1_000, 50), 50);
        assert_eq!(pacer.start_ns(1_300, 60), 200);
        assert_eq!(pacer.host_ns(100), 50);
    }
}
