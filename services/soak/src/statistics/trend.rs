/// The median of the slopes of all pairs of points (P. K. Sen, J. Am. Stat. Assoc. 63, 1379, 1968): a few wild points do not
/// bend it. None of fewer than two points with different x.
pub(crate) fn theil_sen(points: &[(f64, f64)]) -> Option<f64> {
    let mut slopes = Vec::new();
    for (place, (x, y)) in points.iter().enumerate() {
        let others = points[place + 1..].iter().filter(|(other, _)| other != x);
        slopes.extend(others.map(|(other_x, other_y)| (other_y - y) / (other_x - x)));
    }
    median(slopes)
}

/// The middle value; the mean of the two in the middle of an even number. None of none.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => None,
        odd if odd % 2 == 1 => Some(values[middle]),
        _ => Some((values[middle - 1] + values[middle]) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wild_point_does_not_bend_the_line() {
        let mut points: Vec<_> = (0..20).map(|x| (f64::from(x), 5.0 + 0.5 * f64::from(x))).collect();
        points[7].1 = 1e6;
        assert!((theil_sen(&points).unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(theil_sen(&points[..1]), None);
    }

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(vec![]), None);
    }
}
