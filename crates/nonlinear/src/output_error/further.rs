//! Terms that are missing in an output-error fit.

use mechid_estimate::{Estimate, EstimateError, EstimateParts};
use mechid_model::{ResponseQuantity, Term, Terms};
use mechid_numerics::NumericsError;
use mechid_numerics::gauss_newton::Residuals;
use mechid_numerics::least_squares::solve_compressed;
use mechid_numerics::triangular::TriangularFactor;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::{NonlinearFit, Problem, SteppedRecord, Weights, output_error, search};
use crate::estimate::NonlinearEstimate;
use crate::kinds::further_terms_up_to;

/// Output-error fit with further terms.
#[derive(Debug, Clone, PartialEq)]
pub struct FurtherFit {
    /// The fit; its last terms are the further terms.
    pub fit: NonlinearFit,
    /// Fraction of the residual power that the further terms explain.
    pub explained: f64,
    /// Probability that, with noise alone, at least one of the candidates explains at least the
    /// residual power that the first of the further terms explains.
    pub p_value: f64,
}

/// Adds terms of the usual kinds to an output-error fit, as long as the information criterion
/// falls; `None` if no term is added.
///
/// The candidates are selected in a linearised fit, in which the change of the simulated response
/// due to a small force of a candidate is known. Afterwards the selected terms are fitted together
/// with all parameters.
///
/// # Errors
/// As [`output_error`].
///
/// # Source
/// Billings, *Nonlinear System Identification: NARMAX Methods* (2013), chapter 3 (forward
/// selection); Rao (1948), Mathematical Proceedings of the Cambridge Philosophical Society 44,
/// 50–57 (tests at the estimate without the parameters that are added).
pub fn further_output_error(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    fit: &NonlinearFit,
) -> Result<Option<FurtherFit>, EstimateError> {
    // A missing term is most visible in the residual if the weights are those of the most likely
    // noise.
    let weighted = search(records, measured, &fit.estimate, Weights::AnyNoise)?;
    let linearised = Linearised::new(records, measured, &weighted)?;
    let Some((start, p_value)) = linearised.start()? else { return Ok(None) };
    let larger = output_error(records, measured, &start)?;
    let ratios = larger.rmse.iter().zip(&fit.rmse).map(|(after, before)| after / before);
    let remaining = ratios.map(|ratio| ratio * ratio).sum::<f64>() / fit.rmse.len() as f64;
    Ok(Some(FurtherFit { fit: larger, explained: 1.0 - remaining, p_value }))
}

/// Fit with candidates whose coefficients are zero, linearised at its parameters.
struct Linearised<'a> {
    fit: &'a NonlinearFit,
    /// Terms that are tried.
    candidates: Terms,
    /// Triangular factor of columns: first the derivatives of the residual with respect to the
    /// parameters of the fit, next those with respect to the coefficients of the candidates, last
    /// the residual.
    triangle: DMatrix<f64>,
    /// Number of parameters of the fit.
    parameters: usize,
    /// Number of samples of all records and channels.
    samples: usize,
}

impl<'a> Linearised<'a> {
    fn new(
        records: &[SteppedRecord],
        measured: ResponseQuantity,
        fit: &'a NonlinearFit,
    ) -> Result<Self, EstimateError> {
        let estimate = &fit.estimate;
        let candidates = candidates(records, measured, fit)?;
        let terms = Terms::new(estimate.terms.iter().chain(candidates.iter()).cloned().collect())?;
        let coefficients = [&estimate.coefficients[..], &vec![0.0; candidates.len()]].concat();
        let larger = NonlinearEstimate { terms, coefficients, ..estimate.clone() };
        let system = larger.system()?;
        let mut problem = Problem::new(records, measured, &larger, &system)?;
        problem.levels = fit.rmse.iter().map(|e| if *e > 0.0 { *e } else { 1.0 }).collect();
        let theta = problem.parameters_at(fit, &system);
        let (samples, count) = (problem.len(), theta.len());
        let mut residual = DVector::zeros(samples);
        if !problem.residual(&theta, &mut residual) {
            return Err(EstimateError::Diverged { len: samples });
        }
        problem.noise = problem.noise(&theta);
        problem.weigh(&mut residual);
        let mut jacobian = DMatrix::zeros(samples, count);
        problem.jacobian(&mut jacobian);
        // The columns are free entries, terms, candidates, constants and initial states; candidates
        // have no constants.
        let first = problem.free.len() + estimate.terms.len();
        let tried = first..first + candidates.len();
        let of_fit: Vec<usize> = (0..first).chain(tried.end..count).collect();
        let columns: Vec<usize> = of_fit.iter().copied().chain(tried).collect();
        let jacobian = jacobian.select_columns(&columns);
        let mut factor = TriangularFactor::new(columns.len() + 1);
        let residual = DMatrix::from_column_slice(samples, 1, residual.as_slice());
        if !factor.push(&[jacobian.as_view(), residual.as_view()]) {
            return Err(NumericsError::Overflow.into());
        }
        let (triangle, parameters) = (factor.r().clone(), of_fit.len());
        Ok(Self { fit, candidates, triangle, parameters, samples })
    }

