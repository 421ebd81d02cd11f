//! Result of a maximum-likelihood fit, computed at the minimum that the search found.

use mechid_model::SecondOrderSystem;
use mechid_numerics::gauss_newton::{Minimum, SumOfSquares};
use mechid_numerics::{NumericsError, check_size};
use mechid_spectra::SpectraError;
use mechid_spectra::noise::pulse::PulseErrors;
use mechid_spectra::transient;
use mechid_spectra::transient::TransientLoad;
use mechid_spectra::{FrequencyData, NoiseModel, NoiseSpectrum, Sinusoid};
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::misfit::Misfit;
use super::multi_start::{GlobalMinimum, Plausible};
use super::weight_uncertainty::WeightUncertainty;
use crate::estimate::EstimateParts;
use crate::limits::FIT_PLAUSIBLE;
use crate::relations::Relations;
use crate::{Estimate, EstimateError, Unknowns};

/// An [`Estimate`] by maximum likelihood, with the results of its search.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputErrorFit {
    /// M̂, Ĉ, K̂ with the covariance from the Fisher information.
    pub estimate: Estimate,
    /// Ratio of the weighted residual power to its expectation. If model and noise are correct, it
    /// is 1 with a standard deviation of about √(2/ν) (more if the noise is estimated from few
    /// periods), where ν is the number of residuals minus the number of parameters. The ratio is
    /// much larger if the model is wrong (a nonlinearity, missing degrees of freedom). It is 1 by
    /// definition if the noise is estimated from the residual.
    pub misfit_ratio: f64,
    /// Twice the negative log-likelihood, up to a constant and corrected for sampled weights, a
    /// pure number; `None` if the noise is estimated from the residual. The difference between two
    /// fits of the same data gives a [`likelihood_ratio`].
    ///
    /// [`likelihood_ratio`]: super::likelihood_ratio()
    pub deviance: Option<f64>,
    /// Number of Gauss–Newton steps from the best initial estimate to the minimum.
    pub steps: usize,
    /// Number of searches, each from a different initial estimate.
    pub searches: usize,
    /// Number of searches that ended at this minimum; if two or more agree, it is probably the
    /// global minimum.
    pub agreeing: usize,
    /// Estimated noise spectra of the weights: one for each experiment, from its periods, or one
    /// from the residual; empty if the noise is stated.
    pub noise: Vec<NoiseModel>,
    /// Noise spectrum of the weights: stated, or estimated from the residual up to a common level.
    pub spectrum: NoiseSpectrum,
    /// Transient loads of open records, `None` if all rows belong to periods.
    pub ends: Option<EndLoads>,
    /// For each open record, the subtracted sinusoids, which are not a response to the forces;
    /// empty if the noise is stated.
    pub sinusoids: Vec<Vec<Sinusoid>>,
    /// Most likely amplitudes of the errors of pulses, one for each pattern of
    /// [`FrequencyData::pulse_errors`], pure numbers; empty if there are none.
    pub pulse_amplitudes: Vec<f64>,
    /// Ratio of the variance of the parameters to that for independent lines; above 1 for a table
    /// whose neighbouring lines have correlated errors.
    pub variance_ratio: f64,
}

impl OutputErrorFit {
    /// Returns the independent unknowns, followed by the loads of the transients.
    pub(super) fn theta(&self, unknowns: &Unknowns) -> DVector<f64> {
        let entries: Vec<f64> = self.estimate.parameters().map(|p| p.value).collect();
        let mut theta = match Relations::from_unknowns(unknowns) {
            None => entries,
            Some(relations) => relations.unknowns(&entries).as_slice().to_vec(),
        };
        theta.extend_from_slice(self.ends.as_ref().map_or(&[], EndLoads::loads));
        theta.into()
    }

    /// Returns the minimum of the fit, without its sum of squares, which the fit does not store.
    pub(super) fn minimum(&self, unknowns: &Unknowns) -> GlobalMinimum {
        let minimum = Minimum {
            parameters: self.theta(unknowns),
            cost: f64::INFINITY,
            steps: self.steps,
            converged: true,
        };
        GlobalMinimum { minimum, searches: self.searches, agreeing: self.agreeing }
    }

