//! Rings and columns of a cloud, recovered from the sensor model, or the verdict that there are none.
//!
//! A sweep is called organised only where that is true: every return within half a ring spacing of its ring's
//! elevation and within one step of its column's azimuth, columns in one sense and within one turn. Anything else
//! (a cloud corrected for the carrier's motion, say) is left unorganised: then the k-d tree serves, which needs neither.

use std::f64::consts::{PI, TAU};

use lidar::{MAX_COLUMNS, MAX_RINGS, SensorModel};

use super::Cloud;
use crate::intake::Limits;

/// No ring: the point is refused.
const REFUSED: u8 = u8::MAX;
/// Columns by geometry lie on the grid to this share of a step.
const GRID_TOLERANCE: f64 = 0.3;

/// Azimuths that are nearer are equal [rad]: a thousandth of what the finest sensor turns between columns.
const MIN_STEP_RAD: f64 = 1e-6;

/// A column as it was recovered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Draft {
    /// Azimuth of its first firing [rad], counter-clockwise from +x.
    pub(crate) azimuth_rad: f64,
    /// Time of its first firing [ns], where a return tells.
    pub(crate) time_ns: Option<u64>,
    /// The file says that it was fired: by a return, or by a firing without one.
    pub(crate) is_known: bool,
    /// Returns that are not refused, then the sums behind its azimuth.
    members: u32,
    reference_rad: f64,
    sums_rad: [f64; 2],
}

/// Recovers rings and columns; its memory is used again from sweep to sweep.
#[derive(Debug)]
pub(crate) struct Organiser {
    elevations_rad: Vec<f64>,
    /// Firing time after the column's first, as a share of the time from column to column, by ring.
    shares: Vec<f64>,
    offsets_ns: Vec<u64>,
    ring_of_laser: Vec<u8>,
    laser_of_ring: Vec<u8>,
    rings: Vec<u8>,
    azimuths_rad: Vec<f64>,
    numbers: Vec<u32>,
    columns: Vec<Draft>,
    regrouped: Vec<Draft>,
    steps_rad: Vec<f64>,
    turned_rad: f64,
}

/// Order of the 32 (or so) points of a column in a cloud that has all of them.
#[derive(Clone, Copy, Debug)]
enum Pattern {
    Firing,
    Ring,
}

impl Organiser {
    pub(crate) fn new(sensor: &SensorModel) -> Self {
        let lasers = sensor.lasers();
        let mut laser_of_ring = vec![0; lasers.len()];
        for (laser, model) in lasers.iter().enumerate() {
            laser_of_ring[usize::from(model.ring)] = laser as u8;
        }
        let by_ring = || laser_of_ring.iter().map(|&laser| &lasers[usize::from(laser)]);
        Self {
            elevations_rad: by_ring().map(|laser| laser.elevation_rad).collect(),
            shares: by_ring().map(|laser| f64::from(laser.offset_ns) / f64::from(sensor.cycle_ns())).collect(),
            offsets_ns: by_ring().map(|laser| u64::from(laser.offset_ns)).collect(),
            ring_of_laser: lasers.iter().map(|laser| laser.ring).collect(),
            laser_of_ring,
            rings: Vec::new(),
            azimuths_rad: Vec::new(),
            numbers: Vec::new(),
            columns: Vec::new(),
            regrouped: Vec::new(),
            steps_rad: Vec::new(),
            turned_rad: 0.0,
        }
    }

    /// The columns last recovered.
    pub(crate) fn columns(&self) -> &[Draft] {
        &self.columns
    }

    /// Mean azimuth from column to column [rad], positive.
    pub(crate) fn step_rad(&self) -> f64 {
        self.turned_rad / self.columns.len().saturating_sub(1).max(1) as f64
    }

    /// Column and ring of the point at `index`; zeros for a refused one.
    pub(crate) fn place(&self, index: usize) -> (u16, u8) {
        match self.rings[index] {
            REFUSED => (0, 0),
            ring => (self.numbers[index] as u16, ring),
        }
    }

    /// Recovers rings and columns of `cloud`; false where they are not true to the sensor.
    pub(crate) fn organise(&mut self, cloud: &Cloud, limits: &Limits) -> bool {
        if self.elevations_rad.len() < 2 || !self.find_rings(cloud, limits) {
            return false;
        }
        let Some((sense, mut step_rad)) = self.find_step() else { return false };
        let is_grouped = if cloud.has_key {
            self.group_by_key(cloud) && {
                step_rad = self.refined_step(sense, step_rad);
                self.spread_groups(sense, step_rad)
            }
        } else {
            self.group_by_place(Pattern::Firing)
                || self.group_by_place(Pattern::Ring)
                || self.group_by_azimuth(sense, step_rad, 1.0)
                || self.group_by_azimuth(sense, step_rad, 0.0)
        };
        is_grouped && self.find_azimuths(sense, step_rad) && self.is_true(sense, step_rad) && self.find_times(cloud)
    }

