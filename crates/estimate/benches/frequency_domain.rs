//! Cost of identifying the bearing in the frequency domain, records included.

#[allow(dead_code, reason = "the tests use the rest")]
#[path = "../tests/suite/common/mod.rs"]
mod common;

use mechid_model::ResponseQuantity;
use std::hint::black_box;

use common::monte_carlo::{Estimator, Experiment};
use common::{bearing, displacements, forces, synthesise};
use criterion::{Criterion, criterion_group, criterion_main};
use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{FrequencyData, Lines, equation_error};
use mechid_signal::{Sampling, Spectrum};

/// 1,024 samples of two forces and two displacements to C and K with their covariance.
fn identify(c: &mut Criterion) {
    let system = bearing();
    let sampling = Sampling::new(0.05, 1024).unwrap();
    let mut group = c.benchmark_group("bearing from 1024 samples");
    group.sample_size(30);
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    for count in [64, 256] {
        let chosen: Vec<usize> = (1..=count).collect();
        let lines = Lines::new(sampling, chosen.clone()).unwrap();
        let amplitudes = forces(&chosen, 2, 1.0);
        let motion = displacements(&system, &lines.omega(), &amplitudes);
        let force = synthesise(sampling, &chosen, &amplitudes, ResponseQuantity::Displacement);
        let motion = synthesise(sampling, &chosen, &motion, ResponseQuantity::Displacement);
        let read = |lines: &Lines| {
            FrequencyData::read(lines, &force, &motion, ResponseQuantity::Displacement).unwrap()
        };
        group.bench_function(format!("{count} lines, everything included"), |b| {
            b.iter(|| {
                let lines = Lines::new(sampling, black_box(&chosen).iter().copied()).unwrap();
                equation_error(&read(&lines), &unknowns).unwrap()
            })
        });
        group.bench_function(format!("{count} lines, transform planned before"), |b| {
            b.iter(|| equation_error(&read(black_box(&lines)), &unknowns).unwrap())
        });
        let data = read(&lines);
        group.bench_function(format!("{count} lines, from amplitudes"), |b| {
            b.iter(|| equation_error(black_box(&data), &unknowns).unwrap())
        });
        // The yardstick: the transforms alone.
        group.bench_function(format!("{count} lines, four transforms alone"), |b| {
            b.iter(|| (Spectrum::of(black_box(&force)), Spectrum::of(black_box(&motion))))
        });
    }
    group.finish();
}

/// One estimate of the bearing from 16 noisy periods of 256 samples, 127 lines.
fn estimators(c: &mut Criterion) {
    let system = bearing();
    let unknowns = Unknowns::known_mass(system.mass()).unwrap();
    let experiment = Experiment::new(system, unknowns, 16, 0.01);
    let periods = experiment.measure(1);
    let mut group = c.benchmark_group("bearing from 16 periods");
    group.sample_size(20);
    group.bench_function("measure", |b| b.iter(|| experiment.measure(black_box(1))));
    for estimator in
        [Estimator::LeastSquares, Estimator::InstrumentalVariables, Estimator::MaximumLikelihood]
    {
        group.bench_function(format!("{estimator:?}"), |b| {
            b.iter(|| experiment.estimate(black_box(&periods), estimator))
        });
    }
    group.finish();
}

criterion_group!(benches, identify, estimators);
criterion_main!(benches);
