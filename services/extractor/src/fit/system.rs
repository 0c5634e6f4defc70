use nalgebra::Vector3;

/// Most parameters of a body: shift and turn in its own axes, ln of its half extents.
pub(crate) const MOST: usize = 9;

/// Parameters of a solid: a round one has no turn about z and one half extent for x and y.
pub(crate) const fn parameters(round: bool) -> usize {
    if round { 7 } else { 9 }
}

/// Sum of squares and its Gauss–Newton approximation: gradient Jᵀr and curvature JᵀJ (lower triangle).
#[derive(Clone, Copy, Debug)]
pub(crate) struct System {
    pub(crate) cost: f64,
    pub(crate) gradient: [f64; MOST],
    pub(crate) curvature: [[f64; MOST]; MOST],
}

impl System {
    pub(crate) const fn zero() -> Self {
        Self { cost: 0.0, gradient: [0.0; MOST], curvature: [[0.0; MOST]; MOST] }
    }

    /// Adds a residual whose derivative is `factor` times the way outward along `normal` of the surface's point.
    #[inline(always)]
    pub(crate) fn add(&mut self, round: bool, residual: f64, factor: f64, normal: &Vector3<f64>, point: &Vector3<f64>) {
        let row = row(round, factor, normal, point);
        self.cost += residual * residual;
        let count = parameters(round);
        for i in 0..count {
            self.gradient[i] += row[i] * residual;
            for j in 0..=i {
                self.curvature[i][j] += row[i] * row[j];
            }
        }
    }

    /// Adds a residual that depends on the sizes alone: the `count` parameters from `first` on.
    pub(crate) fn add_sizes(&mut self, first: usize, count: usize, residual: f64, row: &[f64; 3]) {
        self.cost += residual * residual;
        for i in 0..count {
            self.gradient[first + i] += row[i] * residual;
            for j in 0..=i {
                self.curvature[first + i][first + j] += row[i] * row[j];
            }
        }
    }

    /// Solves (JᵀJ + λ diag(JᵀJ) + 10⁻³) x = Jᵀr by Cholesky's decomposition; none where that fails.
    pub(crate) fn step(&self, round: bool, damping: f64) -> Option<[f64; MOST]> {
        let count = parameters(round);
        let mut factor = self.curvature;
        for (i, row) in factor.iter_mut().enumerate().take(count) {
            row[i] += row[i] * damping + 1e-3;
        }
        decompose(&mut factor, count)?;
        let mut x = self.gradient;
        solve(&factor, count, &mut x);
        Some(x)
    }
}

#[inline(always)]
fn row(round: bool, factor: f64, normal: &Vector3<f64>, point: &Vector3<f64>) -> [f64; MOST] {
    let n = normal * factor;
    let turn = point.cross(&n);
    let grow = n.component_mul(point);
    if round {
        [n.x, n.y, n.z, turn.x, turn.y, grow.x + grow.y, grow.z, 0.0, 0.0]
    } else {
        [n.x, n.y, n.z, turn.x, turn.y, turn.z, grow.x, grow.y, grow.z]
    }
}

/// Cholesky's decomposition in place (lower triangle) of the first `count` rows; none where not positive definite.
pub(crate) fn decompose(matrix: &mut [[f64; MOST]; MOST], count: usize) -> Option<()> {
    for i in 0..count {
        for j in 0..=i {
            let products = matrix[i][..j].iter().zip(&matrix[j][..j]).map(|(a, b)| a * b);
            let rest = products.fold(matrix[i][j], |rest, product| rest - product);
            matrix[i][j] = if j < i {
                rest / matrix[j][j]
            } else if rest > 0.0 {
                rest.sqrt()
            } else {
                return None;
            };
        }
    }
    Some(())
}

/// Solves L Lᵀ x = b for the factor L of [`decompose`]; `x` is b before and x after.
pub(crate) fn solve(factor: &[[f64; MOST]; MOST], count: usize, x: &mut [f64; MOST]) {
    for i in 0..count {
        for j in 0..i {
            x[i] -= factor[i][j] * x[j];
        }
        x[i] /= factor[i][i];
    }
    for i in (0..count).rev() {
        for j in i + 1..count {
            x[i] -= factor[j][i] * x[j];
        }
        x[i] /= factor[i][i];
    }
}
