//! The speed of rotation of which a misfit speaks.

use std::f64::consts::TAU;

use mechid_checks::limits::{CONCENTRATED, DISTURBED_ALONE};
use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::equation_error;
use mechid_model::ResponseQuantity;
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix};

use super::BearingData;
use super::data::rotates;

/// Number of lines over those near the multiples of a speed: of more lines chance finds some speed that holds any few.
const LINES_PER_MULTIPLE: usize = 4;

/// Number of speeds that are tried at most.
const MOST_SPEEDS: usize = 10_000;

/// Difference of the Bayesian information criterion up to which speeds are as likely as the best.
const ALIKE: f64 = 6.0;

/// Returns the range of the speed, in Hz, without whose multiples the tests agree with a film up to their noise, or nearly; `None` if
/// there is none. It holds the speeds of least Bayesian information criterion.
///
/// The film is that of least squares on the equation of motion, of each speed anew: what the disturbed lines did to it
/// goes with them.
///
/// # Source
/// Cook & Weisberg, *Residuals and Influence in Regression* (1982), deletion of several cases; Schwarz (1978), Annals of
/// Statistics 6, 461–464.
pub(super) fn speed_of_misfit(tests: &BearingData) -> Option<[f64; 2]> {
    let (data, spacing_hz) = (&tests.data, tests.spacing_hz);
    let all: Vec<usize> = (0..data.len()).collect();
    let whole = residual_power(data, &all)?;
    let highest = data.omega().iter().copied().fold(0.0, f64::max) / TAU;
    let mut speeds: Vec<(f64, f64)> = Vec::new();
    let mut hz = 2.0 * spacing_hz;
    while hz > 0.0 && hz <= highest && speeds.len() < MOST_SPEEDS {
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
            // A line that is left out has a response and a force of its own, two complex numbers.
            let [kept, removed, all] =
                [kept.len(), removed, all.len()].map(|count| (4 * count) as f64);
            speeds.push((kept * power + removed * all.ln(), hz));
        }
        // The highest multiple moves by half the distance of the lines.
        hz *= 1.0 + 0.5 * spacing_hz / highest;
    }
    let best = speeds.iter().map(|(criterion, _)| *criterion).reduce(f64::min)?;
    let alike = speeds.iter().filter(|(criterion, _)| criterion - best <= ALIKE);
    let hz = || alike.clone().map(|(_, hz)| *hz);
    Some([hz().fold(f64::INFINITY, f64::min), hz().fold(0.0, f64::max)])
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