    /// Returns the change of the parameters if some of the candidates are added, and the residual
    /// power.
    fn with(&self, chosen: &[usize]) -> Result<(DVector<f64>, f64), EstimateError> {
        let columns: Vec<usize> =
            (0..self.parameters).chain(chosen.iter().map(|at| self.parameters + at)).collect();
        let regressors = self.triangle.select_columns(&columns);
        let target = self.triangle.columns(self.triangle.ncols() - 1, 1);
        let solution = solve_compressed(regressors.as_view(), target, self.samples)?;
        let change: DVector<f64> = solution.coefficients.column(0).into_owned();
        let power = (target - regressors * &change).norm_squared();
        Ok((-change, power))
    }

    /// Returns the initial estimate of a fit with the candidates that the information criterion
    /// adds, and the p-value of the first candidate (that of an F test, times the number of
    /// candidates). `None` if the criterion does not add a candidate.
    ///
    /// # Source
    /// Chen & Chen (2008), Biometrika 95, 759–771 (extended Bayesian information criterion).
    fn start(&self) -> Result<Option<(NonlinearEstimate, f64)>, EstimateError> {
        let n = self.samples as f64;
        let mut p_value = None;
        let price = n.ln() + 2.0 * (self.candidates.len().max(1) as f64).ln();
        let mut chosen: Vec<usize> = Vec::new();
        let (mut change, mut power) = self.with(&chosen)?;
        loop {
            let mut best: Option<(usize, DVector<f64>, f64)> = None;
            for at in (0..self.candidates.len()).filter(|at| !chosen.contains(at)) {
                let (change, power) = self.with(&[&chosen[..], &[at]].concat())?;
                if best.as_ref().is_none_or(|(_, _, least)| power < *least) {
                    best = Some((at, change, power));
                }
            }
            let Some((at, next, least)) = best else { break };
            if n * (power / least).ln() <= price {
                break;
            }
            let freedom = self.samples.saturating_sub(self.parameters + 1) as f64;
            let tail = FisherSnedecor::new(1.0, freedom)
                .map_or(1.0, |law| law.sf((power / least - 1.0) * freedom));
            p_value = p_value.or(Some((self.candidates.len() as f64 * tail).min(1.0)));
            chosen.push(at);
            (change, power) = (next, least);
        }
        let Some(p_value) = p_value else { return Ok(None) };
        Ok(Some((self.moved(&chosen, &change)?, p_value)))
    }

    /// Returns the fit with some of the candidates added and with its parameters changed by a given
    /// amount.
    fn moved(
        &self,
        chosen: &[usize],
        change: &DVector<f64>,
    ) -> Result<NonlinearEstimate, EstimateError> {
        let estimate = &self.fit.estimate;
        let linear = &estimate.linear;
        let free = linear.unknowns().free().len();
        let values = linear.parameters().zip(change.iter()).map(|(p, by)| p.value + by).collect();
        let linear = Estimate::new(EstimateParts {
            unknowns: linear.unknowns().clone(),
            values,
            covariance: linear.covariance().into(),
            degrees_of_freedom: linear.degrees_of_freedom(),
            residual_nrmse: linear.residual_nrmse().to_vec(),
            condition: linear.condition(),
            undetermined: Vec::new(),
        })?;
        let pairs = estimate.coefficients.iter().zip(change.iter().skip(free));
        let moved = pairs.map(|(coefficient, by)| coefficient + by);
        let added = change.iter().skip(self.parameters);
        let candidates: Vec<&Term> = self.candidates.iter().collect();
        let terms = estimate.terms.iter().chain(chosen.iter().map(|at| candidates[*at])).cloned();
        Ok(NonlinearEstimate {
            linear,
            terms: Terms::new(terms.collect())?,
            coefficients: moved.chain(added.copied()).collect(),
            ..estimate.clone()
        })
    }
}

/// Returns the terms that are missing in a fit; the simulated velocities scale the friction.
fn candidates(
    records: &[SteppedRecord],
    measured: ResponseQuantity,
    fit: &NonlinearFit,
) -> Result<Terms, EstimateError> {
    let system = fit.estimate.system()?;
    let mut problem = Problem::new(records, measured, &fit.estimate, &system)?;
    let theta = problem.parameters_at(fit, &system);
    let samples = problem.len();
    if !problem.residual(&theta, &mut DVector::zeros(samples)) {
        return Err(EstimateError::Diverged { len: samples });
    }
    further_terms_up_to(&fit.estimate, |term| problem.range_of(term)[1])
}
