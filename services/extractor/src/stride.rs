use lidar::Return;
use messages::{MIN_FEATURE_POINTS, SweepHeader};

/// Largest stride: twice what the finest sensor needs (HDL-32E at 5 Hz: 9).
const MAX_STRIDE: usize = 18;

/// Columns from one used column to the next: the whole number that comes nearest to `spacing_rad`, 1 to 18.
/// 1 for unorganised sweeps, whose returns have no column.
///
/// Five nearest neighbours of a finely stepped sweep lie on one ring, where no normal is determined; in strides the
/// columns are about as far apart as in the paper's sweeps, and neighbours lie across rings.
pub fn column_stride(header: &SweepHeader, spacing_rad: f32) -> usize {
    if !header.is_organised() || header.column_step_rad.is_nan() || header.column_step_rad <= 0.0 {
        return 1;
    }
    ((spacing_rad / header.column_step_rad).round() as usize).clamp(1, MAX_STRIDE)
}

/// The largest stride up to `wanted` at which some phase of the cluster (its returns with equal column modulo stride)
/// has enough points for features; 1 at the least.
pub(crate) fn served_stride(returns: &[Return], wanted: usize) -> usize {
    (2..=wanted).rev().find(|&stride| (0..stride).any(|phase| enough(returns, stride, phase))).unwrap_or(1)
}

fn enough(returns: &[Return], stride: usize, phase: usize) -> bool {
    returns.iter().filter(|r| usize::from(r.column) % stride == phase).nth(MIN_FEATURE_POINTS - 1).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(columns: &[u16]) -> Vec<Return> {
        columns.iter().map(|&column| Return { column, ..Return::default() }).collect()
    }

    #[test]
    fn sweeps_of_500_1084_and_2170_columns_are_read_in_strides_of_1_2_and_4() {
        let stride = |columns: f32| {
            let header = SweepHeader {
                organised: 1,
                column_step_rad: std::f32::consts::TAU / columns,
                ..SweepHeader::default()
            };
            column_stride(&header, 0.72_f32.to_radians())
        };
        assert_eq!([stride(300.0), stride(500.0), stride(1_084.0), stride(2_170.0)], [1, 1, 2, 4]);
    }

    #[test]
    fn a_sweep_without_columns_or_with_a_senseless_step_is_read_whole_or_bounded() {
        let header = |organised, column_step_rad| SweepHeader { organised, column_step_rad, ..SweepHeader::default() };
        assert_eq!(column_stride(&header(0, 0.001), 0.0126), 1);
        for step in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(column_stride(&header(1, step), 0.0126), 1);
        }
        assert_eq!(column_stride(&header(1, 1e-30), 0.0126), MAX_STRIDE);
    }

    #[test]
    fn a_cluster_too_small_for_the_stride_is_read_in_a_finer_one() {
        assert_eq!(served_stride(&columns(&[4, 8, 12, 16, 20]), 4), 4);
        assert_eq!(served_stride(&columns(&[4, 8, 12, 16, 18]), 4), 2);
        assert_eq!(served_stride(&columns(&[4, 5, 6, 7, 8]), 4), 1);
        assert_eq!(served_stride(&columns(&[7, 7, 7, 7, 7]), 4), 4);
        assert_eq!(served_stride(&columns(&[7, 7, 7]), 4), 1);
    }
}
