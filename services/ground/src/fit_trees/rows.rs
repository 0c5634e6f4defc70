use lidar::ObstacleClass;

use super::FitTreesError;

/// Examples to fit to or to measure a loss on.
#[derive(Clone, Copy, Debug)]
pub struct LabelledRows<'a> {
    /// Row after row, as many numbers in each as there are features; NaN where one is unknown.
    pub features: &'a [f32],
    /// Of each row, its class's place in [`ObstacleClass::SOLIDS`].
    pub classes: &'a [u8],
    /// Of each row, how much it counts; 1 where nothing is given.
    pub weights: Option<&'a [f32]>,
}

const MAX_WEIGHT: f32 = 1e6;

impl LabelledRows<'_> {
    pub(super) fn check(&self, features: usize) -> Result<&Self, FitTreesError> {
        let rows = self.classes.len();
        let most = u32::MAX as usize;
        if rows > most {
            return Err(FitTreesError::Length { what: "classes", found: rows, expected: most });
        }
        let weights = self.weights.map_or(rows, <[f32]>::len);
        for (what, found, expected) in [("features", self.features.len(), rows * features), ("weights", weights, rows)]
        {
            if found != expected {
                return Err(FitTreesError::Length { what, found, expected });
            }
        }
        if let Some(row) = self.classes.iter().position(|&class| class > 3) {
            return Err(FitTreesError::Class { row, class: self.classes[row] });
        }
        let weights = self.weights.unwrap_or_default();
        if let Some(row) = weights.iter().position(|weight| !(0.0..=MAX_WEIGHT).contains(weight)) {
            return Err(FitTreesError::Weight { row, weight: weights[row] });
        }
        Ok(self)
    }

    pub(super) fn weight_of(&self, row: usize) -> f64 {
        self.weights.map_or(1.0, |weights| f64::from(weights[row]))
    }

    /// Sum of the weights.
    pub(super) fn weight(&self) -> f64 {
        (0..self.classes.len()).map(|row| self.weight_of(row)).sum()
    }

    /// Logarithm of each class's share of the weights: the scores under which constant posteriors lose least.
    pub(super) fn log_shares(&self) -> Result<[f64; 4], FitTreesError> {
        let mut weights = [0.0; 4];
        for (row, &class) in self.classes.iter().enumerate() {
            weights[usize::from(class)] += self.weight_of(row);
        }
        if let Some(class) = weights.iter().position(|&weight| weight <= 0.0) {
            return Err(FitTreesError::NoRows(ObstacleClass::SOLIDS[class]));
        }
        let all: f64 = weights.iter().sum();
        Ok(weights.map(|weight| (weight / all).ln()))
    }
}
