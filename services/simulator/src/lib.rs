//! Simulated lidar sweeps: a scene and a sensor model → [`messages::Sweep`] and its [`messages::Truth`].
//!
//! A pure room: no file, clock or thread. The caller reads scene, sensor and meshes and hands over their text.
//! Frame: the sensor's, x forward (azimuth 0), y left, z up; metres, seconds, radians.
//!
//! ```
//! use messages::{Sweep, Truth};
//! use simulator::{SceneFile, Simulator};
//! use zerocopy::FromZeros;
//!
//! let sensor: lidar::SensorFile = toml::from_str(include_str!("../../../config/sensors/hdl-32e-paper.toml"))?;
//! let scene: SceneFile = toml::from_str(include_str!("../../../config/scenes/reference.toml"))?;
//! let scene = scene.checked(&sensor.checked()?, &Default::default())?;
//! let mut simulator = Simulator::new(scene);
//! let (mut sweep, mut truth) = (Sweep::new_box_zeroed().unwrap(), Truth::new_box_zeroed().unwrap());
//! simulator.sweep(7, &mut sweep, &mut truth);
//! assert_eq!(sweep.columns.len(), 500);
//! assert_eq!(sweep.returns.len(), truth.owners.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cast;
mod ego;
mod field;
mod mesh;
mod obstacle;
mod receiver;
mod scene;
mod simulator;
mod solids;
mod turn;
mod window;

pub use ego::Ego;
pub use field::{Field, FieldFile};
pub use mesh::{Mesh, MeshError};
pub use obstacle::{Body, Motion, Obstacle, Pose, Shape};
pub use scene::{EgoFile, MeshFile, ObstacleFile, Scene, SceneError, SceneFile};
pub use simulator::Simulator;
