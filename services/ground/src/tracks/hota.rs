//! HOTA (J. Luiten et al., "HOTA: a higher order metric for evaluating multi-object tracking", International Journal of
//! Computer Vision 129, 2021), for points: their similarity is 1 − distance/`zero_m`, at least 0.

use std::collections::{BTreeMap, BTreeSet};

use super::assignment::assign;
use super::frame::Frame;

/// Thresholds of similarity that the measure is a mean over: 0.05 to 0.95 (Sec. 4.2).
pub const ALPHAS: usize = 19;

fn alpha(place: usize) -> f64 {
    0.05 + 0.05 * place as f64
}

/// Detection and association at one threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Level {
    both: f64,
    missed: f64,
    claimed: f64,
    /// Σ of A(c) over the matches c.
    association: f64,
    /// Σ of the similarity of matches.
    similarity: f64,
}

/// Detection and association, by threshold.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hota {
    levels: [Level; ALPHAS],
}

impl Hota {
    /// Of one scene.
    pub(crate) fn of(frames: &[Frame], zero_m: f64) -> Self {
        let similarity = |frame: &Frame| -> Vec<f64> {
            frame.distance_m.iter().map(|distance_m| (1.0 - distance_m / zero_m).max(0.0)).collect()
        };
        let ids: BTreeSet<u16> = frames.iter().flat_map(|frame| frame.actual.iter().copied()).collect();
        let tracks: BTreeSet<u64> = frames.iter().flat_map(|frame| frame.claimed.iter().copied()).collect();
        let row_of: BTreeMap<u16, usize> = ids.into_iter().zip(0..).collect();
        let column_of: BTreeMap<u64, usize> = tracks.into_iter().zip(0..).collect();
        let width = column_of.len();
        let places = |frame: &Frame| -> (Vec<usize>, Vec<usize>) {
            (frame.actual.iter().map(|id| row_of[id]).collect(), frame.claimed.iter().map(|id| column_of[id]).collect())
        };
        // Sec. 4.5: how well two agree over the whole scene, before any is matched.
        let mut together = vec![0.0; row_of.len() * width];
        let (mut objects, mut claims) = (vec![0.0; row_of.len()], vec![0.0; width]);
        for frame in frames {
            let (rows, columns) = places(frame);
            let alike = similarity(frame);
            let of_column =
                |column: usize| -> f64 { (0..rows.len()).map(|row| alike[row * columns.len() + column]).sum() };
            let by_column: Vec<f64> = (0..columns.len()).map(of_column).collect();
            for (row, &id) in rows.iter().enumerate() {
                objects[id] += 1.0;
                let own = &alike[row * columns.len()..(row + 1) * columns.len()];
                let by_row: f64 = own.iter().sum();
                for (column, &track) in columns.iter().enumerate() {
                    let either = by_row + by_column[column] - own[column];
                    if either > f64::EPSILON {
                        together[id * width + track] += own[column] / either;
                    }
                }
            }
            columns.iter().for_each(|&track| claims[track] += 1.0);
        }
        let mut sum = Self::default();
        let mut matches = vec![vec![0.0; together.len()]; ALPHAS];
        for frame in frames {
            let (rows, columns) = places(frame);
            let alike = similarity(frame);
            let score = |place: usize| {
                let (id, track) = (rows[place / columns.len()], columns[place % columns.len()]);
                let agreed = together[id * width + track];
                -agreed / (objects[id] + claims[track] - agreed) * alike[place]
            };
            let cost: Vec<f64> = (0..alike.len()).map(score).collect();
            let pairs = assign(&cost, rows.len(), columns.len());
            for (place, level) in sum.levels.iter_mut().enumerate() {
                let (mut count, least) = (0.0, alpha(place) - f64::EPSILON);
                for &(row, column) in &pairs {
                    let alike = alike[row * columns.len() + column];
                    if alike >= least {
                        count += 1.0;
                        level.similarity += alike;
                        matches[place][rows[row] * width + columns[column]] += 1.0;
                    }
                }
                level.both += count;
                level.missed += rows.len() as f64 - count;
                level.claimed += columns.len() as f64 - count;
            }
        }
        for (level, matches) in sum.levels.iter_mut().zip(&matches) {
            // Eq. (6): A(c) = TPA/(TPA + FNA + FPA), the same for all matches of an obstacle with a track.
            let each = matches.iter().enumerate().filter(|(_, both)| **both > 0.0);
            level.association = each
                .map(|(place, &both)| both * both / (objects[place / width] + claims[place % width] - both).max(1.0))
                // Nothing sums to -0.
                .fold(0.0, |sum, one| sum + one);
        }
        sum
    }

    pub(crate) fn add(&mut self, other: &Self) {
        for (level, other) in self.levels.iter_mut().zip(&other.levels) {
            level.both += other.both;
            level.missed += other.missed;
            level.claimed += other.claimed;
            level.association += other.association;
            level.similarity += other.similarity;
        }
    }

    /// Σ over thresholds of √(DetA · AssA)/19 (Eq. (7) and (8)); none where there is neither obstacle nor track.
    pub fn hota(&self) -> Option<f64> {
        self.mean(|level| (level.detection() * level.matched()).sqrt())
    }

    /// Detection accuracy, mean over thresholds: TP/(TP + FN + FP).
    pub fn detection(&self) -> Option<f64> {
        self.mean(Level::detection)
    }

    /// Association accuracy, mean over thresholds: mean of A(c) over matches.
    pub fn association(&self) -> Option<f64> {
        self.mean(Level::matched)
    }

    /// Localisation accuracy, mean over thresholds: mean similarity of matches, 1 where there is none.
    pub fn localisation(&self) -> Option<f64> {
        self.mean(|level| level.similarity.max(1e-10) / level.both.max(1e-10))
    }

    fn mean(&self, of: impl Fn(&Level) -> f64) -> Option<f64> {
        let first = &self.levels[0];
        (first.both + first.missed + first.claimed > 0.0)
            .then(|| self.levels.iter().map(of).sum::<f64>() / ALPHAS as f64)
    }
}

impl Level {
    fn detection(&self) -> f64 {
        self.both / (self.both + self.missed + self.claimed).max(1.0)
    }

    fn matched(&self) -> f64 {
        self.association / self.both.max(1.0)
    }
}
