//! Noise on the samples of a hit: the covariance must include the common error of its lines.

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::output_error_pooling;
use mechid_model::ResponseQuantity;
use mechid_signal::{Record, Sampling, noise};
use mechid_spectra::noise::pulse::PulseNoise;
use mechid_spectra::{FrequencyData, Lines, Pooling};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use crate::common::oscillator;

const SAMPLES: usize = 1024;
const PULSE: std::ops::Range<usize> = 20..32;
/// Noise on the force, in N, for a pulse of 200 N.
const DEVIATION: f64 = 1.0;

/// Squares of the errors of m, c and k over their standard errors, of the response to one hit in steady state.
fn errors(seed: u64, as_pulse: bool) -> Vec<f64> {
    let system = oscillator();
    let fastest = system.modes().unwrap().last().unwrap().natural_frequency();
    let sampling = Sampling::new(0.3 / fastest, SAMPLES).unwrap();
    let lines = Lines::new(sampling, 1..=200).unwrap();
    let pulse = |k: usize| {
        let part = (k as f64 - 19.5) / PULSE.len() as f64;
        if PULSE.contains(&k) { 200.0 * (std::f64::consts::PI * part).sin() } else { 0.0 }
    };
    let exact = Record::from_channel(sampling, (0..SAMPLES).map(pulse).collect()).unwrap();
    let drawn = noise::white(sampling, 1, DEVIATION, 2 * seed).unwrap();
    let noisy = (0..SAMPLES).map(|k| {
        let noise = if PULSE.contains(&k) { drawn.channel(0)[k] } else { 0.0 };
        exact.channel(0)[k] + noise
    });
    let noisy = Record::from_channel(sampling, noisy.collect()).unwrap();
    let force = lines.read(&exact).unwrap();
    let response = lines.omega().into_iter().zip(force.iter());
    let response: Vec<Complex<f64>> =
        response.map(|(omega, f)| system.receptance(omega).unwrap()[(0, 0)] * f).collect();
    let largest = response.iter().map(|x| x.norm()).fold(0.0, f64::max);
    let of_response = noise::white(sampling, 1, 0.05 * largest, 2 * seed + 1).unwrap();
    let response = DMatrix::from_vec(200, 1, response) + lines.read(&of_response).unwrap();
    let (measured, force) = (ResponseQuantity::Displacement, lines.read(&noisy).unwrap());
    let data = FrequencyData::from_amplitudes(lines.omega(), force, response, measured).unwrap();
    let data = match as_pulse {
        true => {
            let (rows, samples, deviation) = (0..200, PULSE, DEVIATION);
            data.with_pulse_noise(&[PulseNoise { rows, sampling, channel: 0, deviation, samples }])
        }
        false => {
            let share = (PULSE.len() as f64 / SAMPLES as f64).sqrt();
            data.with_force_noise(&[DEVIATION * share], SAMPLES)
        }
    };
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let fit = output_error_pooling(&data.unwrap(), &unknowns, Pooling::AllLines).unwrap();
    let truth = [system.mass(), system.damping(), system.stiffness()].map(|matrix| matrix[(0, 0)]);
    let each = fit.estimate.parameters().zip(truth);
    each.map(|(p, exact)| ((p.value - exact) / p.standard_error).powi(2)).collect()
}

/// In 400 tests the mean square of three errors, which are not independent, scatters by about 0.08.
#[test]
fn the_covariance_knows_that_the_lines_of_a_pulse_err_together() {
    let mean = |as_pulse: bool| {
        let all: Vec<f64> =
            (0..400u64).into_par_iter().flat_map_iter(|seed| errors(seed, as_pulse)).collect();
        all.iter().sum::<f64>() / all.len() as f64
    };
    let (together, apart) = (mean(true), mean(false));
    assert!((0.75..1.25).contains(&together), "{together}");
    assert!(apart > 1.5, "{apart}: as if every line had noise of its own");
}
