//! What a sweep costs, by method, range d and columns of the turn.

#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

#[path = "../tests/common/mod.rs"]
mod common;

use clusterer::Method;
use common::scanner::Scanner;
use common::{WHOLE, room};
use criterion::{Criterion, criterion_group, criterion_main};
use messages::{Clusters, Message};
use stage::Stage;
use zerocopy::FromZeros;

fn bench(c: &mut Criterion) {
    for (columns, samples) in [(500, 50), (2_170, 20)] {
        let full =
            Scanner { rings: 32, columns, walls_m: Some([15.0, 25.0, 6.0]), obstacles: 60, ..Scanner::default() };
        let open = Scanner { walls_m: None, ..full.clone() };
        for (scene, scanner) in [("room", full), ("open space", open)] {
            let sweep = scanner.sweep();
            for (name, method) in [("scan", Method::Scan), ("kdtree", Method::Kdtree)] {
                for range_d_m in [0.5, 1.0] {
                    let mut sut = room(method, range_d_m);
                    let mut output = Clusters::new_box_zeroed().unwrap();
                    let name =
                        format!("{scene} of {} returns/{columns} columns/{name}/d {range_d_m}", sweep.returns.len());
                    let mut group = c.benchmark_group("process");
                    group.sample_size(samples).bench_function(name, |b| {
                        b.iter(|| {
                            output.clear();
                            sut.process(WHOLE, &sweep, &mut output)
                        });
                    });
                    group.finish();
                }
            }
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
