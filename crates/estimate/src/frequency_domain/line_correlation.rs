//! Correlation of the errors of neighbouring lines of a table, which the window of an analyser
//! causes.

use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::DVector;
use statrs::distribution::{ContinuousCDF, Normal};

use super::whitened::Whitened;
use crate::Estimate;
use crate::limits::{CORRELATED_DISTANCES, CORRELATED_LINES, LINE_STEP};

/// Returns the ratio of the variance of the parameters to that for independent lines: 1 + 2 Σ ρ_d,
/// where ρ_d is the correlation of the errors of lines d apart. The ratio is 1 if the residual
/// shows no correlation.
///
/// The ratio is right if the response changes little from line to line, and too large for
/// resonances as narrow as a line.
///
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), section 11.5 (windows); Newey & West (1987),
/// Econometrica 55, 703–708 (variance under correlation).
pub(super) fn variance_ratio(
    data: &FrequencyData,
    estimate: &Estimate,
    noise: &NoiseSpectrum,
) -> f64 {
    let values = estimate.parameters().map(|p| p.value).collect::<Vec<_>>();
    let covariance = |row: usize| noise.covariance(row).clone();
    let values = DVector::from_vec(values);
    let residual = Whitened::residual_of(data, estimate.unknowns(), &values, covariance);
    let Some(Whitened { residual, .. }) = residual else { return 1.0 };
    let omega = data.omega();
    let steps = omega.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    let step = steps.fold(f64::INFINITY, f64::min);
    let channels = 2 * data.dof();
    let of_row = |row: usize| residual.rows(channels * row, channels);
    let power = residual.norm_squared() / residual.len() as f64;
    let correlation = |distance: usize| {
        let is_pair = |row: &usize| {
            let apart = (omega[row + distance] - omega[*row]) / step;
            (apart - distance as f64).abs() < LINE_STEP
        };
        let pairs = (0..omega.len().saturating_sub(distance)).filter(is_pair);
        let products = pairs.map(|row| of_row(row).dot(&of_row(row + distance)));
        let (count, sum) =
            products.fold((0, 0.0), |(count, sum), one| (count + channels, sum + one));
        let correlation = sum / (count as f64 * power);
        let in_errors = correlation * (count as f64).sqrt();
        (correlation.is_finite() && Normal::standard().sf(in_errors) < CORRELATED_LINES)
            .then_some(correlation)
    };
    1.0 + 2.0 * (1..=CORRELATED_DISTANCES).map_while(correlation).sum::<f64>()
}
