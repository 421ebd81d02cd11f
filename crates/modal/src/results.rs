//! From a fit and its covariance to the numbers of a mode.

use std::f64::consts::TAU;

use mechid_numerics::Uncertain;
use nalgebra::{Complex, DMatrix};

use crate::covariance::Covariance;
use crate::limits::EDGE_HALF_WIDTHS;
use crate::lines::{Lines, Load};
use crate::mode::IdentifiedMode;
use crate::model::Model;
use crate::noise::{Noise, modal_gain};
use crate::search::Fit;

/// Returns natural frequency (Hz), damping ratio and their covariance, from those of ln(−Re λ) and
/// ln Im λ.
pub(crate) fn natural_frequency_and_damping(
    pole: Complex<f64>,
    mode: usize,
    covariance: &Covariance,
) -> (Uncertain, Uncertain, f64) {
    let (size, re, im) = (pole.norm(), pole.re, pole.im);
    let by_frequency = [re * re / size / TAU, im * im / size / TAU];
    let by_damping = [-re * im * im / size.powi(3), re * im * im / size.powi(3)];
    let product = |a: [f64; 2], b: [f64; 2]| -> f64 {
        let entry = |i: usize, j: usize| covariance.parameters[(2 * mode + i, 2 * mode + j)];
        (0..2)
            .flat_map(|i| (0..2).map(move |j| (i, j)))
            .map(|(i, j)| a[i] * entry(i, j) * b[j])
            .sum()
    };
    let uncertain = |value: f64, by: [f64; 2]| Uncertain {
        value,
        standard_error: product(by, by).max(0.0).sqrt(),
        degrees_of_freedom: covariance.degrees_of_freedom,
    };
    let frequency = uncertain(size / TAU, by_frequency);
    let damping = uncertain(-re / size, by_damping);
    (frequency, damping, product(by_frequency, by_damping))
}

/// Returns the power of a mode from the measured forces and from the unmeasured one.
fn powers(lines: &Lines, model: &Model, noise: &Noise, mode: usize) -> (f64, f64) {
    let (mut measured, mut unmeasured) = (0.0, 0.0);
    for block in &lines.blocks {
        for row in block.rows.clone() {
            let gain = modal_gain(model.poles[mode], lines.omega[row]).norm_sqr();
            let of_load = |load: &usize| match lines.loads[*load] {
                Load::Force(_) => model.participation[mode][*load] * lines.load(*load, row),
                Load::Transient(_) => Complex::default(),
            };
            let force: Complex<f64> = block.active.iter().map(of_load).sum();
            measured += gain * force.norm_sqr();
            unmeasured += gain * noise.process[mode];
        }
    }
    (measured, unmeasured)
}

/// Returns the ratio of the unmeasured to the measured modal force, or `None` without measured
/// forces.
pub(crate) fn unmeasured_ratio(
    lines: &Lines,
    model: &Model,
    noise: &Noise,
    mode: usize,
) -> Option<f64> {
    if lines.inputs() == 0 {
        return None;
    }
    let (measured, unmeasured) = powers(lines, model, noise, mode);
    Some((unmeasured / measured).sqrt())
}

/// Returns one mode of a fit; `gain` is what it brings to −2 log L.
pub(crate) fn identified_mode(
    fit: &Fit<'_>,
    noise: &Noise,
    covariance: &Covariance,
    shape: &[Complex<f64>],
    mode: usize,
    gain: f64,
) -> IdentifiedMode {
    let (lines, model, levels) = (fit.lines, &fit.model, &fit.weights.level);
    let pole = model.poles[mode];
    let (frequency, damping, between) = natural_frequency_and_damping(pole, mode, covariance);
    let reference =
        (0..shape.len()).max_by(|a, b| shape[*a].norm().total_cmp(&shape[*b].norm())).unwrap_or(0);
    let errors = |matrix: DMatrix<f64>| {
        Complex::new(matrix[(0, 0)].max(0.0).sqrt(), matrix[(1, 1)].max(0.0).sqrt())
    };
    let of_entry = |output: usize| {
        errors(covariance.of_normalised_shape(mode, output, reference, shape, levels))
    };
    let inputs = lines.inputs();
    let of_input = |input: usize| {
        let level = levels[reference];
        errors(covariance.of_participation(fit, mode, reference, input, shape[reference], level))
    };
    let driven_share =
        unmeasured_ratio(lines, model, noise, mode).map(|ratio| 1.0 / (1.0 + ratio * ratio));
    let (low, high) = lines.band();
    let width = EDGE_HALF_WIDTHS * -pole.re;
    IdentifiedMode {
        pole,
        natural_frequency_hz: frequency,
        damping_ratio: damping,
        frequency_damping_covariance: between,
        shape: shape.iter().map(|value| value / shape[reference]).collect(),
        shape_standard_error: (0..shape.len()).map(of_entry).collect(),
        participation: (0..inputs)
            .map(|input| model.participation[mode][input] * shape[reference])
            .collect(),
        participation_standard_error: (0..inputs).map(of_input).collect(),
        driven_share,
        unmeasured_ratio: unmeasured_ratio(lines, model, noise, mode),
        gain,
        near_edge: pole.im - low < width || high - pole.im < width,
    }
}
