//! What the named fields of a cloud mean, and the point that their numbers make.

use super::value::Number;
use super::{Point, intensity};

/// Names by meaning, the better ones first. Lower case.
const NAMES: [&[&str]; 7] = [
    &["x"],
    &["y"],
    &["z"],
    &["intensity", "scalar_intensity", "reflectivity", "reflectance", "i"],
    &["ring", "scalar_ring", "line", "channel"],
    &["column"],
    &["time", "t", "timestamp", "time_stamp", "offset_time", "scalar_time"],
];
/// Number of meanings.
pub(crate) const MEANINGS: usize = NAMES.len();
const INTENSITY: usize = 3;
const RING: usize = 4;
const COLUMN: usize = 5;
const TIME: usize = 6;

/// A time that is longer is counted from 1970 [s].
const MAX_RELATIVE_S: f64 = 1e6;
const NS_PER_S: f64 = 1e9;

/// Which of a cloud's fields has each meaning.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Meanings {
    /// Index among the fields, by meaning.
    fields: [Option<usize>; MEANINGS],
}

impl Meanings {
    /// Of fields with these names; upper and lower case are the same.
    pub(crate) fn of<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Self {
        let place = |known: &&str| names.clone().position(|name| name.eq_ignore_ascii_case(known));
        Self { fields: NAMES.map(|known| known.iter().find_map(place)) }
    }

    /// The first of x, y, z that is missing.
    pub(crate) fn missing(&self) -> Option<&'static str> {
        (0..INTENSITY).find(|&meaning| self.fields[meaning].is_none()).map(|meaning| NAMES[meaning][0])
    }

    pub(crate) fn has_ring(&self) -> bool {
        self.fields[RING].is_some()
    }

    pub(crate) fn has_column(&self) -> bool {
        self.fields[COLUMN].is_some()
    }

    pub(crate) fn has_time(&self) -> bool {
        self.fields[TIME].is_some()
    }

    /// The point of a row and whether its intensity fits; none if a number is missing. `number` gives that of a field by
    /// its index. Times that are not counted from 1970 are counted from `start_ns`.
    pub(crate) fn point(&self, start_ns: u64, number: impl Fn(usize) -> Option<Number>) -> Option<(Point, bool)> {
        let float = |meaning: usize| self.fields[meaning].map(|field| number(field).map(Number::float));
        let position_m = [float(0)??, float(1)??, float(2)??];
        let (intensity, fits) = float(INTENSITY).map_or(Some((0, true)), |strength| strength.map(intensity))?;
        let ring = float(RING).unwrap_or(Some(f64::NAN))?;
        // 255 is no ring of any sensor.
        let ring = if ring.fract() == 0.0 && (0.0..255.0).contains(&ring) { ring as u8 } else { u8::MAX };
        let key = float(COLUMN).unwrap_or(Some(0.0))?;
        let time_ns = match self.fields[TIME] {
            Some(field) => time_ns(number(field)?, start_ns),
            None => start_ns,
        };
        Some((Point { position_m, key, time_ns, ring, intensity }, fits))
    }
}

/// Keeps the numbering of points that cannot be read.
pub(crate) const UNREADABLE: Point =
    Point { position_m: [f64::NAN; 3], key: f64::NAN, time_ns: 0, ring: u8::MAX, intensity: 0 };

/// Sensor time of a point [ns]. Drivers write seconds as floats and nanoseconds as integers; what is counted from 1970
/// also comes in milli-, micro- and nanoseconds, told by its size. NaN is the start.
fn time_ns(time: Number, start_ns: u64) -> u64 {
    match time {
        Number::Float(s) if s.abs() < MAX_RELATIVE_S => start_ns.saturating_add_signed((s * NS_PER_S).round() as i64),
        // From here on since 1970: in 1973 a second had 1e8, now 1.8e9 behind it.
        Number::Float(s) if s < 1e11 => (s * NS_PER_S) as u64,
        Number::Float(ms) if ms < 1e14 => (ms * 1e6) as u64,
        Number::Float(us) if us < 1e17 => (us * 1e3) as u64,
        Number::Float(ns) if ns.is_nan() => start_ns,
        Number::Float(ns) => ns as u64,
        Number::Integer(ns) if ns.unsigned_abs() < 1_000_000_000_000 => start_ns.saturating_add_signed(ns),
        Number::Integer(us) if us.unsigned_abs() < 100_000_000_000_000_000 => us.unsigned_abs().saturating_mul(1_000),
        Number::Integer(ns) => ns.unsigned_abs(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_told_by_kind_and_size() {
        let start_ns = 1_700_000_000_000_000_000;
        let cases = [
            (Number::Float(0.25), start_ns + 250_000_000),
            (Number::Float(-0.25), start_ns - 250_000_000),
            (Number::Float(f64::NAN), start_ns),
            (Number::Integer(46_080), start_ns + 46_080),
            (Number::Float(1_700_000_000.5), start_ns + 500_000_000),
            (Number::Float(1_700_000_000_500.0), start_ns + 500_000_000),
            (Number::Float(1_700_000_000_500_000.0), start_ns + 500_000_000),
            (Number::Float(1_700_000_000_500_000_000.0), start_ns + 500_000_000),
            (Number::Integer(1_700_000_000_500_000), start_ns + 500_000_000),
            (Number::Integer(1_700_000_000_500_000_001), start_ns + 500_000_001),
        ];
        for (time, expected_ns) in cases {
            assert_eq!(time_ns(time, start_ns), expected_ns, "{time:?}");
        }
    }

    #[test]
    fn the_better_name_wins_whatever_the_order() {
        let names = ["reflectivity", "X", "y", "z", "intensity"];
        let sut = Meanings::of(names.into_iter());
        assert_eq!((sut.fields[0], sut.fields[INTENSITY], sut.missing()), (Some(1), Some(4), None));
        assert_eq!(Meanings::of(["x", "z"].into_iter()).missing(), Some("y"));
    }
}
