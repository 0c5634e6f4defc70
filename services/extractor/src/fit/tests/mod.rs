//! Bodies, rays and oracles for the tests of the fit.

mod fits;
mod honest;
mod meeting;
mod passing;
mod recovery;
mod same;
mod stand;
mod twin;

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) use self::twin::{Meeting, Passing};
use super::solid::for_kind;
use super::wide::{Wide, WideVector};
use super::{Body, FitParams, FitSettings, Kind, Ray, UnitSolid};

pub(crate) type V = Vector3<f64>;

pub(crate) fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// The shipped settings.
pub(crate) fn settings() -> FitSettings {
    #[derive(serde::Deserialize)]
    struct File {
        fit: FitParams,
    }
    let file: File = toml::from_str(include_str!("../../../../../config/stages/extractor.toml")).unwrap();
    file.fit.checked().unwrap()
}

/// A direction, uniform over the sphere.
pub(crate) fn random_direction(random: &mut ChaCha8Rng) -> V {
    loop {
        let v = V::from_fn(|_, _| random.random_range(-1.0..1.0));
        if (0.01..1.0).contains(&v.norm_squared()) {
            return v.normalize();
        }
    }
}

pub(crate) fn random_rotation(random: &mut ChaCha8Rng) -> Matrix3<f64> {
    let turn = random_direction(random) * random.random_range(0.0..std::f64::consts::PI);
    Rotation3::new(turn).into_inner()
}

/// A body 5 to 12 m away with half extents of 0.3 to 2 m.
pub(crate) fn random_body(kind: Kind, random: &mut ChaCha8Rng) -> Body {
    let mut half_m = V::from_fn(|_, _| random.random_range(0.3..2.0));
    if kind.is_round() {
        half_m.y = half_m.x;
    }
    let centre_m = random_direction(random) * random.random_range(5.0..12.0);
    Body { centre_m, rotation: random_rotation(random), ln_half: half_m.map(f64::ln) }
}

/// The direction from the sensor to a random place within the body's box, made `wider` times as large.
pub(crate) fn random_aim(body: &Body, wider: f64, random: &mut ChaCha8Rng) -> V {
    let half_m = body.ln_half.map(f64::exp) * wider;
    let place = half_m.map(|half| random.random_range(-half..half));
    (body.centre_m + body.rotation * place).normalize()
}

/// The sensor and a direction as a body sees them [m].
pub(crate) fn to_body(body: &Body, direction: &V) -> (V, V) {
    (-body.rotation.tr_mul(&body.centre_m), body.rotation.tr_mul(direction))
}

/// A vector for one ray.
pub(crate) fn wide(v: &V) -> WideVector<pulp::Scalar> {
    [v.x, v.y, v.z].map(|component| Wide::splat(pulp::Scalar, component))
}

/// The number of one ray.
pub(crate) fn narrow(wide: Wide<pulp::Scalar>) -> f64 {
    let mut value = [0.0];
    wide.store(&mut value);
    value[0]
}

pub(crate) fn narrow_vector(wide: WideVector<pulp::Scalar>) -> V {
    V::from(wide.map(narrow))
}

/// Where one ray meets the solid of unit half extents.
pub(crate) fn meet_unit(kind: Kind, origin: &V, direction: &V) -> Option<Meeting> {
    let meeting = for_kind!(kind, S => S::meet(wide(origin), wide(direction)));
    let found = meeting.found.any();
    found.then(|| Meeting { distance: narrow(meeting.distance), normal: narrow_vector(meeting.normal) })
}

/// How one ray passes a body of these half extents.
pub(crate) fn pass(kind: Kind, half_m: &V, origin: &V, direction: &V) -> Passing {
    let passing = for_kind!(kind, S => S::pass(wide(half_m), wide(origin), wide(direction)));
    Passing {
        distance_m: narrow(passing.distance_m),
        normal: narrow_vector(passing.normal),
        point_m: narrow_vector(passing.point_m),
    }
}

/// Where a ray from the sensor meets a body; distances in metres.
pub(crate) fn meet(kind: Kind, body: &Body, direction: &V) -> Option<Meeting> {
    let half_m = body.ln_half.map(f64::exp);
    let (origin, direction) = to_body(body, direction);
    meet_unit(kind, &origin.component_div(&half_m), &direction.component_div(&half_m))
}

/// Negative within the body of these half extents, positive without: written from the solids' definitions.
pub(crate) fn implicit(kind: Kind, half_m: &V, point: &V) -> f64 {
    let p = point.component_div(half_m);
    let radius = p.x.hypot(p.y);
    match kind {
        Kind::Cuboid => p.amax() - 1.0,
        Kind::Ellipsoid => p.norm() - 1.0,
        Kind::Cylinder => (radius - 1.0).max(p.z.abs() - 1.0),
        Kind::Cone => (radius - 0.5 * (1.0 - p.z)).max(-1.0 - p.z).max(p.z - 1.0),
    }
}

/// The support function h(u) = max of u·x over the body, frame and half extents its own: written from the definitions.
pub(crate) fn support(kind: Kind, half_m: &V, u: &V) -> f64 {
    let across = half_m.x * u.x.hypot(u.y);
    match kind {
        Kind::Cuboid => half_m.dot(&u.abs()),
        Kind::Ellipsoid => half_m.component_mul(u).norm(),
        Kind::Cylinder => across + half_m.z * u.z.abs(),
        Kind::Cone => (half_m.z * u.z).max(across - half_m.z * u.z),
    }
}

/// A ray that ends on the body.
pub(crate) fn hit_of(kind: Kind, body: &Body, direction: &V) -> Option<Ray> {
    meet(kind, body, direction).map(|meeting| Ray { direction: *direction, range_m: meeting.distance })
}

/// A ray within and a ray beside the outline of a body, both `aside` [rad] from it (and less than 1e-9).
pub(crate) fn at_outline(kind: Kind, body: &Body, aside: f64, random: &mut ChaCha8Rng) -> [V; 2] {
    let within = body.centre_m.normalize();
    loop {
        let beside = random_aim(body, 4.0, random);
        if meet(kind, body, &within).is_none() || meet(kind, body, &beside).is_some() {
            continue;
        }
        let between = |share: f64| (within + (beside - within) * share).normalize();
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if meet(kind, body, &between(middle)).is_some() { low = middle } else { high = middle }
        }
        let step = aside / (beside - within).norm();
        return [between(low - step), between(high + step)];
    }
}
