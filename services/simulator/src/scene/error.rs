use lidar::{MAX_COLUMNS, MAX_RETURNS};
use messages::MAX_TRUTH_OBJECTS;

use crate::mesh::MeshError;

/// Why a scene is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A number out of its range.
    #[error("{key} is {value}, must be {expected}")]
    Number {
        /// The key, with its table: `field[0].ring_m[1]`.
        key: String,
        /// Its value.
        value: f64,
        /// What it must be.
        expected: String,
    },
    /// The scene names another sensor than the one given.
    #[error("sensor is {named}, must be the sensor in use: {given}")]
    Sensor {
        /// The scene's.
        named: String,
        /// The one given.
        given: String,
    },
    /// A turn does not fit a message.
    #[error(
        "rotation_hz gives {columns} columns of {rings} rings, must be 1 to {MAX_COLUMNS} and {MAX_RETURNS} firings"
    )]
    Capacity {
        /// Columns of a turn.
        columns: usize,
        /// Rings of the sensor.
        rings: usize,
    },
    /// More obstacles than a truth can hold.
    #[error("obstacle, field and mesh make {0} obstacles, must be at most {MAX_TRUTH_OBJECTS}")]
    Obstacles(usize),
    /// An attitude is given twice, or not at all, or is no rotation.
    #[error("{table} gives {found}, must give one of attitude_wxyz (not all zero) and attitude_deg")]
    Attitude {
        /// The table: `obstacle[0]`.
        table: String,
        /// What it gives.
        found: &'static str,
    },
    /// A field has no shapes to choose from.
    #[error("{0}.shapes is empty, must name at least one of box, ellipsoid, cylinder, cone")]
    Shapes(String),
    /// A field does not find room for its obstacles: fewer, smaller, or more room.
    #[error("{table}.count is {count}, must be at most about {placed}: no room for more at this spacing_m and clear_m")]
    Crowded {
        /// The table.
        table: String,
        /// Obstacles asked for.
        count: usize,
        /// Obstacles that found room.
        placed: usize,
    },
    /// The text of a mesh was not handed over.
    #[error("{table}.path is {path}, must be one of the files given")]
    MeshMissing {
        /// The table.
        table: String,
        /// The path, as in the scene.
        path: String,
    },
    /// A mesh file is no mesh.
    #[error("{table}.path: {path} {cause}")]
    Mesh {
        /// The table.
        table: String,
        /// The path, as in the scene.
        path: String,
        /// What is wrong.
        cause: MeshError,
    },
}