    /// Returns the fitted records, each without the most likely errors of the pulses of its forces.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if the records have more or fewer pulse errors than the fitted ones.
    ///
    /// # Source
    /// As [`FrequencyData::without_pulse_errors`].
    pub fn without_pulse_errors(
        &self,
        records: &[FrequencyData],
    ) -> Result<Vec<FrequencyData>, EstimateError> {
        if self.pulse_amplitudes.is_empty() {
            return Ok(records.to_vec());
        }
        let count = |data: &FrequencyData| -> usize {
            data.pulse_errors().iter().map(PulseErrors::count).sum()
        };
        let total = records.iter().map(count).sum();
        check_size("amplitudes of the errors of pulses", total, self.pulse_amplitudes.len())?;
        let mut following = &self.pulse_amplitudes[..];
        let corrected = records.iter().map(|data| {
            let (own, rest) = following.split_at(count(data));
            following = rest;
            Ok(data.without_pulse_errors(own)?)
        });
        corrected.collect()
    }
}

/// Transient loads of open records, as defined at [`FrequencyData::as_open_record`].
#[derive(Debug, Clone, PartialEq)]
pub struct EndLoads {
    tau: Vec<f64>,
    /// Statistic τᵀ Cov(τ)⁻¹ τ of the loads τ, a pure number. For records of whole periods it is χ²
    /// distributed with one degree of freedom per load.
    pub statistic: f64,
    /// Ratio of the power of the transient loads to the power of the forces, both summed over the
    /// lines of the fit.
    pub share: f64,
}

impl EndLoads {
    /// Number of unknown loads.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.tau.len()
    }

    /// Estimated loads, in the order of [`TransientLoad`].
    pub(super) fn loads(&self) -> &[f64] {
        &self.tau
    }

    /// Returns the probability that records of whole periods give a larger statistic than this one:
    /// the upper tail of the χ² distribution.
    pub fn p_value(&self) -> f64 {
        let chi_squared = ChiSquared::new(self.tau.len() as f64);
        chi_squared.map_or(f64::NAN, |chi_squared| chi_squared.sf(self.statistic))
    }

    /// Returns the fitted records as if each were a period: the transient loads are subtracted from
    /// the force (N).
    ///
    /// # Errors
    /// [`NumericsError::Size`] if the number of open records or of degrees of freedom differs from
    /// that of the fit.
    pub fn without_transients(
        &self,
        records: &[FrequencyData],
    ) -> Result<Vec<FrequencyData>, EstimateError> {
        let len = records.iter().map(transient::len).sum();
        check_size("transient loads of the open records", len, self.tau.len())?;
        let mut loads = &self.tau[..];
        let closed = records.iter().map(|record| {
            let (tau, following) = loads.split_at(transient::len(record));
            loads = following;
            record.without_transient(tau)
        });
        Ok(closed.collect())
    }

    /// Returns the fitted records, each as the response to its force alone: the response of
    /// `system` to the transient loads is subtracted from the displacement (m), on lines where the
    /// receptance of `system` exists.
    ///
    /// # Errors
    /// As [`EndLoads::without_transients`], and [`NumericsError::Size`] for another number of
    /// degrees of freedom.
    pub fn without_transient_responses(
        &self,
        records: &[FrequencyData],
        system: &SecondOrderSystem,
    ) -> Result<Vec<FrequencyData>, EstimateError> {
        let closed = self.without_transients(records)?;
        let responses = records.iter().zip(&closed).map(|(record, closed)| {
            check_size("degrees of freedom", record.dof(), system.dof())?;
            Ok(record.without_response_to_transient(closed.force(), system))
        });
        responses.collect()
    }

    fn new(data: &FrequencyData, tau: &[f64], covariance: DMatrix<f64>) -> Option<Self> {
        if tau.is_empty() {
            return None;
        }
        let scale = covariance.diagonal().map(f64::sqrt);
        let scaled = DMatrix::from_fn(tau.len(), tau.len(), |i, j| {
            covariance[(i, j)] / (scale[i] * scale[j])
        });
        let in_errors = DVector::from_fn(tau.len(), |at, _| tau[at] / scale[at]);
        let statistic =
            scaled.cholesky().map_or(f64::INFINITY, |f| in_errors.dot(&f.solve(&in_errors)));
        let loads = TransientLoad::new(data, tau);
        let mut of_ends = DMatrix::zeros(data.dof(), data.len());
        loads.subtract_from(&mut of_ends);
        let load = of_ends.norm_squared();
        let share = load / data.force().norm_squared();
        Some(Self { tau: tau.to_vec(), statistic, share })
    }
}

