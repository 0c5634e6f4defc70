//! The scan-window method: exact, for sweeps in firing order of rings × columns.
//!
//! If |p − q| ≤ d and p has range r and horizontal range h, then the elevations of p and q differ by at most asin(d/r)
//! and their azimuths by at most asin(d/h), whatever the range of q. So of each pair the one whose column comes later,
//! looking back over its own window, finds the other; across the seam it is the one just after the seam.

use lidar::{MAX_COLUMNS, MAX_RETURNS, Return};
use messages::Sweep;

use crate::distance::ROUNDING;
use crate::image::{Image, Seeker};
use crate::sets::Sets;
use crate::slack::{Slack, arcsine_above};
use crate::turn::Turn;

/// Horizontal range below which azimuth bounds nothing, as a factor of d. Short of 1/0.98 the arcsine is too steep
/// for single precision, so a little above d counts as close too.
const CLOSE: f32 = 1.02;
/// Horizontal range within which all neighbours of close returns lie: CLOSE + 1, and a margin.
const NEAR: f32 = 2.03;
/// Sine of the largest angle between a return and its column that the window allows for: half a radian.
const SIDEWAYS_SINE: f32 = 0.479;
/// Sine of the elevation above which single precision is too coarse to measure it.
const STEEP_SINE: f32 = 0.999;
/// Squared range above which nothing is measured any more [m²].
const FAR_M2: f32 = 1e12;
/// Widest spread of elevations on a ring, and of azimuths relative to the column, at which the window is quick [rad].
/// A sensor whose lasers sit 0.2 m apart in height shows 0.05 rad at 4 m.
const REGULAR_RAD: [f32; 2] = [0.05, 0.1];

/// Which sweeps are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Premises {
    /// The window is exact.
    Exact,
    /// The window is exact and narrow: returns lie where ring and column say.
    Regular,
}

/// What a return can reach.
#[derive(Clone, Copy)]
struct Reach {
    /// asin(d/h), rounded up [rad]; infinite for close returns.
    azimuth_rad: f32,
    /// d/r, rounded up.
    elevation_sine: f32,
}

/// The scan-window method and its memory.
pub(crate) struct ScanWindow {
    range_d_m: f32,
    image: Image,
    turn: Turn,
    slack: Slack,
    column_sine_cosine: Vec<[f32; 2]>,
    reaches: Vec<Reach>,
    close: Vec<u32>,
}

impl ScanWindow {
    pub(crate) fn new(range_d_m: f32) -> Self {
        Self {
            range_d_m,
            image: Image::new(),
            turn: Turn::new(),
            slack: Slack::new(),
            column_sine_cosine: Vec::with_capacity(MAX_COLUMNS),
            reaches: Vec::with_capacity(MAX_RETURNS),
            close: Vec::with_capacity(MAX_RETURNS),
        }
    }

    /// Joins all pairs of returns within d. False, and sets of no meaning, where the sweep does not meet the premises.
    pub(crate) fn partition(&mut self, sweep: &Sweep, premises: Premises, sets: &mut Sets) -> bool {
        if !sweep.header.is_organised() || !self.turn.measure(&sweep.columns) || !self.place(sweep) {
            return false;
        }
        let [elevation_rad, azimuth_rad] = REGULAR_RAD;
        if premises == Premises::Regular && !self.slack.is_within(elevation_rad, azimuth_rad) {
            return false;
        }
        self.slack.tabulate();
        sets.reset(sweep.returns.len());
        self.join_close(sweep, sets);
        self.join_windows(sweep, sets);
        true
    }