    /// Ring and azimuth of every accepted point; false if one is farther than half a spacing from its ring.
    fn find_rings(&mut self, cloud: &Cloud, limits: &Limits) -> bool {
        self.rings.clear();
        self.azimuths_rad.clear();
        for point in &cloud.points {
            if limits.refusal(point.position_m).is_some() {
                self.rings.push(REFUSED);
                self.azimuths_rad.push(0.0);
                continue;
            }
            let [x, y, z] = point.position_m;
            let elevation_rad = z.atan2(x.hypot(y));
            let ring = if cloud.has_ring { usize::from(point.ring) } else { self.nearest_ring(elevation_rad) };
            let Some(&center_rad) = self.elevations_rad.get(ring) else { return false };
            // The spacing outside the outermost rings is that inside.
            let below = if ring == 0 { 0 } else { ring - 1 };
            let above = if ring + 1 == self.elevations_rad.len() { ring - 1 } else { ring };
            let side = if elevation_rad < center_rad { below } else { above };
            let spacing_rad = self.elevations_rad[side + 1] - self.elevations_rad[side];
            if (elevation_rad - center_rad).abs() > spacing_rad / 2.0 {
                return false;
            }
            self.rings.push(ring as u8);
            self.azimuths_rad.push(y.atan2(x));
        }
        true
    }

    fn nearest_ring(&self, elevation_rad: f64) -> usize {
        let above = self.elevations_rad.partition_point(|&ring_rad| ring_rad < elevation_rad);
        match above {
            0 => 0,
            n if n == self.elevations_rad.len() => n - 1,
            n if elevation_rad - self.elevations_rad[n - 1] < self.elevations_rad[n] - elevation_rad => n - 1,
            n => n,
        }
    }

    fn accepted(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let known = self.rings.iter().enumerate().filter(|&(_, &ring)| ring != REFUSED);
        known.map(|(index, &ring)| (index, usize::from(ring)))
    }

    /// Sense of rotation (1 counter-clockwise, −1 clockwise) and azimuth from column to column, from what follows one
    /// another on the same ring: most of it lies in neighbouring columns, the rest some columns apart.
    fn find_step(&mut self) -> Option<(f64, f64)> {
        let mut last = [f64::NAN; MAX_RINGS];
        let mut steps = std::mem::take(&mut self.steps_rad);
        steps.clear();
        let mut turning = 0_i64;
        for (index, ring) in self.accepted() {
            let step_rad = wrapped(self.azimuths_rad[index] - last[ring]);
            last[ring] = self.azimuths_rad[index];
            // False for NaN too: the first of its ring.
            if step_rad.abs() > MIN_STEP_RAD {
                turning += if step_rad > 0.0 { 1 } else { -1 };
                steps.push(step_rad.abs());
            }
        }
        let found = usual(&mut steps).map(|step_rad| (if turning < 0 { -1.0 } else { 1.0 }, step_rad));
        self.steps_rad = steps;
        found
    }

    /// The step by the groups' azimuths, where it is the finer one: on one ring returns may never lie in neighbouring
    /// columns. Both are whole multiples of the true step. Twice, as the groups' azimuths depend on it a little.
    fn refined_step(&mut self, sense: f64, step_rad: f64) -> f64 {
        let mut refined_rad = step_rad;
        for _ in 0..2 {
            if !self.find_azimuths(sense, refined_rad) {
                break;
            }
            let mut steps = std::mem::take(&mut self.steps_rad);
            steps.clear();
            let groups = self.columns.windows(2);
            let apart = groups.map(|pair| wrapped(pair[1].azimuth_rad - pair[0].azimuth_rad).abs());
            steps.extend(apart.filter(|&apart_rad| apart_rad > MIN_STEP_RAD));
            refined_rad = usual(&mut steps).unwrap_or(refined_rad);
            self.steps_rad = steps;
        }
        if refined_rad < 0.75 * step_rad { refined_rad } else { step_rad }
    }

    /// Equal azimuths of the file, one after the other, are one group; groups are numbered from 0.
    fn group_by_key(&mut self, cloud: &Cloud) -> bool {
        self.numbers.clear();
        self.numbers.resize(self.rings.len(), 0);
        let (mut key, mut number) = (f64::NAN, 0);
        let mut is_first = true;
        for index in 0..self.rings.len() {
            if self.rings[index] == REFUSED {
                continue;
            }
            if cloud.points[index].key != key {
                key = cloud.points[index].key;
                number += u32::from(!is_first);
                is_first = false;
            }
            self.numbers[index] = number;
        }
        self.columns.clear();
        self.columns.resize(number as usize + 1, Draft::KNOWN);
        !is_first
    }

