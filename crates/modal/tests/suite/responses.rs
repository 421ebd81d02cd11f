//! Frequency responses of identified modes against those of the true structure.

use std::f64::consts::TAU;

use mechid_modal::{ModalSettings, identify_modes};
use nalgebra::{Complex, DVector};

use crate::generator::{Case, pair};

/// Returns the ratio of the squared errors to the stated variances, both summed over records and
/// lines. The lines at resonances dominate both sums, as they dominate the response to a force that
/// acts on all lines.
fn squared_ratio(case: &Case, seeds: std::ops::Range<u64>) -> f64 {
    let forces = [Complex::new(1.0, 0.0), Complex::new(0.3, -0.8)];
    let (mut squares, mut variances) = (0.0, 0.0);
    for seed in seeds {
        let estimate = identify_modes(&case.lines(seed), &ModalSettings::default()).unwrap();
        let model = estimate.model();
        let [low, high] = case.band_hz;
        for k in 0..400 {
            let omega = TAU * (low + (high - low) * (f64::from(k) + 0.5) / 400.0);
            let difference = model.response(omega) - case.response(omega, &case.participation);
            let error = difference * DVector::from_column_slice(&forces);
            let variance = model.response_variance(omega, &forces);
            squares += error.norm_squared();
            variances += variance.iter().sum::<f64>();
        }
    }
    squares / variances
}

/// Reference: the modal sum of the true structure. The ratio of the squared errors to the stated
/// variances is 1 on average; for three records it scatters by 40 %, because a few resonances
/// dominate the errors. The errors of two modes 0.3 % apart nearly cancel in the sum of these
/// modes: if these errors counted as independent, the ratio would be below 0.01.
#[test]
fn the_covariance_of_responses_is_that_of_their_errors() {
    let mut close = pair(8);
    close.frequency_hz[3] = 131.4;
    for case in [pair(8), Case { unmeasured: 0.05, ..pair(8) }, close] {
        let ratio = squared_ratio(&case, 0..3);
        assert!((0.3..2.5).contains(&ratio), "{}: {ratio}", case.name);
    }
}

#[test]
fn diagonal_and_full_covariance_agree() {
    let estimate = identify_modes(&pair(8).lines(1), &ModalSettings::default()).unwrap();
    let (model, forces) = (estimate.model(), [Complex::new(0.2, 1.0), Complex::new(-1.0, 0.5)]);
    assert!(model.is_consistent());
    for hz in [52.0, 131.0, 250.0] {
        let covariance = model.response_covariance(TAU * hz, &forces);
        let variance = model.response_variance(TAU * hz, &forces);
        for (output, variance) in variance.iter().enumerate() {
            let entry = covariance[(output, output)];
            assert!((entry.re / variance - 1.0).abs() < 1e-9 && entry.im.abs() < 1e-9 * variance);
        }
    }
}
