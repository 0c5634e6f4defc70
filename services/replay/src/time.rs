use lidar::SensorModel;

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
