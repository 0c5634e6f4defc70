use lidar::ObstacleClass;
use messages::{Detection, Solid};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::class::Belief;
use crate::filter::{Filter, Measured, Motion};
use crate::frame::seconds;
use crate::lifecycle::Life;
use crate::measurement::{AxisOrder, axis_order, blur, of_centroid, of_solid};
use crate::params::{FitParams, Params};
use crate::sighting::Sighting;
use crate::spin::{AttitudeFit, SpinFilter, SpinParams};
use crate::tracking::Sweep;

/// Standard deviation of a place before it is measured [m]: wider than any fit's.
const ANYWHERE_M: f64 = 30.0;
/// Least and most factor on a fit's covariance that a track may learn.
const STRAY: [f64; 2] = [0.3, 30.0];
/// Most that one fit teaches, in times of what is expected: farther ones have jumped.
const MOST_SURPRISE: f64 = 5.0;
/// Half extents that are reckoned with [m].
const HALF_M: [f64; 2] = [0.05, 25.0];

/// An obstacle through time.
#[derive(Clone, Debug)]
pub(crate) struct Tracked {
    pub(crate) id: u64,
    pub(crate) life: Life,
    pub(crate) belief: Belief,
    pub(crate) filter: Filter,
    /// Sensor time of the filter's state: that of the last measurement [ns].
    pub(crate) filter_ns: u64,
    /// Sensor time at which it was last seen, measured or not [ns].
    pub(crate) seen_ns: u64,
    /// Fits in a row that were far from what was expected.
    jumps: u32,
    /// Fits that the filter's state stands on.
    fits: u32,
    /// Factor on the covariances of its fits: how much farther they stray than they say.
    stray: f64,
    /// The last solid that was fitted.
    pub(crate) solid: Option<Attitude>,
    /// How it turns; none before the first fit that tells.
    pub(crate) spin: Option<SpinFilter>,
}

/// How the last solid lay.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attitude {
    /// Rotation from body to the tracks' frame.
    pub(crate) attitude: UnitQuaternion<f64>,
    /// Which body axis each of the track's extents is along.
    pub(crate) order: AxisOrder,
}

impl Attitude {
    /// The axes of the track's extents in the tracks' frame, column by column; their signs mean nothing.
    fn axes(&self) -> Matrix3<f64> {
        let all = self.attitude.to_rotation_matrix();
        Matrix3::from_fn(|row, axis| all[(row, self.order[axis])])
    }
}

impl Tracked {
    /// A new track, seen for the first time.
    pub(crate) fn born(id: u64, sweep: &Sweep<'_>, sighting: &Sighting) -> Self {
        let params = sweep.params;
        let mut tracked = Self {
            id,
            life: Life::born(sweep.number, &params.lifecycle),
            belief: Belief::default(),
            filter: unknown(sweep, sighting),
            filter_ns: sighting.time_ns,
            seen_ns: sighting.time_ns,
            jumps: 0,
            fits: 0,
            stray: 1.0,
            solid: None,
            spin: None,
        };
        tracked.measure(sweep, sighting, false, true);
        tracked
    }

    /// Takes in what was seen of it. `torn`: in several clusters, or in one with something else. `shared`: in one with a
    /// confirmed track, which confirms no other.
    pub(crate) fn see(&mut self, sweep: &Sweep<'_>, sighting: &Sighting, torn: bool, shared: bool) {
        if !shared || self.life.is_confirmed() {
            self.life.seen(sweep.number, &sweep.params.lifecycle);
        }
        self.measure(sweep, sighting, torn, false);
    }

    /// It was seen, but what was seen of it tells nothing of where it is.
    pub(crate) fn glimpse(&mut self, sweep: &Sweep<'_>, time_ns: u64) {
        self.life.seen(sweep.number, &sweep.params.lifecycle);
        self.seen_ns = time_ns;
    }

