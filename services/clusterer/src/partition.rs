use lidar::MAX_RETURNS;
use messages::Sweep;

use crate::params::{Checked, Method};
use crate::scan::{Premises, ScanWindow};
use crate::sets::Sets;
use crate::tree::Tree;

/// Partitions returns into the connected components of "at most d apart", by whichever method serves.
pub(crate) struct Partition {
    method: Method,
    scan: ScanWindow,
    tree: Tree,
    sets: Sets,
}

impl Partition {
    pub(crate) fn new(params: &Checked) -> Self {
        Self {
            method: params.method,
            scan: ScanWindow::new(params.range_d_m),
            tree: Tree::new(params.range_d_m),
            sets: Sets::with_capacity(MAX_RETURNS),
        }
    }

    /// For each return the place of the first return of its component.
    pub(crate) fn roots(&mut self, sweep: &Sweep) -> &[u32] {
        let scanned = match self.method {
            Method::Auto => self.scan.partition(sweep, Premises::Regular, &mut self.sets),
            Method::Scan => self.scan.partition(sweep, Premises::Exact, &mut self.sets),
            Method::Kdtree => false,
        };
        if !scanned {
            self.tree.partition(sweep, &mut self.sets);
        }
        self.sets.roots()
    }
}
