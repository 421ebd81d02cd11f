//! Speed of rotation that would explain a misfit.

use std::f64::consts::TAU;

use mechid_checks::limits::{CONCENTRATED, DISTURBED_ALONE};
use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::equation_error;
use mechid_model::ResponseQuantity;
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix};

use super::BearingData;
use super::data::rotates;

/// Minimum ratio of the number of lines to the number of lines near the multiples of a speed; with
/// a smaller ratio, some trial speed would by chance have its multiples near any disturbed lines.
const LINES_PER_MULTIPLE: usize = 4;

/// Maximum number of trial speeds.
const MOST_SPEEDS: usize = 10_000;

/// Maximum difference of the Bayesian information criterion from its minimum for a plausible speed.
const PLAUSIBLE: f64 = 6.0;

/// Returns the range of speeds, in Hz, that explain the misfit: if the lines at the multiples of
/// the speed are excluded, the residual of a fitted film is close to the noise. `None` if there is
/// no such speed. The range contains the speeds whose Bayesian information criterion is close to
/// the smallest one.
///
/// For each speed, a film is fitted to the other lines by least squares on the equation of motion,
/// so that the excluded lines do not influence the film.
///
/// # Source
/// Cook & Weisberg, *Residuals and Influence in Regression* (1982), deletion of several cases;
/// Schwarz (1978), Annals of Statistics 6, 461–464.
pub(super) fn speed_of_misfit(tests: &BearingData) -> Option<[f64; 2]> {
    let (data, spacing_hz) = (&tests.data, tests.spacing_hz);
    let rows: Vec<usize> = (0..data.len()).collect();
    let whole = residual_power(data, &rows)?;
    let highest = data.omega().iter().copied().fold(0.0, f64::max) / TAU;
    let mut speeds: Vec<(f64, f64)> = Vec::new();
    let mut hz = 2.0 * spacing_hz;
    while hz > 0.0 && hz <= highest && speeds.len() < MOST_SPEEDS {
        let used: Vec<usize> = rows
            .iter()
            .copied()
            .filter(|row| !rotates(data.omega()[*row] / TAU, Some(hz), spacing_hz))
            .collect();
        let excluded = rows.len() - used.len();
        if (1..=rows.len() / LINES_PER_MULTIPLE).contains(&excluded)
            && let Some(power) = residual_power(data, &used)
            && power <= DISTURBED_ALONE
            && whole - power >= CONCENTRATED * (whole - 1.0)
        {
            // Each line has two complex residuals, which are four real numbers. The exclusion of a
            // line therefore counts as four parameters.
            let [used, excluded, total] =
                [used.len(), excluded, rows.len()].map(|count| (4 * count) as f64);
            speeds.push((used * power + excluded * total.ln(), hz));
        }
        // This step of the speed moves the highest multiple of the speed in the band by half the
        // line spacing.
        hz *= 1.0 + 0.5 * spacing_hz / highest;
    }
    let best = speeds.iter().map(|(criterion, _)| *criterion).reduce(f64::min)?;
    let plausible = speeds.iter().filter(|(criterion, _)| criterion - best <= PLAUSIBLE);
    let hz = || plausible.clone().map(|(_, hz)| *hz);
    Some([hz().fold(f64::INFINITY, f64::min), hz().fold(0.0, f64::max)])
}

/// Returns the ratio of the residual power of some rows to their noise power.
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
        // Covariance of the error F − H X; the noise covariance has the displacements first.
        let mut weights = DMatrix::<Complex<f64>>::zeros(2, 4);
        weights.view_mut((0, 0), (2, 2)).copy_from(&-h);
        weights.view_mut((0, 2), (2, 2)).fill_with_identity();
        let covariance = &weights * noise.covariance(*row) * weights.adjoint();
        power += error.dotc(&covariance.lu().solve(&error)?).re;
    }
    let mean = power / (2 * rows.len()) as f64;
    mean.is_finite().then_some(mean)
}
