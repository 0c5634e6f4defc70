use lidar::{MAX_COLUMNS, Return};
use messages::{Cell, CellKind, Cluster, Clusters};
use nalgebra::Vector3;
use pulp::Simd;

use super::wide::{Wide, WideVector};

/// A ray from the sensor: a hit at `range_m`, or free up to there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ray {
    /// Unit vector, sensor frame.
    pub(crate) direction: Vector3<f64>,
    /// Range measured; for a miss the range up to which nothing was met [m].
    pub(crate) range_m: f64,
}

impl Ray {
    /// Where it ends [m], sensor frame.
    pub(crate) fn end_m(&self) -> Vector3<f64> {
        self.direction * self.range_m
    }
}

/// Rays side by side, to be worked on many at once.
#[derive(Debug)]
pub(crate) struct Beam {
    count: usize,
    /// x, y, z of the directions, then ranges [m]; filled up with the last ray to a multiple of [`MOST_LANES`].
    columns: [Vec<f64>; 4],
}

/// Most rays that any machine works on at once.
pub(crate) const MOST_LANES: usize = 8;

impl Beam {
    /// Room for `most` rays.
    pub(crate) fn new(most: usize) -> Self {
        Self { count: 0, columns: std::array::from_fn(|_| Vec::with_capacity(most.next_multiple_of(MOST_LANES))) }
    }

    /// Takes these rays in their order.
    pub(crate) fn take(&mut self, rays: &[Ray]) {
        self.count = rays.len();
        let fill = rays.len().next_multiple_of(MOST_LANES) - rays.len();
        let all = || rays.iter().chain(rays.last().into_iter().cycle().take(fill));
        for (axis, column) in self.columns.iter_mut().enumerate() {
            column.clear();
            column.extend(all().map(|ray| ray.direction.get(axis).copied().unwrap_or(ray.range_m)));
        }
    }

    /// Rays taken, without those that fill up.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Directions and ranges of the `place`th group of rays.
    #[inline(always)]
    pub(crate) fn group<S: Simd>(&self, simd: S, place: usize) -> (WideVector<S>, Wide<S>) {
        let [x, y, z, range_m] = &self.columns;
        let direction = [Wide::load(simd, x, place), Wide::load(simd, y, place), Wide::load(simd, z, place)];
        (direction, Wide::load(simd, range_m, place))
    }
}

/// Neighbours among the eight of an empty cell from which on it counts as a lost echo, not as a miss.
const ENCLOSED: u32 = 5;

/// The rays of one cluster: its returns, and the misses round it.
#[derive(Debug)]
pub struct Bundle {
    /// Rays that met the cluster.
    pub(crate) hits: Vec<Ray>,
    /// Rays that passed it by.
    pub(crate) misses: Vec<Ray>,
    /// Cells with something nearer, behind which the cluster may go on.
    pub(crate) nearer: u32,
    /// Rings of the cluster's returns of each column, a bit a ring; all zero between clusters.
    members: Vec<u64>,
}

impl Bundle {
    /// Takes the memory for clusters of up to `returns` returns and `cells` cells.
    pub fn new(returns: usize, cells: usize) -> Self {
        Self {
            hits: Vec::with_capacity(returns),
            misses: Vec::with_capacity(cells),
            nearer: 0,
            members: vec![0; MAX_COLUMNS],
        }
    }

    /// Takes the rays of a cluster of `clusters`, whose returns are `returns`. Unknown cells tell nothing, those with
    /// something nearer next to nothing; a ray that met something farther is free up to there; an empty cell among returns
    /// is a lost echo.
    pub fn take(&mut self, clusters: &Clusters, cluster: &Cluster, returns: &[Return]) {
        self.hits.clear();
        self.misses.clear();
        self.nearer = 0;
        for r in returns {
            let position = Vector3::new(f64::from(r.x), f64::from(r.y), f64::from(r.z));
            let range_m = position.norm();
            if range_m > 0.0 {
                self.hits.push(Ray { direction: position / range_m, range_m });
            }
            if let Some(rings) = self.members.get_mut(usize::from(r.column)) {
                *rings |= 1 << (r.ring & 63);
            }
        }
        let columns = clusters.turn_columns as usize;
        let reach_m = f64::from(clusters.header.reach_m);
        // A cluster without cells may name any place as that of its first.
        for cell in clusters.cells.get(cluster.cell_places()).unwrap_or_default() {
            let Some(&elevation_rad) = clusters.ring_elevation_rad.get(usize::from(cell.ring)) else { continue };
            let range_m = match cell.kind {
                CellKind::Unknown => continue,
                CellKind::Nearer => {
                    self.nearer += 1;
                    continue;
                }
                CellKind::Miss => reach_m,
                CellKind::Farther => f64::from(cell.range_m),
            };
            if cell.kind == CellKind::Miss && self.members_round(cell, columns) >= ENCLOSED {
                continue;
            }
            let (sin_az, cos_az) = f64::from(cell.azimuth_rad).sin_cos();
            let (sin_el, cos_el) = f64::from(elevation_rad).sin_cos();
            self.misses.push(Ray { direction: Vector3::new(cos_el * cos_az, cos_el * sin_az, sin_el), range_m });
        }
        for r in returns {
            if let Some(rings) = self.members.get_mut(usize::from(r.column)) {
                *rings = 0;
            }
        }
    }

    fn members_round(&self, cell: &Cell, columns: usize) -> u32 {
        let mut count = 0;
        let around = 0b111_u128 << (cell.ring & 63) >> 1;
        for step in [-1_isize, 0, 1] {
            let mut column = usize::from(cell.column).wrapping_add_signed(step);
            if columns > 0 {
                column = (usize::from(cell.column) + columns).wrapping_add_signed(step) % columns;
            }
            let rings = self.members.get(column).copied().unwrap_or(0);
            count += (u128::from(rings) & around).count_ones();
        }
        count
    }
}

/// Copies at most `most` of `rays`, evenly over their order: one of each of `most` equal stretches, at a place that
/// moves by the golden ratio from one to the next, so that no rhythm of rings comes through. None comes twice.
pub(crate) fn thin(rays: &[Ray], most: usize, thinned: &mut Vec<Ray>) {
    thinned.clear();
    if rays.len() <= most {
        thinned.extend_from_slice(rays);
        return;
    }
    let first = |place: usize| place * rays.len() / most;
    for place in 0..most {
        let stretch = &rays[first(place)..first(place + 1)];
        let within = (place as f64 * 0.618_033_988_749_894_9).fract();
        thinned.push(stretch[(within * stretch.len() as f64) as usize]);
    }
}

#[cfg(test)]
mod tests;
