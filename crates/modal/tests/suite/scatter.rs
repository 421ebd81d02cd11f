//! Errors that move all outputs together, as the leakage of averaged responses does.

use std::f64::consts::TAU;

use mechid_modal::{ModalSettings, identify_modes};
use mechid_signal::{Sampling, noise};
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix};

const OUTPUTS: usize = 8;
const HZ: f64 = 20.0;
const RATIO: f64 = 0.02;

/// Returns responses to a unit force at lines 0.1 Hz apart, with independent noise and with an
/// error along the shape. This error is random on each line; at the resonance its size is `along`
/// times the response, and away from the resonance it falls faster than the response. The stated
/// variance includes both errors.
fn table(along: f64, seed: u64) -> LineData {
    let lines = 300;
    let sampling = Sampling::new(1.0, lines).unwrap();
    let drawn = noise::white(sampling, 2 * OUTPUTS + 2, 0.5_f64.sqrt(), seed).unwrap();
    let normal = |channel: usize, line: usize| {
        Complex::new(drawn.channel(2 * channel)[line], drawn.channel(2 * channel + 1)[line])
    };
    let hz = |line: usize| 5.0 + 0.1 * line as f64;
    let response = |line: usize, output: usize| {
        let [s, omega] = [Complex::new(0.0, TAU * hz(line)), Complex::from(TAU * HZ)];
        let shape = (1.0 + output as f64).sin();
        shape * omega * omega / (s * s + 2.0 * RATIO * omega * s + omega * omega)
    };
    let level = 0.01;
    let size = |line: usize| {
        let peak = response(150, 0).norm();
        along * (response(line, 0).norm() / peak).powi(2)
    };
    let outputs = DMatrix::from_fn(lines, OUTPUTS, |line, output| {
        let exact = response(line, output);
        exact * (1.0 + size(line) * normal(OUTPUTS, line)) + level * normal(output, line)
    });
    let variance = DMatrix::from_fn(lines, OUTPUTS, |line, output| {
        level * level + (size(line) * response(line, output).norm()).powi(2)
    });
    let omega = (0..lines).map(|line| TAU * hz(line)).collect();
    let inputs = DMatrix::from_element(lines, 1, Complex::from(1.0));
    let data = LineData::new(omega, inputs, outputs, Transient::None).unwrap();
    data.with_output_variance(variance).unwrap()
}

/// Under independent noise, 76 of 80 intervals of frequency and damping ratio contain the true
/// value on average, with a standard deviation of 2, and the ratio of the scatter along the shape
/// to its expected value is near 1. Under a common error of all outputs, which no noise model
/// describes, fewer intervals contain the true value. If the variances are multiplied by this ratio
/// of the scatter, more intervals contain the true value, but fewer than 95 %.
#[test]
fn the_scatter_shows_outputs_that_move_together() {
    for along in [0.0, 0.05] {
        let (mut held, mut without, mut ratios) = (0, 0, 0.0);
        for seed in 0..40 {
            let data = table(along, seed);
            let estimate = identify_modes(&data, &ModalSettings::default()).unwrap();
            let scatter = estimate.scatter_along_shapes(&data).unwrap();
            let [Some(ratio)] = scatter[..] else { panic!("{scatter:?}") };
            let mode = &estimate.modes()[0];
            let errors = [
                (mode.natural_frequency_hz.value - HZ, mode.natural_frequency_hz.standard_error),
                (mode.damping_ratio.value - RATIO, mode.damping_ratio.standard_error),
            ];
            for (error, standard_error) in errors {
                let size = error.abs() / standard_error;
                without += u32::from(size < 1.96);
                held += u32::from(size < 1.96 * ratio.max(1.0).sqrt());
            }
            ratios += ratio / 40.0;
        }
        if along > 0.0 {
            assert!(held >= without + 15 && ratios > 1.5, "{held}, {without}, ratio {ratios}");
        } else {
            assert!(held >= 70 && (0.8..1.3).contains(&ratios), "{held}, ratio {ratios}");
        }
    }
}
