//! Level of the force noise from the residual; the reference is the generator.

use std::f64::consts::TAU;

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{
    force_noise_factor, force_noise_of_residual, output_error_pooling,
};
use mechid_model::{ResponseQuantity, Sdof};
use mechid_signal::{Sampling, noise};
use mechid_spectra::{FrequencyData, Lines, Pooling};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

const SAMPLES: usize = 4096;
/// Stated standard deviation of the noise of a force of 1 N (RMS), in N.
const STATED: f64 = 0.03;

/// Returns one period of a random force on an oscillator with its natural frequency at line 400 and
/// a damping ratio of 0.02. The variance of the force noise is `ratio` times the stated one; the
/// noise of the response is white.
fn period(ratio: f64, seed: u64) -> FrequencyData {
    let sampling = Sampling::new(1.0 / SAMPLES as f64, SAMPLES).unwrap();
    let natural = TAU * 400.0;
    let system = Sdof::new(1.0, 0.04 * natural, natural * natural).unwrap().system();
    let lines = Lines::new(sampling, 1..=1200).unwrap();
    let read = |level: f64, seed: u64| {
        lines.read(&noise::white(sampling, 1, level, seed).unwrap()).unwrap()
    };
    let force = read(1.0, 3 * seed);
    let pairs = lines.omega().into_iter().zip(force.iter());
    let response: Vec<Complex<f64>> =
        pairs.map(|(omega, f)| system.receptance(omega).unwrap()[(0, 0)] * f).collect();
    let measured = &force + read(STATED * ratio.sqrt(), 3 * seed + 1);
    let response =
        DMatrix::from_vec(1200, 1, response) + read(0.02 / (natural * natural), 3 * seed + 2);
    FrequencyData::from_amplitudes(
        lines.omega(),
        measured,
        response,
        ResponseQuantity::Displacement,
    )
    .unwrap()
}

/// Returns the result of [`force_noise_factor`] for a [`period`].
fn factor(ratio: f64, seed: u64) -> Option<f64> {
    let data = period(ratio, seed).with_force_noise(&[STATED], SAMPLES).unwrap();
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let fit = output_error_pooling(&data, &unknowns, Pooling::AllLines).unwrap();
    force_noise_factor(&data, &unknowns, &fit)
}

/// Returns the result of [`force_noise_of_residual`] for a [`period`] that was fitted with an exact
/// force and noise of the response of any spectrum.
fn ratio_of_residual(ratio: f64, seed: u64) -> Option<f64> {
    let data = period(ratio, seed);
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let fit = output_error_pooling(&data, &unknowns, Pooling::Automatic).unwrap();
    let stated = data.with_force_noise(&[STATED], SAMPLES).unwrap();
    force_noise_of_residual(&stated, &unknowns, &fit)
}

/// If the stated level of the force noise is correct, the test at a level of 1 % finds less noise
/// in at most 3 of 60 records. The probability of more than 3 is 0.003. If the noise is weaker than
/// stated, the mean of the factors is the ratio of the true variance to the stated variance.
#[test]
fn the_factor_is_the_ratio_of_the_variances() {
    let all = |ratio: f64| -> Vec<Option<f64>> {
        (0..60).into_par_iter().map(|seed| factor(ratio, seed)).collect()
    };
    let reduced = all(1.0).iter().flatten().count();
    assert!(reduced <= 3, "{reduced} of 60");
    for ratio in [0.3, 0.1, 0.0] {
        let factors: Vec<f64> = all(ratio).into_iter().flatten().collect();
        let mean = factors.iter().sum::<f64>() / factors.len() as f64;
        assert!(factors.len() >= 57, "{ratio}: {} of 60", factors.len());
        assert!((mean - ratio).abs() < 0.05, "{ratio}: {mean}");
    }
}

/// Without noise of the force, the residual shows none in at least 57 of 60 records: Schwarz's
/// criterion accepts one parameter too many with a probability of about 0.01. With noise, it is
/// found in every record; the mean of the ratios is the ratio of the true variance to the stated
/// one.
#[test]
fn the_residual_shows_the_noise_of_the_force() {
    let all = |ratio: f64| -> Vec<f64> {
        (0..60).into_par_iter().filter_map(|seed| ratio_of_residual(ratio, seed)).collect()
    };
    let exact = all(0.0).len();
    assert!(exact <= 3, "{exact} of 60");
    for ratio in [0.5, 1.0] {
        let ratios = all(ratio);
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        assert!(ratios.len() >= 57, "{ratio}: {} of 60", ratios.len());
        assert!((mean / ratio - 1.0).abs() < 0.1, "{ratio}: {mean}");
    }
}
