use messages::{ClusterSummary, Fit, RELIEF, Solid, SweepHeader};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Numbers for each solid.
const PER_SOLID: [&str; 14] = [
    "excess",
    "misfit",
    "miss_cost",
    "belief_cost",
    "strayed",
    "violated",
    "information",
    "runner_up",
    "ln_half_a",
    "ln_half_b",
    "ln_half_c",
    "view_a",
    "view_b",
    "view_c",
];
/// Names of the solids in those of features, in the paper's order.
const SOLIDS: [&str; 4] = ["box", "ellipsoid", "cylinder", "cone"];
/// Numbers for the cluster.
const PER_CLUSTER: [&str; 12] = [
    "least_cost",
    "second_excess",
    "third_excess",
    "ln_points",
    "range_m",
    "rings",
    "hits",
    "misses",
    "nearer",
    "range_sigma_m",
    "column_step_m",
    "height",
];

/// Features of a fitted cluster: what the boosted trees judge.
pub const SOLID_FEATURES: usize = 4 * PER_SOLID.len() + PER_CLUSTER.len() + RELIEF;

/// Added to a cost per hit before its logarithm is taken.
const LEAST_MISFIT: f32 = 0.05;

/// Names of the features, in order. A model that was trained on others is refused.
pub fn solid_feature_names() -> Vec<String> {
    let of_solids = SOLIDS.iter().flat_map(|solid| PER_SOLID.iter().map(move |name| format!("{solid}_{name}")));
    let of_cluster = PER_CLUSTER.iter().map(|&name| name.to_owned());
    of_solids.chain(of_cluster).chain((0..RELIEF).map(|place| format!("relief_{place}"))).collect()
}

/// The features of a cluster and its fit.
///
/// For each solid: cost above the least of the four; ln of the hits' cost per hit; the misses' and the beliefs' cost; share
/// of hits that strayed; misses violated; ln of the information's determinant less the mean of the four; how far the next
/// minimum is behind; ln of the half extents [ln m]; the view along the body's axes (absolute but for a cone's, whose two ends
/// differ). For the cluster: least cost, how far the second and third best solid are behind it; ln of the number of
/// returns; range [m]; rings; hits and misses used; cells with something nearer; standard deviation of a range [m]; way
/// between columns at that range [m]; sine of the elevation. Then the relief.
pub fn solid_features(header: &SweepHeader, summary: &ClusterSummary, fit: &Fit) -> [f32; SOLID_FEATURES] {
    let mut features = [0.0; SOLID_FEATURES];
    let mut places = features.iter_mut();
    let mut put = |value: f32| {
        if let Some(place) = places.next() {
            *place = value;
        }
    };
    let costs = fit.solids.map(|solid| solid.cost());
    let mut ranked = costs;
    ranked.sort_unstable_by(f32::total_cmp);
    let mean_information = fit.solids.iter().map(|solid| solid.ln_information).sum::<f32>() / 4.0;
    let hits = fit.hits.max(1) as f32;
    for (place, of) in fit.solids.iter().enumerate() {
        put(costs[place] - ranked[0]);
        put((of.hit_cost / hits + LEAST_MISFIT).ln());
        put(of.miss_cost);
        put(of.belief_cost);
        put(of.strayed as f32 / hits);
        put(of.violated as f32);
        put(of.ln_information - mean_information);
        put(of.runner_up);
        of.solid.size_m.into_iter().for_each(|size_m| put((0.5 * size_m).max(f32::MIN_POSITIVE).ln()));
        let [a, b, c] = view(&of.solid);
        put(a.abs());
        put(b.abs());
        put(if place == 3 { c } else { c.abs() });
    }
    put(ranked[0]);
    put(ranked[1] - ranked[0]);
    put(ranked[2] - ranked[0]);
    put((summary.points.max(1) as f32).ln());
    let range_m = summary.range_m();
    put(range_m);
    put(summary.rings as f32);
    put(fit.hits as f32);
    put(fit.misses as f32);
    put(fit.nearer as f32);
    put(header.range_sigma_m);
    put(header.column_step_rad * range_m);
    put(summary.centroid_m[2] / range_m.max(f32::MIN_POSITIVE));
    fit.relief.into_iter().for_each(put);
    features
}

