//! Cost of sampling a long multisine and of minimising a crest factor.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mechid_signal::{CrestSearch, Multisine, Phases, Sampling, lines};

/// Measures the duration of four computations: 10⁶ samples with all 499,999 lines, the samples of
/// the period of the dissertation, a plain sum of cosines for the same period, and one exact value,
/// which a Runge-Kutta stage needs.
fn sampling(c: &mut Criterion) {
    let sampling = Sampling::new(1e-6, 1_000_000).unwrap();
    let all = lines::full(sampling);
    let m = Multisine::flat(all, 1.0, Phases::SchroederBinary).unwrap();
    let mut group = c.benchmark_group("multisine");
    group.sample_size(10);
    group.bench_function("sample 1e6", |b| b.iter(|| black_box(&m).sample(sampling)));
    let few = Multisine::flat(1..=127, 1.0, Phases::SchroederBinary).unwrap();
    let short = Sampling::new(1e-3, 256).unwrap();
    group.bench_function("sample 256", |b| b.iter(|| black_box(&few).sample(short)));
    let omega0 = short.omega0();
    group.bench_function("sum of cosines 256", |b| {
        b.iter(|| short.times().map(|t| black_box(&few).value(t, omega0)).sum::<f64>())
    });
    group.bench_function("value of 127 lines", |b| {
        b.iter(|| black_box(&few).value(black_box(0.1234), omega0))
    });
    group.finish();
}

fn crest(c: &mut Criterion) {
    let mut group = c.benchmark_group("crest");
    group.sample_size(10);
    let flat = Multisine::flat(1..=127, 1.0, Phases::Schroeder).unwrap();
    let odd = Multisine::flat(lines::odd(127), 1.0, Phases::Schroeder).unwrap();
    let search = CrestSearch::default();
    group.bench_function("127 flat lines", |b| b.iter(|| search.minimise(black_box(&flat))));
    group.bench_function("64 odd lines", |b| b.iter(|| search.minimise(black_box(&odd))));
    group.finish();
}

criterion_group!(benches, sampling, crest);
criterion_main!(benches);
