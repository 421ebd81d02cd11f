//! Selection of nonlinear terms from candidates.

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{Term, Terms};
use mechid_numerics::least_squares::LeastSquares;
use mechid_spectra::SpectraError;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::equation_error::{EquationErrorOptions, equation_error, weighted};
use super::equations::Equations;
use super::shape::{Shape, ShapeConstants};
use super::{NonlinearEstimate, SteadyExperiments, Weighting};
use crate::limits::{SELECTION_LEVEL, SIGNIFICANT};

/// Criterion for the addition of a term.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum Criterion {
    /// The extended Bayesian information criterion: the cost must fall by more than the penalty of
    /// one parameter, which depends on the number of candidates. The criterion assumes a white
    /// residual; therefore the added terms are tested again at the end. A term is removed if its
    /// coefficient does not differ significantly from zero, at 1 % for all candidates together
    /// ([`least_certain`]).
    ///
    /// # Source
    /// Chen & Chen (2008), Biometrika 95, 759–771.
    #[default]
    Information,
    /// Prediction of each experiment from the fit to all other experiments: the squared residual of
    /// this prediction must fall significantly by Student's t over the experiments, at 5 % for all
    /// candidates together.
    ///
    /// # Source
    /// Stone (1974), Journal of the Royal Statistical Society B 36, 111–147 (cross-validation).
    HeldOut,
}

/// Selected terms, and the steps of the selection.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    /// Given terms and added terms, in their order.
    pub terms: Terms,
    /// Steps of the selection: the first without any candidate, the others each with one more term.
    pub steps: Vec<SelectionStep>,
    /// Step with the best of the candidates that the criterion refused.
    pub refused: Option<SelectionStep>,
    /// Names of the terms that were added and later removed; the least certain term comes first.
    pub removed: Vec<String>,
}

/// Step of a selection.
#[derive(Debug, Clone, PartialEq)]
pub struct SelectionStep {
    /// Name of the added term; `None` for the first step.
    pub added: Option<String>,
    /// Value of the criterion with the term (a smaller value is better): the information criterion,
    /// or the squared residual of experiments that are excluded from the fit, divided by the
    /// number of equations.
    pub score: f64,
    /// Fraction (RMS) of the weighted force that a fit with the term does not explain.
    pub unexplained: f64,
}

/// Adds candidates to the given terms, one after the other. Each step adds the candidate that
/// lowers the equation error most, if the criterion accepts this candidate. At the end, uncertain
/// terms are removed ([`Criterion::Information`]).
///
/// Rows are weighted by the residual of a fit with all candidates, so that a missing term does not
/// affect the weights. Constants inside the laws do not change.
///
/// # Errors
/// As [`equation_error`](super::equation_error) for all terms together, and
/// [`SpectraError::TooFewAverages`](mechid_spectra::SpectraError::TooFewAverages) for held-out
/// tests with fewer than three experiments.
///
/// # Source
/// Billings, *Nonlinear System Identification: NARMAX Methods* (2013), chapter 3 (forward selection
/// by the reduction of the error).
pub fn select_terms(
    data: &SteadyExperiments,
    unknowns: &Unknowns,
    given: &Terms,
    candidates: &Terms,
    criterion: Criterion,
    weighting: Weighting,
) -> Result<Selection, EstimateError> {
    if criterion == Criterion::HeldOut && data.count() < 3 {
        return Err(SpectraError::TooFewAverages { got: data.count(), needed: 3 }.into());
    }
    let all_terms =
        candidates.iter().try_fold(given.clone(), |terms, term| terms.and(term.clone()))?;
    let equations = Equations::new(data, unknowns, &all_terms)?;
    let shape = Shape::new(&all_terms, ShapeConstants::default());
    let fit = weighted(&equations, &shape, weighting, None)?;
    let mut triangles = Vec::new();
    for columns in &fit.columns {
        let mut rows = LeastSquares::new(equations.count(), 1);
        equations.push(&mut rows, columns, &fit.weights.of_rows, &[])?;
        triangles.push(rows);
    }
    let judge = Judge {
        triangles,
        equations: equations.equations(),
        candidates: candidates.len(),
        criterion,
    };
    let base = equations.free.len() + given.len();
    let mut chosen: Vec<usize> = (0..base).collect();
    let mut before = judge.misfit(&chosen)?;
    let mut steps = vec![judge.step(None, &before, chosen.len())];
    let mut terms = given.clone();
    let refused = loop {
        let next = judge.best_next(&chosen, base..equations.count())?;
        let Some((at, after)) = next else { break None };
        let term: &Term =
            all_terms.iter().nth(at - equations.free.len()).expect("one of all terms");
        let step = judge.step(Some(term.name().to_owned()), &after, chosen.len() + 1);
        if !judge.better(&before, &after, chosen.len()) {
            break Some(step);
        }
        terms = terms.and(term.clone())?;
        chosen.push(at);
        steps.push(step);
        before = after;
    };
    let mut removed = Vec::new();
    if criterion == Criterion::Information {
        let options = EquationErrorOptions { weighting, ..Default::default() };
        while terms.len() > given.len() {
            let fit = equation_error(data, unknowns, &terms, &options)?;
            let Some(name) = least_certain(&fit, candidates)? else { break };
            terms = without(&terms, &name)?;
            removed.push(name);
        }
    }
    Ok(Selection { terms, steps, refused, removed })
}

