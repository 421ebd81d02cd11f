//! Maximum likelihood: the smallest difference between modelled and measured displacement, weighted
//! by the noise.

use mechid_model::SecondOrderSystem;
use mechid_numerics::check_size;
use mechid_numerics::gauss_newton::SumOfSquares;
use mechid_spectra::transient;
use mechid_spectra::{FrequencyData, NoiseSpectrum, Pooling};
use nalgebra::{Complex, DMatrix, DVector};

use super::equation_error;
use super::initial_estimates::InitialEstimates;
use super::line_correlation::variance_ratio;
use super::misfit::Misfit;
use super::multi_start::{search, thinned};
use super::output_error_fit::{
    OutputErrorFit, Scale, entries, finish, parts, plausible, sampled_weight_inflation, spare,
    uncertain_weights,
};
use super::unknown_noise::{with_response_noise, with_unknown_noise};
use crate::relations::Relations;
use crate::{Estimate, EstimateError, Unknowns};

/// Maximum-likelihood estimate of the free entries of M, C and K from noisy displacements. It
/// minimises the weighted distance between measured displacement and G(ω) F by Gauss–Newton steps
/// from several initial estimates: [`equation_error`] with several weights, and total least squares
/// in rounds, each weighted by the dynamic stiffness of the previous round. If the searches end at
/// different minima, further searches start from the best minima after a few steps in resampled
/// data. The best minimum is the result. To first order in the noise the estimate is unbiased and
/// has the least scatter. The weights come from [`FrequencyData::noise`]:
///
/// - noise on displacement alone (exact force): the output-error estimator;
/// - noise on force, too: errors in variables, with the true force eliminated row by row;
/// - no noise stated: the noise of each channel is estimated from the residual, white in the
///   measured quantity or with a smooth spectrum ([`Pooling::Automatic`]); the force is exact.
///
/// Weights from few repeated periods are uncertain; the covariance of the estimate includes this
/// uncertainty.
///
/// # Errors
/// The errors of [`equation_error`], [`EstimateError::Undetermined`] if the data do not determine a
/// parameter, [`EstimateError::SingularNoise`] if a stated noise covariance cannot be inverted,
/// [`SpectraError::TooFewAverages`](mechid_spectra::SpectraError::TooFewAverages) if it comes from
/// too few periods for a weight, and [`EstimateError::NotConverged`] if no search converges.
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

/// Estimates as [`output_error`], with a nominal system, such as a finite element model, as an
/// additional initial estimate.
///
/// # Errors
/// As [`output_error`], and [`NumericsError::Size`](mechid_numerics::NumericsError::Size) if the
/// numbers of degrees of freedom of the nominal system and of `data` differ.
///
/// # Source
/// As [`output_error`].
pub fn output_error_near(
    data: &FrequencyData,
    unknowns: &Unknowns,
    nominal: Option<&SecondOrderSystem>,
) -> Result<OutputErrorFit, EstimateError> {
    if let Some(system) = nominal {
        check_size("degrees of freedom of the nominal system", unknowns.dof(), system.dof())?;
    }
    search_near(data, unknowns, nominal, Pooling::Automatic)
}

/// Estimates as [`output_error`]. If the data state no noise, the noise spectrum is estimated from
/// the residual with the pooling `residual`.
///
/// # Errors
/// As [`output_error`];
/// [`SpectraError::TooFewAverages`](mechid_spectra::SpectraError::TooFewAverages) for
/// [`Pooling::PerLine`] where the data state no noise: the residual is one sample of each line.
///
/// # Source
/// As [`output_error`].
pub fn output_error_pooling(
    data: &FrequencyData,
    unknowns: &Unknowns,
    residual: Pooling,
) -> Result<OutputErrorFit, EstimateError> {
    search_near(data, unknowns, None, residual)
}

/// Estimates as [`output_error`] from frequency responses. If the data state no noise, the noise of
/// each response is white, proportional to the response, or the sum of both; the residual decides.
/// If the residual also shows that the errors of neighbouring lines are correlated, as under the
/// window of an analyser, the covariance of the parameters includes this correlation
/// ([`OutputErrorFit::variance_ratio`]).
///
/// # Errors
/// As [`output_error`].
///
/// # Source
/// As [`output_error`]; Schwarz (1978), Annals of Statistics 6, 461–464, for the choice; Newey &
/// West (1987), Econometrica 55, 703–708, for correlated errors.
pub fn output_error_of_table(
    data: &FrequencyData,
    unknowns: &Unknowns,
) -> Result<OutputErrorFit, EstimateError> {
    equation_error(data, unknowns)?.check_determined()?;
    let mut fit = match data.noise() {
        Some(noise) => with_known_noise(data, unknowns, noise, None)?,
        None => with_response_noise(data, unknowns)?,
    };
    fit.variance_ratio = variance_ratio(data, &fit.estimate, &fit.spectrum);
    let freedom = fit.estimate.degrees_of_freedom() as f64 / fit.variance_ratio;
    fit.estimate = fit.estimate.with_error_scale(fit.variance_ratio.sqrt(), freedom as usize);
    Ok(fit)
}

