//! What a cluster costs, by model: the shipped support vector machine and the shipped trees.

#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

#[path = "../tests/common/mod.rs"]
mod common;

use classifier::{BoostedTrees, Svm, SvmFile, couple};
use common::histograms;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

fn bench(c: &mut Criterion) {
    let text = include_str!("../../../config/models/paper-svm/model.libsvm");
    let mut svm = Svm::new(&SvmFile::parse(text).unwrap());
    for count in [1, 40, 300] {
        let descriptors = histograms(count, 3);
        let mut group = c.benchmark_group("svm");
        group.throughput(Throughput::Elements(count as u64));
        group.bench_function(BenchmarkId::new("one by one", count), |b| {
            b.iter(|| descriptors.iter().map(|(_, bins)| svm.decide(bins).winner).sum::<usize>());
        });
        group.bench_function(BenchmarkId::new("together", count), |b| {
            b.iter(|| {
                let mut winners = 0;
                svm.decide_all(descriptors.iter().map(|(_, bins)| &bins[..]), |_, _, decision| {
                    winners += decision.winner;
                });
                winners
            });
        });
        group.finish();
    }
    c.bench_function("coupling", |b| {
        let pairwise = [[0.0, 0.9, 0.7, 0.6], [0.1, 0.0, 0.4, 0.3], [0.3, 0.6, 0.0, 0.5], [0.4, 0.7, 0.5, 0.0]];
        b.iter(|| couple(std::hint::black_box(&pairwise)));
    });
    let trees = BoostedTrees::parse(include_str!("../../../config/models/solids/model.txt")).unwrap();
    let features: Vec<f32> = (0..trees.feature_names().len()).map(|place| (place * 7 % 13) as f32 * 0.3).collect();
    c.bench_function("boosted trees", |b| b.iter(|| trees.posterior(std::hint::black_box(&features))));
}

criterion_group!(benches, bench);
criterion_main!(benches);