/// Returns the range of a sum of squares that noise alone explains. The sum has `spare` degrees of
/// freedom, and the noise variance in its weights has `known` degrees of freedom.
pub(super) fn plausible(expected: Option<f64>, spare: f64, known: f64) -> Plausible {
    let spread = (2.0 / spare.max(1.0) + 2.0 / known.max(1.0)).sqrt();
    Plausible { expected, factor: 1.0 + FIT_PLAUSIBLE * spread }
}

/// Scale of the covariance relative to the inverse of the Fisher information.
pub(super) struct Scale {
    /// Ratio of the noise power to the power assumed by the weights.
    pub(super) level: f64,
    /// Ratio, due to sampled weights, of the covariance to the inverse of the Fisher information;
    /// ignored if there is a [`WeightUncertainty`].
    pub(super) inflation: f64,
    pub(super) weights: Option<WeightUncertainty>,
    /// Inverse of the Fisher information with errors of pulses in the forces; `None` if the lines
    /// have independent errors.
    pub(super) with_pulses: Option<DMatrix<f64>>,
    pub(super) degrees_of_freedom: usize,
    pub(super) misfit_ratio: f64,
    pub(super) deviance: Option<f64>,
    pub(super) noise: Vec<NoiseModel>,
    pub(super) spectrum: NoiseSpectrum,
}

impl Scale {
    /// Returns the covariance of the independent unknowns for a noise level of 1, and the degrees
    /// of freedom of this covariance. `inverse` is the inverse of the Fisher information.
    fn covariance(&self, inverse: DMatrix<f64>) -> (DMatrix<f64>, usize) {
        let inverse = self.with_pulses.clone().unwrap_or(inverse);
        match &self.weights {
            None => (inverse * self.inflation, self.degrees_of_freedom),
            Some(weights) => {
                let fewest = weights.degrees_of_freedom.min(self.degrees_of_freedom as f64);
                (inverse + &weights.excess, fewest.max(1.0) as usize)
            }
        }
    }
}

/// Returns the free entries of M, C and K with their covariance, from the independent unknowns and
/// the covariance of these unknowns.
fn entries_with_covariance(
    unknowns: &Unknowns,
    independent: &[f64],
    covariance: DMatrix<f64>,
) -> (Vec<f64>, DMatrix<f64>) {
    match Relations::from_unknowns(unknowns) {
        None => (independent.to_vec(), covariance),
        Some(relations) => {
            let tangent = relations.tangent(independent);
            let entries = relations.entries(independent).as_slice().to_vec();
            (entries, &tangent * covariance * tangent.transpose())
        }
    }
}

/// Returns the power of the modelled response to the forces, divided by the power of the measured
/// response. If the ratio is above 1, the modelled transients cancel the excess. If the ratio is
/// above 1/ε, the sum of modelled response and transients is only rounding error; the ratio then
/// acts like the condition number of the normal equations.
fn cancelled_power(data: &FrequencyData, unknowns: &Unknowns, independent: &[f64]) -> f64 {
    let [m, c, k] = unknowns.assemble(entries(unknowns, independent).as_slice());
    let Ok(system) = SecondOrderSystem::new(m, c, k) else { return 0.0 };
    let powers = data.omega().iter().zip(data.force().row_iter()).filter_map(|(omega, force)| {
        let forced = system.dynamic_stiffness(*omega).lu().solve(&force.transpose())?;
        Some(forced.norm_squared())
    });
    powers.sum::<f64>() / data.displacement().norm_squared()
}

