/// "None" where places are kept as numbers.
pub(crate) const NONE: u32 = u32::MAX;

/// A pairing that is possible, and what it costs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Edge {
    /// Place of what is assigned to.
    pub(crate) column: u32,
    /// Cost; finite.
    pub(crate) cost: f64,
}

/// Sparse linear assignment by shortest augmenting paths (Jonker and Volgenant 1987): each row to one column at most,
/// each column to one row, least sum of costs, where a row that stays alone costs `alone`.
///
/// All memory is taken at once; a path explores only what it can reach, so that obstacles far apart cost nothing.
#[derive(Debug)]
pub(crate) struct Assignment {
    rows: Vec<u32>,
    columns: Vec<u32>,
    row_price: Vec<f64>,
    column_price: Vec<f64>,
    /// Cheapest way to a column on the present search, and the row before it.
    way: Vec<f64>,
    before: Vec<u32>,
    scanned: Vec<bool>,
    /// Columns that the present search has reached.
    reached: Vec<u32>,
}

/// Where a search ends.
enum End {
    /// The row stays, or is left, alone.
    Alone(u32),
    /// A column that nobody had.
    Free(u32),
}

impl Assignment {
    /// For at most so many rows and columns.
    pub(crate) fn new(rows: usize, columns: usize) -> Self {
        Self {
            rows: Vec::with_capacity(rows),
            columns: Vec::with_capacity(columns),
            row_price: Vec::with_capacity(rows),
            column_price: Vec::with_capacity(columns),
            way: Vec::with_capacity(columns),
            before: Vec::with_capacity(columns),
            scanned: Vec::with_capacity(columns),
            reached: Vec::with_capacity(columns),
        }
    }

