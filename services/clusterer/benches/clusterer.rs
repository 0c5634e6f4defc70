//! What a sweep costs, by method, range d and columns of the turn; and what its last sector costs where it travels as many.

#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::cell::RefCell;

use clusterer::Method;
use common::scanner::Scanner;
use common::sectors::Sender;
use common::{WHOLE, room};
use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use messages::{Clusters, Cutter, Message, Sweep};
use stage::Stage;
use zerocopy::FromZeros;

const SECTORS: u32 = 36;

fn bench_whole(c: &mut Criterion, name: &str, samples: usize, sweep: &Sweep) {
    for (method_name, method) in [("scan", Method::Scan), ("kdtree", Method::Kdtree)] {
        for range_d_m in [0.5, 1.0] {
            let mut sut = room(method, range_d_m);
            let mut output = Clusters::new_box_zeroed().unwrap();
            let mut group = c.benchmark_group("process");
            group.sample_size(samples).bench_function(format!("{name}/{method_name}/d {range_d_m}"), |b| {
                b.iter(|| {
                    output.clear();
                    sut.process(WHOLE, sweep, &mut output)
                });
            });
            group.finish();
        }
    }
}

/// The last sector alone: the others are sent, and it is cut out, before each turn of the clock.
fn bench_last_sector(c: &mut Criterion, name: &str, sweep: &mut Sweep) {
    Cutter::new(SECTORS).measure(sweep);
    for range_d_m in [0.5, 1.0] {
        let sender = RefCell::new(Sender::new(room(Method::Scan, range_d_m)));
        let send_others = || {
            let mut sender = sender.borrow_mut();
            for sector in 0..SECTORS - 1 {
                sender.send_quietly(sweep, SECTORS, sector);
            }
            sender.cut(sweep, SECTORS, SECTORS - 1);
        };
        let mut group = c.benchmark_group(format!("last of {SECTORS} sectors"));
        group.sample_size(50).bench_function(format!("{name}/d {range_d_m}"), |b| {
            b.iter_batched(send_others, |()| sender.borrow_mut().send(SECTORS, SECTORS - 1), BatchSize::PerIteration);
        });
        group.finish();
    }
}

fn bench(c: &mut Criterion) {
    for (columns, samples) in [(500, 50), (2_170, 20)] {
        let full =
            Scanner { rings: 32, columns, walls_m: Some([15.0, 25.0, 6.0]), obstacles: 60, ..Scanner::default() };
        let open = Scanner { walls_m: None, ..full.clone() };
        for (scene, scanner) in [("room", full), ("open space", open)] {
            let mut sweep = scanner.sweep();
            let name = format!("{scene} of {} returns/{columns} columns", sweep.returns.len());
            bench_whole(c, &name, samples, &sweep);
            bench_last_sector(c, &name, &mut sweep);
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
