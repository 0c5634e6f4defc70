//! Many rays at once against one at a time, to the bit, with every set of instructions that this machine has.

use pulp::Arch;
use rand::RngExt;

use super::super::rays::Beam;
use super::super::residuals::{Measure, Parts, Rays, measure};
use super::super::solid::for_kind;
use super::super::system::{System, parameters};
use super::super::{Body, Kind, Ray};
use super::*;

/// This machine's best instructions, those of older ones, and none.
fn machines() -> Vec<Arch> {
    let mut machines = vec![Arch::new(), Arch::Scalar];
    #[cfg(target_arch = "x86_64")]
    machines.extend(pulp::x86::V3::try_new().map(Arch::V3));
    machines
}

/// All that a fit goes on with.
fn bits(round: bool, (system, parts): &(System, Parts)) -> Vec<u64> {
    let count = parameters(round);
    let mut numbers = vec![system.cost, parts.hits, parts.misses, parts.beliefs];
    numbers.extend([f64::from(parts.strayed), f64::from(parts.violated)]);
    numbers.extend(&system.gradient[..count]);
    (0..count).for_each(|i| numbers.extend(&system.curvature[i][..=i]));
    // A number that is none has no certain bits.
    numbers.iter().map(|number| if number.is_nan() { f64::NAN.to_bits() } else { number.to_bits() }).collect()
}

/// Asserts that a body costs the same on these rays, measured either way, to the end and stopped half-way.
fn check(kind: Kind, body: &Body, hits: &[Ray], misses: &[Ray], sigma_m: f64) {
    let beliefs = settings().beliefs;
    let slow = twin::Rays { hits, misses, sigma_m, beliefs: &beliefs };
    let (mut beam, mut round) = (Beam::new(hits.len()), Beam::new(misses.len()));
    beam.take(hits);
    round.take(misses);
    for how in [Measure::Near, Measure::Range] {
        let whole = twin::measure(kind, body, &slow, how, f64::INFINITY);
        for arch in machines() {
            let rays = Rays { arch, hits: &beam, misses: &round, sigma_m, beliefs: &beliefs };
            for limit in [f64::INFINITY, 0.5 * whole.0.cost, whole.0.cost] {
                let right = twin::measure(kind, body, &slow, how, limit);
                let found = for_kind!(kind, S => measure::<S>(body, &rays, how, limit));
                let [right, found] = [right, found].map(|measured| bits(kind.is_round(), &measured));
                assert_eq!(found, right, "{kind:?}, {how:?}, {arch:?}, limit {limit}: {body:?}");
            }
        }
    }
}

// verifies EXT-012
#[test]
fn rays_measured_side_by_side_give_the_bits_of_rays_measured_one_by_one() {
    let mut random = random(51);
    for round in 0..1_500 {
        let kind = Kind::ALL[round % 4];
        let body = random_body(kind, &mut random);
        let aim = |random: &mut ChaCha8Rng, wider: f64| random_aim(&body, wider, random);
        let range_m = body.centre_m.norm();
        let hits: Vec<Ray> = (0..random.random_range(1..40))
            .map(|_| {
                let wider = [0.5, 1.0, 3.0][random.random_range(0..3)];
                let direction = aim(&mut random, wider);
                let there_m = meet(kind, &body, &direction).map_or(range_m, |meeting| meeting.distance);
                Ray { direction, range_m: there_m + random.random_range(-0.1..0.1) * random.random_range(0.0..10.0) }
            })
            .collect();
        let misses: Vec<Ray> = (0..random.random_range(0..40))
            .map(|_| Ray { direction: aim(&mut random, 4.0), range_m: [range_m, 100.0][random.random_range(0..2)] })
            .collect();
        check(kind, &body, &hits, &misses, [0.005, 0.03, 1.0][random.random_range(0..3)]);
    }
}

// verifies EXT-012
#[test]
fn bodies_along_the_axes_and_rays_through_their_middle_give_the_same_bits_too() {
    let directions: Vec<V> = (0..27)
        .map(|i| V::new(f64::from(i % 3) - 1.0, f64::from(i / 3 % 3) - 1.0, f64::from(i / 9) - 1.0))
        .filter(|v| v.norm() > 0.0)
        .map(|v| v.normalize())
        .collect();
    for kind in Kind::ALL {
        for range_m in [0.0, 1e-3, 0.5, 1.0, 4.0] {
            for at in &directions {
                for half_m in [V::new(1.0, 1.0, 1.0), V::new(0.5, 0.5, 2.0), V::new(2.0, 2.0, 0.1)] {
                    let (centre_m, ln_half) = (at * range_m, half_m.map(f64::ln));
                    let body = Body { centre_m, rotation: Matrix3::identity(), ln_half };
                    let rays: Vec<Ray> =
                        directions.iter().map(|&direction| Ray { direction, range_m: range_m + 1.0 }).collect();
                    check(kind, &body, &rays, &rays, 0.02);
                }
            }
        }
    }
}
