//! The speed of rotation of which a misfit speaks.

use std::f64::consts::TAU;

use mechid_checks::limits::{CONCENTRATED, DISTURBED_ALONE};
use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::equation_error;
use mechid_model::ResponseQuantity;
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix};

use super::data::{rotates, spacing};

/// Number of lines over those near the multiples of a speed: of more lines chance finds some speed that holds any few.
const LINES_PER_MULTIPLE: usize = 4;

/// Returns the speed, in Hz, without whose multiples the tests agree with a film up to their noise, or nearly; `None` if
/// there is none. Of several it is the one with the fewest lines.
///
/// The film is that of least squares on the equation of motion, of each speed anew: what the disturbed lines did to it
/// goes with them.
///
/// # Source
/// Cook & Weisberg, *Residuals and Influence in Regression* (1982), deletion of several cases.
pub(super) fn speed_of_misfit(data: &FrequencyData) -> Option<f64> {
    let all: Vec<usize> = (0..data.len()).collect();
    let whole = residual_power(data, &all)?;
    let spacing_hz = spacing(data.omega());
    let highest = data.omega().iter().copied().fold(0.0, f64::max) / TAU;
    let mut speeds: Vec<(usize, f64)> = Vec::new();
    let mut hz = 2.0 * spacing_hz;
    while hz > 0.0 && hz <= highest {
        let kept: Vec<usize> = all
            .iter()
            .copied()
            .filter(|row| !rotates(data.omega()[*row] / TAU, Some(hz), spacing_hz))
            .collect();
        let removed = all.len() - kept.len();
        if (1..=all.len() / LINES_PER_MULTIPLE).contains(&removed)
            && let Some(power) = residual_power(data, &kept)
            && power <= DISTURBED_ALONE
            && whole - power >= CONCENTRATED * (whole - 1.0)
        {
            speeds.push((removed, hz));
        }
        // The highest multiple moves by half the distance of the lines.
        hz *= 1.0 + 0.5 * spacing_hz / highest;
    }
    let fewest = speeds.iter().map(|(removed, _)| *removed).min()?;
    let hz: Vec<f64> =
        speeds.into_iter().filter(|(removed, _)| *removed == fewest).map(|(_, hz)| hz).collect();
    // Speeds in the middle of those with the same lines.
    Some(hz[hz.len() / 2])
}

/// Residual power of some rows over that of their noise.
fn residual_power(data: &FrequencyData, rows: &[usize]) -> Option<f64> {
    let omega: Vec<f64> = rows.iter().map(|row| data.omega()[*row]).collect();
    let [force, motion] = [data.force(), data.displacement()].map(|m| m.select_rows(rows));
    let kind = ResponseQuantity::Displacement;
    let part = FrequencyData::from_amplitudes(omega, force, motion, kind).ok()?;
    let estimate = equation_error(&part, &Unknowns::unknown_mass(2).ok()?).ok()?;
    let system = estimate.system().ok()?;
    let noise = data.noise()?;
    let mut power = 0.0;
    for row in rows {
        let omega = data.omega()[*row];
        let h = DMatrix::from_fn(2, 2, |i, j| {
            let real = system.stiffness()[(i, j)] - omega * omega * system.mass()[(i, j)];
            Complex::new(real, omega * system.damping()[(i, j)])
        });
        let [x, f] = [data.displacement(), data.force()].map(|m| m.row(*row).transpose());
        let error = f - &h * x;
        // Of the error F − H X, with displacements first in the covariance of the noise.
        let mut weights = DMatrix::<Complex<f64>>::zeros(2, 4);
        weights.view_mut((0, 0), (2, 2)).copy_from(&-h);
        weights.view_mut((0, 2), (2, 2)).fill_with_identity();
        let covariance = &weights * noise.covariance(*row) * weights.adjoint();
        power += error.dotc(&covariance.lu().solve(&error)?).re;
    }
    let mean = power / (2 * rows.len()) as f64;
    mean.is_finite().then_some(mean)
}
