/// Ties sensor time to host time at the first sweep; later sweeps are due when the sensor would have ended them.
#[derive(Default)]
pub(crate) struct Pacer {
    anchor: Option<(u64, u64)>,
    quiet_until_ns: u64,
}

impl Pacer {
    /// Host time at which the sweep's last return should be there [ns]. The first sweep starts now.
    pub(crate) fn due_ns(&mut self, sensor_time_ns: u64, period_ns: u64, now_ns: u64) -> u64 {
        let (sensor_ns, host_ns) = match self.anchor {
            Some((sensor_ns, host_ns)) if sensor_time_ns >= sensor_ns => (sensor_ns, host_ns),
            // The first sweep, or the sensor's clock was set back: start anew from here.
            _ => *self.anchor.insert((sensor_time_ns, now_ns)),
        };
        let due_ns = host_ns + (sensor_time_ns - sensor_ns) + period_ns;
        self.quiet_until_ns = due_ns + period_ns / 2;
        due_ns
    }

    /// Host time until which the source leaves the cores to the stages: half a period after it last sent [ns].
    pub(crate) fn quiet_until_ns(&self) -> u64 {
        self.quiet_until_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeps_are_due_by_the_sensors_clock_from_the_first_on() {
        let mut pacer = Pacer::default();
        assert_eq!(pacer.due_ns(1_000, 100, 50), 150);
        assert_eq!(pacer.quiet_until_ns(), 200);
        assert_eq!(pacer.due_ns(1_100, 100, 170), 250);
        assert_eq!(pacer.due_ns(1_300, 100, 260), 450, "a gap in the recording is a gap in time");
    }

    #[test]
    fn a_clock_set_back_starts_anew() {
        let mut pacer = Pacer::default();
        pacer.due_ns(1_000_000, 100, 50);
        assert_eq!(pacer.due_ns(7, 100, 300), 400);
    }
}
