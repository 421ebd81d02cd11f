//! Standard errors where model and data disagree by more than noise.

use mechid_checks::Finding;
use mechid_estimate::Estimate;
use mechid_nonlinear::NonlinearEstimate;
use nalgebra::{DMatrix, DVector};

use super::checks::CheckRow;
use crate::{AnalysisError, text};

/// Ratio of the standard errors that the disagreement of model and data requires to those that
/// follow from the noise; above 1.
#[derive(Debug)]
struct ErrorScale {
    /// The ratio.
    factor: f64,
    degrees_of_freedom: usize,
    /// Subjects of the checks that warn.
    subjects: String,
}

impl ErrorScale {
    /// Returns the largest error scale of the checks that warn; `None` if no scale exceeds 1. A
    /// check gives a scale if it compares the parts of the data or if it tests the size of the
    /// residual, which has `spare` degrees of freedom.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227; Particle Data Group, *Review of Particle
    /// Physics*, introduction.
    fn from_checks(checks: &[CheckRow], spare: usize) -> Option<Self> {
        let scale = |check: &CheckRow| match &check.finding {
            Finding::PartsAgreement(parts) => Some((parts.scatter, parts.degrees_of_freedom)),
            Finding::Misfit(misfit) => Some((misfit.ratio.sqrt(), spare)),
            _ => None,
        };
        let scales = checks.iter().filter(|check| check.is_conspicuous());
        let scales = scales.filter_map(|check| Some((check.subject.to_string(), scale(check)?)));
        let (mut subjects, scales): (Vec<_>, Vec<_>) = scales.unzip();
        subjects.dedup();
        let (factor, degrees_of_freedom) = scales
            .into_iter()
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(scale, _)| *scale > 1.0)?;
        Some(Self { factor, degrees_of_freedom, subjects: subjects.join(", ") })
    }

    /// Returns an estimate with scaled standard errors.
    fn apply(&self, estimate: Estimate) -> Estimate {
        estimate.with_error_scale(self.factor, self.degrees_of_freedom)
    }

    /// Returns the remark on scaled standard errors.
    fn remark(&self) -> String {
        text::scaled_errors(self.factor, &self.subjects)
    }
}

/// Additions to the standard errors of a fit because model and data disagree by more than noise.
#[derive(Debug, Default)]
pub(super) struct Disagreement {
    /// Mean square error that omitted terms add to the covariance of the parameters, in the product
    /// of the units of two parameters (parameters × parameters).
    omitted: Option<DMatrix<f64>>,
    /// Vector of the parameter changes times its transpose (parameters × parameters), in the
    /// product of the units of two parameters. The changes are due to another model that explains
    /// the residual (a delay, a fault of the acquisition, another quantity).
    explained: Option<DMatrix<f64>>,
    /// Scale of the standard errors; `None` if they follow from the noise alone.
    scale: Option<ErrorScale>,
}

impl Disagreement {
    /// Creates the additions to the standard errors; the checks decide later which of these
    /// additions apply.
    pub(super) fn new(omitted: Option<DMatrix<f64>>, explained: Option<DMatrix<f64>>) -> Self {
        Self { omitted, explained, scale: None }
    }

    /// Returns only those additions to the covariance for which a check warns, together with the
    /// scale that the checks determine. The residual has `spare` degrees of freedom.
    pub(super) fn with_warnings_only(self, checks: &[CheckRow], spare: usize) -> Self {
        let warns = |is_of: fn(&CheckRow) -> bool| {
            checks.iter().any(|check| check.is_conspicuous() && is_of(check))
        };
        let is_left_out = |check: &CheckRow| {
            matches!(check.finding, Finding::TermLeftOut(_) | Finding::NonlinearTermsLeftOut(_))
        };
        Self {
            omitted: self.omitted.filter(|_| warns(is_left_out)),
            explained: self.explained.filter(|_| warns(CheckRow::is_explanation)),
            scale: ErrorScale::from_checks(checks, spare),
        }
    }

    /// Removes the scale, because standard errors that follow from the residual need no scale.
    pub(super) fn without_scale(self) -> Self {
        Self { scale: None, ..self }
    }

    /// Returns the estimate with all additions in its covariance: the scale, the omitted term, and
    /// the other explanation of the residual.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] for another number of parameters.
    pub(super) fn included_in(&self, estimate: Estimate) -> Result<Estimate, AnalysisError> {
        let scaled = match &self.scale {
            Some(scale) => scale.apply(estimate),
            None => estimate,
        };
        let squares = self.omitted.iter().chain(&self.explained);
        squares.into_iter().try_fold(scaled, |sum, square| Ok(sum.with_mean_square(square)?))
    }

    /// Returns an estimate with nonlinear terms whose covariance includes the omitted terms; its
    /// standard errors follow from the residual and are not scaled.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] for another number of parameters.
    pub(super) fn with_omitted(
        &self,
        estimate: NonlinearEstimate,
    ) -> Result<NonlinearEstimate, AnalysisError> {
        Ok(match &self.omitted {
            Some(square) => estimate.with_mean_square(square)?,
            None => estimate,
        })
    }

    /// Returns the ratio of the standard errors to those that follow from the noise.
    pub(super) fn error_scale(&self) -> f64 {
        self.scale.as_ref().map_or(1.0, |scale| scale.factor)
    }

    /// Returns remarks that state what was added to the standard errors, and why.
    pub(super) fn remarks(&self, checks: &[CheckRow]) -> Vec<String> {
        let term = self.omitted.as_ref().map(|_| {
            "standard errors and intervals include the effect of the term that the model omits (check: alternative)"
                .to_owned()
        });
        let explanation = checks.iter().find(|check| check.is_explanation());
        let explanation = explanation.filter(|_| self.explained.is_some()).map(|check| {
            format!(
                "standard errors and intervals include the difference between these parameters and those of the \
                 model that explains the residual (check: {})",
                check.subject
            )
        });
        let scale = self.scale.as_ref().map(ErrorScale::remark);
        scale.into_iter().chain(term).chain(explanation).collect()
    }
}

/// Returns the vector of the parameter changes from one estimate to another times its transpose
/// (parameters × parameters), in the product of the units of two parameters.
pub(super) fn outer_product_of_change(from: &Estimate, to: &Estimate) -> DMatrix<f64> {
    let pairs = from.parameters().zip(to.parameters());
    let change: Vec<f64> = pairs.map(|(from, to)| to.value - from.value).collect();
    let change = DVector::from_vec(change);
    &change * change.transpose()
}