/// How far the best solid is from explaining the rays: cost of hits and misses per hit. About 1 for a true one.
pub fn misfit(fit: &Fit) -> f32 {
    let best = fit.solids.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()));
    best.map_or(0.0, |best| (best.hit_cost + best.miss_cost) / fit.hits.max(1) as f32)
}

/// Direction from the sensor to the solid, in the body's axes.
fn view(solid: &Solid) -> [f32; 3] {
    let [w, x, y, z] = solid.attitude_wxyz;
    let attitude = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z));
    let centre = Vector3::from(solid.centre_m);
    let view = attitude.inverse_transform_vector(&centre) / centre.norm().max(f32::MIN_POSITIVE);
    view.into()
}

#[cfg(test)]
mod tests {
    use messages::SolidFit;

    use super::*;

    #[test]
    fn every_feature_has_a_name_of_its_own() {
        let names = solid_feature_names();
        assert_eq!(names.len(), SOLID_FEATURES);
        let different: std::collections::BTreeSet<_> = names.iter().collect();
        assert_eq!(different.len(), SOLID_FEATURES);
        assert!(names.iter().all(|name| !name.contains(char::is_whitespace)));
    }

    #[test]
    fn features_stand_under_their_names() {
        let names = solid_feature_names();
        let mut fit = Fit { hits: 10, misses: 7, nearer: 3, ..Fit::default() };
        for (place, solid) in fit.solids.iter_mut().enumerate() {
            *solid = SolidFit { hit_cost: 10.0 * (4 - place) as f32, miss_cost: 1.0, violated: place as u32, ..*solid };
            solid.solid.centre_m = [0.0, 5.0, 0.0];
            solid.solid.size_m = [2.0, 2.0, 2.0 * std::f32::consts::E];
        }
        // A quarter turn about x takes the body's z axis to the sensor's −y.
        fit.solids[3].solid.attitude_wxyz = [0.5_f32.sqrt(), 0.5_f32.sqrt(), 0.0, 0.0];
        fit.relief[57] = 8.0;
        let summary = ClusterSummary { points: 12, rings: 4, centroid_m: [3.0, 0.0, 4.0], ..ClusterSummary::default() };
        let header = SweepHeader { column_step_rad: 0.01, range_sigma_m: 0.02, ..SweepHeader::default() };
        let features = solid_features(&header, &summary, &fit);
        let of = |name: &str| features[names.iter().position(|other| other == name).unwrap()];
        assert_eq!((of("box_excess"), of("cone_excess")), (30.0, 0.0));
        assert!((of("ellipsoid_misfit") - 3.05_f32.ln()).abs() < 1e-6);
        assert_eq!((of("cylinder_violated"), of("misses"), of("nearer")), (2.0, 7.0, 3.0));
        assert!((of("cone_ln_half_c") - 1.0).abs() < 1e-6);
        assert!((of("cone_view_c") + 1.0).abs() < 1e-6, "{}", of("cone_view_c"));
        assert!((of("box_view_b") - 1.0).abs() < 1e-6);
        assert_eq!((of("second_excess"), of("third_excess")), (10.0, 20.0));
        assert_eq!((of("range_m"), of("rings"), of("height"), of("relief_57")), (5.0, 4.0, 0.8, 8.0));
        assert!((of("column_step_m") - 0.05).abs() < 1e-6);
        assert!((misfit(&fit) - 1.1).abs() < 1e-6);
    }

    #[test]
    fn an_empty_fit_gives_finite_features() {
        let features = solid_features(&SweepHeader::default(), &ClusterSummary::default(), &Fit::default());
        assert!(features.iter().all(|feature| feature.is_finite()));
    }
}
