use lidar::ObstacleClass;
use messages::{Detections, Part};

use crate::top::view::{DetectionRow, DetectionsView};

/// The latest sweep's obstacles, part by part.
#[derive(Default)]
pub(super) struct Collector {
    open: Vec<(u32, DetectionRow)>,
    /// The sweep of `open`, and the sector that comes next.
    next: Option<(u64, u32)>,
    view: DetectionsView,
}

impl Collector {
    /// Adds a part; `whole` says that every part of its sweep up to it was seen.
    pub(super) fn add(&mut self, part: &Part, message: &Detections, whole: bool) {
        if self.next.is_none_or(|(sweep, _)| sweep != part.sweep) {
            self.open.clear();
        }
        self.next = Some((part.sweep, part.sector + 1));
        for detection in message.detections.iter() {
            let solid = detection.solid_place().and_then(|place| message.solids.get(place));
            let row = DetectionRow {
                cluster: 0,
                class: detection.class.name(),
                p: detection.class.solid_index().and_then(|place| detection.posterior.get(place).copied()),
                range_m: detection.summary.range_m(),
                size_m: solid.map(|solid| solid.size_m),
                points: detection.summary.points,
            };
            self.open.push((detection.summary.key, row));
        }
        if part.is_last() {
            self.end(part.sweep, whole);
            self.next = None;
        }
    }

    fn end(&mut self, sweep: u64, complete: bool) {
        self.open.sort_unstable_by_key(|(key, _)| *key);
        for (cluster, (_, row)) in self.open.iter_mut().enumerate() {
            row.cluster = cluster;
        }
        let count = |class: ObstacleClass| self.open.iter().filter(|(_, row)| row.class == class.name()).count();
        let classes = ObstacleClass::ALL.into_iter().map(|class| (class.name(), count(class))).collect();
        let order = |row: &DetectionRow| (row.p.is_none(), row.range_m);
        self.open.sort_by(|(_, a), (_, b)| order(a).0.cmp(&order(b).0).then(a.range_m.total_cmp(&b.range_m)));
        let rows = self.open.drain(..).map(|(_, row)| row).take(DetectionsView::MAX_ROWS).collect();
        self.view = DetectionsView { sweep: Some(sweep), complete, classes, rows };
    }

    pub(super) fn view(&self) -> DetectionsView {
        self.view.clone()
    }
}
