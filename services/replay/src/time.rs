use lidar::SensorModel;

const NS_PER_HOUR: i128 = 3_600_000_000_000;

/// Duration of a turn where the recording does not tell [ns]: the geometric middle of the sensor's rates
/// (10 Hz for 5 to 20).
pub(crate) fn nominal_period_ns(sensor: &SensorModel) -> u64 {
    let [slow_hz, fast_hz] = sensor.rotation_hz();
    (1e9 / (slow_hz * fast_hz).sqrt()).round() as u64
}

/// Duration of the sensor's slowest turn [ns].
pub(crate) fn slowest_period_ns(sensor: &SensorModel) -> u64 {
    (1e9 / sensor.rotation_hz()[0]).round() as u64
}

/// Whether the sensor can turn once in `period_ns`, give or take a tenth.
pub(crate) fn is_turn(sensor: &SensorModel, period_ns: u64) -> bool {
    let [slow_hz, fast_hz] = sensor.rotation_hz();
    let hz = 1e9 / period_ns.max(1) as f64;
    (0.9 * slow_hz..=1.1 * fast_hz).contains(&hz)
}

/// Puts a stamp [µs since the top of the hour] into the hour of the host's clock, or the one beside it when the result
/// would be more than half an hour off. Never before 1970, nor after 2262, so that times can be added to.
pub(crate) fn absolute_ns(host_ns: u64, stamp_us: u64) -> u64 {
    let host = i128::from(host_ns);
    let mut time = host - host % NS_PER_HOUR + i128::from(stamp_us) * 1_000;
    if time - host > NS_PER_HOUR / 2 && time >= NS_PER_HOUR {
        time -= NS_PER_HOUR;
    } else if host - time > NS_PER_HOUR / 2 {
        time += NS_PER_HOUR;
    }
    u64::try_from(time.min(i128::from(i64::MAX))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_goes_into_the_hour_nearest_to_the_hosts_clock() {
        const HOUR: u64 = NS_PER_HOUR as u64;
        let minute = HOUR / 60;
        for (host, stamp_min, expected) in [
            (10 * HOUR + 5 * minute, 5, 10 * HOUR + 5 * minute),
            (10 * HOUR + minute, 59, 9 * HOUR + 59 * minute),
            (10 * HOUR + 59 * minute, 1, 11 * HOUR + minute),
            (24 * HOUR + minute, 59, 23 * HOUR + 59 * minute),
            (0, 59, 59 * minute),
            (0, 0, 0),
            (u64::MAX, 5, i64::MAX as u64),
        ] {
            assert_eq!(absolute_ns(host, stamp_min * 60_000_000), expected, "{host} {stamp_min}");
        }
    }
}
