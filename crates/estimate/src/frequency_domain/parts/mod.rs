//! Comparison of the parameters from parts of the data, without a fit to each part.

mod comparison;
mod linearised;
mod omitted;
mod split;
mod terms;

use std::borrow::Cow;

use mechid_model::Parameter;
use mechid_spectra::frf::Frf;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::DVector;

use super::output_error_fit::{EndLoads, sampled_weight_inflation};
use super::unknown_noise::white_noise_at;
use crate::limits::{MAX_PARTS, PARTS, SHARPENING_ROUNDS, SHARPENING_SETTLED};
use crate::relations::Relations;
use crate::{Estimate, Unknowns};
use linearised::Linearised;

pub use comparison::{Difference, PartsComparison};
pub(crate) use comparison::{Level, Scores};
pub use omitted::OmittedTerms;
pub(crate) use split::equal_bands;
pub use split::{Part, Split};
pub use terms::{OmittedTerm, Power, SampledRows};

/// A fit, linearised at its minimum, for a comparison of parts of its data.
///
/// The residual e and its orthonormal sensitivities Q are weighted by the noise, without the
/// components that the transients of open records explain. D_p selects part p, with Σ D_p = I; the
/// part contributes the score Qᵀ D_p e to the estimate. The sum of the scores is zero. If the parts
/// differ by noise alone, the covariance of the scores follows from the columns (I − QQᵀ) D_p Q.
pub struct PartsOfFit<'a> {
    data: &'a FrequencyData,
    /// Data without the transient loads of open records.
    closed: Cow<'a, FrequencyData>,
    noise: Cow<'a, NoiseSpectrum>,
    unknowns: Unknowns,
    parameters: Vec<Parameter>,
    /// Most likely values, in the order of the parameters.
    values: DVector<f64>,
    /// Linearisation at the most likely values.
    linear: Linearised,
    /// Averaged responses, whose neighbouring lines have correlated errors; `None` if the data come
    /// from another source.
    responses: Option<&'a [(Frf, Vec<usize>)]>,
    /// Ratio of the variance of a score with sampled weights to its variance with exact weights.
    inflation: f64,
    /// Degrees of freedom of the noise level; `None` if it is estimated from the residual.
    known: Option<f64>,
}

impl<'a> PartsOfFit<'a> {
    /// Linearises a fit of `data`, with the transient loads `ends` of its open records, at the most
    /// likely parameters near the `estimate`. If the data state a noise, it is used. Otherwise the
    /// noise has the shape of `spectrum`, or is white, and its level comes from the residual.
    /// `None` for large fits, for data without noise, and for linearly dependent sensitivities.
    pub fn new(
        data: &'a FrequencyData,
        estimate: &Estimate,
        ends: Option<&EndLoads>,
        spectrum: Option<&'a NoiseSpectrum>,
    ) -> Option<Self> {
        let unknowns = estimate.unknowns();
        if 2 * data.dof() * data.len() * unknowns.independent() * PARTS > MAX_PARTS {
            return None;
        }
        let relations = Relations::from_unknowns(unknowns);
        let entries: Vec<f64> = estimate.parameters().map(|p| p.value).collect();
        let mut values = match &relations {
            None => DVector::from_vec(entries),
            Some(relations) => relations.unknowns(&entries),
        };
        let noise = match data.noise().or(spectrum) {
            Some(noise) => Cow::Borrowed(noise),
            None => Cow::Owned(white_noise_at(data, unknowns, &values).ok()?),
        };
        let closed = match ends {
            Some(ends) => Cow::Owned(data.without_transient(ends.loads())),
            None => Cow::Borrowed(data),
        };
        let entries_of = |values: &DVector<f64>| match &relations {
            None => values.clone(),
            Some(relations) => relations.entries(values.as_slice()),
        };
        let at = |values: &DVector<f64>| {
            Linearised::new([data, &closed], unknowns, &entries_of(values), &noise)
        };
        let mut linear = at(&values)?;
        for _ in 0..SHARPENING_ROUNDS {
            if linear.step_in_errors() <= SHARPENING_SETTLED {
                break;
            }
            let next_values = &values + linear.step();
            let Some(next) = at(&next_values).filter(|next| next.cost() < linear.cost()) else {
                break;
            };
            (values, linear) = (next_values, next);
        }
        linear.finish_step();
        if let Some(relations) = &relations {
            linear.relate(&relations.tangent(values.as_slice()));
        }
        let nu = noise.degrees_of_freedom();
        Some(Self {
            parameters: estimate.parameters().map(|p| p.parameter).collect(),
            values: entries_of(&values),
            linear,
            responses: None,
            inflation: sampled_weight_inflation(nu, data.dof()).ok()?,
            known: data.noise().map(|noise| noise.total_degrees_of_freedom() as f64),
            unknowns: unknowns.clone(),
            closed,
            noise,
            data,
        })
    }

    /// Returns the same fit with errors that are correlated from line to line; this correlation
    /// multiplies the variance of the parameters by `ratio`, a pure number.
    #[must_use]
    pub fn with_variance_ratio(self, ratio: f64) -> Self {
        Self { inflation: self.inflation * ratio, ..self }
    }

    /// Linearises a fit of averaged responses, each with the degrees of freedom of its forces,
    /// counted from 0; `data` has the lines of all these responses. `None` as for
    /// [`PartsOfFit::new`], and if the error covariance of a response is unknown.
    pub fn from_responses(
        data: &'a FrequencyData,
        records: &'a [(Frf, Vec<usize>)],
        estimate: &Estimate,
    ) -> Option<Self> {
        let fit = Self::new(data, estimate, None, None)?;
        let known = Some(estimate.degrees_of_freedom() as f64);
        let is_known = records.iter().all(|(frf, _)| frf.has_error_covariance());
        is_known.then_some(Self { responses: Some(records), inflation: 1.0, known, ..fit })
    }
}
