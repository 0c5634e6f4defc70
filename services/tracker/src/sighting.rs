use messages::{Detection, Solid, SweepHeader};
use nalgebra::Vector3;

use crate::frame::{Frame, Pose};

/// A cluster of the sweep as the tracker sees it: when and from where, in the tracks' frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sighting {
    pub(crate) key: u32,
    /// Number of returns.
    pub(crate) points: f64,
    /// Sensor time at which the beam was at its middle [ns].
    pub(crate) time_ns: u64,
    /// Standard deviation of that time [s]: 0 but for clusters that both ends of the sweep share.
    pub(crate) time_sigma_s: f64,
    /// The sensor then.
    pub(crate) pose: Pose,
    /// Mean of the returns [m].
    pub(crate) centroid_m: Vector3<f64>,
    /// Unit vector from the sensor to it.
    pub(crate) line_of_sight: Vector3<f64>,
    /// Distance from the sensor to it [m].
    pub(crate) range_m: f64,
    /// Half of its mean width, by the columns that it was seen in [m].
    pub(crate) half_width_m: f64,
    /// The detection among those gathered.
    pub(crate) detection: usize,
}

impl Sighting {
    /// What the detection at a place among those gathered says.
    pub(crate) fn new(place: usize, detection: &Detection, header: &SweepHeader, frame: &Frame) -> Self {
        let summary = &detection.summary;
        let points = f64::from(summary.points);
        let columns = if summary.rings > 0 { points / f64::from(summary.rings) } else { points.sqrt() };
        let half_angle = (0.5 * columns * f64::from(header.column_step_rad)).min(std::f64::consts::PI);
        // Half of the beam's pass before its end.
        let half_pass_ns = half_angle / std::f64::consts::TAU * header.period_ns as f64;
        let mut middle_ns = (f64::from(summary.last_offset_ns) - half_pass_ns).max(0.0);
        let mut time_sigma_s = 0.0;
        if summary.seam != 0 && u64::from(summary.last_offset_ns) > header.period_ns / 2 {
            // It touches the sweep's last column; how much of it was seen in the first, a period before, nobody knows.
            middle_ns = 0.5 * header.period_ns as f64;
            time_sigma_s = header.period_ns as f64 * 1e-9 / 12.0_f64.sqrt();
        }
        let time_ns = frame.start_ns.saturating_add(middle_ns as u64);
        let pose = frame.at(time_ns);
        let centroid = Vector3::from(summary.centroid_m).cast::<f64>();
        let range_m = centroid.norm();
        let away = centroid.try_normalize(1e-9).unwrap_or_else(Vector3::x);
        Self {
            key: summary.key,
            points,
            time_ns,
            time_sigma_s,
            pose,
            centroid_m: pose.place(&centroid),
            line_of_sight: pose.attitude * away,
            range_m,
            half_width_m: range_m * half_angle.min(0.8).tan(),
            detection: place,
        }
    }

    /// Two pieces of one obstacle as one sighting, with the detection of the larger.
    pub(crate) fn joined(&self, other: &Self) -> Self {
        let points = self.points + other.points;
        let share = other.points / points;
        let centroid_m = self.centroid_m.lerp(&other.centroid_m, share);
        let later_ns = other.time_ns.wrapping_sub(self.time_ns) as i64 as f64 * share;
        let away = centroid_m - self.pose.position_m;
        let apart_m = (self.centroid_m - other.centroid_m).norm();
        Self {
            points,
            centroid_m,
            time_ns: self.time_ns.wrapping_add_signed(later_ns as i64),
            line_of_sight: away.try_normalize(1e-9).unwrap_or(self.line_of_sight),
            range_m: away.norm(),
            half_width_m: (apart_m + self.half_width_m + other.half_width_m) / 2.0,
            ..if share > 0.5 { *other } else { *self }
        }
    }

    /// Half of the angle that it hides [rad]; of its solid where it has one.
    pub(crate) fn half_angle_rad(&self, solid: Option<&Solid>) -> f64 {
        let half_m = match solid {
            Some(solid) => {
                let [a, b, c] = solid.size_m.map(f64::from);
                // Mean of the two longer extents.
                0.25 * (a + b + c - a.min(b).min(c))
            }
            None => self.half_width_m,
        };
        half_m.atan2(self.range_m)
    }
}

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, EgoMotion};

    use super::*;

    fn header() -> SweepHeader {
        SweepHeader { period_ns: 100_000_000, column_step_rad: 0.01, ..SweepHeader::default() }
    }

    fn sighting(summary: ClusterSummary) -> Sighting {
        let frame = Frame::new(1_000_000_000, &EgoMotion::default());
        Sighting::new(0, &Detection { summary, ..Detection::default() }, &header(), &frame)
    }

    #[test]
    fn a_cluster_was_seen_half_of_its_width_before_its_last_return() {
        let summary = ClusterSummary { points: 60, rings: 3, last_offset_ns: 40_000_000, ..ClusterSummary::default() };
        let seen = sighting(ClusterSummary { centroid_m: [0.0, 10.0, 0.0], ..summary });
        // 20 columns of 0.01 rad: 0.2 of 2π of the period, half of it before.
        let half_ns = 0.1 / std::f64::consts::TAU * 1e8;
        assert!((seen.time_ns as f64 - (1.04e9 - half_ns)).abs() < 2.0);
        assert!((seen.half_width_m - 10.0 * 0.1_f64.tan()).abs() < 1e-6);
        assert_eq!((seen.line_of_sight, seen.time_sigma_s), (Vector3::y(), 0.0));
    }

    // verifies TRA-010
    #[test]
    fn a_cluster_at_the_end_of_the_sweep_may_have_been_seen_at_its_begin_as_well() {
        let summary = ClusterSummary { points: 9, rings: 3, seam: 1, ..ClusterSummary::default() };
        let at_end = sighting(ClusterSummary { last_offset_ns: 99_900_000, ..summary });
        assert_eq!(at_end.time_ns, 1_050_000_000);
        assert!((at_end.time_sigma_s - 0.1 / 12.0_f64.sqrt()).abs() < 1e-12);
        let at_begin = sighting(ClusterSummary { last_offset_ns: 1_000_000, ..summary });
        assert!(at_begin.time_ns < 1_001_000_001 && at_begin.time_sigma_s == 0.0);
    }

    #[test]
    fn pieces_make_one_sighting_from_end_to_end() {
        let summary = ClusterSummary { points: 30, rings: 3, last_offset_ns: 40_000_000, ..ClusterSummary::default() };
        let one = sighting(ClusterSummary { centroid_m: [10.0, 1.0, 0.0], ..summary });
        let other = sighting(ClusterSummary {
            centroid_m: [10.0, -2.0, 0.0],
            points: 60,
            last_offset_ns: 43_000_000,
            ..summary
        });
        let both = one.joined(&other);
        assert!((both.centroid_m - Vector3::new(10.0, -1.0, 0.0)).norm() < 1e-6);
        assert_eq!(both.points, 90.0);
        assert!(one.time_ns < both.time_ns && both.time_ns < other.time_ns);
        assert!((both.half_width_m - (3.0 + one.half_width_m + other.half_width_m) / 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_cluster_at_the_sensor_itself_is_seen_somewhere() {
        let seen = sighting(ClusterSummary { points: 1, ..ClusterSummary::default() });
        assert!(seen.line_of_sight.norm() == 1.0 && seen.range_m == 0.0 && seen.half_width_m == 0.0);
    }
}