pub(super) fn finish(
    data: &FrequencyData,
    unknowns: &Unknowns,
    misfit: &mut Misfit<'_>,
    best: &GlobalMinimum,
    scale: Scale,
) -> Result<OutputErrorFit, EstimateError> {
    let equations = misfit.linearise().ok_or(NumericsError::Overflow)?;
    let (covariance, condition) = equations.covariance().ok_or(NumericsError::Overflow)?;
    let (independent, tau) = parts(data, &best.minimum.parameters);
    let cancelled = if tau.is_empty() { 0.0 } else { cancelled_power(data, unknowns, independent) };
    let is_singular = cancelled * f64::EPSILON >= 1.0;
    let condition = if is_singular { condition.max(cancelled) } else { condition };
    let count = independent.len();
    let of_ends = covariance.view((count, count), (tau.len(), tau.len()));
    let ends = EndLoads::new(data, tau, of_ends * scale.level);
    let covariance = covariance.view((0, 0), (count, count)).into_owned();
    let (covariance, degrees_of_freedom) = scale.covariance(covariance);
    let (entries, covariance) = entries_with_covariance(unknowns, independent, covariance);
    let errors = misfit.errors();
    let nrmse = |(e, x): (f64, f64)| if e == 0.0 { 0.0 } else { e / x };
    let residual_nrmse = errors
        .column_iter()
        .zip(data.displacement().column_iter())
        .map(|(e, x)| nrmse((e.norm(), x.norm())))
        .collect();
    let estimate = Estimate::new(EstimateParts {
        unknowns: unknowns.clone(),
        values: entries,
        covariance: (covariance * scale.level).into(),
        degrees_of_freedom,
        residual_nrmse,
        condition,
        undetermined: Vec::new(),
    })?;
    Ok(OutputErrorFit {
        estimate,
        misfit_ratio: scale.misfit_ratio,
        deviance: scale.deviance,
        steps: best.minimum.steps,
        searches: best.searches,
        agreeing: best.agreeing,
        noise: scale.noise,
        spectrum: scale.spectrum,
        ends,
        sinusoids: Vec::new(),
        pulse_amplitudes: Vec::new(),
        variance_ratio: 1.0,
    })
}

/// Returns the uncertainty of estimated weights; the transient loads are treated as exact.
pub(super) fn uncertain_weights(
    data: &FrequencyData,
    unknowns: &Unknowns,
    theta: &DVector<f64>,
    noise: &NoiseSpectrum,
) -> Option<WeightUncertainty> {
    let (independent, tau) = parts(data, theta);
    let entries = entries(unknowns, independent);
    match tau {
        [] => WeightUncertainty::new(data, unknowns, &entries, noise),
        _ => WeightUncertainty::new(&data.without_transient(tau), unknowns, &entries, noise),
    }
}

/// Returns the free entries of M, C and K from the independent unknowns.
pub(super) fn entries(unknowns: &Unknowns, independent: &[f64]) -> DVector<f64> {
    match Relations::from_unknowns(unknowns) {
        None => DVector::from_column_slice(independent),
        Some(relations) => relations.entries(independent),
    }
}

/// Splits the parameters of a search into the independent unknowns of M, C and K and the transient
/// loads.
pub(super) fn parts<'a>(data: &FrequencyData, theta: &'a DVector<f64>) -> (&'a [f64], &'a [f64]) {
    theta.as_slice().split_at(theta.len() - transient::len(data))
}

/// Returns the number of real equations minus unknowns.
pub(super) fn spare(data: &FrequencyData, unknowns: &Unknowns) -> usize {
    let unknowns = unknowns.independent() + transient::len(data);
    (2 * data.dof() * data.len()).saturating_sub(unknowns)
}

/// Returns the ratio, due to sampled weights, of the covariance to the inverse of the Fisher
/// information.
///
/// For weights W = Ŝ⁻¹ with a sample covariance Ŝ of n channels and ν degrees of freedom, and the
/// true covariance S, E[W] = ν/(ν−n)·S⁻¹ and E[W S W] = ν³/((ν−n)((ν−n)²−1))·S⁻¹. The covariance of
/// the estimate is therefore E[WSW]/E[W]² times the best covariance, and ν²/((ν−n)²−1) times the
/// computed covariance.
///
/// # Errors
/// [`SpectraError::TooFewAverages`](mechid_spectra::SpectraError::TooFewAverages) if this
/// covariance does not exist.
pub(super) fn sampled_weight_inflation(nu: f64, channels: usize) -> Result<f64, EstimateError> {
    if nu.is_infinite() {
        return Ok(1.0);
    }
    let n = channels as f64;
    if nu <= n + 1.0 {
        let (got, needed) = (nu as usize + 1, channels + 3);
        return Err(SpectraError::TooFewAverages { got, needed }.into());
    }
    Ok(nu * nu / ((nu - n) * (nu - n) - 1.0))
}
