use classifier::{SOLID_FEATURES, misfit, solid_features};

use super::plan::SetPlan;
use crate::owner::owner;
use crate::paper::Files;
use crate::{Described, ObserveError, Observer, Seen, View, parallel};

/// Scenes that one job looks at.
const SCENES_OF_JOB: u64 = 25;

/// Fitted clusters of a set of scenes.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    /// Features, row after row.
    pub(super) features: Vec<f32>,
    /// True class, by its place in the four.
    pub(super) classes: Vec<u8>,
    pub(super) misfits: Vec<f32>,
    pub(super) points: Vec<u32>,
}

impl Rows {
    pub(super) fn len(&self) -> usize {
        self.classes.len()
    }

    pub(super) fn extend(&mut self, other: Self) {
        self.features.extend(other.features);
        self.classes.extend(other.classes);
        self.misfits.extend(other.misfits);
        self.points.extend(other.points);
    }

    pub(super) fn row(&self, place: usize) -> &[f32] {
        &self.features[place * SOLID_FEATURES..(place + 1) * SOLID_FEATURES]
    }

    fn add(&mut self, seen: &Seen<'_>) {
        for descriptor in &seen.descriptors.descriptors {
            let Some(fit) = descriptor.fit_place().map(|place| &seen.descriptors.fits[place]) else { continue };
            let members = &seen.descriptors.members[descriptor.summary.member_places()];
            let Some(class) = owner(members, seen.truth).and_then(|object| object.class.solid_index()) else {
                continue;
            };
            self.features.extend(solid_features(&seen.descriptors.header, &descriptor.summary, fit));
            self.classes.push(class as u8);
            self.misfits.push(misfit(fit));
            self.points.push(descriptor.summary.points);
        }
    }
}

/// Looks at the scenes of a set, seeds rising from `first_seed`. A scene too crowded for its obstacles is passed over.
pub(super) fn look_at(set: &SetPlan, first_seed: u64, read: Files<'_>) -> Result<Rows, ObserveError> {
    let view = View {
        sensor: set.sensor.clone(),
        range_sigma_m: set.range_sigma_m,
        proportion: set.proportion,
        dropout: set.dropout,
        most_points: set.most_points,
        described: Described::Solids,
        ..View::of(&set.scene)
    };
    let jobs: Vec<u64> = (0..set.scenes).step_by(SCENES_OF_JOB as usize).collect();
    let parts = parallel::map(&jobs, |&first| -> Result<Rows, ObserveError> {
        let mut observer = Observer::new(&view, &read)?;
        let mut rows = Rows::default();
        for scene in first..(first + SCENES_OF_JOB).min(set.scenes) {
            if observer.mixed(first_seed.wrapping_add(scene)).is_ok() {
                rows.add(&observer.seen());
            }
        }
        Ok(rows)
    });
    let mut rows = Rows::default();
    for part in parts {
        rows.extend(part?);
    }
    Ok(rows)
}
