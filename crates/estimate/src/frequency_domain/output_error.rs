//! Maximum likelihood: modelled against measured displacement, weighted by the noise.

use mechid_model::SecondOrderSystem;
use nalgebra::{Complex, DMatrix, DVector};

use super::misfit::Misfit;
use super::multi_start::{Found, Plausible, search};
use super::residual_noise::with_residual_noise;
use super::search::SumOfSquares;
use super::starts::Starts;
use super::weight_uncertainty::WeightUncertainty;
use super::{FrequencyData, NoiseModel, NoiseSpectrum, Pooling, equation_error};
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
    /// Noise spectra by which it was weighted where they were estimated: one of each experiment from its
    /// periods, or one from the residual; none where the noise is known beforehand.
    pub noise: Vec<NoiseModel>,
}

/// Standard deviations by which the misfit ratio of a right model may differ from 1.
const PLAUSIBLE: f64 = 6.0;

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
/// - no noise stated: the noise of each channel found from the residual, white in the quantity measured or
///   of a smooth spectrum ([`Pooling::Automatic`]), the force exact.
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
    search_near(data, unknowns, None, Pooling::Automatic)
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
    search_near(data, unknowns, nominal, Pooling::Automatic)
}

/// [`output_error`] with a given way to find the noise from the residual where the data state none.
///
/// # Errors
/// As [`output_error`]; [`EstimateError::TooFewAverages`] for [`Pooling::PerLine`] where the data state no
/// noise: the residual is one sample of each line.
///
/// # Source
/// That of [`output_error`].
pub fn output_error_pooling(
    data: &FrequencyData,
    unknowns: &Unknowns,
    residual: Pooling,
) -> Result<OutputErrorFit, EstimateError> {
    search_near(data, unknowns, None, residual)
}

fn search_near(
    data: &FrequencyData,
    unknowns: &Unknowns,
    nominal: Option<&SecondOrderSystem>,
    residual: Pooling,
) -> Result<OutputErrorFit, EstimateError> {
    // Refuses what no estimator can determine.
    equation_error(data, unknowns)?.check_determined()?;
    match data.noise() {
        Some(noise) => with_known_noise(data, unknowns, noise, nominal),
        None => with_residual_noise(data, unknowns, nominal, residual),
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
        level: 1.0,
        inflation,
        weights: WeightUncertainty::of(data, unknowns, &found.minimum.theta, noise),
        degrees_of_freedom: noise.total_degrees_of_freedom(),
        misfit_ratio: found.minimum.cost / expected,
        deviance: Some(found.minimum.cost / inflation),
        noise: noise.models().to_vec(),
    };
    finish(data, unknowns, &mut misfit, &found, scale)
}

/// A sum of squares of `spare` numbers, weighted by a variance of `known` degrees of freedom.
pub(super) fn plausible(expected: Option<f64>, spare: f64, known: f64) -> Plausible {
    let spread = (2.0 / spare.max(1.0) + 2.0 / known.max(1.0)).sqrt();
    Plausible { expected, factor: 1.0 + PLAUSIBLE * spread }
}

/// How the covariance follows from the Fisher information.
pub(super) struct Scale {
    /// Power of the noise over that of the weights.
    pub(super) level: f64,
    /// By which the covariance is larger for weights that are uncertain, where nothing better is known.
    pub(super) inflation: f64,
    pub(super) weights: Option<WeightUncertainty>,
    pub(super) degrees_of_freedom: usize,
    pub(super) misfit_ratio: f64,
    pub(super) deviance: Option<f64>,
    pub(super) noise: Vec<NoiseModel>,
}

pub(super) fn finish(
    data: &FrequencyData,
    unknowns: &Unknowns,
    misfit: &mut Misfit<'_>,
    found: &Found,
    scale: Scale,
) -> Result<OutputErrorFit, EstimateError> {
    let equations = misfit.normal_equations().ok_or(EstimateError::Overflow)?;
    let (covariance, condition) = equations.covariance().ok_or(EstimateError::Overflow)?;
    let (covariance, degrees_of_freedom) = match scale.weights {
        None => (covariance * scale.inflation, scale.degrees_of_freedom),
        Some(weights) => {
            let fewest = weights.degrees_of_freedom.min(scale.degrees_of_freedom as f64);
            (covariance + weights.excess, fewest.max(1.0) as usize)
        }
    };
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
        covariance: covariance * scale.level,
        degrees_of_freedom,
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
        noise: scale.noise,
    })
}

/// Real equations less unknowns.
pub(super) fn spare(data: &FrequencyData, unknowns: &Unknowns) -> usize {
    (2 * data.dof() * data.len()).saturating_sub(unknowns.free().len())
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
pub(super) fn sampled_weight_inflation(nu: f64, channels: usize) -> Result<f64, EstimateError> {
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
