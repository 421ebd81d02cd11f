//! Maximum likelihood: modelled against measured displacement, weighted by the noise.

use mechid_model::SecondOrderSystem;
use nalgebra::{Complex, DMatrix, DVector};

use super::misfit::Misfit;
use super::multi_start::{Found, Plausible, search};
use super::search::SumOfSquares;
use super::starts::Starts;
use super::{FrequencyData, NoiseSpectrum, equation_error};
use crate::estimate::Findings;
use crate::least_squares::size;
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
    /// Twice the negative logarithm of the likelihood, up to a constant and allowing for sampled
    /// weights, a pure number; `None` where the noise is estimated from the residual. What two fits of
    /// the same data differ by is a [`likelihood_ratio`].
    ///
    /// [`likelihood_ratio`]: super::likelihood_ratio()
    pub deviance: Option<f64>,
    /// Gauss–Newton steps from the best start to the minimum.
    pub steps: usize,
    /// Number of searches, each from another start.
    pub searches: usize,
    /// Number of searches that ended at this minimum; of two or more it is the global one as far as
    /// searches can tell.
    pub agreeing: usize,
}

/// Relative change of the noise levels below which another round of weighting is useless.
const WEIGHT_TOLERANCE: f64 = 1e-3;
/// A residual this small against the motion is rounding.
const ROUNDING: f64 = 1e-12;
/// Standard deviations by which the misfit ratio of a right model may differ from 1.
const PLAUSIBLE: f64 = 6.0;
/// Rounds of weighting; the second is nearly always the last but one.
const MAX_ROUNDS: usize = 10;

