//! Nonlinear terms that are missing in a fit with nonlinear terms, and their effect on the
//! parameters of this fit.

use mechid_checks::{Finding, NamedChange, NonlinearTermsLeftOut, PValue};
use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{ResponseQuantity, Term, Terms};
use mechid_nonlinear::{
    Criterion, EquationErrorOptions, FurtherFit, NonlinearEstimate, NonlinearFit, SelectionStep,
    SteadyExperiments, SteppedRecord, equation_error, further_output_error, further_terms,
    select_terms,
};
use mechid_numerics::Uncertain;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::nonlinear::estimated;
use super::options::Nonlinear;
use crate::AnalysisError;

/// Terms that explain a part of the residual of a fit.
pub(super) struct FurtherTerms {
    /// Finding that names the terms and the changes of the parameters by these terms.
    pub(super) finding: Finding,
    /// Vector of the parameter changes times its transpose (parameters × parameters), in the
    /// product of the units of two parameters.
    pub(super) squared_change: DMatrix<f64>,
}

impl FurtherTerms {
    /// Adds terms of the usual kinds to a fit of whole periods, as long as the information
    /// criterion falls and their coefficients differ from zero; `None` if there are no such terms,
    /// or if the larger fit fails. The larger fit uses the estimator of `fit`. If the larger fit
    /// fails with this estimator, both fits use least squares on the equation of motion.
    pub(super) fn from_periods(
        data: &SteadyExperiments,
        unknowns: &Unknowns,
        how: &Nonlinear,
        stepped: &[SteppedRecord],
        fit: &NonlinearEstimate,
    ) -> Option<Self> {
        let candidates = further_terms(data, fit).ok()?;
        let with_terms = |stepped: &[SteppedRecord], fit: &NonlinearEstimate| {
            let larger = with_terms(data, unknowns, how, stepped, fit, &candidates)?;
            Ok(larger.and_then(|(larger, explained)| {
                let further = larger.terms().iter().skip(fit.terms().len());
                let p_value = least_p_value(&larger, further.map(Term::name)).ok()?;
                Self::new(fit, &larger, explained, (candidates.len() as f64 * p_value).min(1.0))
            }))
        };
        let with_equation_error = |_: AnalysisError| {
            let options = EquationErrorOptions {
                weighting: how.weighting,
                ..EquationErrorOptions::default()
            };
            let fit = equation_error(data, unknowns, fit.terms(), &options)?;
            with_terms(&[], &fit)
        };
        with_terms(stepped, fit).or_else(with_equation_error).ok().flatten()
    }

    /// Adds terms of the usual kinds to a fit of open records as
    /// [`FurtherTerms::from_periods`] does, by output error.
    pub(super) fn from_open_records(
        records: &[SteppedRecord],
        measured: ResponseQuantity,
        fit: &NonlinearFit,
    ) -> Option<Self> {
        let further = further_output_error(records, measured, fit).ok().flatten()?;
        let FurtherFit { fit: larger, explained, p_value } = further;
        Self::new(&fit.estimate, &larger.estimate, explained, p_value)
    }

    /// Compares a fit with a larger fit, whose last terms are the further terms; `None` if the
    /// larger fit has no further terms. `p_value` is the probability that noise alone gives a
    /// further term at least as significant as the most significant of these terms (for open
    /// records: as the first of these terms).
    fn new(
        fit: &NonlinearEstimate,
        larger: &NonlinearEstimate,
        explained: f64,
        p_value: f64,
    ) -> Option<Self> {
        let further = || larger.terms().iter().skip(fit.terms().len());
        let changes = changes(fit, larger).ok().filter(|_| further().len() > 0)?;
        let change = DVector::from_iterator(changes.len(), changes.iter().map(|change| change.by));
        let law = |term: &Term| {
            let text = term.to_string();
            text.split_once(": ").map_or(text.clone(), |(_, law)| law.to_owned())
        };
        let finding = Finding::NonlinearTermsLeftOut(NonlinearTermsLeftOut {
            laws: further().map(law).collect(),
            explained,
            p_value: PValue::new(p_value),
            changes,
        });
        Some(Self { finding, squared_change: &change * change.transpose() })
    }
}

/// Returns the fit with the candidates that the information criterion adds, and the fraction of the
/// remaining power of the force that they explain; `None` if it adds none.
fn with_terms(
    data: &SteadyExperiments,
    unknowns: &Unknowns,
    how: &Nonlinear,
    stepped: &[SteppedRecord],
    fit: &NonlinearEstimate,
    candidates: &Terms,
) -> Result<Option<(NonlinearEstimate, f64)>, AnalysisError> {
    let (terms, criterion) = (fit.terms(), Criterion::Information);
    let selection = select_terms(data, unknowns, terms, candidates, criterion, how.weighting)?;
    let left = |step: Option<&SelectionStep>| step.map_or(0.0, |step| step.unexplained.powi(2));
    let explained = 1.0 - left(selection.steps.last()) / left(selection.steps.first());
    if selection.terms.len() == terms.len() {
        return Ok(None);
    }
    let how = Nonlinear {
        terms: terms.clone(),
        candidates: candidates.clone(),
        criterion,
        ..how.clone()
    };
    let (larger, _) = estimated(data, unknowns, &how, stepped, &mut Some(selection))?;
    Ok(Some((larger, explained)))
}

/// Returns the smallest p-value of the coefficients of the added terms: the probability that noise
/// alone gives a coefficient that differs from zero by at least as many standard errors.
fn least_p_value<'a>(
    fit: &NonlinearEstimate,
    added: impl Iterator<Item = &'a str>,
) -> Result<f64, EstimateError> {
    let mut least = 1.0f64;
    for name in added {
        let Uncertain { value, standard_error, degrees_of_freedom } = fit.parameter(name)?.estimate;
        let ratio = (value / standard_error).abs();
        if let Ok(student) = StudentsT::new(0.0, 1.0, degrees_of_freedom as f64) {
            least = least.min(2.0 * student.sf(ratio));
        }
    }
    Ok(least)
}

/// Returns the change of each parameter of a fit by further terms.
fn changes(
    fit: &NonlinearEstimate,
    larger: &NonlinearEstimate,
) -> Result<Vec<NamedChange>, EstimateError> {
    let change = |parameter: &mechid_nonlinear::NamedParameter| {
        let by = larger.parameter(&parameter.name)?.estimate.value - parameter.estimate.value;
        let in_errors = by / parameter.estimate.standard_error;
        let (parameter, unit) = (parameter.name.clone(), parameter.unit.clone());
        Ok(NamedChange { parameter, unit, by, in_errors })
    };
    fit.parameters().iter().map(change).collect()
}
