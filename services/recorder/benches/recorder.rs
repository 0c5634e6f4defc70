//! What a sweep of 50,000 returns in 400 clusters costs the chain (`accept`) and the writer.

#![allow(clippy::unwrap_used, reason = "a bench fails by panicking")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::spin_loop;
use std::time::Duration;

use common::{HandMade, Sut, settings, start};
use criterion::{BatchSize, Criterion};
use messages::Tracks;
use recorder::Settings;
use stage::Sink;
use zerocopy::FromZeros;

fn wait_until_settled(recorder: &Sut, parts: u64) {
    while recorder.settled() < parts {
        spin_loop();
    }
}

fn bench(c: &mut Criterion) {
    let (mut trace, detections) = HandMade::interleaved(0, 50_000, 400, 100).whole();
    let mut message = Tracks::new_box_zeroed().unwrap();
    message.detections.copy_from(&detections);
    let folder = tempfile::tempdir().unwrap();
    let mut bench = |name: &str, of: Settings| {
        let mut recorder = start(of).unwrap();
        let mut parts = 0;
        c.bench_function(&format!("accept/{name}"), |b| {
            let recorder = std::cell::RefCell::new(&mut recorder);
            let parts = std::cell::Cell::from_mut(&mut parts);
            b.iter_batched(
                || wait_until_settled(&recorder.borrow(), parts.get()),
                |()| {
                    trace.part.sweep = parts.get();
                    parts.set(parts.get() + 1);
                    Sink::accept(&mut ***recorder.borrow_mut(), &trace, &message)
                },
                BatchSize::PerIteration,
            );
        });
        c.bench_function(&format!("accept and write/{name}"), |b| {
            b.iter(|| {
                trace.part.sweep = parts;
                parts += 1;
                let verdict = Sink::accept(&mut *recorder, &trace, &message);
                wait_until_settled(&recorder, parts);
                verdict
            });
        });
        recorder.finish().unwrap();
    };
    let file = |name| Some(folder.path().join(name));
    bench("statistics only", settings());
    bench(
        "to nowhere",
        Settings { detections: Some("/dev/null".into()), labels: Some("/dev/null".into()), ..settings() },
    );
    // Not lossless: that would measure the trace's writer.
    bench("trace to nowhere", Settings { trace: Some("/dev/null".into()), lossless: false, ..settings() });
    bench("detections file", Settings { detections: file("a"), ..settings() });
    bench("tracks file", Settings { tracks: file("d"), ..settings() });
    bench("both files", Settings { detections: file("b"), labels: file("c"), ..settings() });
}

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args();
    bench(&mut criterion);
    criterion.final_summary();
}
