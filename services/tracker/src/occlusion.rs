use messages::Solid;
use nalgebra::Vector3;

use crate::sighting::Sighting;

/// Whether a nearer obstacle of the sweep covers the place where one is expected, so that not to see it means nothing.
///
/// `expected` gives the expected centre at a time; `half_m` is its mean half extent. Covered is what lies behind a
/// cluster and within the angle that it hides, up to the middle of the obstacle's own.
pub(crate) fn is_hidden<'a>(
    sightings: &[Sighting],
    solid_of: impl Fn(&Sighting) -> Option<&'a Solid>,
    expected: impl Fn(u64) -> Vector3<f64>,
    half_m: f64,
) -> bool {
    sightings.iter().any(|sighting| {
        let away = expected(sighting.time_ns) - sighting.pose.position_m;
        let range_m = away.norm();
        if sighting.range_m > range_m - half_m {
            return false;
        }
        let angle = away.angle(&sighting.line_of_sight);
        angle < sighting.half_angle_rad(solid_of(sighting)) + 0.5 * half_m.atan2(range_m)
    })
}

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, Detection, EgoMotion, SweepHeader};

    use super::*;
    use crate::frame::Frame;

    // verifies TRA-009
    #[test]
    fn an_obstacle_behind_another_is_hidden_and_one_before_or_beside_it_is_not() {
        let header = SweepHeader { column_step_rad: 0.01, period_ns: 100_000_000, ..SweepHeader::default() };
        // 20 columns: 1 m to each side at 10 m.
        let summary =
            ClusterSummary { points: 60, rings: 3, centroid_m: [10.0, 0.0, 0.0], ..ClusterSummary::default() };
        let frame = Frame::new(0, &EgoMotion::default());
        let near = Sighting::new(0, &Detection { summary, ..Detection::default() }, &header, &frame);
        let hidden = |x, y, z| is_hidden(&[near], |_| None, |_| Vector3::new(x, y, z), 0.5);
        assert!(hidden(20.0, 0.0, 0.0));
        assert!(hidden(20.0, 2.0, 0.0));
        assert!(!hidden(20.0, 3.0, 0.0));
        assert!(!hidden(20.0, 0.0, 3.0));
        assert!(!hidden(10.2, 0.0, 0.0));
        assert!(!hidden(-20.0, 0.0, 0.0));
        // A solid that is larger than what was seen of it hides more.
        let solid = Solid { size_m: [4.0, 4.0, 4.0], ..Solid::default() };
        assert!(is_hidden(&[near], |_| Some(&solid), |_| Vector3::new(20.0, 3.5, 0.0), 0.5));
    }
}
