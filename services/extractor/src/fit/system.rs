/// Most parameters of a body: shift and turn in its own axes, ln of its half extents.
pub(crate) const MOST: usize = 9;

/// Parameters of a solid: a round one has no turn about z and one half extent for x and y.
pub(crate) const fn parameters(round: bool) -> usize {
    if round { 7 } else { 9 }
}

/// Numbers that come with a residual: its derivatives, nothing for those that a round solid has not, and itself.
pub(crate) const COLUMNS: usize = MOST + 1;

/// The columns of one residual: derivatives, and the residual where a solid has fewer.
const WIDTH: usize = 8;

/// The sums of a [`System`] while residuals come one after another: products of a residual's numbers with the first
/// [`WIDTH`] of them at a time. In each sum the residuals are added in the order they come.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sums<const ROUND: bool> {
    pub(crate) cost: f64,
    products: [[f64; WIDTH]; COLUMNS],
    /// Of a solid that is not round: of its last derivative with itself and with the residual.
    last: [f64; 2],
}

impl<const ROUND: bool> Sums<ROUND> {
    pub(crate) const fn zero() -> Self {
        Self { cost: 0.0, products: [[0.0; WIDTH]; COLUMNS], last: [0.0; 2] }
    }

    /// Adds a residual with its derivatives: the first 7 or 9 numbers of `columns`, and the residual as the next.
    #[inline(always)]
    pub(crate) fn add(&mut self, columns: &[f64; COLUMNS]) {
        let count = parameters(ROUND);
        let residual = columns[count];
        self.cost += residual * residual;
        let mut first = [0.0; WIDTH];
        first.copy_from_slice(&columns[..WIDTH]);
        let rows = if ROUND { count } else { COLUMNS };
        for (sums, &by) in self.products.iter_mut().zip(columns).take(rows) {
            for (sum, factor) in sums.iter_mut().zip(first) {
                *sum += by * factor;
            }
        }
        if !ROUND {
            self.last[0] += columns[MOST - 1] * columns[MOST - 1];
            self.last[1] += columns[MOST - 1] * residual;
        }
    }

    /// What came together.
    #[inline(always)]
    pub(crate) fn system(&self) -> System {
        let count = parameters(ROUND);
        let mut system = System::zero();
        system.cost = self.cost;
        for i in 0..count {
            for j in 0..=i.min(WIDTH - 1) {
                system.curvature[i][j] = self.products[i][j];
            }
            system.gradient[i] = match (ROUND, i) {
                (true, _) => self.products[i][WIDTH - 1],
                (false, WIDTH) => self.last[1],
                (false, _) => self.products[MOST][i],
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
