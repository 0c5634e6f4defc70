//! What holds of every fit, whatever the rays: no panic, no NaN, a budget that is kept, the same bytes every time.

use messages::Fit;
use nalgebra::SMatrix;
use rand::RngExt;
use zerocopy::IntoBytes;

use super::stand::Stand;
use super::*;
use crate::fit::{Bundle, Fitter};

const SIGMA_M: f64 = 0.02;

fn bundle(hits: Vec<Ray>, misses: Vec<Ray>) -> Bundle {
    let mut bundle = Bundle::new(0, 0);
    (bundle.hits, bundle.misses) = (hits, misses);
    bundle
}

fn to(point_m: V) -> Ray {
    Ray { direction: point_m.normalize(), range_m: point_m.norm() }
}

/// All numbers finite, quaternions of unit length, covariances symmetric by construction and positive semi-definite.
fn check(fit: &Fit, name: &str) {
    for (kind, solid_fit) in Kind::ALL.into_iter().zip(&fit.solids) {
        let solid = &solid_fit.solid;
        let costs = [solid_fit.hit_cost, solid_fit.miss_cost, solid_fit.belief_cost];
        let others = [solid_fit.ln_information, solid_fit.runner_up];
        let numbers =
            [&costs[..], &others, &solid.centre_m, &solid.attitude_wxyz, &solid.size_m, &solid.covariance].concat();
        assert!(numbers.iter().all(|number| number.is_finite()), "{name}, {kind:?}: {solid_fit:?}");
        assert!(costs.iter().all(|&cost| cost >= 0.0) && solid_fit.runner_up >= 0.0, "{name}, {kind:?}: {solid_fit:?}");
        let length = solid.attitude_wxyz.iter().map(|c| c * c).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-4, "{name}, {kind:?}: {length}");
        assert!(solid.size_m.iter().all(|&size| size > 0.0), "{name}, {kind:?}: {:?}", solid.size_m);
        assert!(!kind.is_round() || solid.size_m[0] == solid.size_m[1]);
        let covariance = covariance(solid);
        // In units of its own deviations, for metres and radians differ by far.
        let deviations = covariance.diagonal().map(f64::sqrt);
        assert!(deviations.iter().all(|&d| d > 0.0), "{name}, {kind:?}: {deviations}");
        let correlation = SMatrix::<f64, 9, 9>::from_fn(|i, j| covariance[(i, j)] / (deviations[i] * deviations[j]));
        let least = correlation.symmetric_eigenvalues().min();
        assert!(least > -1e-5, "{name}, {kind:?}: {least}");
    }
}

pub(crate) fn covariance(solid: &messages::Solid) -> SMatrix<f64, 9, 9> {
    SMatrix::from_fn(|i, j| f64::from(solid.covariance_of(i, j)))
}

fn degenerate() -> Vec<(&'static str, Vec<Ray>, Vec<Ray>)> {
    let mut random = random(21);
    let wall = |range_m: f64, step_m: f64| -> Vec<Ray> {
        (0..25).map(|i| to(V::new(range_m, f64::from(i % 5) * step_m, f64::from(i / 5) * step_m))).collect()
    };
    let line = |axis: V| (0..9).map(|i| to(V::new(5.0, 1.0, 0.5) + axis * f64::from(i) * 0.1)).collect::<Vec<_>>();
    let around: Vec<Ray> = (0..8).map(|i| to(V::new(5.0, f64::from(i) * 0.2 - 0.7, 0.6))).collect();
    let every_way: Vec<Ray> = (0..60).map(|_| to(random_direction(&mut random) * 3.0)).collect();
    vec![
        ("one hit", vec![to(V::new(4.0, 0.0, 0.0))], vec![]),
        ("one hit along z", vec![to(V::new(0.0, 0.0, 4.0))], around.clone()),
        ("all in one point", vec![to(V::new(4.0, 1.0, 0.0)); 30], around.clone()),
        ("two points", [vec![to(V::new(4.0, 1.0, 0.0)); 9], vec![to(V::new(4.0, 1.2, 0.0)); 9]].concat(), vec![]),
        ("on a line across", line(V::y()), around.clone()),
        ("on a line along the view", line(V::new(5.0, 1.0, 0.5).normalize()), vec![]),
        ("on an upright line", line(V::z()), around.clone()),
        ("a flat wall", wall(5.0, 0.1), vec![]),
        ("a flat wall and misses", wall(5.0, 0.1), around.clone()),
        ("a wall 100 m away", wall(100.0, 0.3), vec![]),
        ("a tiny body", wall(3.0, 1e-4), around.clone()),
        ("a body of no size", wall(3.0, 1e-12), around.clone()),
        ("a body nearer than a hand", wall(0.01, 1e-3), around.clone()),
        ("a wide one", wall(3.0, 2.0), around.clone()),
        ("round the sensor", every_way, vec![]),
        ("opposite", vec![to(V::x() * 2.0), to(V::x() * -2.0)], vec![]),
        (
            "on either side",
            (0..6).flat_map(|i| [1.0, -1.0].map(|s| to(V::new(2.0 * s, s * f64::from(i), s)))).collect(),
            vec![],
        ),
        ("misses through all hits", wall(5.0, 0.1), wall(100.0, 2.0)),
        ("misses that end at once", wall(5.0, 0.1), around.iter().map(|ray| Ray { range_m: 0.0, ..*ray }).collect()),
    ]
}

