//! Nanoseconds as Foxglove writes them.

use foxglove::messages::{Duration, Timestamp};

const NS_PER_S: u64 = 1_000_000_000;

/// A time [ns]; saturates after 136 years.
pub(crate) fn timestamp(ns: u64) -> Timestamp {
    let Ok(seconds) = u32::try_from(ns / NS_PER_S) else { return Timestamp::MAX };
    Timestamp::new_checked(seconds, (ns % NS_PER_S) as u32).unwrap_or(Timestamp::MAX)
}

/// A span of time [ns]; saturates at 68 years.
pub(crate) fn duration(ns: u64) -> Duration {
    let Ok(seconds) = i32::try_from(ns / NS_PER_S) else { return Duration::MAX };
    Duration::new_checked(seconds, (ns % NS_PER_S) as u32).unwrap_or(Duration::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_split_into_seconds_and_the_rest_and_saturate() {
        assert_eq!(timestamp(3_000_000_007), Timestamp::new(3, 7));
        assert_eq!(timestamp(u64::MAX), Timestamp::MAX);
        assert_eq!(duration(100_000_000), Duration::new(0, 100_000_000));
        assert_eq!(duration(u64::MAX), Duration::MAX);
    }
}
