//! Angular velocity of a tumbling obstacle, from the attitudes that its fits give sweep after sweep.
//!
//! An error-state Kalman filter (Lefferts, Markley and Shuster 1982; the small turn as in Markley 2003, but about inertial
//! axes): state R, ω; R(t + dt) = exp(ω·dt)·R(t). True attitude exp(δθ)·R, true angular velocity ω + δω.
//!
//! ω is taken for constant in the given frame. It is for a rigid body that turns about a principal axis, and so is the
//! turn of the *axis* of any torque-free body of revolution (it precesses about its angular momentum at a constant rate).
//! Otherwise |dω/dt| ≤ |ω|²/√3, for by Euler's equations each component is (I₂ − I₃)/I₁·ω₂·ω₃ and so on, and moments of
//! inertia obey |I₂ − I₃| ≤ I₁: 0.09 rad/s² at 0.4 rad/s. [`SpinParams::wander_radps`] must cover what is expected of it.

pub(crate) use fit::AttitudeFit;
use fit::{blind, is_usable, noise};
use lidar::ObstacleClass;
use nalgebra::{Matrix3, Matrix6, Rotation3, SMatrix, Vector3};
pub use params::SpinParams;
use symmetry::{Symmetry, alike, shortest};

mod fit;
mod params;
mod symmetry;
#[cfg(test)]
mod tests;

/// Cost of a size that contradicts what was seen before at most, in squared standard deviations: half-hidden obstacles
/// are fitted too small or too large again and again.
const MOST_SIZE_COST: f64 = 9.0;
/// Part of a size that fits may differ by beyond their own standard deviation.
const SIZE_SLACK: f64 = 0.15;

/// An angular velocity of more than this many of its standard deviations before the first fit is none.
const MOST_PRIORS: f64 = 4.0;

/// Which part of an angular velocity is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Observed {
    /// None of it.
    #[default]
    Nothing,
    /// The component across the axis of a cylinder or cone; about the axis nothing is seen.
    AcrossAxis,
    /// All of it.
    Whole,
}

/// Angular velocity of an obstacle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SpinEstimate {
    /// Angular velocity in the frame of the attitudes [rad/s]. Of a cylinder or cone only the component across its axis at
    /// the time of the last fit: the one about the axis counts as 0. All 0 where nothing is observed.
    pub(crate) radps: Vector3<f64>,
    /// Standard deviation along each of the directions that are known, in the root mean square [rad/s]; 0 where nothing is.
    pub(crate) sigma_radps: f64,
    /// What is known.
    pub(crate) observed: Observed,
}

/// The filter of one obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SpinFilter {
    time_s: f64,
    class: ObstacleClass,
    attitude: Rotation3<f64>,
    spin_radps: Vector3<f64>,
    /// Covariance of the small turn [rad] and of the angular velocity [rad/s].
    covariance: Matrix6<f64>,
    size_m: [f64; 3],
    /// Fits in a row that did not count.
    ignored: u32,
}

fn symmetry(class: ObstacleClass) -> Option<Symmetry> {
    match class {
        ObstacleClass::Rectangular | ObstacleClass::Ellipsoidal => Some(Symmetry::Planes),
        ObstacleClass::Cylindrical => Some(Symmetry::Axis),
        ObstacleClass::Conical => Some(Symmetry::Arrow),
        ObstacleClass::Unclassified => None,
    }
}

