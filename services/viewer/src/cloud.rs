use messages::{Detections, Solid, Sweep, TrackTable};

use crate::columns::Columns;
use crate::paths::Paths;
use crate::tracks;

/// What positions of returns and centroids are rounded to [m]: the step in which an HDL-32E says its ranges.
pub const POINT_UNIT_M: f64 = 0.002;
/// What poses and sizes of solids are rounded to [m].
const SOLID_UNIT_M: f64 = 0.001;
/// What the parts of a quaternion are rounded to.
const TURN_UNIT: f64 = 1e-4;
/// What probabilities are rounded to.
const PROBABILITY_UNIT: f64 = 1e-3;
/// Rings that a return can name.
const RINGS: usize = u8::MAX as usize + 1;

/// What is known of one sweep.
#[derive(Clone, Copy, Default)]
pub(crate) struct Known<'a> {
    /// Its number.
    pub(crate) number: u32,
    pub(crate) sweep: Option<&'a Sweep>,
    pub(crate) detections: Option<&'a Detections>,
    /// Its tracks, and where they were before.
    pub(crate) tracks: Option<(&'a TrackTable, &'a Paths)>,
}

/// One sweep as the page draws it. Columns `x y z cluster ring intensity` of its returns, ring after ring (neighbours are
/// alike, and deflate well); `class points rings cx cy cz p0…p3` of its clusters by number; `of sx sy sz qw qx qy qz a b c
/// sigma` of its solids. A return without a cluster has −1; `of` is the cluster of a solid; `sigma` is the standard
/// deviation of its centre. Columns of tracks (see [`tracks::put`]) only where they are known. At most `most_points` returns: every k-th is kept where there are more.
pub(crate) fn encode(known: Known<'_>, most_points: usize) -> std::io::Result<Vec<u8>> {
    let mut columns = Columns::default();
    if let Some(sweep) = known.sweep {
        returns(sweep, &owners(known.detections), most_points, &mut columns);
    }
    if let Some(detections) = known.detections {
        clusters(detections, &mut columns);
        solids(detections, &mut columns);
    }
    if let Some((table, paths)) = known.tracks {
        tracks::put(table, known.detections, &paths.trails(known.number, table), &mut columns);
    }
    columns.finish()
}

/// Index in the sweep of every member, and the number of its cluster; by index.
fn owners(detections: Option<&Detections>) -> Vec<(u32, i32)> {
    let mut owners = Vec::new();
    if let Some(message) = detections {
        for (number, detection) in message.detections.iter().enumerate() {
            let first = detection.summary.first_member as usize;
            let members = message.members.get(first..first + detection.summary.points as usize);
            owners.extend(members.unwrap_or_default().iter().map(|&index| (index, number as i32)));
        }
    }
    owners.sort_unstable();
    owners
}

fn returns(sweep: &Sweep, owners: &[(u32, i32)], most_points: usize, columns: &mut Columns) {
    let mut first = [0; RINGS];
    for point in &sweep.returns {
        first[point.ring as usize] += 1;
    }
    let mut sum = 0;
    for count in &mut first {
        sum += std::mem::replace(count, sum);
    }
    let mut order = vec![0; sweep.returns.len()];
    for (place, point) in sweep.returns.iter().enumerate() {
        let next = &mut first[point.ring as usize];
        order[*next] = place;
        *next += 1;
    }
    let every = order.len().div_ceil(most_points.max(1)).max(1);
    let kept = || order.iter().step_by(every).copied();
    let points = || kept().map(|place| sweep.returns[place]);
    columns.reals("x", POINT_UNIT_M, points().map(|point| point.x.into()));
    columns.reals("y", POINT_UNIT_M, points().map(|point| point.y.into()));
    columns.reals("z", POINT_UNIT_M, points().map(|point| point.z.into()));
    let owner = |index| owners.binary_search_by_key(&index, |owner| owner.0).map_or(-1, |place| owners[place].1);
    columns.integers("cluster", kept().map(|place| owner(sweep.index_of(place))));
    columns.integers("ring", points().map(|point| point.ring.into()));
    columns.integers("intensity", points().map(|point| point.intensity.into()));
}

fn clusters(message: &Detections, columns: &mut Columns) {
    let all = || message.detections.iter();
    columns.integers("class", all().map(|detection| detection.class as i32));
    columns.integers("points", all().map(|detection| detection.summary.points as i32));
    columns.integers("rings", all().map(|detection| detection.summary.rings as i32));
    for (axis, name) in ["cx", "cy", "cz"].into_iter().enumerate() {
        columns.reals(name, POINT_UNIT_M, all().map(|detection| detection.summary.centroid_m[axis].into()));
    }
    for (class, name) in ["p0", "p1", "p2", "p3"].into_iter().enumerate() {
        columns.reals(name, PROBABILITY_UNIT, all().map(|detection| detection.posterior[class].into()));
    }
}

fn solids(message: &Detections, columns: &mut Columns) {
    let numbered = message.detections.iter().enumerate();
    let found: Vec<(usize, &Solid)> = numbered
        .filter_map(|(number, detection)| Some((number, message.solids.get(detection.solid_place()?)?)))
        .collect();
    columns.integers("of", found.iter().map(|(number, _)| *number as i32));
    let mut put = |name, unit, value: &dyn Fn(&Solid) -> f32| {
        columns.reals(name, unit, found.iter().map(|(_, solid)| value(solid).into()));
    };
    for (axis, name) in ["sx", "sy", "sz"].into_iter().enumerate() {
        put(name, SOLID_UNIT_M, &|solid| solid.centre_m[axis]);
    }
    for (part, name) in ["qw", "qx", "qy", "qz"].into_iter().enumerate() {
        put(name, TURN_UNIT, &|solid| solid.attitude_wxyz[part]);
    }
    for (axis, name) in ["a", "b", "c"].into_iter().enumerate() {
        put(name, SOLID_UNIT_M, &|solid| solid.size_m[axis]);
    }
    put("sigma", SOLID_UNIT_M, &|solid| (0..3).map(|axis| solid.covariance_of(axis, axis)).sum::<f32>().sqrt());
}

#[cfg(test)]
mod tests;
