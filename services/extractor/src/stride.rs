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

/// A cluster's returns parted by column modulo a stride: each phase is the cluster as a sensor with `stride` times fewer
/// columns would see it. Memory is taken once, in [`Phases::new`].
#[derive(Debug)]
pub struct Phases {
    phases: usize,
    /// First place of each phase, and the end of the last.
    first: [usize; MAX_STRIDE + 1],
    points: Vec<[f32; 3]>,
    rings: Vec<u8>,
}

impl Phases {
    /// Room for clusters of up to `capacity` returns.
    pub fn new(capacity: usize) -> Self {
        Self { phases: 0, first: [0; MAX_STRIDE + 1], points: vec![[0.0; 3]; capacity], rings: vec![0; capacity] }
    }

    /// Parts a cluster's returns (no more than the capacity, else none are taken) in strides of `wanted` columns, 1 to 18
    /// (more are cut). Where no phase has [`MIN_FEATURE_POINTS`], the stride is lessened until one has; 1 at the least.
    pub fn part(&mut self, returns: &[Return], wanted: usize) {
        self.phases = 0;
        if returns.len() > self.points.len() {
            return;
        }
        let mut stride = wanted.clamp(1, MAX_STRIDE);
        let mut next = counts(returns, stride);
        while stride > 1 && next.iter().all(|&count| count < MIN_FEATURE_POINTS) {
            stride -= 1;
            next = counts(returns, stride);
        }
        self.phases = stride;
        let mut end = 0;
        for (first, next) in self.first.iter_mut().zip(&mut next) {
            *first = end;
            end += std::mem::replace(next, end);
        }
        self.first[stride] = end;
        for r in returns {
            let place = &mut next[phase(r, stride)];
            self.points[*place] = r.position();
            self.rings[*place] = r.ring;
            *place += 1;
        }
    }

    /// Points [m] and rings of each phase that has at least [`MIN_FEATURE_POINTS`], in the order of the returns.
    pub fn usable(&self) -> impl Iterator<Item = (&[[f32; 3]], &[u8])> {
        let places = self.first.windows(2).take(self.phases).map(|ends| ends[0]..ends[1]);
        let usable = places.filter(|places| places.len() >= MIN_FEATURE_POINTS);
        usable.map(|places| (&self.points[places.clone()], &self.rings[places]))
    }
}

/// Returns of each phase.
fn counts(returns: &[Return], stride: usize) -> [usize; MAX_STRIDE] {
    let mut counts = [0; MAX_STRIDE];
    for r in returns {
        counts[phase(r, stride)] += 1;
    }
    counts
}

fn phase(r: &Return, stride: usize) -> usize {
    // Narrow numbers divide fastest.
    usize::from(r.column % stride as u16)
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

    fn served_stride(returns: &[Return], wanted: usize) -> usize {
        let mut phases = Phases::new(returns.len());
        phases.part(returns, wanted);
        phases.phases
    }

    #[test]
    fn phases_keep_the_order_of_the_returns_and_leave_out_those_of_too_few() {
        let mut returns = columns(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 17]);
        for (place, r) in returns.iter_mut().enumerate() {
            (r.x, r.ring) = (place as f32, place as u8 / 2);
        }
        let mut phases = Phases::new(13);
        phases.part(&returns, 2);
        let found: Vec<(Vec<f32>, Vec<u8>)> =
            phases.usable().map(|(points, rings)| (points.iter().map(|p| p[0]).collect(), rings.to_vec())).collect();
        let even = (vec![0.0, 2.0, 4.0, 6.0, 8.0, 9.0, 10.0, 11.0], vec![0, 1, 2, 3, 4, 4, 5, 5]);
        assert_eq!(found, [even, (vec![1.0, 3.0, 5.0, 7.0, 12.0], vec![0, 1, 2, 3, 6])]);
        phases.part(&returns, 3);
        // Phases 0 and 1 have four.
        assert_eq!(phases.usable().map(|(points, _)| points.len()).collect::<Vec<_>>(), [5]);
        phases.part(&columns(&[0; 14]), 1);
        assert_eq!(phases.usable().count(), 0, "more than there is room for");
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