impl SpinFilter {
    /// Starts with a first fit; none for an unclassified one, or one that is not a number.
    pub(crate) fn new(fit: &AttitudeFit, params: &SpinParams) -> Option<Self> {
        symmetry(fit.class)?;
        if !is_usable(fit) {
            return None;
        }
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&noise(fit, params));
        covariance.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(params.prior_radps * params.prior_radps);
        Some(Self {
            time_s: fit.time_s,
            class: fit.class,
            attitude: fit.attitude.to_rotation_matrix(),
            spin_radps: Vector3::zeros(),
            covariance,
            size_m: fit.size_m,
            ignored: 0,
        })
    }

    /// Takes a later fit into account; whether it counted. Fits from before the last one, of no class, or that are not
    /// numbers do not.
    pub(crate) fn update(&mut self, fit: &AttitudeFit, params: &SpinParams) -> bool {
        let (Some(theirs), Some(ours)) = (symmetry(fit.class), symmetry(self.class)) else { return false };
        if !is_usable(fit) || fit.time_s < self.time_s {
            return false;
        }
        self.propagate(fit.time_s, params);
        let counted = theirs == ours
            && match ours {
                Symmetry::Planes => self.take_planes(fit, params),
                Symmetry::Axis | Symmetry::Arrow => self.take_axis(fit, ours, params),
            };
        if counted && self.spin_radps.norm() <= MOST_PRIORS * params.prior_radps {
            self.ignored = 0;
            return true;
        }
        if counted {
            // Two fits that do not belong together: nothing of it is kept.
            self.believe(fit, false, params);
            return false;
        }
        self.ignored = self.ignored.saturating_add(1);
        if self.ignored >= params.patience {
            self.believe(fit, theirs == ours, params);
        }
        false
    }

    /// What is known at the time of the last fit.
    pub(crate) fn estimate(&self, params: &SpinParams) -> SpinEstimate {
        let spread: Matrix3<f64> = self.covariance.fixed_view::<3, 3>(3, 3).into();
        let (across, dimensions, observed) = match symmetry(self.class) {
            Some(Symmetry::Planes) => (Matrix3::identity(), 3.0, Observed::Whole),
            _ => {
                let axis = self.axis();
                (Matrix3::identity() - axis * axis.transpose(), 2.0, Observed::AcrossAxis)
            }
        };
        let sum = (across * spread * across).trace().max(0.0);
        // The sum over all directions bounds the worst of them.
        if sum.sqrt() > params.most_sigma_radps {
            return SpinEstimate::default();
        }
        SpinEstimate { radps: across * self.spin_radps, sigma_radps: (sum / dimensions).sqrt(), observed }
    }

    fn axis(&self) -> Vector3<f64> {
        self.attitude.matrix().column(2).into()
    }

    /// To a later time.
    fn propagate(&mut self, time_s: f64, params: &SpinParams) {
        let dt = time_s - self.time_s;
        self.time_s = time_s;
        let turn = Rotation3::from_scaled_axis(self.spin_radps * dt);
        self.attitude = turn * self.attitude;
        let mut step = Matrix6::identity();
        step.fixed_view_mut::<3, 3>(0, 0).copy_from(turn.matrix());
        // ∫ exp(ω·s) ds to second order in ω·dt.
        let half = (self.spin_radps * (0.5 * dt)).cross_matrix();
        step.fixed_view_mut::<3, 3>(0, 3).copy_from(&((Matrix3::identity() + half) * dt));
        self.covariance = step * self.covariance * step.transpose();
        let wander = params.wander_radps * params.wander_radps;
        for axis in 0..3 {
            self.covariance[(axis, axis)] += wander * dt * dt * dt / 3.0;
            self.covariance[(axis, axis + 3)] += wander * dt * dt / 2.0;
            self.covariance[(axis + 3, axis)] += wander * dt * dt / 2.0;
            self.covariance[(axis + 3, axis + 3)] += wander * dt;
        }
    }

    fn take_planes(&mut self, fit: &AttitudeFit, params: &SpinParams) -> bool {
        let noise = blind(&noise(fit, params), params.blind_rad);
        let turn: Matrix3<f64> = self.covariance.fixed_view::<3, 3>(0, 0).into();
        let variance = (noise + turn).trace() / 3.0;
        let order_cost = |order: [usize; 3]| {
            let cost = |axis: usize| {
                let (old, new) = (self.size_m[axis], fit.size_m[order[axis]]);
                let (sigma, slack) = (fit.size_sigma_m[order[axis]], SIZE_SLACK * old.max(new));
                (new - old).powi(2) / (sigma * sigma + slack * slack).max(1e-12)
            };
            (cost(0) + cost(1) + cost(2)).min(MOST_SIZE_COST)
        };
        let fitted = fit.attitude.to_rotation_matrix();
        let (named, order) = alike(fitted.matrix(), self.attitude.matrix(), variance, order_cost);
        let residual = Rotation3::from_matrix_unchecked(named * self.attitude.matrix().transpose()).scaled_axis();
        let counted = self.correct(&Matrix3::identity(), &residual, &noise, params);
        if counted {
            for (size, axis) in self.size_m.iter_mut().zip(order) {
                *size += 0.1 * (fit.size_m[axis] - *size);
            }
        }
        counted
    }

    fn take_axis(&mut self, fit: &AttitudeFit, symmetry: Symmetry, params: &SpinParams) -> bool {
        let expected = self.axis();
        let mut axis = fit.attitude * Vector3::z();
        if symmetry == Symmetry::Axis && axis.dot(&expected) < 0.0 {
            axis = -axis;
        }
        let first = expected.cross(&Vector3::ith(expected.iamin(), 1.0)).normalize();
        let second = expected.cross(&first);
        let across = SMatrix::<f64, 2, 3>::from_rows(&[first.transpose(), second.transpose()]);
        // Opposite axes have no shortest turn between them: half a turn, which no gate lets pass.
        let turn = if axis.dot(&expected) < -0.999 { first * 3.0 } else { shortest(&expected, &axis) };
        let noise = across * noise(fit, params) * across.transpose();
        // How far the body has turned about its axis is nobody's business: it is 0 by agreement, and stays known.
        let mut agreed = Matrix6::identity();
        agreed.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() - expected * expected.transpose()));
        self.covariance = agreed * self.covariance * agreed;
        self.correct(&across, &(across * turn), &noise, params)
    }

    /// Update with `residual` of `across`·δθ; whether it is within the gate.
    fn correct<const N: usize>(
        &mut self,
        across: &SMatrix<f64, N, 3>,
        residual: &SMatrix<f64, N, 1>,
        noise: &SMatrix<f64, N, N>,
        params: &SpinParams,
    ) -> bool {
        let seen = across * self.covariance.fixed_view::<3, 6>(0, 0);
        let expected: SMatrix<f64, N, N> = seen.fixed_view::<N, 3>(0, 0) * across.transpose();
        let Some(inverse) = (expected + noise).try_inverse() else { return false };
        let distance2 = residual.dot(&(inverse * residual));
        if distance2.is_nan() || distance2 > params.gate {
            return false;
        }
        // Student's distribution: variance of the fit times (ν + d²)/(ν + N), where that is more than 1.
        let wider = ((params.freedom + distance2) / (params.freedom + N as f64)).max(1.0);
        let noise = noise * wider;
        let Some(inverse) = (expected + noise).try_inverse() else { return false };
        let gain: SMatrix<f64, 6, N> = seen.transpose() * inverse;
        let change = gain * residual;
        let turn = Rotation3::from_scaled_axis(change.fixed_rows::<3>(0).into_owned());
        self.attitude = turn * self.attitude;
        self.attitude.renormalize();
        self.spin_radps += change.fixed_rows::<3>(3);
        // Joseph's form.
        let mut left = Matrix6::identity();
        let taken = left.fixed_view::<6, 3>(0, 0) - gain * across;
        left.fixed_view_mut::<6, 3>(0, 0).copy_from(&taken);
        let covariance = left * self.covariance * left.transpose() + gain * noise * gain.transpose();
        self.covariance = (covariance + covariance.transpose()) * 0.5;
        true
    }

    /// Starts anew from a fit; the angular velocity stays where the body is of the same kind, less well known than before.
    fn believe(&mut self, fit: &AttitudeFit, same_kind: bool, params: &SpinParams) {
        let Some(mut fresh) = Self::new(fit, params) else { return };
        if same_kind {
            let spread: Matrix3<f64> = self.covariance.fixed_view::<3, 3>(3, 3).into();
            let prior = params.prior_radps * params.prior_radps;
            // A variance that is harmonically between twice the old one and the prior.
            let wider = (spread * 2.0).try_inverse().map(|known| known + Matrix3::identity() / prior);
            if let Some(wider) = wider.and_then(|known| known.try_inverse()) {
                fresh.spin_radps = self.spin_radps;
                fresh.covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&wider);
            }
        }
        *self = fresh;
    }
}