    fn measure(&mut self, sweep: &Sweep<'_>, sighting: &Sighting, torn: bool, first: bool) {
        let Sweep { gathered, params, .. } = *sweep;
        let detection = &gathered.detections()[sighting.detection];
        let solid = gathered.solid(sighting.detection);
        let half_m = self.half_m();
        let solid = solid.filter(|_| !torn);
        let probability = self.probability(detection);
        let lies = solid.map(|solid| self.lie(solid, sighting));
        let mut measured = match solid.zip(lies) {
            Some((solid, lies)) => {
                let measured = of_solid(solid, &lies.order, sighting, half_m, self.stray, &params.fit);
                measured.doubted(probability, half_m, &params.fit)
            }
            None => {
                let half_sigma_m = (self.filter.size_covariance().trace() / 3.0).sqrt() / 2.0;
                of_centroid(sighting, half_m, half_sigma_m, torn, &params.centroid)
            }
        };
        let place_m2 = measured.place_m2();
        if sighting.time_sigma_s > 0.0 {
            blur(&mut measured, &self.filter.velocity_mps(), &self.filter.velocity_covariance(), sighting.time_sigma_s);
        }
        self.seen_ns = sighting.time_ns;
        // A whole cluster of its own tells where it is, be it worth reckoning or not.
        let never_fitted = self.solid.is_none();
        if !torn || never_fitted {
            self.life.measured(sweep.number);
        }
        let known_m2 = self.spread_m2(sighting.time_ns, params).trace();
        // Returns alone tell nothing new of a place that fits know much better.
        if solid.is_some() || never_fitted || place_m2 < params.centroid.worth * known_m2 {
            let motion =
                Motion { velocity_walk_mps: params.motion.velocity_walk_mps, size_walk_m: params.motion.size_walk_m };
            self.filter.predict(seconds(self.filter_ns, sighting.time_ns), &motion);
            self.filter_ns = sighting.time_ns;
            self.life.measured(sweep.number);
            if !first {
                self.weigh(&mut measured, sweep, sighting);
            }
            // A sum without a root changes nothing: the track goes on as predicted.
            let _ = self.filter.update(&measured);
            self.belief.add(&detection.posterior, &params.class);
        }
        if let Some((solid, lies)) = solid.zip(lies).filter(|_| probability >= params.fit.foreign_posterior) {
            self.solid = Some(lies);
            let attitude = lies.attitude;
            if detection.summary.points >= params.spin.min_points {
                self.turn(solid, detection.class, sighting, attitude, &params.spin);
            }
        }
    }

    /// Takes in how the solid lies.
    fn turn(
        &mut self,
        solid: &Solid,
        class: ObstacleClass,
        sighting: &Sighting,
        attitude: UnitQuaternion<f64>,
        params: &SpinParams,
    ) {
        let to_frame = sighting.pose.attitude.to_rotation_matrix();
        let turn = Matrix3::from_fn(|row, column| f64::from(solid.covariance_of(3 + row, 3 + column)));
        let fit = AttitudeFit {
            time_s: sighting.time_ns as f64 * 1e-9,
            attitude,
            covariance_rad2: to_frame.matrix() * turn * to_frame.matrix().transpose(),
            class,
            size_m: solid.size_m.map(f64::from),
            size_sigma_m: std::array::from_fn(|axis| {
                f64::from(solid.covariance_of(6 + axis, 6 + axis)).max(0.0).sqrt()
            }),
        };
        match &mut self.spin {
            Some(spin) => _ = spin.update(&fit, params),
            None => self.spin = SpinFilter::new(&fit, params),
        }
    }

    /// How a solid lies, its axes named as the track names them.
    fn lie(&self, solid: &Solid, sighting: &Sighting) -> Attitude {
        let [w, x, y, z] = solid.attitude_wxyz.map(f64::from);
        let body = UnitQuaternion::try_new(nalgebra::Quaternion::new(w, x, y, z), 1e-6);
        let attitude = sighting.pose.attitude * body.unwrap_or_else(UnitQuaternion::identity);
        let before = self.solid.map(|solid| solid.axes());
        Attitude { attitude, order: axis_order(&attitude, before.as_ref()) }
    }

    /// Student's t: what is far from what is expected counts less. Where nothing but jumps to other minima comes, it is the
    /// track that stands in one, and it begins anew.
    fn weigh(&mut self, measured: &mut Measured, sweep: &Sweep<'_>, sighting: &Sighting) {
        let params = &sweep.params.fit;
        let distance = self.filter.distance(measured);
        if !distance.is_finite() {
            return;
        }
        let freedom = if measured.sized { 6.0 } else { 3.0 };
        self.jumps = if distance > params.jump { self.jumps + 1 } else { 0 };
        let patience = f64::from(params.patience).max(params.patience_share * f64::from(self.fits));
        self.fits = self.fits.saturating_add(1);
        if f64::from(self.jumps) >= patience {
            (self.jumps, self.fits) = (0, 0);
            self.filter = unknown(sweep, sighting);
            return;
        }
        if measured.sized {
            self.learn_stray(distance / freedom, params);
        }
        let excess = ((params.degrees_of_freedom + distance) / (params.degrees_of_freedom + freedom)).max(1.0);
        measured.covariance *= excess;
    }

