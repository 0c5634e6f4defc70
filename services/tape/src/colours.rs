//! One colour a class, the same wherever obstacles are shown.
//!
//! From the palette of Okabe and Ito (Color Universal Design, 2008), those that are bright enough for a dark ground, and
//! a light grey. Seen without one of the three kinds of cones (model of Machado et al. 2009, full severity), the nearest
//! two are still 16 apart in CIELAB (sky blue and bluish green, tritanopia; 18 and more otherwise). Magenta is none of
//! theirs: of the colours looked at it stands out most among them, and is 16 and more from each of them for all eyes.

use lidar::ObstacleClass;

/// Sky blue: boxes. Red, green, blue, 0 to 255.
pub const RECTANGULAR: [u8; 3] = [86, 180, 233];
/// Orange: ellipsoids.
pub const ELLIPSOIDAL: [u8; 3] = [230, 159, 0];
/// Bluish green: cylinders.
pub const CYLINDRICAL: [u8; 3] = [0, 158, 115];
/// Vermilion: cones.
pub const CONICAL: [u8; 3] = [213, 94, 0];
/// Grey: no class.
pub const UNCLASSIFIED: [u8; 3] = [190, 190, 190];
/// Magenta: likelier to be met than allowed, whatever its class. What it says is said by a word, too.
pub const ALERT: [u8; 3] = [255, 0, 255];

/// The colour of a class: red, green, blue, 0 to 255.
pub const fn colour(class: ObstacleClass) -> [u8; 3] {
    match class {
        ObstacleClass::Rectangular => RECTANGULAR,
        ObstacleClass::Ellipsoidal => ELLIPSOIDAL,
        ObstacleClass::Cylindrical => CYLINDRICAL,
        ObstacleClass::Conical => CONICAL,
        ObstacleClass::Unclassified => UNCLASSIFIED,
    }
}