// verifies EXT-025
#[test]
fn no_cluster_however_odd_gives_a_panic_or_a_number_that_is_none() {
    let mut sut = Fitter::new(settings());
    for (name, hits, misses) in degenerate() {
        for sigma_m in [1e-4, SIGMA_M, 10.0] {
            check(&sut.fit(&bundle(hits.clone(), misses.clone()), sigma_m), name);
        }
    }
}

#[test]
fn no_rays_give_an_empty_fit() {
    let around = degenerate()[1].2.clone();
    assert_eq!(Fitter::new(settings()).fit(&bundle(vec![], around), SIGMA_M), Fit::default());
}

// verifies EXT-025
#[test]
fn rays_at_random_give_neither_a_panic_nor_a_number_that_is_none() {
    let mut random = random(22);
    for round in 0..600 {
        let mut settings = settings();
        settings.evaluations = 10_u64.pow(round % 5);
        let scale_m = 10.0_f64.powf(random.random_range(-3.0..1.0));
        let centre_m = random_direction(&mut random) * 10.0_f64.powf(random.random_range(-2.0..2.0));
        let hits = (0..random.random_range(1..200))
            .map(|_| to(centre_m + random_direction(&mut random) * scale_m * random.random::<f64>()))
            .collect();
        let misses = (0..random.random_range(0..100))
            .map(|_| Ray { range_m: 100.0, ..to(centre_m + random_direction(&mut random) * scale_m * 2.0) })
            .collect();
        check(&Fitter::new(settings).fit(&bundle(hits, misses), SIGMA_M), &format!("round {round}"));
    }
}

/// Looks at random bodies, some well seen and some hardly, each with its rays.
fn seen(count: usize, seed: u64) -> Vec<Bundle> {
    let mut random = random(seed);
    let mut stand = Stand::new(SIGMA_M);
    let mut bundles = Vec::new();
    while bundles.len() < count {
        let kind = Kind::ALL[bundles.len() % 4];
        let mut body = random_body(kind, &mut random);
        let (azimuth, range_m): (f64, f64) = (random.random_range(-3.0..3.0), random.random_range(4.0..40.0));
        body.centre_m = V::new(range_m * azimuth.cos(), range_m * azimuth.sin(), random.random_range(-1.0..1.0));
        if let Some(rays) = stand.rays(kind, &body) {
            bundles.push(bundle(rays.hits.clone(), rays.misses.clone()));
        }
    }
    bundles
}

// verifies EXT-018
#[test]
fn fits_of_simulated_bodies_are_numbers_with_covariances() {
    let mut sut = Fitter::new(settings());
    for (number, bundle) in seen(200, 23).iter().enumerate() {
        check(&sut.fit(bundle, SIGMA_M), &format!("body {number}"));
    }
}

// verifies EXT-016
#[test]
fn no_fit_costs_more_evaluations_than_its_budget_and_what_is_owed() {
    for bundle in &seen(12, 24) {
        for evaluations in [1, 10, 100, 500, 1_000, 2_000, 5_000, 10_000, 30_000, 100_000, 100_000_000] {
            let settings = FitSettings { evaluations, ..settings() };
            let fit = Fitter::new(settings).fit(bundle, SIGMA_M);
            // Owed to each solid: one body on the few rays, and one on all that are used.
            let few = bundle.hits.len().min(settings.scouting_rays) + bundle.misses.len().min(settings.scouting_rays);
            let full = bundle.hits.len().min(settings.rays) + bundle.misses.len().min(settings.rays);
            assert_eq!((fit.hits + fit.misses) as usize, full);
            let most = evaluations + 4 * (few + full) as u64;
            assert!(u64::from(fit.evaluations) <= most, "{} of {evaluations}, {most}", fit.evaluations);
            assert!(u64::from(fit.evaluations) >= 4 * (few + full) as u64);
            check(&fit, "on a budget");
        }
    }
}

// verifies EXT-016
#[test]
fn a_larger_budget_finds_no_worse_bodies_on_the_whole() {
    let bundles = seen(60, 25);
    let mean_cost = |evaluations| {
        let mut sut = Fitter::new(FitSettings { evaluations, ..settings() });
        bundles
            .iter()
            .map(|bundle| sut.fit(bundle, SIGMA_M).solids.iter().map(|s| f64::from(s.cost())).sum::<f64>())
            .sum::<f64>()
    };
    let costs = [1_000, 5_000, 30_000, 300_000].map(mean_cost);
    assert!(costs.windows(2).all(|pair| pair[1] < pair[0]), "{costs:?}");
}

// verifies EXT-017
#[test]
fn the_same_rays_give_the_same_bytes_whatever_was_fitted_before() {
    let bundles = seen(40, 26);
    let mut used = Fitter::new(settings());
    let first: Vec<Fit> = bundles.iter().map(|bundle| used.fit(bundle, SIGMA_M)).collect();
    for (bundle, first) in bundles.iter().zip(&first).rev() {
        assert_eq!(used.fit(bundle, SIGMA_M).as_bytes(), first.as_bytes());
        assert_eq!(Fitter::new(settings()).fit(bundle, SIGMA_M).as_bytes(), first.as_bytes());
    }
}