    /// Fits that stray farther from expectation than they say are believed less from now on, and others more (adaptive
    /// measurement noise by innovations: Mehra 1970).
    fn learn_stray(&mut self, strayed: f64, params: &FitParams) {
        let surprise = (strayed / params.stray_expected).min(MOST_SURPRISE) - 1.0;
        self.stray = (self.stray * (1.0 + params.stray_gain * surprise)).clamp(STRAY[0], STRAY[1]);
    }

    /// How likely this obstacle is of a detection's class.
    fn probability(&self, detection: &Detection) -> f64 {
        let Some(class) = detection.class.solid_index() else { return 1.0 };
        match self.belief.class() {
            ObstacleClass::Unclassified => f64::from(detection.posterior[class]).clamp(0.0, 1.0),
            _ => self.belief.posterior()[class],
        }
    }

    /// Where its centre is expected at a sensor time [m].
    pub(crate) fn expected_m(&self, time_ns: u64) -> Vector3<f64> {
        self.filter.position_m() + self.filter.velocity_mps() * seconds(self.filter_ns, time_ns)
    }

    /// Mean half extent that is reckoned with [m].
    pub(crate) fn half_m(&self) -> f64 {
        (self.filter.size_m().mean() / 2.0).clamp(HALF_M[0], HALF_M[1])
    }

    /// Covariance of its place at a sensor time [m²], and the variance of a velocity added by then.
    pub(crate) fn spread_m2(&self, time_ns: u64, params: &Params) -> Matrix3<f64> {
        let all = self.kinematic(time_ns, params);
        all.fixed_view::<3, 3>(0, 0).into()
    }

    /// Covariance of position and velocity at a sensor time.
    pub(crate) fn kinematic(&self, time_ns: u64, params: &Params) -> nalgebra::Matrix6<f64> {
        let dt_s = seconds(self.filter_ns, time_ns);
        let mut all = self.filter.kinematic_covariance();
        for column in 0..6 {
            for axis in 0..3 {
                all[(axis, column)] += dt_s * all[(3 + axis, column)];
            }
        }
        for axis in 0..3 {
            for row in 0..6 {
                all[(row, axis)] += dt_s * all[(row, 3 + axis)];
            }
        }
        let dt_s = dt_s.abs();
        let walk = params.motion.velocity_walk_mps.powi(2);
        for axis in 0..3 {
            all[(axis, axis)] += walk * dt_s.powi(3) / 3.0;
            all[(axis, 3 + axis)] += walk * dt_s.powi(2) / 2.0;
            all[(3 + axis, axis)] += walk * dt_s.powi(2) / 2.0;
            all[(3 + axis, 3 + axis)] += walk * dt_s;
        }
        all
    }

    /// Whether a place lies in its body, or at most `margin_m` outside, at a sensor time.
    pub(crate) fn holds(&self, place_m: &Vector3<f64>, time_ns: u64, margin_m: f64) -> bool {
        let from = place_m - self.expected_m(time_ns);
        let size = self.filter.size_m();
        let Some(solid) = self.solid else { return from.norm() < self.half_m() + margin_m };
        let along = solid.attitude.inverse() * from;
        (0..3).all(|rank| along[solid.order[rank]].abs() < size[rank] / 2.0 + margin_m)
    }
}

/// What is known of an obstacle before anything is measured, at a sighting.
fn unknown(sweep: &Sweep<'_>, sighting: &Sighting) -> Filter {
    let Sweep { params, frame, .. } = *sweep;
    let own = params.birth.velocity_sigma_mps;
    // At rest, or along with the sensor: whatever is between.
    let velocity = Matrix3::identity() * (own * own) + frame.velocity_mps * frame.velocity_mps.transpose();
    let mean = [sighting.centroid_m, Vector3::zeros(), Vector3::repeat(params.birth.size_m)];
    Filter::new(mean, ANYWHERE_M, velocity, params.birth.size_sigma_m)
}
