//! The result of maximum likelihood, made of the minimum that its search found.

use mechid_model::SecondOrderSystem;
use mechid_numerics::gauss_newton::SumOfSquares;
use mechid_numerics::{NumericsError, check_size};
use mechid_spectra::SpectraError;
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
    /// weights, a pure number; `None` where the noise is estimated from the residual. What two fits
    /// of the same data differ by is a [`likelihood_ratio`].
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
    /// Noise spectra by which it was weighted where they were estimated: one of each experiment
    /// from its periods, or one from the residual; none where the noise is known beforehand.
    pub noise: Vec<NoiseModel>,
    /// Noise by which the lines were weighted: stated, or found from the residual up to its common
    /// level.
    pub spectrum: NoiseSpectrum,
    /// Loads of the ends of open records, `None` where all rows belong to periods.
    pub ends: Option<EndLoads>,
    /// Sinusoids of each open record that were found beside the response to the forces and taken
    /// off it; none where the noise is stated.
    pub sinusoids: Vec<Vec<Sinusoid>>,
}

/// Loads of the ends of open records, as [`FrequencyData::of_open_record`] describes them.
#[derive(Debug, Clone, PartialEq)]
pub struct EndLoads {
    tau: Vec<f64>,
    /// τᵀ Cov(τ)⁻¹ τ: its χ² distribution has as many degrees of freedom as there are loads, if the
    /// records are periods.
    pub statistic: f64,
    /// Power of the loads on the lines over that of the forces, a ratio.
    pub share: f64,
}

impl EndLoads {
    /// Number of unknown loads.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.tau.len()
    }

    /// The unknown loads, in the order of [`TransientLoad`].
    pub(super) fn loads(&self) -> &[f64] {
        &self.tau
    }

    /// Probability that periods show loads like these: the tail of the χ² distribution beyond the
    /// statistic.
    pub fn p_value(&self) -> f64 {
        let chi_squared = ChiSquared::new(self.tau.len() as f64);
        chi_squared.map_or(f64::NAN, |chi_squared| chi_squared.sf(self.statistic))
    }

    /// The records that were fitted, each with its loads taken off the force (N): as if it were a
    /// period.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if there are more or fewer open records or degrees of freedom.
    pub fn taken_off(
        &self,
        records: &[FrequencyData],
    ) -> Result<Vec<FrequencyData>, EstimateError> {
        let all = records.iter().map(transient::len).sum();
        check_size("loads of open ends", all, self.tau.len())?;
        let mut rest = &self.tau[..];
        let closed = records.iter().map(|record| {
            let (tau, others) = rest.split_at(transient::len(record));
            rest = others;
            record.without_transient(tau)
        });
        Ok(closed.collect())
    }

    /// The records that were fitted, each as the response to its force alone: what the loads of its
    /// ends make of `system` is taken off the displacement (m), where its receptance exists.
    ///
    /// # Errors
    /// As [`EndLoads::taken_off`], and [`NumericsError::Size`] for another number of degrees of
    /// freedom.
    pub fn taken_off_responses(
        &self,
        records: &[FrequencyData],
        system: &SecondOrderSystem,
    ) -> Result<Vec<FrequencyData>, EstimateError> {
        let closed = self.taken_off(records)?;
        let each = records.iter().zip(&closed).map(|(record, closed)| {
            check_size("degrees of freedom", record.dof(), system.dof())?;
            Ok(record.without_response_to_transient(closed.force(), system))
        });
        each.collect()
    }

    fn of(data: &FrequencyData, tau: &[f64], covariance: DMatrix<f64>) -> Option<Self> {
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
        let load: f64 = (0..data.len()).map(|row| loads.load(row).norm_squared()).sum();
        let share = load / data.force().norm_squared();
        Some(Self { tau: tau.to_vec(), statistic, share })
    }
}

/// A sum of squares of `spare` numbers, weighted by a variance of `known` degrees of freedom.
pub(super) fn plausible(expected: Option<f64>, spare: f64, known: f64) -> Plausible {
    let spread = (2.0 / spare.max(1.0) + 2.0 / known.max(1.0)).sqrt();
    Plausible { expected, factor: 1.0 + FIT_PLAUSIBLE * spread }
}

