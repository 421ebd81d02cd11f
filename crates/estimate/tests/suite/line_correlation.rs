//! Tables whose neighbouring lines have correlated errors.

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::output_error_of_table;
use mechid_model::{ResponseQuantity, Sdof};
use mechid_signal::{Sampling, noise};
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix};

/// Number of lines of a table.
const LINES: usize = 300;

/// Returns receptances at lines 1 to [`LINES`]; their noise is smoothed over neighbouring lines.
fn table(weights: [f64; 3], seed: u64) -> FrequencyData {
    let system = Sdof::new(5.0, 60.0, 6e4).unwrap().system();
    let sampling = Sampling::new(1.0, LINES + 2).unwrap();
    let drawn = noise::white(sampling, 2, 1e-7, seed).unwrap();
    let size = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
    let omega: Vec<f64> = (1..=LINES).map(|line| line as f64).collect();
    let response = |(row, omega): (usize, &f64)| {
        let smoothed = |channel: usize| {
            (0..3).map(|at| weights[at] * drawn.channel(channel)[row + at]).sum::<f64>() / size
        };
        let error = Complex::new(smoothed(0), smoothed(1));
        DMatrix::from_element(1, 1, system.receptance(*omega).unwrap()[(0, 0)] + error)
    };
    let response: Vec<_> = omega.iter().enumerate().map(response).collect();
    let quantity = ResponseQuantity::Displacement;
    FrequencyData::from_responses(&omega, &response, None, quantity, &[0]).unwrap()
}

/// The intervals contain the truth for independent and for smoothed lines. The weights ½, 1, ½
/// correlate neighbouring lines by 2/3 and lines at a distance of two by 1/6, so the variance of
/// the estimate is 8/3 times the variance with independent lines.
#[test]
fn intervals_hold_for_independent_and_for_smoothed_lines() {
    let truth = [5.0, 60.0, 6e4];
    for (weights, ratio) in [([0.0, 1.0, 0.0], 1.0), ([0.5, 1.0, 0.5], 8.0 / 3.0)] {
        let (mut held, mut ratios) = (0, Vec::new());
        for seed in 0..100 {
            let data = table(weights, seed);
            let fit = output_error_of_table(&data, &Unknowns::unknown_mass(1).unwrap()).unwrap();
            for (p, truth) in fit.estimate.parameters().zip(truth) {
                held += u32::from((p.value - truth).abs() < 1.96 * p.standard_error);
            }
            ratios.push(fit.variance_ratio);
        }
        let mean = ratios.iter().sum::<f64>() / 100.0;
        // On average, 285 of 300 intervals contain the truth, with a standard deviation of 4.
        assert!(held >= 273, "{weights:?}: {held} of 300");
        assert!((mean / ratio - 1.0).abs() < 0.1, "{weights:?}: {mean}");
    }
}
