use pulp::Simd;

/// Most parameters of a body: shift and turn in its own axes, ln of its half extents.
pub(crate) const MOST: usize = 9;

/// Parameters of a solid: a round one has no turn about z and one half extent for x and y.
pub(crate) const fn parameters(round: bool) -> usize {
    if round { 7 } else { 9 }
}

/// Numbers of one residual: its derivatives, 7 or 9, and itself after them.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Row(pub(crate) [f64; 2 * WIDTH]);

impl Row {
    pub(crate) const ZERO: Self = Self([0.0; 2 * WIDTH]);
}

/// Sums that lie side by side.
const WIDTH: usize = 8;

/// The sums of a [`System`] while residuals come one after another: products of each of a row's numbers with the first
/// [`WIDTH`] of them. In each sum the residuals are added in the order they come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sums<S: Simd, const ROUND: bool> {
    simd: S,
    pub(crate) cost: f64,
    products: [Row; 5],
    /// Of a solid that is not round: of its last derivative with itself and with the residual.
    last: [f64; 2],
}

impl<S: Simd, const ROUND: bool> Sums<S, ROUND> {
    #[inline(always)]
    pub(crate) fn zero(simd: S) -> Self {
        Self { simd, cost: 0.0, products: [Row::ZERO; 5], last: [0.0; 2] }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, row: &Row) {
        let count = parameters(ROUND);
        let residual = row.0[count];
        self.cost += residual * residual;
        let (first, _) = S::as_simd_f64s(&row.0[..WIDTH]);
        // A round solid's residual is among the first numbers itself.
        let rows = if ROUND { count } else { MOST + 1 };
        let sums = self.products.iter_mut().flat_map(|pair| pair.0.chunks_exact_mut(WIDTH));
        for (sums, &by) in sums.zip(&row.0).take(rows) {
            let by = self.simd.splat_f64s(by);
            for (sum, &first) in S::as_mut_simd_f64s(sums).0.iter_mut().zip(first) {
                *sum = self.simd.add_f64s(*sum, self.simd.mul_f64s(by, first));
            }
        }
        if !ROUND {
            self.last[0] += row.0[MOST - 1] * row.0[MOST - 1];
            self.last[1] += row.0[MOST - 1] * residual;
        }
    }

    /// What came together.
    #[inline(always)]
    pub(crate) fn system(&self) -> System {
        let count = parameters(ROUND);
        let mut system = System::zero();
        system.cost = self.cost;
        let product = |i: usize, j: usize| self.products[i / 2].0[i % 2 * WIDTH + j];
        for i in 0..count {
            for j in 0..=i.min(WIDTH - 1) {
                system.curvature[i][j] = product(i, j);
            }
            system.gradient[i] = match (ROUND, i) {
                (true, _) => product(i, WIDTH - 1),
                (false, WIDTH) => self.last[1],
                (false, _) => product(MOST, i),
            };
        }
        if !ROUND {
            system.curvature[WIDTH][WIDTH] = self.last[0];
        }
        system
    }
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
        if round {
            self.step_of::<{ parameters(true) }>(damping)
        } else {
            self.step_of::<{ parameters(false) }>(damping)
        }
    }

    /// With the count of parameters known beforehand.
    #[inline(always)]
    fn step_of<const COUNT: usize>(&self, damping: f64) -> Option<[f64; MOST]> {
        let mut factor = self.curvature;
        for (i, row) in factor.iter_mut().enumerate().take(COUNT) {
            row[i] += row[i] * damping + 1e-3;
        }
        decompose(&mut factor, COUNT)?;
        let mut x = self.gradient;
        solve(&factor, COUNT, &mut x);
        Some(x)
    }
}

/// Cholesky's decomposition in place (lower triangle) of the first `count` rows; none where not positive definite.
#[inline(always)]
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
#[inline(always)]
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
