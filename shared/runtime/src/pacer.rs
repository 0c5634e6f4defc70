/// Ties sensor time to host time at the first sweep; later sweeps begin when the sensor would have begun them, or so many
/// times sooner or later.
pub(crate) struct Pacer {
    /// Seconds of sensor time in a second of host time, above 0.
    rate: f64,
    anchor: Option<(u64, u64)>,
}

impl Pacer {
    /// For a sensor that turns `rate` times as fast as it did.
    pub(crate) fn at_rate(rate: f64) -> Self {
        Self { rate, anchor: None }
    }

    /// Host time at which a sweep's first firing is due [ns]. The first sweep begins now.
    pub(crate) fn start_ns(&mut self, sensor_time_ns: u64, now_ns: u64) -> u64 {
        let (sensor_ns, host_ns) = match self.anchor {
            Some((sensor_ns, host_ns)) if sensor_time_ns >= sensor_ns => (sensor_ns, host_ns),
            // The first sweep, or the sensor's clock was set back: start anew from here.
            _ => *self.anchor.insert((sensor_time_ns, now_ns)),
        };
        host_ns.saturating_add(self.host_ns(sensor_time_ns - sensor_ns))
    }

    /// Host time that a stretch of sensor time takes [ns].
    pub(crate) fn host_ns(&self, sensor_ns: u64) -> u64 {
        if self.rate == 1.0 { sensor_ns } else { (sensor_ns as f64 / self.rate) as u64 }
    }
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
    }

    #[test]
    fn at_twice_the_rate_everything_comes_in_half_the_time() {
        let mut pacer = Pacer::at_rate(2.0);
        assert_eq!(pacer.start_ns(1_000, 50), 50);
        assert_eq!(pacer.start_ns(1_300, 60), 200);
        assert_eq!(pacer.host_ns(100), 50);
    }
}
