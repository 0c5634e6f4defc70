//! The four solids fitted to the rays of a cluster: those that met it, and those that passed it by.
//!
//! A body is pose and size of a solid; its residuals are what the sensor would have measured on it less what it did measure
//! ([`residuals`]), ray by ray ([`sight`]) but many at once ([`wide`]). Each solid knows, in a file of its own, where a ray
//! meets it and how a ray passes it; the derivatives are the same for all ([`solid`]). [`Fitter`] looks for the best body of
//! each solid: from several starts ([`frames`], [`start`]) by Levenberg's and Marquardt's method ([`descent`]), on a budget
//! ([`budget`]); how far the truth may be off follows from ranges, outline and other minima ([`spread`], [`outline`],
//! [`bounds`]).

mod bounds;
mod budget;
mod cone;
mod cuboid;
mod cylinder;
mod descent;
mod ellipsoid;
mod fitter;
mod frames;
mod outcome;
mod outline;
mod rays;
mod residuals;
mod settings;
mod sight;
mod silhouette;
mod solid;
mod spread;
mod start;
mod system;
#[cfg(test)]
mod tests;
mod wide;

pub use fitter::Fitter;
pub use rays::Bundle;
pub(crate) use rays::Ray;
pub use settings::{Beliefs, FitParams, FitParamsError, FitSettings};
pub(crate) use solid::{Body, Kind, Meeting, UnitSolid};
