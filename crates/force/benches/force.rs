//! Cost of each reconstruction, on the two-degree-of-freedom bearing:
//! `cargo bench -p mechid-force`. Time per sample is constant for all but the dense open record.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mechid_force::{
    Filter, ForceModel, ForceUnknowns, Measurement, Noise, Rule, Start, Tuning, continuous,
    discretised, frequency_domain, inner_lines, kalman, regularised,
};
use mechid_model::{
    Discretisation, InitialState, KyxSign, Response, ResponseQuantity, SecondOrderSystem,
};
use mechid_problems::{dissertation_bearing, exact_foh};
use mechid_signal::{Extent, NoiseLevel, Record, Sampling, noise};
use nalgebra::DMatrix;

fn bearing() -> SecondOrderSystem {
    dissertation_bearing(KyxSign::Minus).system()
}

fn response(len: usize) -> Response {
    let sampling = Sampling::new(0.05, len).unwrap();
    let force = DMatrix::from_fn(len, 2, |k, i| if i == 1 { (0.3 * k as f64).sin() } else { 0.0 });
    let force = Record::new(sampling, force).unwrap();
    exact_foh(&bearing(), &force, &InitialState::rest(2)).unwrap()
}

fn displacements(len: usize) -> Measurement {
    let exact = response(len);
    let noisy = noise::add_white(exact.displacement(), NoiseLevel::FractionOfRms(0.01), 1).unwrap();
    Measurement::from_record(ResponseQuantity::Displacement, noisy)
}

fn equations(c: &mut Criterion) {
    let mut group = c.benchmark_group("equation of motion");
    for len in [1_000, 100_000] {
        let motion = response(len);
        group.throughput(Throughput::Elements(len as u64));
        group.bench_function(BenchmarkId::new("continuous", len), |b| {
            b.iter(|| continuous(&bearing(), &motion).unwrap());
        });
        group.bench_function(BenchmarkId::new("exact linear", len), |b| {
            let how = Discretisation::FirstOrderHold;
            b.iter(|| discretised(&bearing(), &motion, how, Extent::Open).unwrap());
        });
    }
    group.finish();
}

fn periods(c: &mut Criterion) {
    let mut group = c.benchmark_group("whole period");
    group.sample_size(20);
    for len in [1_024, 16_384] {
        let measured = displacements(len);
        let lines = inner_lines(&measured);
        group.throughput(Throughput::Elements(len as u64));
        group.bench_function(BenchmarkId::new("frequency domain", len), |b| {
            b.iter(|| frequency_domain(&bearing(), &measured, &[1], &lines, &Noise::Unknown));
        });
        for (name, filter) in
            [("Tikhonov, GCV", Filter::Tikhonov(Rule::Gcv)), ("shrinkage", Filter::Shrinkage)]
        {
            let (extent, noise) = (ForceUnknowns::EveryLine, Noise::Unknown);
            group.bench_function(BenchmarkId::new(name, len), |b| {
                b.iter(|| regularised(&bearing(), &measured, &[1], &extent, filter, &noise));
            });
        }
    }
    group.finish();
}

fn open_records(c: &mut Criterion) {
    let mut group = c.benchmark_group("open record");
    group.sample_size(10);
    for len in [128, 256, 512] {
        let measured = displacements(len);
        let filter = Filter::Tikhonov(Rule::Likelihood);
        let (extent, noise) = (ForceUnknowns::Samples(Start::InMotion), Noise::Unknown);
        group.throughput(Throughput::Elements(len as u64));
        group.bench_function(BenchmarkId::new("Tikhonov, dense", len), |b| {
            b.iter(|| regularised(&bearing(), &measured, &[1], &extent, filter, &noise));
        });
    }
    for len in [1_000, 10_000, 100_000] {
        let measured = displacements(len);
        let tuning = Tuning::Given {
            noise_std: vec![1e-3; 2],
            model: ForceModel { order: 2, corner_hz: 1.0, rms: vec![1.0] },
        };
        group.throughput(Throughput::Elements(len as u64));
        group.bench_function(BenchmarkId::new("Kalman smoother, tuned", len), |b| {
            b.iter(|| kalman(&bearing(), &measured, &[1], Start::InMotion, &tuning));
        });
    }
    let measured = displacements(10_000);
    group.bench_function("Kalman smoother, likelihood/10000", |b| {
        b.iter(|| kalman(&bearing(), &measured, &[1], Start::InMotion, &Tuning::Likelihood));
    });
    group.finish();
}

criterion_group!(benches, equations, periods, open_records);
criterion_main!(benches);
