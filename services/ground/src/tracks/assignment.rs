//! The cheapest assignment of rows to columns (Kuhn 1955, Munkres 1957), by shortest augmenting paths (Jonker and
//! Volgenant 1987).

/// The pairing of least total cost of all rows, or of all columns where these are fewer; in order of rows. `cost` is row
/// by row and finite.
pub(crate) fn assign(cost: &[f64], rows: usize, columns: usize) -> Vec<(usize, usize)> {
    if rows > columns {
        let turned: Vec<f64> = (0..columns * rows).map(|place| cost[place % rows * columns + place / rows]).collect();
        let mut pairs: Vec<_> = assign(&turned, columns, rows).into_iter().map(|(a, b)| (b, a)).collect();
        pairs.sort_unstable();
        return pairs;
    }
    // Place 0 of each list stands for "none".
    let (mut row_price, mut column_price) = (vec![0.0; rows + 1], vec![0.0; columns + 1]);
    let mut row_of = vec![0; columns + 1];
    for row in 1..=rows {
        let (mut least, mut before) = (vec![f64::INFINITY; columns + 1], vec![0; columns + 1]);
        let mut done = vec![false; columns + 1];
        row_of[0] = row;
        let mut column = 0;
        while row_of[column] != 0 {
            done[column] = true;
            let (from, mut step, mut next) = (row_of[column], f64::INFINITY, 0);
            for to in 1..=columns {
                if done[to] {
                    continue;
                }
                let reduced = cost[(from - 1) * columns + to - 1] - row_price[from] - column_price[to];
                if reduced < least[to] {
                    (least[to], before[to]) = (reduced, column);
                }
                if least[to] < step {
                    (step, next) = (least[to], to);
                }
            }
            for to in 0..=columns {
                if done[to] {
                    row_price[row_of[to]] += step;
                    column_price[to] -= step;
                } else {
                    least[to] -= step;
                }
            }
            column = next;
        }
        while column != 0 {
            row_of[column] = row_of[before[column]];
            column = before[column];
        }
    }
    let mut pairs: Vec<_> = (1..=columns).filter(|&to| row_of[to] != 0).map(|to| (row_of[to] - 1, to - 1)).collect();
    pairs.sort_unstable();
    pairs
}

/// As many pairs within `limit` as there can be, and of these pairings that of least total distance; in order of rows.
/// `distance` is row by row and not negative.
pub(crate) fn assign_within(distance: &[f64], rows: usize, columns: usize, limit: f64) -> Vec<(usize, usize)> {
    // One pair out of reach costs more than all that are within.
    let beyond = (limit + 1.0) * (rows.min(columns) + 1) as f64;
    let cost: Vec<f64> = distance.iter().map(|&one| if one <= limit { one } else { beyond }).collect();
    let mut pairs = assign(&cost, rows, columns);
    pairs.retain(|&(row, column)| distance[row * columns + column] <= limit);
    pairs
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Every pairing, one by one: most pairs, then least cost.
    fn best(distance: &[f64], columns: usize, limit: f64, row: usize, taken: u32) -> (usize, f64) {
        if row * columns >= distance.len() {
            return (0, 0.0);
        }
        let mut found = best(distance, columns, limit, row + 1, taken);
        for column in (0..columns).filter(|column| taken & 1 << column == 0) {
            let one = distance[row * columns + column];
            if one <= limit {
                let (pairs, sum) = best(distance, columns, limit, row + 1, taken | 1 << column);
                if pairs + 1 > found.0 || pairs + 1 == found.0 && sum + one < found.1 {
                    found = (pairs + 1, sum + one);
                }
            }
        }
        found
    }

    #[test]
    fn no_other_assignment_has_more_pairs_or_less_distance() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for case in 0..600 {
            let (rows, columns) = (random.random_range(0..6), random.random_range(0..6));
            let distance: Vec<f64> = (0..rows * columns).map(|_| random.random_range(0.0..3.0)).collect();
            let limit = if case % 3 == 0 { 9.0 } else { 1.5 };
            let found = assign_within(&distance, rows, columns, limit);
            let sum: f64 = found.iter().map(|(row, column)| distance[row * columns + column]).sum();
            let (pairs, least) = best(&distance, columns, limit, 0, 0);
            assert_eq!(found.len(), pairs, "{rows} x {columns}: {distance:?}");
            assert!((sum - least).abs() < 1e-9, "{rows} x {columns}: {distance:?}");
            assert!(found.windows(2).all(|two| two[0].0 < two[1].0));
        }
    }
}
