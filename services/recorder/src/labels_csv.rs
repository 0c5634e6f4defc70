//! Sweep → CSV rows `sweep,return,cluster`.
//!
//! A whole sweep has a row for every recorded return from 0, −1 for those that belong to no cluster: the refused ones.
//! Where sectors are missing, or members and returns do not agree, that cannot be said of the others; then only the
//! returns of known clusters have rows, in order of return.

use crate::assemble::SweepRows;

/// First line of the file.
pub(crate) const HEADER: &[u8] = b"sweep,return,cluster\n";

const REFUSED: i64 = -1;

/// Makes the rows of one sweep after another in the same memory.
#[derive(Default)]
pub(crate) struct Labels {
    /// Cluster of each recorded return.
    cluster: Vec<i64>,
    /// Return and cluster, where not all returns are known.
    known: Vec<(u32, u32)>,
    prefix: Vec<u8>,
}

impl Labels {
    /// Appends the sweep's rows.
    pub(crate) fn write_rows(&mut self, sweep: &SweepRows, rows: &mut Vec<u8>) {
        self.prefix.clear();
        push_decimal(&mut self.prefix, sweep.part.sweep);
        self.prefix.push(b',');
        if self.fill(sweep) {
            for (index, &cluster) in self.cluster.iter().enumerate() {
                push_row(rows, &self.prefix, index as u64, cluster);
            }
        } else {
            self.known.clear();
            self.known.extend(members(sweep).map(|(index, cluster)| (index, cluster as u32)));
            self.known.sort_unstable();
            for &(index, cluster) in &self.known {
                push_row(rows, &self.prefix, u64::from(index), i64::from(cluster));
            }
        }
    }

    /// Fills `cluster`; false unless the members are a partition of the accepted returns of a whole sweep.
    fn fill(&mut self, sweep: &SweepRows) -> bool {
        if !sweep.is_whole() || sweep.members.len() as u64 != sweep.accepted {
            return false;
        }
        self.cluster.clear();
        self.cluster.resize(sweep.recorded as usize, REFUSED);
        for (index, cluster) in members(sweep) {
            match self.cluster.get_mut(index as usize) {
                Some(free) if *free == REFUSED => *free = cluster,
                _ => return false,
            }
        }
        true
    }
}

/// Return and cluster of every member, cluster after cluster. Places were checked when the part was accepted.
fn members(sweep: &SweepRows) -> impl Iterator<Item = (u32, i64)> + '_ {
    sweep.detections.iter().enumerate().flat_map(|(cluster, detection)| {
        let members = sweep.members.get(detection.summary.member_places()).unwrap_or_default();
        members.iter().map(move |&index| (index, cluster as i64))
    })
}

fn push_row(rows: &mut Vec<u8>, prefix: &[u8], index: u64, cluster: i64) {
    rows.extend_from_slice(prefix);
    push_decimal(rows, index);
    rows.push(b',');
    if cluster < 0 {
        rows.push(b'-');
    }
    push_decimal(rows, cluster.unsigned_abs());
    rows.push(b'\n');
}

/// Appends `number` in decimal. Several times as fast as `write!`, which matters at a million rows a second.
fn push_decimal(text: &mut Vec<u8>, mut number: u64) {
    let mut digits = [0; 20]; // u64::MAX has 20
    let mut first = digits.len();
    loop {
        first -= 1;
        digits[first] = b'0' + (number % 10) as u8;
        number /= 10;
        if number == 0 {
            break;
        }
    }
    text.extend_from_slice(&digits[first..]);
}

#[cfg(test)]
mod tests {
    use messages::{ClusterSummary, Detection, Part};

    use super::*;

    fn sweep(clusters: &[&[u32]], recorded: u64) -> SweepRows {
        let mut sweep = SweepRows { part: Part { sweep: 12, ..Part::default() }, recorded, ..SweepRows::default() };
        for members in clusters {
            sweep.detections.push(Detection {
                summary: ClusterSummary {
                    key: members[0],
                    first_member: sweep.members.len() as u32,
                    points: members.len() as u32,
                    ..ClusterSummary::default()
                },
                ..Detection::default()
            });
            sweep.members.extend_from_slice(members);
        }
        sweep.accepted = sweep.members.len() as u64;
        sweep
    }

    fn rows(sweep: &SweepRows) -> String {
        let mut rows = Vec::new();
        Labels::default().write_rows(sweep, &mut rows);
        String::from_utf8(rows).unwrap()
    }

    #[test]
    fn every_recorded_return_has_a_row_and_refused_ones_minus_one() {
        assert_eq!(rows(&sweep(&[&[1, 4], &[2]], 5)), "12,0,-1\n12,1,0\n12,2,1\n12,3,-1\n12,4,0\n");
    }

    #[test]
    fn a_sweep_without_returns_has_no_rows() {
        assert_eq!(rows(&sweep(&[], 0)), "");
    }

    #[test]
    fn only_known_returns_have_rows_where_a_sector_is_missing() {
        let torn = SweepRows { missing_sectors: 1, ..sweep(&[&[1, 40], &[2]], 5) };
        assert_eq!(rows(&torn), "12,1,0\n12,2,1\n12,40,0\n");
    }

    #[test]
    fn members_that_are_no_partition_never_pass_for_a_whole_sweep() {
        assert_eq!(rows(&sweep(&[&[1], &[1]], 2)), "12,1,0\n12,1,1\n", "one return in two clusters");
        assert_eq!(rows(&sweep(&[&[7]], 2)), "12,7,0\n", "a return beyond those recorded");
        let short = SweepRows { accepted: 2, ..sweep(&[&[0]], 2) };
        assert_eq!(rows(&short), "12,0,0\n", "an accepted return in no cluster");
    }

    #[test]
    fn decimals_agree_with_the_standard_library() {
        let mut numbers = vec![0, 1, u64::MAX, u64::MAX - 1];
        for power in 1..20 {
            let ten = 10_u64.pow(power);
            numbers.extend([ten - 1, ten, ten + 1]);
        }
        for number in numbers {
            let mut text = Vec::new();
            push_decimal(&mut text, number);
            assert_eq!(String::from_utf8(text).unwrap(), number.to_string());
        }
    }
}
