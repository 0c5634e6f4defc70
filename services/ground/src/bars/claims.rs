//! What the chain claims where no truth is known.

use lidar::ObstacleClass;
use messages::MIN_FEATURE_POINTS;
use stage::{Next, Source};

use super::EvaluateError;
use super::share::Share;
use super::tally::CONFIDENT;
use super::witness::{Judges, Witness};
use crate::{Files, View};

/// Verdicts on a recording. Counts are of clusters of at least 5 points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Claims {
    /// Sweeps of the recording.
    pub sweeps: u64,
    /// Clusters of fewer points, left out of all else.
    pub small: u64,
    /// By class: the four solids, then unclassified.
    pub by_class: [u32; 5],
    /// With fitted solids.
    pub fitted: Share,
    /// With a posterior of at least 0.9.
    pub confident: Share,
    /// Left unclassified.
    pub unclassified: Share,
}

impl Claims {
    /// Judges the source's sweeps to its end, at most `sweeps` of them. `scene` only lends its stages.
    ///
    /// # Errors
    /// A source that fails, or a classifier that rejects.
    pub fn of(
        source: &mut impl Source,
        sweeps: u64,
        scene: &str,
        read: Files<'_>,
        judges: Judges<'_>,
    ) -> Result<Self, EvaluateError> {
        let mut witness = Witness::new(&View::of(scene), read, judges)?;
        let mut claims = Self::default();
        while claims.sweeps < sweeps {
            let next = witness.observer.look(|sweep, truth| source.next(sweep, truth));
            if next.map_err(|cause| EvaluateError::Recording(cause.to_string()))? == Next::End {
                break;
            }
            claims.sweeps += 1;
            let descriptors = witness.observer.seen().descriptors;
            let detections = witness.bench.detect(descriptors)?;
            for (descriptor, detection) in descriptors.descriptors.iter().zip(&detections.detections) {
                if (detection.summary.points as usize) < MIN_FEATURE_POINTS {
                    claims.small += 1;
                    continue;
                }
                let most = detection.posterior.iter().copied().fold(0.0, f32::max);
                claims.by_class[detection.class.solid_index().unwrap_or(4)] += 1;
                claims.fitted.add(descriptor.fits > 0);
                claims.confident.add(f64::from(most) >= CONFIDENT);
                claims.unclassified.add(detection.class == ObstacleClass::Unclassified);
            }
        }
        Ok(claims)
    }
}