/// Returns the name of the least certain candidate among the terms of a fit, if its coefficient
/// does not differ significantly from zero, at 1 % for all candidates together. The test is
/// Student's t with the degrees of freedom of the fit. If there are several periods, the bias due
/// to noise in the regressors is subtracted first.
///
/// # Errors
/// [`EstimateError::NoSuchParameter`] if the fit lacks the coefficient of one of its terms.
pub fn least_certain(
    fit: &NonlinearEstimate,
    candidates: &Terms,
) -> Result<Option<String>, EstimateError> {
    let is_candidate = |term: &&Term| candidates.iter().any(|other| other.name() == term.name());
    let mut least: Option<(f64, String)> = None;
    for term in fit.terms().iter().filter(is_candidate) {
        let mut estimate = fit.parameter(term.name())?.estimate;
        let index = fit.parameters().iter().position(|parameter| parameter.name == term.name());
        estimate.value -= index.and_then(|at| fit.bias.get(at)).copied().unwrap_or(0.0);
        let [low, high] = estimate.interval(1.0 - SIGNIFICANT / candidates.len() as f64)?;
        let certainty = estimate.value.abs() / estimate.standard_error;
        if low <= 0.0 && high >= 0.0 && least.as_ref().is_none_or(|(least, _)| certainty < *least) {
            least = Some((certainty, term.name().to_owned()));
        }
    }
    Ok(least.map(|(_, name)| name))
}

/// Returns the terms without the term of this name.
fn without(terms: &Terms, name: &str) -> Result<Terms, EstimateError> {
    let mut remaining = terms.iter().filter(|term| term.name() != name).cloned();
    Ok(remaining.try_fold(Terms::none(), |remaining, term| remaining.and(term))?)
}

impl Selection {
    /// Removes an uncertain term by its name, and lists it as removed.
    ///
    /// # Errors
    /// [`EstimateError::Model`] if the remaining terms are not a valid list.
    pub fn remove(&mut self, name: String) -> Result<(), EstimateError> {
        self.terms = without(&self.terms, &name)?;
        self.removed.push(name);
        Ok(())
    }
}

/// Weighted sums of squared residuals of a fit with some of the columns.
struct Misfit {
    /// Sum of squared residuals of all experiments, with coefficients that were fitted to all of
    /// them together.
    fitted: f64,
    /// Sum of squared residuals of all experiments if all coefficients are zero.
    total_sum: f64,
    /// Sum of squares of each experiment, with the coefficients that were fitted to all other
    /// experiments; used only with [`Criterion::HeldOut`], otherwise empty.
    held_out: Vec<f64>,
}

struct Judge {
    /// Triangular factor of \[A | b\] of each experiment.
    triangles: Vec<LeastSquares>,
    equations: usize,
    candidates: usize,
    criterion: Criterion,
}

