/// How likely something is met and when, in one number of an event: the larger is the likelier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Danger {
    /// Probability [millionths].
    pub probability_ppm: u32,
    /// When it comes closest [ms].
    pub time_ms: u32,
}

impl Danger {
    /// From a probability, 0 to 1, and a time [s]; what is no number is none.
    pub fn of(probability: f32, time_s: f32) -> Self {
        Self {
            probability_ppm: (f64::from(probability) * 1e6).round() as u32,
            time_ms: (f64::from(time_s) * 1e3).round() as u32,
        }
    }

    /// As a number of an event.
    pub fn to_number(self) -> u64 {
        u64::from(self.probability_ppm) << 32 | u64::from(self.time_ms)
    }

    /// From a number of an event.
    pub fn from_number(number: u64) -> Self {
        Self { probability_ppm: (number >> 32) as u32, time_ms: number as u32 }
    }
}

impl std::fmt::Display for Danger {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (percent, time_s) = (f64::from(self.probability_ppm) / 1e4, f64::from(self.time_ms) / 1e3);
        write!(f, "met with a probability of {percent} % in {time_s} s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_danger_comes_back_from_its_number_and_the_likelier_is_the_larger() {
        let danger = Danger::of(0.125, 3.4);
        assert_eq!(Danger::from_number(danger.to_number()), danger);
        assert_eq!(danger.to_string(), "met with a probability of 12.5 % in 3.4 s");
        assert!(Danger::of(0.2, 0.0).to_number() > danger.to_number());
        assert_eq!(Danger::of(f32::NAN, -1.0), Danger { probability_ppm: 0, time_ms: 0 });
    }
}
