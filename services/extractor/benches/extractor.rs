//! What a cluster costs, by its points and by step: neighbours, normals, histogram; and all of it in strides.

#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{histogram_params, sphere};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use extractor::{Features, Histogram, Neighbours, estimate_normals};
use lidar::Return;

fn bench(c: &mut Criterion) {
    // Columns 0.72° apart as in the paper, and 0.166° as at 2,170 of them; the last a wall of a body round the corner.
    for (centre_m, radius_m, step_deg) in [
        ([24.0, 0.0, 0.0], 0.8, 0.72),
        ([9.0, 0.0, 0.2], 1.0, 0.72),
        ([9.0, 0.0, 0.2], 2.0, 0.166),
        ([9.0, 0.0, 0.2], 8.0, 0.04),
    ] {
        let returns = sphere(centre_m, radius_m, step_deg, 0.02, 1);
        let points: Vec<[f32; 3]> = returns.iter().map(Return::position).collect();
        let rings: Vec<u8> = returns.iter().map(|r| r.ring).collect();
        let mut neighbours = Neighbours::new(points.len(), 4);
        let mut normals = vec![[0.0; 3]; points.len()];
        let mut histogram = Histogram::new(points.len());
        let mut features = Features::new(&histogram_params().checked().unwrap());
        let mut group = c.benchmark_group("cluster");
        group.throughput(criterion::Throughput::Elements(points.len() as u64));
        let id = |name| BenchmarkId::new(name, points.len());
        group.bench_function(id("neighbours in any order"), |b| b.iter(|| neighbours.find(&points)));
        group.bench_function(id("neighbours in rings"), |b| b.iter(|| neighbours.find_in_rings(&points, &rings)));
        group.bench_function(id("normals"), |b| b.iter(|| estimate_normals(&points, &neighbours, &mut normals)));
        group.bench_function(id("histogram"), |b| {
            b.iter(|| {
                histogram.clear();
                histogram.add(&points, &normals, &neighbours);
            });
        });
        group.bench_function(id("all, stride 4"), |b| b.iter(|| features.describe(&returns, 4).bins().count()));
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
