use lidar::MAX_RINGS;

/// Margin on every angle for single-precision rounding [rad]: ten times what it can come to.
const MARGIN_RAD: f32 = 2e-5;

/// How far the returns of each ring stray from where ring and column say they are, measured in one sweep.
///
/// True elevations of a ring lie in an interval; so do the differences between a return's true azimuth and that of its
/// column (in the head's sense), for the head turns on while a column fires and some sensors' lasers look sideways.
pub(crate) struct Slack {
    rings: usize,
    elevation_sine: [Interval; MAX_RINGS],
    azimuth_sine: [Interval; MAX_RINGS],
    /// Sine of the elevation that at least lies between two rings, and all rings beyond, seen from the first.
    gap_sine: Vec<f32>,
    /// What is to be added to a return's travel less its window for the lowest travel of a column on another ring [rad].
    shift_rad: Vec<f32>,
}

#[derive(Clone, Copy)]
struct Interval {
    low: f32,
    high: f32,
}

impl Interval {
    const EMPTY: Self = Self { low: f32::INFINITY, high: f32::NEG_INFINITY };

    #[inline]
    fn include(&mut self, value: f32) {
        self.low = if value < self.low { value } else { self.low };
        self.high = if value > self.high { value } else { self.high };
    }

    fn is_empty(self) -> bool {
        self.low > self.high
    }

    fn asin(self) -> Self {
        if self.is_empty() { self } else { Self { low: self.low.asin(), high: self.high.asin() } }
    }

    /// The least way from a value of one interval to a value of the other, negative where they overlap; infinite when
    /// one of them is empty.
    fn gap(self, other: Self) -> f32 {
        (other.low - self.high).max(self.low - other.high)
    }

    fn width(self) -> f32 {
        (self.high - self.low).max(0.0)
    }
}

impl Slack {
    pub(crate) fn new() -> Self {
        Self {
            rings: 0,
            elevation_sine: [Interval::EMPTY; MAX_RINGS],
            azimuth_sine: [Interval::EMPTY; MAX_RINGS],
            gap_sine: Vec::with_capacity(MAX_RINGS * MAX_RINGS),
            shift_rad: Vec::with_capacity(MAX_RINGS * MAX_RINGS),
        }
    }

    /// Forgets the sweep before.
    pub(crate) fn reset(&mut self, rings: usize) {
        self.rings = rings;
        self.elevation_sine.fill(Interval::EMPTY);
        self.azimuth_sine.fill(Interval::EMPTY);
    }

    /// Takes in a return: sines of its elevation and of its azimuth relative to its column.
    #[inline]
    pub(crate) fn include(&mut self, ring: u8, elevation_sine: f32, azimuth_sine: f32) {
        self.elevation_sine[usize::from(ring)].include(elevation_sine);
        self.azimuth_sine[usize::from(ring)].include(azimuth_sine);
    }

    /// Whether no ring's returns spread over more than this.
    pub(crate) fn is_within(&self, elevation_rad: f32, azimuth_rad: f32) -> bool {
        self.elevation_sine[..self.rings].iter().all(|ring| ring.asin().width() <= elevation_rad)
            && self.azimuth_sine[..self.rings].iter().all(|ring| ring.asin().width() <= azimuth_rad)
    }

    /// Works out the tables once all returns are in.
    pub(crate) fn tabulate(&mut self) {
        let mut elevation = self.elevation_sine;
        let mut azimuth = self.azimuth_sine;
        for interval in elevation.iter_mut().chain(&mut azimuth) {
            *interval = interval.asin();
        }
        let rings = self.rings;
        let (elevation, azimuth) = (&elevation[..rings], &azimuth[..rings]);
        self.gap_sine.clear();
        self.gap_sine.resize(rings * rings, 0.0);
        self.shift_rad.clear();
        for from in 0..rings {
            let row = &mut self.gap_sine[from * rings..][..rings];
            fill_inwards(elevation[from], row[..from].iter_mut().zip(&elevation[..from]));
            fill_inwards(elevation[from], row[from + 1..].iter_mut().zip(&elevation[from + 1..]).rev());
            self.shift_rad.extend(azimuth.iter().map(|to| azimuth[from].low - to.high - MARGIN_RAD));
        }
    }

