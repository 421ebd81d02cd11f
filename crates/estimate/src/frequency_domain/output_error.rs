//! Maximum likelihood: modelled against measured displacement, weighted by the noise.

use nalgebra::{Complex, DMatrix, DVector};

use super::equation_error::weighted_equation_errors;
use super::levenberg_marquardt::{Minimum, SumOfSquares, minimise};
use super::misfit::{Misfit, Noise, output_weights};
use super::{FrequencyData, NoiseSpectrum, equation_error};
use crate::estimate::Findings;
use crate::least_squares::solve_compressed;
use crate::triangular::TriangularFactor;
use crate::{Estimate, EstimateError, Unknowns};

/// An [`Estimate`] by maximum likelihood, with what its search tells.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputErrorFit {
    /// M̂, Ĉ, K̂ with the covariance that the Fisher information gives.
    pub estimate: Estimate,
    /// Weighted residual power over its expectation: 1 within a few √(2/degrees of freedom)
    /// if the model is right and the noise is as stated; much more if the machine is not
    /// what the model says (nonlinear, more degrees of freedom). 1 by construction where the
    /// noise is estimated from the residual.
    pub misfit_ratio: f64,
    /// Gauss–Newton steps taken.
    pub steps: usize,
}

/// Relative change of the noise levels below which another round of weighting is useless.
const WEIGHT_TOLERANCE: f64 = 1e-3;
/// A residual this small against the motion is rounding.
const ROUNDING: f64 = 1e-12;
/// Rounds of weighting; the second is nearly always the last but one.
const MAX_ROUNDS: usize = 10;

