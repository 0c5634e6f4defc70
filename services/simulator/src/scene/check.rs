use std::fmt;

use nalgebra::Vector3;

use super::SceneError;

/// A table of a scene file, to name its keys: `obstacle[2]`; empty for the scene itself.
#[derive(Clone, Copy)]
pub(crate) struct Table {
    pub(crate) name: &'static str,
    pub(crate) index: usize,
}

impl Table {
    /// The scene's own keys.
    pub(crate) const SCENE: Self = Self { name: "", index: 0 };

    /// `value`, if it `holds`.
    pub(crate) fn number(
        self,
        key: &str,
        value: f64,
        holds: bool,
        expected: impl fmt::Display,
    ) -> Result<f64, SceneError> {
        match holds {
            true => Ok(value),
            false => Err(SceneError::Number { key: self.key(key), value, expected: expected.to_string() }),
        }
    }

    /// `value`, if it lies within `bounds`.
    pub(crate) fn within(self, key: &str, value: f64, bounds: Bounds) -> Result<f64, SceneError> {
        self.number(key, value, bounds.hold(value), bounds)
    }

    /// A range [first, second] within bounds, its first not above its second.
    pub(crate) fn range(self, key: &str, [first, second]: [f64; 2], bounds: Bounds) -> Result<[f64; 2], SceneError> {
        self.within(&format!("{key}[0]"), first, bounds)?;
        self.within(&format!("{key}[1]"), second, bounds)?;
        self.number(&format!("{key}[1]"), second, first <= second, format_args!("at least {first}, its first value"))?;
        Ok([first, second])
    }

    /// A vector with each component within bounds.
    pub(crate) fn vector(self, key: &str, vector: [f64; 3], bounds: Bounds) -> Result<Vector3<f64>, SceneError> {
        for (index, &value) in vector.iter().enumerate() {
            self.within(&format!("{key}[{index}]"), value, bounds)?;
        }
        Ok(Vector3::from(vector))
    }

    fn key(self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{self}.{key}") }
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}[{}]", self.name, self.index)
    }
}

/// What a number must lie within. NaN lies within nothing.
#[derive(Clone, Copy)]
pub(crate) enum Bounds {
    /// Both ends count.
    Closed(f64, f64),
    /// The first end does not count.
    Above(f64, f64),
}

impl Bounds {
    fn hold(self, value: f64) -> bool {
        match self {
            Self::Closed(low, high) => (low..=high).contains(&value),
            Self::Above(low, high) => value > low && value <= high,
        }
    }
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Closed(low, high) => write!(f, "within [{low}, {high}]"),
            Self::Above(low, high) => write!(f, "within ({low}, {high}]"),
        }
    }
}