    /// A cloud with a point for every firing: the place in the file says which.
    fn group_by_place(&mut self, pattern: Pattern) -> bool {
        let lasers = self.ring_of_laser.len();
        let columns = self.rings.len() / lasers;
        if !self.rings.len().is_multiple_of(lasers) || columns > MAX_COLUMNS {
            return false;
        }
        let is_pattern = self.accepted().all(|(index, ring)| {
            ring == match pattern {
                Pattern::Firing => usize::from(self.ring_of_laser[index % lasers]),
                Pattern::Ring => index % lasers,
            }
        });
        if is_pattern {
            self.numbers.clear();
            self.numbers.extend((0..self.rings.len()).map(|index| (index / lasers) as u32));
            self.columns.clear();
            self.columns.resize(columns, Draft::KNOWN);
        }
        is_pattern
    }

    /// A cloud of returns only, in firing order: a new column begins where the azimuth has gone on by whole steps.
    /// `turn` is 1 where azimuths go on within a column as the head turns, 0 where the file has one azimuth a column.
    fn group_by_azimuth(&mut self, sense: f64, step_rad: f64, turn: f64) -> bool {
        self.numbers.clear();
        self.numbers.resize(self.rings.len(), 0);
        let (mut number, mut laser, mut reference_rad) = (0, None, 0.0);
        for index in 0..self.rings.len() {
            if self.rings[index] == REFUSED {
                continue;
            }
            let ring = usize::from(self.rings[index]);
            let azimuth_rad = self.azimuths_rad[index] - sense * turn * step_rad * self.shares[ring];
            let Some(before) = laser else {
                (laser, reference_rad) = (Some(self.laser_of_ring[ring]), azimuth_rad);
                continue;
            };
            // From half a step back, so that rounding does not make a turn of nothing.
            let ahead_rad = (sense * (azimuth_rad - reference_rad) + step_rad / 2.0).rem_euclid(TAU) - step_rad / 2.0;
            let steps = ahead_rad / step_rad;
            let whole = steps.round();
            let is_later = whole > 0.0 || self.laser_of_ring[ring] > before;
            if (steps - whole).abs() > GRID_TOLERANCE || !is_later || whole > MAX_COLUMNS as f64 {
                return false;
            }
            if whole > 0.0 {
                number = (number + whole as u32).min(MAX_COLUMNS as u32);
                reference_rad = azimuth_rad;
            }
            laser = Some(self.laser_of_ring[ring]);
            self.numbers[index] = number;
        }
        if number as usize >= MAX_COLUMNS {
            return false;
        }
        self.columns.clear();
        self.columns.resize(number as usize + 1, Draft::UNKNOWN);
        for (index, _) in self.rings.iter().enumerate().filter(|&(_, &ring)| ring != REFUSED) {
            self.columns[self.numbers[index] as usize].is_known = true;
        }
        true
    }

    /// Numbers groups by their azimuths, with numbers left free for columns that have no return.
    fn spread_groups(&mut self, sense: f64, step_rad: f64) -> bool {
        if !self.find_azimuths(sense, step_rad) {
            return false;
        }
        self.regrouped.clear();
        for group in 0..self.columns.len() {
            let mut free = 0;
            if group > 0 {
                let ahead_rad = sense * (self.columns[group].azimuth_rad - self.columns[group - 1].azimuth_rad);
                free = ((ahead_rad.rem_euclid(TAU) / step_rad).round() as usize).saturating_sub(1);
            }
            if free >= MAX_COLUMNS - self.regrouped.len() {
                return false;
            }
            self.regrouped.resize(self.regrouped.len() + free, Draft::UNKNOWN);
            // What its members' numbers are to become.
            self.columns[group].members = self.regrouped.len() as u32;
            self.regrouped.push(Draft::KNOWN);
        }
        for (number, _) in self.numbers.iter_mut().zip(&self.rings).filter(|&(_, &ring)| ring != REFUSED) {
            *number = self.columns[*number as usize].members;
        }
        std::mem::swap(&mut self.columns, &mut self.regrouped);
        true
    }

