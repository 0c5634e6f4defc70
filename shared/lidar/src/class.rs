use serde::{Deserialize, Serialize};
use zerocopy::{FromZeros, Immutable, IntoBytes, KnownLayout};

/// What an obstacle is taken for: the four solids of the paper (Sec. III-A), or none of them.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    FromZeros,
    IntoBytes,
    Immutable,
    KnownLayout,
)]
#[repr(u8)]
#[serde(rename_all = "lowercase")]
pub enum ObstacleClass {
    /// Too few returns to extract features, or a verdict withheld.
    #[default]
    Unclassified = 0,
    /// Box.
    Rectangular = 1,
    /// Ellipsoid.
    Ellipsoidal = 2,
    /// Circular cylinder.
    Cylindrical = 3,
    /// Circular cone.
    Conical = 4,
}

impl ObstacleClass {
    /// The four solids, in the paper's order: the order of every posterior.
    pub const SOLIDS: [Self; 4] = [Self::Rectangular, Self::Ellipsoidal, Self::Cylindrical, Self::Conical];

    /// All classes in the order of reports: the solids, then `Unclassified`.
    pub const ALL: [Self; 5] =
        [Self::Rectangular, Self::Ellipsoidal, Self::Cylindrical, Self::Conical, Self::Unclassified];

    /// The class's word in files and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unclassified => "unclassified",
            Self::Rectangular => "rectangular",
            Self::Ellipsoidal => "ellipsoidal",
            Self::Cylindrical => "cylindrical",
            Self::Conical => "conical",
        }
    }

    /// Place in [`ObstacleClass::SOLIDS`] and so in a posterior; none for `Unclassified`.
    pub const fn solid_index(self) -> Option<usize> {
        match self {
            Self::Unclassified => None,
            solid => Some(solid as usize - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solid_stands_at_its_own_index() {
        for (index, class) in ObstacleClass::SOLIDS.into_iter().enumerate() {
            assert_eq!(class.solid_index(), Some(index));
        }
        assert_eq!(ObstacleClass::Unclassified.solid_index(), None);
    }
}
