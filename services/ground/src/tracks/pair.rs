//! Tracks beside the obstacles that they are matched to.

use std::collections::BTreeMap;

use messages::Track;

use super::clear_mot::Matches;
use super::frame::{Actual, Frame, Looked};

/// A track and the obstacle that it is matched to, in one sweep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair<'a> {
    /// Place of the sweep in its scene.
    pub(crate) sweep: usize,
    /// Sweeps since the track's number first appeared, in whatever state; 0 in that sweep.
    pub(crate) age: usize,
    pub(crate) actual: &'a Actual,
    pub(crate) track: &'a Track,
}

/// The matches of a scene, sweep after sweep.
pub(crate) fn pairs<'a>(sweeps: &'a [Looked], frames: &[Frame], matches: &[Matches]) -> Vec<Pair<'a>> {
    let born = births(sweeps);
    let mut pairs = Vec::new();
    for (sweep, ((looked, frame), matches)) in sweeps.iter().zip(frames).zip(matches).enumerate() {
        for &(row, column) in matches {
            let (id, claimed) = (frame.actual[row], frame.claimed[column]);
            let actual = looked.actual.iter().find(|actual| actual.id == id);
            let track = looked.tracks.iter().find(|track| track.id == claimed);
            if let (Some(actual), Some(track)) = (actual, track) {
                let age = sweep - born.get(&claimed).copied().unwrap_or(sweep);
                pairs.push(Pair { sweep, age, actual, track });
            }
        }
    }
    pairs
}

/// The sweep in which each number first appeared.
fn births(sweeps: &[Looked]) -> BTreeMap<u64, usize> {
    let mut born = BTreeMap::new();
    for (sweep, looked) in sweeps.iter().enumerate() {
        for track in &looked.tracks {
            born.entry(track.id).or_insert(sweep);
        }
    }
    born
}