/// Maximum-likelihood estimate of the free entries of M, C and K from noisy displacements.
///
/// Minimises the weighted distance between measured displacement and G(ω) F by Gauss–Newton steps
/// from several starts: [`equation_error`] with several weights, and total least squares weighted by
/// the dynamic stiffness found before. Where they do not lead to one minimum, the search is repeated from
/// the best ones after a few steps in resampled data; the best is kept. Unbiased and of least scatter to first order in the noise. The weights come from
/// [`FrequencyData::noise`]:
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
/// [`EstimateError::NotConverged`] if no start leads to a minimum.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapters on
/// maximum likelihood with known and with sampled noise covariances, and on starting values.
pub fn output_error(
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<OutputErrorFit, EstimateError> {
    output_error_near(data, unknowns, None)
}

/// [`output_error`] that also starts its search from a machine that is expected to be near, such as a
/// finite element model.
///
/// # Errors
/// As [`output_error`], and [`EstimateError::Size`] if the machine has another number of degrees of
/// freedom.
///
/// # Source
/// That of [`output_error`].
pub fn output_error_near(
    data: &FrequencyData,
    unknowns: &Unknowns,
    nominal: Option<&SecondOrderSystem>,
) -> Result<OutputErrorFit, EstimateError> {
    if let Some(system) = nominal {
        size("degrees of freedom of the machine expected", unknowns.dof(), system.dof())?;
    }
    // Refuses what no estimator can determine.
    equation_error(data, unknowns)?.check_determined()?;
    match data.noise() {
        Some(noise) => with_known_noise(data, unknowns, noise, nominal),
        None => with_white_noise(data, unknowns, nominal),
    }
}

fn with_known_noise(
    data: &FrequencyData,
    unknowns: &Unknowns,
    noise: &NoiseSpectrum,
    nominal: Option<&SecondOrderSystem>,
) -> Result<OutputErrorFit, EstimateError> {
    let inflation = sampled_weight_inflation(noise.degrees_of_freedom(), data.dof())?;
    let mut misfit = Misfit::new(data, unknowns, noise)?;
    let starts = Starts::new(data, unknowns, noise).with_nominal(nominal);
    let spare = spare(data, unknowns) as f64;
    // A sampled covariance makes the weights too large by ν/(ν − n) on average.
    let expected = spare * noise.mean_inverse_ratio(data.dof());
    let plausible = plausible(Some(expected), spare, noise.total_degrees_of_freedom() as f64);
    let found = search(&mut misfit, &starts, plausible)?;
    let scale = Scale {
        variance: inflation,
        degrees_of_freedom: noise.total_degrees_of_freedom(),
        misfit_ratio: found.minimum.cost / expected,
        deviance: Some(found.minimum.cost / inflation),
    };
    finish(data, unknowns, &mut misfit, &found, scale)
}

/// White noise of unknown level per channel, found in turn with the parameters.
fn with_white_noise(
    data: &FrequencyData,
    unknowns: &Unknowns,
    nominal: Option<&SecondOrderSystem>,
) -> Result<OutputErrorFit, EstimateError> {
    let measured = measured_size(data, data.displacement());
    let mut levels = measured.clone();
    let mut last: Option<Found> = None;
    for _ in 0..MAX_ROUNDS {
        let noise = white_noise(data, &levels)?;
        let mut misfit = Misfit::new(data, unknowns, &noise)?;
        let fit = match last {
            None => {
                let starts = Starts::new(data, unknowns, &noise).with_nominal(nominal);
                let spare = spare(data, unknowns) as f64;
                search(&mut misfit, &starts, plausible(None, spare, spare))?
            }
            Some(before) => before.followed(&mut misfit)?,
        };
        let found = measured_size(data, &misfit.errors());
        // Only the ratios between the channels weigh; the common level is the residual's.
        let common = found[0] / levels[0];
        let settled =
            found.iter().zip(&levels).all(|(f, l)| (f - l * common).abs() <= WEIGHT_TOLERANCE * f);
        // Rounding has no level that could settle.
        let exact = found.iter().zip(&measured).all(|(f, x)| *f <= ROUNDING * x);
        if settled || exact || data.dof() == 1 {
            let spare = spare(data, unknowns);
            let scale = Scale {
                variance: fit.minimum.cost / spare.max(1) as f64,
                degrees_of_freedom: spare,
                misfit_ratio: 1.0,
                deviance: None,
            };
            return finish(data, unknowns, &mut misfit, &fit, scale);
        }
        last = Some(fit);
        // A channel without any residual must not take all the weight.
        let least = found.iter().zip(&levels).map(|(f, l)| f / l).fold(0.0, f64::max) * 1e-6;
        levels = found.iter().zip(&levels).map(|(f, l)| f.max(l * least)).collect();
    }
    let (searches, steps) = last.map_or((0, 0), |fit| (fit.searches, fit.minimum.steps));
    Err(EstimateError::NotConverged { searches, steps })
}

/// A sum of squares of `spare` numbers, weighted by a variance of `known` degrees of freedom.
fn plausible(expected: Option<f64>, spare: f64, known: f64) -> Plausible {
    let spread = (2.0 / spare.max(1.0) + 2.0 / known.max(1.0)).sqrt();
    Plausible { expected, factor: 1.0 + PLAUSIBLE * spread }
}

/// How the covariance follows from the Fisher information.
struct Scale {
    variance: f64,
    degrees_of_freedom: usize,
    misfit_ratio: f64,
    deviance: Option<f64>,
}

fn finish(
    data: &FrequencyData,
    unknowns: &Unknowns,
    misfit: &mut Misfit<'_>,
    found: &Found,
    scale: Scale,
) -> Result<OutputErrorFit, EstimateError> {
    let equations = misfit.normal_equations().ok_or(EstimateError::Overflow)?;
    let (covariance, condition) = equations.covariance().ok_or(EstimateError::Overflow)?;
    let errors = misfit.errors();
    let nrmse = |(e, x): (f64, f64)| if e == 0.0 { 0.0 } else { e / x };
    let residual_nrmse = errors
        .column_iter()
        .zip(data.displacement().column_iter())
        .map(|(e, x)| nrmse((e.norm(), x.norm())))
        .collect();
    let estimate = Estimate::new(Findings {
        unknowns: unknowns.clone(),
        values: found.minimum.theta.iter().copied().collect(),
        covariance: covariance * scale.variance,
        degrees_of_freedom: scale.degrees_of_freedom,
        residual_nrmse,
        condition,
        undetermined: Vec::new(),
    })?;
    Ok(OutputErrorFit {
        estimate,
        misfit_ratio: scale.misfit_ratio,
        deviance: scale.deviance,
        steps: found.minimum.steps,
        searches: found.searches,
        agreeing: found.agreeing,
    })
}

/// Real equations less unknowns.
fn spare(data: &FrequencyData, unknowns: &Unknowns) -> usize {
    (2 * data.dof() * data.len()).saturating_sub(unknowns.free().len())
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

/// White noise of the given levels of the quantity measured, the force exact.
fn white_noise(data: &FrequencyData, levels: &[f64]) -> Result<NoiseSpectrum, EstimateError> {
    let n = data.dof();
    let covariance = data.omega().iter().map(|w| {
        let scale = data.measured().per_displacement(*w).norm();
        DMatrix::from_fn(2 * n, 2 * n, |i, j| {
            let level = if i == j && i < n { levels[i] / scale } else { 0.0 };
            Complex::from(level * level)
        })
    });
    NoiseSpectrum::new(data.omega().to_vec(), covariance.collect())
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
    let theta: DVector<f64> = estimate.parameters().map(|p| p.value).collect::<Vec<_>>().into();
    let mut misfit = Misfit::new(data, estimate.unknowns(), data.noise()?).ok()?;
    misfit.try_at(&theta)?;
    misfit.accept();
    Some(misfit.white())
}