    /// Azimuth of each column's first firing: the mean of what its returns say. Whether their azimuths go on within the
    /// column is decided by which of both fits better. Columns without returns lie evenly between.
    fn find_azimuths(&mut self, sense: f64, step_rad: f64) -> bool {
        for column in &mut self.columns {
            *column = Draft { is_known: column.is_known, ..Draft::KNOWN };
        }
        let mut residuals = [0.0; 2];
        for pass in 0..2 {
            for (index, &ring) in self.rings.iter().enumerate().filter(|&(_, &ring)| ring != REFUSED) {
                let column = &mut self.columns[self.numbers[index] as usize];
                if pass == 0 && column.members == 0 {
                    column.reference_rad = self.azimuths_rad[index];
                }
                let from_rad = wrapped(self.azimuths_rad[index] - column.reference_rad);
                let turn_rad = sense * step_rad * self.shares[usize::from(ring)];
                for (turning, rad) in [from_rad, from_rad - turn_rad].into_iter().enumerate() {
                    if pass == 0 {
                        column.sums_rad[turning] += rad;
                    } else {
                        residuals[turning] += (rad - column.sums_rad[turning] / f64::from(column.members)).powi(2);
                    }
                }
                column.members += u32::from(pass == 0);
            }
        }
        let turning = usize::from(residuals[1] < residuals[0]);
        let mut before: Option<usize> = None;
        for number in 0..self.columns.len() {
            let column = &mut self.columns[number];
            if column.members == 0 {
                continue;
            }
            column.azimuth_rad = column.reference_rad + column.sums_rad[turning] / f64::from(column.members);
            let to_rad = column.azimuth_rad;
            let first = before.map_or(0, |before| before + 1);
            let (from_rad, each_rad) = match before {
                Some(before) => {
                    let from_rad = self.columns[before].azimuth_rad;
                    let ahead_rad = (sense * (to_rad - from_rad)).rem_euclid(TAU);
                    (from_rad, sense * ahead_rad / (number - before) as f64)
                }
                None => (to_rad - sense * step_rad * (number + 1) as f64, sense * step_rad),
            };
            for (ahead, free) in (1..).zip(first..number) {
                self.columns[free].azimuth_rad = from_rad + each_rad * f64::from(ahead);
            }
            before = Some(number);
        }
        let Some(last) = before else { return false };
        for (ahead, free) in (1..).zip(last + 1..self.columns.len()) {
            self.columns[free].azimuth_rad = self.columns[last].azimuth_rad + sense * step_rad * f64::from(ahead);
        }
        true
    }

    /// Columns turn in one sense and not beyond a turn, and every return lies within a step of its column.
    fn is_true(&mut self, sense: f64, step_rad: f64) -> bool {
        let mut turned_rad = 0.0;
        for pair in self.columns.windows(2) {
            let ahead_rad = (sense * (pair[1].azimuth_rad - pair[0].azimuth_rad)).rem_euclid(TAU);
            if ahead_rad < MIN_STEP_RAD {
                return false;
            }
            turned_rad += ahead_rad;
        }
        self.turned_rad = turned_rad;
        let is_within = |(index, _)| {
            let column: &Draft = &self.columns[self.numbers[index] as usize];
            wrapped(self.azimuths_rad[index] - column.azimuth_rad).abs() <= step_rad
        };
        (2..=MAX_COLUMNS).contains(&self.columns.len()) && self.turned_rad <= TAU && self.accepted().all(is_within)
    }

    /// Time of each column, where the file has times; false if they fall, or span more than a message can say.
    fn find_times(&mut self, cloud: &Cloud) -> bool {
        if !cloud.has_time {
            return true;
        }
        for (index, &ring) in self.rings.iter().enumerate().filter(|&(_, &ring)| ring != REFUSED) {
            let time_ns = cloud.points[index].time_ns.saturating_sub(self.offsets_ns[usize::from(ring)]);
            let column = &mut self.columns[self.numbers[index] as usize];
            column.time_ns = Some(column.time_ns.map_or(time_ns, |known| known.min(time_ns)));
        }
        let mut times = self.columns.iter().filter_map(|column| column.time_ns);
        let Some(first_ns) = times.next() else { return false };
        let mut last_ns = first_ns;
        times.all(|time_ns| std::mem::replace(&mut last_ns, time_ns) <= time_ns)
            && last_ns - first_ns <= u64::from(u32::MAX)
    }
}

impl Draft {
    const KNOWN: Self =
        Self { azimuth_rad: 0.0, time_ns: None, is_known: true, members: 0, reference_rad: 0.0, sums_rad: [0.0; 2] };
    const UNKNOWN: Self = Self { is_known: false, ..Self::KNOWN };
}

/// The usual one of steps, most of which are alike and the rest multiples of those: the mean of what is near the lower
/// quartile. None without any.
fn usual(steps: &mut [f64]) -> Option<f64> {
    if steps.is_empty() {
        return None;
    }
    let quarter = steps.len() / 4;
    let (_, &mut usual, _) = steps.select_nth_unstable_by(quarter, f64::total_cmp);
    let near = steps.iter().filter(|&&step| (0.7 * usual..=1.3 * usual).contains(&step));
    let (sum, count) = near.fold((0.0, 0), |(sum, count), step| (sum + step, count + 1));
    Some(sum / f64::from(count))
}

/// An angle in [−π, π).
pub(crate) fn wrapped(rad: f64) -> f64 {
    (rad + PI).rem_euclid(TAU) - PI
}
