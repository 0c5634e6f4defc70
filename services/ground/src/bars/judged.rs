//! What a classifier said of each cluster, beside what is there.

use lidar::ObstacleClass;
use messages::Detections;

use super::solid_error::SolidError;
use crate::Seen;
use crate::owner::owner;

/// One cluster: what it is, and what it was taken for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Judged {
    /// `id` of the obstacle that most of its returns lie on.
    pub(crate) object: u16,
    /// What that is.
    pub(crate) actual: ObstacleClass,
    pub(crate) points: u32,
    pub(crate) rings: u32,
    /// Whether solids were fitted to it.
    pub(crate) fitted: bool,
    pub(crate) verdict: ObstacleClass,
    /// All 0 where the verdict is withheld.
    pub(crate) posterior: [f64; 4],
    /// How far the solid of the detection is off; none where the detection has none.
    pub(crate) solid: Option<SolidError>,
}

impl Judged {
    pub(crate) fn is_right(&self) -> bool {
        self.verdict == self.actual
    }

    /// The greatest posterior; 0 where the verdict is withheld.
    pub(crate) fn confidence(&self) -> f64 {
        self.posterior.iter().copied().fold(0.0, f64::max)
    }
}

/// The clusters whose owner is one of the four solids, in order of their keys.
pub(crate) fn judged(seen: Seen<'_>, detections: &Detections) -> Vec<Judged> {
    let rows = seen.clusters.clusters.iter().zip(&seen.descriptors.descriptors).zip(&detections.detections);
    rows.filter_map(|((cluster, descriptor), detection)| {
        let object = owner(&seen.clusters.members[cluster.summary.member_places()], seen.truth)?;
        object.class.solid_index()?;
        let solid = detection.solid_place().and_then(|place| detections.solids.get(place));
        Some(Judged {
            object: object.id,
            actual: object.class,
            points: cluster.summary.points,
            rings: cluster.summary.rings,
            fitted: descriptor.fits > 0,
            verdict: detection.class,
            posterior: detection.posterior.map(f64::from),
            solid: solid.map(|solid| SolidError::of(solid, object)),
        })
    })
    .collect()
}
