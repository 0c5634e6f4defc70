/// Ties sensor time to host time at the first sweep; later sweeps begin when the sensor would have begun them.
#[derive(Default)]
pub(crate) struct Pacer {
    anchor: Option<(u64, u64)>,
}

impl Pacer {
    /// Host time at which a sweep's first firing is due [ns]. The first sweep begins now.
    pub(crate) fn start_ns(&mut self, sensor_time_ns: u64, now_ns: u64) -> u64 {
        let (sensor_ns, host_ns) = match self.anchor {
            Some((sensor_ns, host_ns)) if sensor_time_ns >= sensor_ns => (sensor_ns, host_ns),
            // The first sweep, or the sensor's clock was set back: start anew from here.
            _ => *self.anchor.insert((sensor_time_ns, now_ns)),
        };
        host_ns + (sensor_time_ns - sensor_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeps_begin_by_the_sensors_clock_from_the_first_on() {
        let mut pacer = Pacer::default();
        assert_eq!(pacer.start_ns(1_000, 50), 50);
        assert_eq!(pacer.start_ns(1_100, 170), 150);
        assert_eq!(pacer.start_ns(1_300, 260), 350, "a gap in the recording is a gap in time");
    }

    #[test]
    fn a_clock_set_back_starts_anew() {
        let mut pacer = Pacer::default();
        pacer.start_ns(1_000_000, 50);
        assert_eq!(pacer.start_ns(7, 300), 300);
    }
}