impl Judge {
    /// Returns the column among `columns` that lowers the residual of all experiments most, and the
    /// residuals with this column.
    fn best_next(
        &self,
        chosen: &[usize],
        columns: std::ops::Range<usize>,
    ) -> Result<Option<(usize, Misfit)>, EstimateError> {
        let mut best: Option<(usize, Misfit)> = None;
        for at in columns.filter(|at| !chosen.contains(at)) {
            let misfit = self.misfit(&[chosen, &[at]].concat())?;
            if best.as_ref().is_none_or(|(_, least)| misfit.fitted < least.fitted) {
                best = Some((at, misfit));
            }
        }
        Ok(best)
    }

    fn misfit(&self, chosen: &[usize]) -> Result<Misfit, EstimateError> {
        let everything: Vec<usize> = (0..self.triangles.len()).collect();
        let coefficients = self.fit(chosen, &everything)?;
        let on = |at: usize, coefficients: &[f64]| {
            let r = self.triangles[at].triangle();
            let mut residual = r.column(r.ncols() - 1).into_owned();
            for (column, coefficient) in chosen.iter().zip(coefficients) {
                residual.axpy(-coefficient, &r.column(*column), 1.0);
            }
            residual.norm_squared()
        };
        let fitted = everything.iter().map(|at| on(*at, &coefficients)).sum();
        let total = everything.iter().map(|at| on(*at, &vec![0.0; chosen.len()])).sum();
        let mut held_out = Vec::new();
        if self.criterion == Criterion::HeldOut {
            for at in &everything {
                let remaining: Vec<usize> =
                    everything.iter().filter(|o| *o != at).copied().collect();
                held_out.push(on(*at, &self.fit(chosen, &remaining)?));
            }
        }
        Ok(Misfit { fitted, total_sum: total, held_out })
    }

    fn fit(&self, chosen: &[usize], experiments: &[usize]) -> Result<Vec<f64>, EstimateError> {
        let mut rows = LeastSquares::new(chosen.len(), 1);
        for at in experiments {
            let r = self.triangles[*at].triangle();
            let target = r.columns(r.ncols() - 1, 1);
            rows.push_rows(r.select_columns(chosen).as_view(), target.as_view())?;
        }
        Ok(rows.solve()?.coefficients.column(0).iter().copied().collect())
    }

    /// Returns n ln(residual²/n) + p (ln n + 2 ln(candidates)), for n equations and p parameters.
    fn information(&self, misfit: &Misfit, parameters: usize) -> f64 {
        let n = self.equations as f64;
        let price = n.ln() + 2.0 * (self.candidates.max(1) as f64).ln();
        n * (misfit.fitted.max(f64::MIN_POSITIVE) / n).ln() + parameters as f64 * price
    }

    fn better(&self, before: &Misfit, after: &Misfit, parameters: usize) -> bool {
        if self.criterion == Criterion::Information {
            return self.information(after, parameters + 1) < self.information(before, parameters);
        }
        let count = before.held_out.len() as f64;
        let falls: Vec<f64> =
            before.held_out.iter().zip(&after.held_out).map(|(b, a)| b - a).collect();
        let mean = falls.iter().sum::<f64>() / count;
        let variance = falls.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let limit = StudentsT::new(0.0, 1.0, count - 1.0)
            .expect("at least three experiments")
            .inverse_cdf(1.0 - SELECTION_LEVEL / self.candidates.max(1) as f64);
        mean > limit * (variance / count).sqrt()
    }

    fn step(&self, added: Option<String>, misfit: &Misfit, parameters: usize) -> SelectionStep {
        let score = match self.criterion {
            Criterion::Information => self.information(misfit, parameters),
            Criterion::HeldOut => misfit.held_out.iter().sum::<f64>() / self.equations as f64,
        };
        let unexplained =
            if misfit.total_sum > 0.0 { (misfit.fitted / misfit.total_sum).sqrt() } else { 0.0 };
        SelectionStep { added, score, unexplained }
    }
}