/// Scale of the covariance relative to the inverse of the Fisher information.
pub(super) struct Scale {
    /// Power of the noise over that of the weights.
    pub(super) level: f64,
    /// Factor by which the covariance is larger for weights that are uncertain, where nothing
    /// better is known.
    pub(super) inflation: f64,
    pub(super) weights: Option<WeightUncertainty>,
    /// Matrix that lines which err together add to the inverse of the Fisher information.
    pub(super) pulses: Option<DMatrix<f64>>,
    pub(super) degrees_of_freedom: usize,
    pub(super) misfit_ratio: f64,
    pub(super) deviance: Option<f64>,
    pub(super) noise: Vec<NoiseModel>,
    pub(super) spectrum: NoiseSpectrum,
}

impl Scale {
    /// Returns the covariance of the independent unknowns, over the level of the noise, and its
    /// degrees of freedom, from the inverse of the Fisher information.
    fn covariance(&self, inverse: DMatrix<f64>) -> (DMatrix<f64>, usize) {
        let (covariance, degrees_of_freedom) = match &self.weights {
            None => (inverse * self.inflation, self.degrees_of_freedom),
            Some(weights) => {
                let fewest = weights.degrees_of_freedom.min(self.degrees_of_freedom as f64);
                (inverse + &weights.excess, fewest.max(1.0) as usize)
            }
        };
        match &self.pulses {
            Some(excess) => (covariance + excess, degrees_of_freedom),
            None => (covariance, degrees_of_freedom),
        }
    }
}

/// Returns the free entries of M, C and K and their covariance, from those of the independent
/// unknowns.
fn of_entries(
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
    let count = independent.len();
    let of_ends = covariance.view((count, count), (tau.len(), tau.len()));
    let ends = EndLoads::of(data, tau, of_ends * scale.level);
    let covariance = covariance.view((0, 0), (count, count)).into_owned();
    let (covariance, degrees_of_freedom) = scale.covariance(covariance);
    let (entries, covariance) = of_entries(unknowns, independent, covariance);
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
    })
}

/// Finds the uncertainty of weights that were estimated, the loads of open ends taken as known.
pub(super) fn uncertain_weights(
    data: &FrequencyData,
    unknowns: &Unknowns,
    theta: &DVector<f64>,
    noise: &NoiseSpectrum,
) -> Option<WeightUncertainty> {
    let (independent, tau) = parts(data, theta);
    let entries = entries(unknowns, independent);
    match tau {
        [] => WeightUncertainty::of(data, unknowns, &entries, noise),
        _ => WeightUncertainty::of(&data.without_transient(tau), unknowns, &entries, noise),
    }
}

/// The free entries of M, C and K.
pub(super) fn entries(unknowns: &Unknowns, independent: &[f64]) -> DVector<f64> {
    match Relations::from_unknowns(unknowns) {
        None => DVector::from_column_slice(independent),
        Some(relations) => relations.entries(independent),
    }
}

/// The independent unknowns of M, C and K among the parameters of a search, and the loads of open
/// ends.
pub(super) fn parts<'a>(data: &FrequencyData, theta: &'a DVector<f64>) -> (&'a [f64], &'a [f64]) {
    theta.as_slice().split_at(theta.len() - transient::len(data))
}

/// Real equations less unknowns.
pub(super) fn spare(data: &FrequencyData, unknowns: &Unknowns) -> usize {
    let unknowns = unknowns.independent() + transient::len(data);
    (2 * data.dof() * data.len()).saturating_sub(unknowns)
}

/// Covariance over the inverse of the Fisher information computed with sampled weights.
///
/// For weights W = Ŝ⁻¹ with a sample covariance Ŝ of n channels and ν degrees of freedom, and
/// true covariance S: E[W] = ν/(ν−n)·S⁻¹, E[W S W] = ν³/((ν−n)((ν−n)²−1))·S⁻¹, so that the
/// covariance of the estimate is E[WSW]/E[W]² times the best one, and ν²/((ν−n)²−1) times the
/// one computed.
///
/// # Errors
/// [`SpectraError::TooFewAverages`](mechid_spectra::SpectraError::TooFewAverages) where it does not
/// exist.
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