    /// Lays the returns out as an image, measuring where they are; false where ring and column do not say it.
    fn place(&mut self, sweep: &Sweep) -> bool {
        self.image.reset(sweep.rings.len(), sweep.columns.len());
        self.slack.reset(sweep.rings.len());
        self.reaches.clear();
        self.close.clear();
        self.column_sine_cosine.clear();
        self.column_sine_cosine
            .extend(sweep.columns.iter().map(|column| <[f32; 2]>::from(column.azimuth_rad.sin_cos())));
        let reach_m = self.range_d_m * ROUNDING;
        let (close_m, near_m) = (self.range_d_m * CLOSE, self.range_d_m * NEAR);
        let sense = self.turn.sense();
        for (place, r) in sweep.returns.iter().enumerate() {
            let place = place as u32;
            let h_m2 = r.x * r.x + r.y * r.y;
            let range_m2 = h_m2 + r.z * r.z;
            // No sensor's; also catches overflow.
            if range_m2 >= FAR_M2 {
                return false;
            }
            let (h_m, range_m) = (h_m2.sqrt(), range_m2.sqrt());
            if h_m <= near_m {
                self.image.put_close(r.position(), place);
            }
            // h ≤ d: the window is the whole turn, and such returns are looked for nowhere else.
            if h_m <= close_m {
                self.close.push(place);
                self.reaches.push(Reach { azimuth_rad: f32::INFINITY, elevation_sine: f32::INFINITY });
                continue;
            }
            let [sine, cosine] = self.column_sine_cosine[usize::from(r.column)];
            let along_m = r.x * cosine + r.y * sine;
            let azimuth_sine = sense * (r.y * cosine - r.x * sine) / h_m;
            let elevation_sine = r.z / range_m;
            if along_m <= 0.0 || azimuth_sine.abs() > SIDEWAYS_SINE || elevation_sine.abs() > STEEP_SINE {
                return false;
            }
            self.slack.include(r.ring, elevation_sine, azimuth_sine);
            self.reaches.push(Reach { azimuth_rad: arcsine_above(reach_m / h_m), elevation_sine: reach_m / range_m });
            // Two returns of one firing: there is one pixel only.
            if !self.image.put(r.ring, r.column, r.position(), range_m, place) {
                return false;
            }
        }
        true
    }

    /// By the triangle inequality, ranges of returns within d differ by at most d; ranges round as distances do.
    fn seeker(&self, r: &Return) -> Seeker {
        let (range_m, reach_m) = (r.range_m(), self.range_d_m * ROUNDING);
        Seeker {
            position: r.position(),
            within_m2: self.range_d_m * self.range_d_m,
            near_m: range_m / ROUNDING - reach_m,
            far_m: range_m * ROUNDING + reach_m,
        }
    }

    /// Close returns with each other and with all they can reach.
    fn join_close(&mut self, sweep: &Sweep, sets: &mut Sets) {
        let lone = sets.count() - self.image.close_count();
        for &place in &self.close {
            // All in one set: nothing is left to find.
            if sets.count() == lone + 1 {
                return;
            }
            let seeker = self.seeker(&sweep.returns[place as usize]);
            let root = sets.root(place);
            self.image.join_close(sets, seeker, root);
        }
    }

    /// All other pairs: each return looks back over its window.
    fn join_windows(&mut self, sweep: &Sweep, sets: &mut Sets) {
        let rings = sweep.rings.len();
        for (place, (r, &reach)) in sweep.returns.iter().zip(&self.reaches).enumerate() {
            if reach.azimuth_rad == f32::INFINITY {
                continue;
            }
            let own = usize::from(r.ring);
            let mut window = Window {
                seeker: self.seeker(r),
                column: usize::from(r.column),
                last_column: sweep.columns.len() - 1,
                earliest_rad: self.turn.travel_rad(usize::from(r.column)) - reach.azimuth_rad,
                root: sets.root(place as u32),
            };
            let (image, turn, slack) = (&mut self.image, &self.turn, &self.slack);
            window.look(image, turn, sets, own, slack.shift_rad(own, own));
            let (mut up, mut down) = (true, true);
            for step in 1..rings {
                up = up && own + step < rings && slack.gap_sine(own, own + step) <= reach.elevation_sine;
                down = down && step <= own && slack.gap_sine(own, own - step) <= reach.elevation_sine;
                if up {
                    window.look(image, turn, sets, own + step, slack.shift_rad(own, own + step));
                }
                if down {
                    window.look(image, turn, sets, own - step, slack.shift_rad(own, own - step));
                }
                if !up && !down {
                    break;
                }
            }
            image.note(r.ring, r.column, window.root);
        }
    }
}

/// A return looking back.
struct Window {
    seeker: Seeker,
    column: usize,
    last_column: usize,
    /// Its column's travel less asin(d/h).
    earliest_rad: f32,
    root: u32,
}

impl Window {
    /// Looks along one ring: back to the window's edge, and over the seam where the window reaches past it.
    #[inline]
    fn look(&mut self, image: &mut Image, turn: &Turn, sets: &mut Sets, ring: usize, shift_rad: f32) {
        let earliest_rad = self.earliest_rad + shift_rad;
        let from = turn.first_from(earliest_rad);
        if from <= self.column {
            self.root = image.join_row(sets, self.seeker, ring, from, self.column, self.root);
        }
        let from = turn.first_from(earliest_rad + std::f32::consts::TAU).max(self.column + 1);
        if from <= self.last_column {
            self.root = image.join_row(sets, self.seeker, ring, from, self.last_column, self.root);
        }
    }
}
