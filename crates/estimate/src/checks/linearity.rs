//! Correlation of a residual with powers of displacement and velocity.

use mechid_model::{Response, ResponseQuantity};
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix};
use statrs::distribution::{ContinuousCDF, Normal};

use super::finding::{Finding, PValue, Power};
use crate::{Estimate, EstimateError, predict_periodic};

/// Powers of a motion that are tested.
const POWERS: [Power; 4] = [Power::Square, Power::Cube, Power::VelocityCube, Power::VelocitySign];

/// Tests whether the response (samples × degrees of freedom) that a machine does not explain under a
/// random force (N) is correlated with the square or the cube of its displacement, or with the cube or the
/// sign of its velocity, between two frequencies in Hz ([`Finding::Linearity`], of the power that correlates most).
///
/// Frequency responses do not show that: under a random force a hardening spring looks like a stiffer
/// one with more noise, and dry friction like damping. So the motion is predicted over the whole record, and those powers
/// of it, less their linear parts, are applied as forces at each degree of freedom in turn. The responses to them must be uncorrelated with the residual, as they are with the noise of a linear
/// machine; a Gaussian force keeps errors of the linear model out, too.
///
/// # Errors
/// As [`predict_periodic`]; [`EstimateError::Undetermined`] if the estimate is no machine,
/// [`EstimateError::Size`] for another number of responses and [`EstimateError::NoExcitedLine`] if no
/// line lies in the band.
///
/// # Source
/// Bendat, *Nonlinear System Techniques and Applications* (1998), for the powers less their linear
/// part, and the sign of the velocity among them; Adams & Allemang (2000), Mechanical Systems and Signal Processing 14, 637–656, for the
/// nonlinearity as a force.
pub fn linearity(
    estimate: &Estimate,
    force: &Record,
    response: &Record,
    measured: ResponseQuantity,
    band_hz: [f64; 2],
) -> Result<Finding, EstimateError> {
    force.check_same_sampling(response)?;
    let system = estimate.system()?;
    let (n, predicted) = (system.dof(), predict_periodic(&system, force)?);
    if response.channels() != n {
        let what = "channels of the response";
        return Err(EstimateError::Size { what, expected: n, got: response.channels() });
    }
    let spectra = [force, response].map(Spectrum::of);
    let inside = |line: &usize| {
        let hz = *line as f64 * force.sampling().line_spacing_hz();
        band_hz[0] <= hz && hz <= band_hz[1] && 2 * line < force.len()
    };
    let lines: Vec<usize> = (1..spectra[0].len()).filter(inside).collect();
    if lines.is_empty() {
        return Err(EstimateError::NoExcitedLine);
    }
    let mut receptances = Vec::with_capacity(lines.len());
    let mut residual = DMatrix::zeros(n, lines.len());
    for (at, line) in lines.iter().enumerate() {
        let omega = spectra[0].omega(*line);
        let receptance = system.receptance(omega)? * measured.per_displacement(omega);
        let [f, x] = [0, 1].map(|s| spectra[s].lines().row(*line).transpose());
        residual.set_column(at, &(x - &receptance * f));
        receptances.push(receptance);
    }
    let mut least = (1.0, POWERS[0], 0);
    for dof in 0..n {
        for power in POWERS {
            let forces = without_linear_part(&predicted, dof, power)?;
            let forces = Spectrum::of(&forces);
            let response = |at: usize| receptances[at].column(dof) * forces.line(lines[at], 0);
            let responses: Vec<_> = (0..lines.len()).map(response).collect();
            let p_value = p_value(&residual, &DMatrix::from_columns(&responses));
            if p_value < least.0 {
                least = (p_value, power, dof);
            }
        }
    }
    // Bonferroni: the least of so many.
    let (p_value, power, dof) = least;
    let p_value = PValue::of(((n * POWERS.len()) as f64 * p_value).min(1.0));
    Ok(Finding::Linearity { power, dof, p_value })
}

/// A power of the motion of a degree of freedom less its mean and its linear part.
fn without_linear_part(
    predicted: &Response,
    dof: usize,
    power: Power,
) -> Result<Record, EstimateError> {
    let (motion, of): (&Record, fn(f64) -> f64) = match power {
        Power::Square => (predicted.displacement(), |x| x * x),
        Power::Cube => (predicted.displacement(), |x| x.powi(3)),
        Power::VelocityCube => (predicted.velocity(), |x| x.powi(3)),
        Power::VelocitySign => (predicted.velocity(), f64::signum),
    };
    let x = motion.without_mean().channel(dof).to_vec();
    let size = (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
    let x: Vec<f64> = x.iter().map(|x| if size > 0.0 { x / size } else { 0.0 }).collect();
    let linear = x.iter().map(|x| of(*x) * x).sum::<f64>() / x.len() as f64;
    let values = x.iter().map(|x| of(*x) - linear * x).collect();
    Ok(Record::from_channel(motion.sampling(), values)?.without_mean())
}

/// Lines to either side over which the spectrum of a residual is averaged.
const NEIGHBOURS: usize = 10;

/// Probability that noise with the spectrum of the residual (channels × lines) is correlated as much
/// with the responses, each line relative to the size of the residual around it.
fn p_value(residual: &DMatrix<Complex<f64>>, responses: &DMatrix<Complex<f64>>) -> f64 {
    let (mut product, mut variance) = (0.0, 0.0);
    for (e, g) in residual.row_iter().zip(responses.row_iter()) {
        let sizes = around(&e.iter().map(|e| e.norm_sqr()).collect::<Vec<_>>());
        for ((e, g), size) in e.iter().zip(g.iter()).zip(sizes).filter(|(_, size)| *size > 0.0) {
            product += (e.conj() * g).re / size;
            variance += 0.5 * e.norm_sqr() * g.norm_sqr() / (size * size);
        }
    }
    if variance > 0.0 {
        let normal = Normal::standard();
        2.0 * normal.sf(product.abs() / variance.sqrt())
    } else {
        1.0
    }
}

/// Mean of the values around each.
fn around(values: &[f64]) -> Vec<f64> {
    let count = values.len();
    let window = |at: usize| at.saturating_sub(NEIGHBOURS)..(at + NEIGHBOURS + 1).min(count);
    let mut sum = 0.0;
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(values.iter().map(|value| {
            sum += value;
            sum
        }))
        .collect();
    let mean =
        |range: std::ops::Range<usize>| (sums[range.end] - sums[range.start]) / range.len() as f64;
    (0..count).map(|at| mean(window(at))).collect()
}
