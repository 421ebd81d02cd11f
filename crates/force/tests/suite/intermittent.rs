//! Forces that act for a part of a record, and records that begin at rest.

use std::f64::consts::{PI, TAU};

use mechid_force::{Measurement, Start, Tuning, kalman, starts_at_rest, within_band};
use mechid_model::{InitialState, ResponseQuantity, SecondOrderSystem};
use mechid_problems::exact_foh;
use mechid_signal::{Extent, Record, Sampling, noise};
use nalgebra::{DMatrix, dmatrix};

use crate::study::accelerations::row;

const OVERSAMPLED: usize = 8;

/// Returns an oscillator of 10 kg with a natural frequency of 9 Hz and a damping ratio of 3.5 %.
fn oscillator() -> SecondOrderSystem {
    let stiffness = 10.0 * (TAU * 9.0).powi(2);
    SecondOrderSystem::new(dmatrix![10.0], dmatrix![40.0], dmatrix![stiffness]).unwrap()
}

/// Returns every eighth sample of a force and of the exact accelerations that it causes from rest.
/// White noise with a standard deviation of 1 % of their RMS value is added to the accelerations.
fn measured(
    system: &SecondOrderSystem,
    force: impl Fn(f64) -> f64,
    [rate_hz, samples]: [usize; 2],
    seed: u64,
) -> (Record, Measurement) {
    let fine =
        Sampling::from_rate_hz((OVERSAMPLED * rate_hz) as f64, OVERSAMPLED * samples).unwrap();
    let dof = system.dof();
    let data =
        DMatrix::from_fn(fine.len(), dof, |k, c| if c == 0 { force(fine.time(k)) } else { 0.0 });
    let exact = Record::new(fine, data).unwrap();
    let response = exact_foh(system, &exact, &InitialState::rest(dof)).unwrap();
    let sampling = Sampling::from_rate_hz(rate_hz as f64, samples).unwrap();
    let every = |record: &Record| {
        let data = DMatrix::from_fn(samples, dof, |k, c| record.data()[(OVERSAMPLED * k, c)]);
        Record::new(sampling, data).unwrap()
    };
    let acceleration = every(response.quantity(ResponseQuantity::Acceleration));
    let rms = (acceleration.data().norm_squared() / (samples * dof) as f64).sqrt();
    let noise = noise::white(sampling, dof, 0.01 * rms, seed).unwrap();
    let noisy = Record::new(sampling, acceleration.data() + noise.data()).unwrap();
    (every(&exact), Measurement::from_record(ResponseQuantity::Acceleration, noisy))
}

/// The intervals contain the force of an impact at 88 % of the samples or more. The spectrum of a
/// pulse falls like that of a stationary force model of low order. A fit of this model to the whole
/// record mistakes all noise for force: its intervals contained the force at only 51 % of the
/// samples.
#[test]
fn the_error_of_an_impact_is_that_of_its_noise() {
    let runs = 4;
    let held = |seed: u64| {
        let first = 0.1 + 0.012 * seed as f64;
        let pulse = |t: f64| {
            let part = (t - first) / 0.012;
            if (0.0..=1.0).contains(&part) { 500.0 * (PI * part).sin() } else { 0.0 }
        };
        let (force, measured) = measured(&oscillator(), pulse, [1000, 1024], seed);
        let found = kalman(&oscillator(), &measured, &[0], Start::InMotion, &Tuning::Likelihood);
        let found = found.unwrap().force;
        let band_hz = found.band_hz().unwrap();
        let truth = within_band(&force, band_hz, Extent::Open).unwrap();
        let error = found.standard_error().unwrap();
        let inside = (0..1024).filter(|k| {
            let off = found.record().channel(0)[*k] - truth.channel(0)[*k];
            off.abs() <= 1.96 * error.channel(0)[*k]
        });
        inside.count() as f64 / 1024.0
    };
    let held: Vec<f64> = (1..=runs).map(held).collect();
    let mean = held.iter().sum::<f64>() / runs as f64;
    // The errors are correlated over half a second, so each record has only a few dozen independent
    // errors, and the limit is well below 0.95.
    assert!(mean > 0.88, "{held:?}");
}

#[test]
fn a_record_that_begins_at_rest_is_told_from_one_in_motion() {
    let system = row(3, 8.0);
    for seed in 1..=6 {
        let random =
            noise::white(Sampling::from_rate_hz(512.0, 4096).unwrap(), 1, 40.0, seed).unwrap();
        let force = |t: f64| random.channel(0)[((t * 512.0) as usize).min(4095)];
        let (_, whole) = measured(&system, force, [256, 1200], 100 + seed);
        let part = |first: usize, len: usize| {
            let record = whole.record().window(first, len).unwrap();
            Measurement::new(record, whole.channels().to_vec()).unwrap()
        };
        let at_rest =
            |measured: &Measurement| starts_at_rest(&system, measured, &[0], None).unwrap();
        assert!(at_rest(&part(0, 500)), "{seed}");
        assert!(!at_rest(&part(600, 500)), "{seed}");
    }
}
