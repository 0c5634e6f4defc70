//! What a sweep costs, by number of tracks.

#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{Seen, message, moving, params, part};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use messages::{EgoMotion, Message, Part, Tracks};
use stage::Stage;
use tracker::Tracker;
use zerocopy::FromZeros;

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("tracker");
    for tracks in [10, 60, 500] {
        let crowd = |sweep: u64| -> Vec<(u32, Seen)> {
            let one = |place: u32| {
                let (angle, range) = (f64::from(place) * 2.4, 4.0 + 2.0 * f64::from(place).sqrt());
                moving([angle.cos() * range, angle.sin() * range, 0.0], [0.1, 0.2, 0.0], sweep)
            };
            (0..tracks).map(|place| (place, one(place))).collect()
        };
        let mut sut = Tracker::init(params()).unwrap();
        let mut output = Tracks::new_box_zeroed().unwrap();
        for sweep in 0..20 {
            output.clear();
            sut.process(part(sweep, 0, 1), &message(sweep, EgoMotion::default(), &crowd(sweep)), &mut output);
        }
        // The same sweep again and again: each time the tracks are first put back.
        let input = message(20, EgoMotion::default(), &crowd(20));
        let mut attempt = 0;
        group.throughput(Throughput::Elements(u64::from(tracks)));
        group.bench_function(BenchmarkId::new("sweep", tracks), |b| {
            b.iter(|| {
                attempt += 1;
                output.clear();
                sut.process(Part { attempt, ..part(20, 0, 1) }, &input, &mut output)
            });
        });
        assert_eq!(output.table.tracks.len(), tracks as usize);
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