/// Estimates from data that state no noise, as [`output_error_pooling`] does, but with one initial
/// estimate only: the result of a `fit` to nearly the same data.
///
/// # Errors
/// As [`output_error_pooling`].
///
/// # Source
/// As [`output_error`].
pub fn output_error_from(
    data: &FrequencyData,
    unknowns: &Unknowns,
    fit: &OutputErrorFit,
    residual: Pooling,
) -> Result<OutputErrorFit, EstimateError> {
    equation_error(data, unknowns)?.check_determined()?;
    with_unknown_noise(data, unknowns, None, Some(fit.minimum(unknowns)), residual)
}

/// Result of [`with_noise_of`].
#[derive(Debug, Clone, PartialEq)]
pub struct Refit {
    /// Change of the free entries of M, C and K, in their units and in the order of
    /// [`Unknowns::free`].
    pub change: DVector<f64>,
    /// Sum of squares in units of the noise, a pure number.
    pub cost: f64,
}

/// Repeats a `fit` with changed `data` and the same noise spectrum. The search begins at `near`, a
/// fit to the changed data or to a part of their lines.
///
/// # Errors
/// As [`output_error`].
///
/// # Source
/// As [`output_error`].
pub fn with_noise_of(
    fit: &OutputErrorFit,
    data: &FrequencyData,
    unknowns: &Unknowns,
    near: &OutputErrorFit,
) -> Result<Refit, EstimateError> {
    let mut misfit = Misfit::new(data, unknowns, &fit.spectrum)?;
    let minimum = near.minimum(unknowns).followed(&mut misfit)?.minimum;
    let (independent, _) = parts(data, &minimum.parameters);
    let before: DVector<f64> =
        fit.estimate.parameters().map(|p| p.value).collect::<Vec<_>>().into();
    Ok(Refit { change: entries(unknowns, independent) - before, cost: minimum.cost })
}

fn search_near(
    data: &FrequencyData,
    unknowns: &Unknowns,
    nominal: Option<&SecondOrderSystem>,
    residual: Pooling,
) -> Result<OutputErrorFit, EstimateError> {
    // Checks that the data determine every parameter.
    equation_error(data, unknowns)?.check_determined()?;
    match data.noise() {
        Some(noise) => with_known_noise(data, unknowns, noise, nominal),
        None => with_unknown_noise(data, unknowns, nominal, None, residual),
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
    let spare = spare(data, unknowns) as f64;
    // Weights from a covariance that is sampled with ν degrees of freedom for n channels are on
    // average too large by the factor ν/(ν − n).
    let expected = spare * noise.mean_inverse_ratio(data.dof());
    let plausible = plausible(Some(expected), spare, noise.total_degrees_of_freedom() as f64);
    let fewer = thinned(data, unknowns, noise);
    let starts = InitialEstimates::new(data, unknowns, noise).with_nominal(nominal);
    let thin = fewer.as_ref().map(|(data, noise)| Misfit::new(data, unknowns, noise));
    let best = search(&mut misfit, thin.transpose()?.as_mut(), &starts, plausible)?;
    let scale = Scale {
        level: 1.0,
        inflation,
        weights: uncertain_weights(data, unknowns, &best.minimum.parameters, noise),
        with_pulses: None,
        degrees_of_freedom: noise.total_degrees_of_freedom(),
        misfit_ratio: best.minimum.cost / expected,
        deviance: Some(best.minimum.cost / inflation),
        noise: noise.models().to_vec(),
        spectrum: noise.clone(),
    };
    finish(data, unknowns, &mut misfit, &best, scale)
}

/// Returns the residual of the displacement, rows × n, in units of the stated noise: independent
/// numbers with E|r|² = 1 if the system and the noise are correct. `None` if no noise is stated, or
/// if some noise is zero.
pub fn in_units_of_noise(
    data: &FrequencyData,
    estimate: &Estimate,
) -> Option<DMatrix<Complex<f64>>> {
    let mut theta: DVector<f64> = estimate.parameters().map(|p| p.value).collect::<Vec<_>>().into();
    if let Some(relations) = Relations::from_unknowns(estimate.unknowns()) {
        theta = relations.unknowns(theta.as_slice());
    }
    let mut misfit = Misfit::new(data, estimate.unknowns(), data.noise()?).ok()?;
    let len = theta.len() + transient::len(data);
    misfit.try_at(&theta.resize_vertically(len, 0.0))?;
    misfit.accept();
    Some(misfit.white())
}