/// Maximum-likelihood estimate of the free entries of M, C and K from noisy displacements.
///
/// Minimises the weighted distance between measured displacement and G(ω) F, by Gauss–Newton
/// steps from the [`equation_error`] estimate, or from the same with its rows weighted by the noise
/// stated where that is nearer. Unbiased and of least scatter to first order
/// in the noise. The weights come from [`FrequencyData::noise`]:
///
/// - noise on displacement alone (force exact): the output-error estimator;
/// - noise on force too: errors in variables, the true force being eliminated row by row;
/// - no noise stated: white noise in the quantity measured, its level per channel found from
///   the residual, the force exact.
///
/// Weights from few repeated periods are themselves uncertain; the covariance allows for that.
///
/// # Errors
/// What [`equation_error`] refuses, [`EstimateError::Undetermined`] if the data leave a parameter
/// open, [`EstimateError::SingularNoise`] if a stated noise covariance cannot be inverted,
/// [`EstimateError::TooFewAverages`] if it comes from too few periods to weight with, and
/// [`EstimateError::NotConverged`].
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapters on
/// maximum likelihood with known and with sampled noise covariances.
pub fn output_error(
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<OutputErrorFit, EstimateError> {
    let start = equation_error(data, unknowns)?;
    start.check_determined()?;
    let theta = values(&start);
    match data.noise() {
        Some(noise) => with_known_noise(data, unknowns, noise, theta),
        None => with_white_noise(data, unknowns, theta),
    }
}

fn with_known_noise(
    data: &FrequencyData,
    unknowns: &Unknowns,
    noise: &NoiseSpectrum,
    theta: DVector<f64>,
) -> Result<OutputErrorFit, EstimateError> {
    let inflation = sampled_weight_inflation(noise.degrees_of_freedom(), data.dof())?;
    let weights =
        if noise.has_force() { Noise::Both(noise) } else { Noise::Output(output_weights(noise)?) };
    let mut misfit = Misfit::new(data, unknowns, weights);
    let weighted = weighted_equation_errors(data, unknowns).map(|found| values(&found));
    let theta = nearest(&mut misfit, theta, weighted);
    let fit = search(&mut misfit, theta)?;
    let spare = spare(data, &fit.theta);
    // A sampled covariance makes the weights too large by ν/(ν − n) on average.
    let expected = spare as f64 * noise.mean_inverse_ratio(data.dof());
    finish(
        data,
        unknowns,
        &misfit,
        &fit,
        Scale {
            variance: inflation,
            degrees_of_freedom: noise.total_degrees_of_freedom(),
            misfit_ratio: fit.cost / expected,
        },
    )
}

/// White noise of unknown level per channel, found in turn with the parameters.
fn with_white_noise(
    data: &FrequencyData,
    unknowns: &Unknowns,
    mut theta: DVector<f64>,
) -> Result<OutputErrorFit, EstimateError> {
    let measured = measured_size(data, data.displacement());
    let mut levels = measured.clone();
    let mut steps = 0;
    for _ in 0..MAX_ROUNDS {
        let mut misfit = Misfit::new(data, unknowns, Noise::Output(white_weights(data, &levels)));
        let mut fit = search(&mut misfit, theta)?;
        steps += fit.steps;
        let found = measured_size(data, &misfit.errors());
        // Only the ratios between the channels weigh; the common level is the residual's.
        let common = found[0] / levels[0];
        let settled =
            found.iter().zip(&levels).all(|(f, l)| (f - l * common).abs() <= WEIGHT_TOLERANCE * f);
        // Rounding has no level that could settle.
        let exact = found.iter().zip(&measured).all(|(f, x)| *f <= ROUNDING * x);
        if settled || exact || data.dof() == 1 {
            fit.steps = steps;
            let spare = spare(data, &fit.theta);
            return finish(
                data,
                unknowns,
                &misfit,
                &fit,
                Scale {
                    variance: fit.cost / spare.max(1) as f64,
                    degrees_of_freedom: spare,
                    misfit_ratio: 1.0,
                },
            );
        }
        theta = fit.theta;
        // A channel without any residual must not take all the weight.
        let least = found.iter().zip(&levels).map(|(f, l)| f / l).fold(0.0, f64::max) * 1e-6;
        levels = found.iter().zip(&levels).map(|(f, l)| f.max(l * least)).collect();
    }
    Err(EstimateError::NotConverged { steps })
}

fn values(estimate: &Estimate) -> DVector<f64> {
    let parameters = estimate.parameters();
    DVector::from_iterator(parameters.len(), parameters.map(|p| p.value))
}

/// The start that misses the data least: far from the minimum a search may run off to a machine
/// so heavy or stiff that it does not move.
fn nearest(
    misfit: &mut Misfit<'_>,
    theta: DVector<f64>,
    others: impl Iterator<Item = DVector<f64>>,
) -> DVector<f64> {
    let mut residual = DVector::zeros(misfit.residuals());
    let mut cost = |theta: &DVector<f64>| match misfit.residual(theta, &mut residual) {
        true => residual.norm_squared(),
        false => f64::INFINITY,
    };
    let mut least = (cost(&theta), theta);
    for other in others {
        let own = cost(&other);
        if own < least.0 {
            least = (own, other);
        }
    }
    least.1
}

/// The minimum, at which `misfit` is left evaluated.
fn search(misfit: &mut Misfit<'_>, theta: DVector<f64>) -> Result<Minimum, EstimateError> {
    let fit = minimise(misfit, theta).ok_or(EstimateError::NotConverged { steps: 0 })?;
    if !fit.converged {
        return Err(EstimateError::NotConverged { steps: fit.steps });
    }
    misfit.residual(&fit.theta, &mut DVector::zeros(misfit.residuals()));
    Ok(fit)
}

/// How the covariance follows from the Fisher information.
struct Scale {
    variance: f64,
    degrees_of_freedom: usize,
    misfit_ratio: f64,
}

fn finish(
    data: &FrequencyData,
    unknowns: &Unknowns,
    misfit: &Misfit<'_>,
    fit: &Minimum,
    scale: Scale,
) -> Result<OutputErrorFit, EstimateError> {
    let sensitivity = misfit.sensitivity();
    let mut factor = TriangularFactor::new(sensitivity.ncols());
    if !factor.push(&[sensitivity.as_view()]) {
        crate::least_squares::finite("sensitivity of the motion", sensitivity.as_view())?;
        return Err(EstimateError::Overflow);
    }
    let none = DMatrix::zeros(sensitivity.ncols(), 1);
    let linear = solve_compressed(factor.r().as_view(), none.as_view(), factor.rows())?;
    let errors = misfit.errors();
    let nrmse = |(e, x): (f64, f64)| if e == 0.0 { 0.0 } else { e / x };
    let residual_nrmse = errors
        .column_iter()
        .zip(data.displacement().column_iter())
        .map(|(e, x)| nrmse((e.norm(), x.norm())))
        .collect();
    let estimate = Estimate::new(Findings {
        unknowns: unknowns.clone(),
        values: fit.theta.iter().copied().collect(),
        covariance: linear.unscaled_covariance * scale.variance,
        degrees_of_freedom: scale.degrees_of_freedom,
        residual_nrmse,
        condition: linear.condition,
        undetermined: Vec::new(),
    })?;
    Ok(OutputErrorFit { estimate, misfit_ratio: scale.misfit_ratio, steps: fit.steps })
}

/// Real equations less unknowns.
fn spare(data: &FrequencyData, theta: &DVector<f64>) -> usize {
    (2 * data.dof() * data.len()).saturating_sub(theta.len())
}

/// Root mean square of displacement amplitudes, per channel, in the quantity measured.
fn measured_size(data: &FrequencyData, amplitudes: &DMatrix<Complex<f64>>) -> Vec<f64> {
    let power = |column: usize| {
        let terms = amplitudes
            .column(column)
            .into_iter()
            .zip(data.omega())
            .map(|(x, w)| (x * data.measured().per_displacement(*w)).norm_sqr());
        terms.sum::<f64>()
    };
    (0..data.dof()).map(|c| (power(c) / data.len() as f64).sqrt().max(f64::MIN_POSITIVE)).collect()
}

fn white_weights(data: &FrequencyData, levels: &[f64]) -> Vec<DMatrix<Complex<f64>>> {
    let levels = DVector::from_iterator(levels.len(), levels.iter().map(|l| Complex::new(*l, 0.0)));
    data.omega()
        .iter()
        .map(|w| {
            let scale = data.measured().per_displacement(*w).norm();
            DMatrix::from_diagonal(&levels.unscale(scale))
        })
        .collect()
}

/// Covariance over the inverse of the Fisher information computed with sampled weights.
///
/// For weights W = Ŝ⁻¹ with a sample covariance Ŝ of n channels and ν degrees of freedom, and
/// true covariance S: E[W] = ν/(ν−n)·S⁻¹, E[W S W] = ν³/((ν−n)((ν−n)²−1))·S⁻¹, so that the
/// covariance of the estimate is E[WSW]/E[W]² times the best one, and ν²/((ν−n)²−1) times the
/// one computed.
///
/// # Errors
/// [`EstimateError::TooFewAverages`] where it does not exist.
fn sampled_weight_inflation(nu: f64, channels: usize) -> Result<f64, EstimateError> {
    if nu.is_infinite() {
        return Ok(1.0);
    }
    let n = channels as f64;
    if nu <= n + 1.0 {
        let (got, needed) = (nu as usize + 1, channels + 3);
        return Err(EstimateError::TooFewAverages { got, needed });
    }
    Ok(nu * nu / ((nu - n) * (nu - n) - 1.0))
}

/// What an estimate leaves of the displacement, rows × n, in units of the stated noise: independent
/// numbers with E|r|² = 1 if the machine and the noise are as stated. Nothing if the noise is not
/// stated, or some of it is none at all.
pub(crate) fn in_units_of_noise(
    data: &FrequencyData,
    estimate: &Estimate,
) -> Option<DMatrix<Complex<f64>>> {
    let noise = data.noise()?;
    let noise = if noise.has_force() {
        Noise::Both(noise)
    } else {
        Noise::Output(output_weights(noise).ok()?)
    };
    let theta = estimate.parameters().map(|p| p.value).collect::<Vec<_>>().into();
    let mut misfit = Misfit::new(data, estimate.unknowns(), noise);
    let mut left = DVector::zeros(misfit.residuals());
    if !misfit.residual(&theta, &mut left) {
        return None;
    }
    let n = data.dof();
    let part =
        |row: usize, c: usize| Complex::new(left[2 * (n * row + c)], left[2 * (n * row + c) + 1]);
    Some(DMatrix::from_fn(data.len(), n, |row, c| part(row, c) / std::f64::consts::SQRT_2))
}