    /// Sine of the gap in elevation between a return of ring `from` and those of ring `to` and beyond, at least;
    /// infinite where the gap is a right angle or where there are none.
    #[inline]
    pub(crate) fn gap_sine(&self, from: usize, to: usize) -> f32 {
        self.gap_sine[from * self.rings + to]
    }

    /// Returns of ring `to` whose true azimuth is at most w before that of a return of ring `from` are in columns of
    /// at least this return's column's travel − w + this [rad].
    #[inline]
    pub(crate) fn shift_rad(&self, from: usize, to: usize) -> f32 {
        self.shift_rad[from * self.rings + to]
    }
}

/// Fills the sines of the gaps between `own` and the rings on one side of it, which come from the outermost inwards.
///
/// The search goes outward and stops at the first ring out of reach, so a gap must not shrink outward, whatever the order
/// of the true elevations.
fn fill_inwards<'a>(own: Interval, rings: impl Iterator<Item = (&'a mut f32, &'a Interval)>) {
    let mut least = f32::INFINITY;
    for (gap_sine, &ring) in rings {
        least = least.min(own.gap(ring));
        *gap_sine = sine_below(least);
    }
}

/// Sine of an angle less the margin; 0 for negative angles, infinite for right angles and more.
fn sine_below(angle_rad: f32) -> f32 {
    let angle_rad = angle_rad - MARGIN_RAD;
    if angle_rad >= std::f32::consts::FRAC_PI_2 { f32::INFINITY } else { angle_rad.max(0.0).sin() }
}

/// An angle of at least asin `sine` for a sine from 0 to 1, but for single-precision rounding [rad]; at most 0.2 % more.
#[inline]
pub(crate) fn arcsine_above(sine: f32) -> f32 {
    /// (asin x − x) / x³ rises with x; this is its value at 0.5, rounded up.
    const CUBIC: f32 = 0.188_791;
    if sine <= 0.5 {
        return sine + CUBIC * sine * sine * sine;
    }
    // asin x = π/2 − 2 asin √((1 − x) / 2), and asin y ≥ y + y³/6 + 3y⁵/40, the start of a series of positive terms.
    let half_2 = 0.5 * (1.0 - sine).max(0.0);
    std::f32::consts::FRAC_PI_2 - 2.0 * half_2.sqrt() * (1.0 + half_2 * (1.0 / 6.0 + half_2 * (3.0 / 40.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quick_arcsine_is_never_below_the_true_one_and_close_to_it() {
        // What rounding may take away: a hundredth of the margin.
        const ROUNDING_RAD: f64 = MARGIN_RAD as f64 / 100.0;
        for step in 0..=1_000_000 {
            let sine = step as f32 / 1_000_000.0;
            let (quick, exact) = (f64::from(arcsine_above(sine)), f64::from(sine).asin());
            assert!(quick >= exact - ROUNDING_RAD, "{sine}: {quick} {exact}");
            assert!(quick <= exact * 1.002 + ROUNDING_RAD, "{sine}: {quick} {exact}");
        }
    }

    #[test]
    fn gaps_never_shrink_outward_even_where_rings_are_out_of_order() {
        let mut sut = Slack::new();
        sut.reset(5);
        for (ring, elevation) in [(0, -0.2), (1, 0.3), (2, -0.1), (4, 0.05_f32)] {
            sut.include(ring, elevation.sin(), 0.0);
        }
        sut.tabulate();
        for from in [0, 1, 2, 4] {
            assert!((from + 2..5).all(|to| sut.gap_sine(from, to) >= sut.gap_sine(from, to - 1)));
            assert!((1..from).all(|to| sut.gap_sine(from, to) <= sut.gap_sine(from, to - 1)));
        }
        assert!((sut.gap_sine(0, 1) - 0.1_f32.sin()).abs() < 1e-4); // not 0.5: ring 2 lies beyond, and nearer
    }
}