    /// Solves for rows whose edges are given by `edges`, among `columns` columns. Gives the column of each row, or
    /// [`NONE`]. No more rows and columns than were asked for at the start; a column is named once by a row at most.
    pub(crate) fn solve<'a>(
        &mut self,
        rows: usize,
        columns: usize,
        alone: f64,
        edges: impl Fn(u32) -> &'a [Edge],
    ) -> &[u32] {
        self.rows.clear();
        self.rows.resize(rows, NONE);
        self.row_price.clear();
        self.row_price.resize(rows, 0.0);
        self.columns.clear();
        self.columns.resize(columns, NONE);
        self.column_price.clear();
        self.column_price.resize(columns, 0.0);
        self.way.clear();
        self.way.resize(columns, f64::INFINITY);
        self.before.clear();
        self.before.resize(columns, NONE);
        self.scanned.clear();
        self.scanned.resize(columns, false);
        for row in 0..rows as u32 {
            self.add(row, alone, &edges);
        }
        &self.rows
    }

    /// Assigns one more row: the assignment stays the cheapest of those rows that have had their turn.
    fn add<'a>(&mut self, first: u32, alone: f64, edges: &impl Fn(u32) -> &'a [Edge]) {
        self.reached.clear();
        let (mut row, mut so_far) = (first, 0.0);
        let mut staying = (f64::INFINITY, first);
        let (length, end) = loop {
            let spare = so_far - self.row_price[row as usize];
            for edge in edges(row) {
                let column = edge.column as usize;
                let length = spare + edge.cost - self.column_price[column];
                if !self.scanned[column] && length < self.way[column] {
                    if self.way[column] == f64::INFINITY {
                        self.reached.push(edge.column);
                    }
                    self.way[column] = length;
                    self.before[column] = row;
                }
            }
            if spare + alone < staying.0 {
                staying = (spare + alone, row);
            }
            let open = self.reached.iter().copied().filter(|&column| !self.scanned[column as usize]);
            let nearest = open.min_by(|&a, &b| self.way[a as usize].total_cmp(&self.way[b as usize]));
            match nearest {
                Some(column) if self.way[column as usize] < staying.0 => {
                    so_far = self.way[column as usize];
                    if self.columns[column as usize] == NONE {
                        break (so_far, End::Free(column));
                    }
                    self.scanned[column as usize] = true;
                    row = self.columns[column as usize];
                }
                _ => break (staying.0, End::Alone(staying.1)),
            }
        };
        self.reprice(first, length);
        self.augment(first, end);
        for &column in &self.reached {
            self.way[column as usize] = f64::INFINITY;
            self.scanned[column as usize] = false;
        }
    }

    /// Keeps every reduced cost from falling below 0.
    fn reprice(&mut self, first: u32, length: f64) {
        self.row_price[first as usize] += length;
        for &column in &self.reached {
            let column = column as usize;
            if self.scanned[column] {
                let gain = length - self.way[column];
                self.column_price[column] -= gain;
                self.row_price[self.columns[column] as usize] += gain;
            }
        }
    }

    /// Gives each row on the path the column that was found for it.
    fn augment(&mut self, first: u32, end: End) {
        let mut column = match end {
            End::Free(column) => column,
            End::Alone(row) if row == first => return,
            End::Alone(row) => std::mem::replace(&mut self.rows[row as usize], NONE),
        };
        loop {
            let row = self.before[column as usize];
            self.columns[column as usize] = row;
            let left = std::mem::replace(&mut self.rows[row as usize], column);
            if row == first {
                return;
            }
            column = left;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const ALONE: f64 = 16.0;

    fn cost(rows: &[Vec<Edge>], assigned: &[u32]) -> f64 {
        let of = |(row, &column): (usize, &u32)| match column {
            NONE => ALONE,
            column => rows[row].iter().find(|edge| edge.column == column).unwrap().cost,
        };
        assigned.iter().enumerate().map(of).sum()
    }

    /// The least cost of any assignment of the rows from `row` on.
    fn brute(rows: &[Vec<Edge>], row: usize, taken: &mut Vec<bool>) -> f64 {
        let Some(edges) = rows.get(row) else { return 0.0 };
        let mut least = ALONE + brute(rows, row + 1, taken);
        for edge in edges {
            if !std::mem::replace(&mut taken[edge.column as usize], true) {
                least = least.min(edge.cost + brute(rows, row + 1, taken));
                taken[edge.column as usize] = false;
            }
        }
        least
    }

    fn random_rows(random: &mut ChaCha8Rng, rows: usize, columns: usize, share: f64, negative: bool) -> Vec<Vec<Edge>> {
        let mut row = || {
            let all = 0..columns as u32;
            let kept: Vec<u32> = all.filter(|_| random.random_bool(share)).collect();
            let lowest = if negative { -20.0 } else { 0.0 };
            kept.into_iter().map(|column| Edge { column, cost: random.random_range(lowest..20.0) }).collect()
        };
        (0..rows).map(|_| row()).collect()
    }

    // verifies TRA-006
    #[test]
    fn no_assignment_is_cheaper_than_the_one_found() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut sut = Assignment::new(8, 8);
        for round in 0..3_000 {
            let (rows, columns) = (round % 7, round / 7 % 8);
            let rows = random_rows(&mut random, rows, columns, [0.3, 0.7, 1.0][round % 3], round % 2 == 0);
            let found = sut.solve(rows.len(), columns, ALONE, |row| &rows[row as usize]).to_vec();
            let mut columns_of: Vec<u32> = found.iter().copied().filter(|&column| column != NONE).collect();
            let count = columns_of.len();
            columns_of.sort_unstable();
            columns_of.dedup();
            assert_eq!(columns_of.len(), count, "a column was given twice");
            let least = brute(&rows, 0, &mut vec![false; columns]);
            assert!((cost(&rows, &found) - least).abs() < 1e-9, "{rows:?}: {found:?}");
        }
    }

    #[test]
    fn rows_that_can_have_nothing_stay_alone() {
        let mut sut = Assignment::new(3, 2);
        let far = [Edge { column: 0, cost: ALONE + 1.0 }];
        let none: [Edge; 0] = [];
        let found = sut.solve(3, 2, ALONE, |row| if row == 1 { &far[..] } else { &none[..] });
        assert_eq!(found, [NONE; 3]);
        assert!(sut.solve(0, 0, ALONE, |_| &none[..]).is_empty());
    }
}
