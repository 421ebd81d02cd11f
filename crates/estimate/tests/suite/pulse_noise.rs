//! Noise on the samples of hits: the errors of all lines of a record are correlated.

use std::ops::Range;

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
const PULSE: Range<usize> = 20..32;
/// Noise on the force, in N, for pulses of 200 N.
const DEVIATION: f64 = 1.0;

/// Noise of a test, and the assumption of the fit about this noise.
struct Case<'a> {
    pulses: &'a [Range<usize>],
    /// Standard deviation of the noise of the response, relative to the largest line of the
    /// response.
    response_noise: f64,
    pooling: Pooling,
    /// `true` if the fit knows that the noise of the force acts during the pulses only.
    as_pulse: bool,
}

/// Returns the errors of m, c and k, identified from the steady-state response to periodic hits,
/// and their standard errors, each divided by the true value.
fn errors(seed: u64, case: &Case<'_>) -> Vec<[f64; 2]> {
    let system = oscillator();
    let fastest = system.modes().unwrap().last().unwrap().natural_frequency();
    let sampling = Sampling::new(0.3 / fastest, SAMPLES).unwrap();
    let lines = Lines::new(sampling, 1..=200).unwrap();
    let pulse_at = |k: usize| case.pulses.iter().find(|pulse| pulse.contains(&k));
    let pulse = |k: usize| {
        let of_pulse = |pulse: &Range<usize>| {
            let part = (k as f64 - pulse.start as f64 + 0.5) / pulse.len() as f64;
            200.0 * (std::f64::consts::PI * part).sin()
        };
        pulse_at(k).map_or(0.0, of_pulse)
    };
    let exact = Record::from_channel(sampling, (0..SAMPLES).map(pulse).collect()).unwrap();
    let drawn = noise::white(sampling, 1, DEVIATION, 2 * seed).unwrap();
    let noisy = (0..SAMPLES).map(|k| {
        let noise = pulse_at(k).map_or(0.0, |_| drawn.channel(0)[k]);
        exact.channel(0)[k] + noise
    });
    let noisy = Record::from_channel(sampling, noisy.collect()).unwrap();
    let force = lines.read(&exact).unwrap();
    let response = lines.omega().into_iter().zip(force.iter());
    let response: Vec<Complex<f64>> =
        response.map(|(omega, f)| system.receptance(omega).unwrap()[(0, 0)] * f).collect();
    let largest = response.iter().map(|x| x.norm()).fold(0.0, f64::max);
    let of_response = noise::white(sampling, 1, case.response_noise * largest, 2 * seed + 1);
    let of_response = of_response.unwrap();
    let response = DMatrix::from_vec(200, 1, response) + lines.read(&of_response).unwrap();
    let (measured, force) = (ResponseQuantity::Displacement, lines.read(&noisy).unwrap());
    let data = FrequencyData::from_amplitudes(lines.omega(), force, response, measured).unwrap();
    let data = if case.as_pulse {
        let pulses = case.pulses.iter().map(|samples| PulseNoise {
            rows: 0..200,
            sampling,
            channel: 0,
            deviation: DEVIATION,
            samples: samples.clone(),
        });
        data.with_pulse_noise(&pulses.collect::<Vec<_>>())
    } else {
        let samples: usize = case.pulses.iter().map(Range::len).sum();
        data.with_force_noise(&[DEVIATION * (samples as f64 / SAMPLES as f64).sqrt()], SAMPLES)
    };
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let fit = output_error_pooling(&data.unwrap(), &unknowns, case.pooling).unwrap();
    let truth = [system.mass(), system.damping(), system.stiffness()].map(|matrix| matrix[(0, 0)]);
    let each = fit.estimate.parameters().zip(truth);
    each.map(|(p, exact)| [(p.value - exact) / exact, p.standard_error / exact]).collect()
}

/// Returns the mean square of the errors of the parameters, each divided by its standard error, and
/// the RMS error of the damping ratio divided by the true damping ratio.
fn judge(case: &Case<'_>, tests: u64) -> (f64, f64) {
    let all: Vec<Vec<[f64; 2]>> =
        (0..tests).into_par_iter().map(|seed| errors(seed, case)).collect();
    let squares = all.iter().flatten().map(|[error, standard]| (error / standard).powi(2));
    let damping = all.iter().map(|parameters| {
        let [[m, _], [c, _], [k, _]] = [0, 1, 2].map(|at| parameters[at]);
        (c - 0.5 * (m + k)).powi(2)
    });
    let count = tests as f64;
    (squares.sum::<f64>() / (3.0 * count), (damping.sum::<f64>() / count).sqrt())
}

/// If the fit knows that the errors of the lines of a pulse are correlated, the mean square of the
/// errors, each divided by its standard error, is about 1. Each of 400 tests has three correlated
/// errors; their mean square scatters by about 0.08.
#[test]
fn the_covariance_knows_that_the_lines_of_a_pulse_err_together() {
    let of = |as_pulse: bool| {
        let pooling = Pooling::AllLines;
        judge(&Case { pulses: &[PULSE], response_noise: 0.05, pooling, as_pulse }, 400).0
    };
    let (together, apart) = (of(true), of(false));
    assert!((0.75..1.25).contains(&together), "{together}");
    assert!(apart > 1.5, "{apart}: as if every line had noise of its own");
}

/// Two hits in one record: near the resonance, the noise of the force has more effect than the
/// noise of the response. If the fit knows that the errors of the lines are correlated, the
/// standard errors agree with the errors. If it assumes independent lines, the lines near the
/// resonance have little weight, and the error of the damping ratio is at least 1.5 times as large.
#[test]
fn errors_of_pulses_are_found_with_the_parameters() {
    let of = |as_pulse: bool| {
        let (pulses, pooling) = (&[PULSE, 400..412], Pooling::Automatic);
        judge(&Case { pulses, response_noise: 0.005, pooling, as_pulse }, 200)
    };
    let ((square, together), (_, apart)) = (of(true), of(false));
    assert!((0.7..1.3).contains(&square), "{square}");
    assert!(apart > 1.5 * together, "{apart} {together}");
}
