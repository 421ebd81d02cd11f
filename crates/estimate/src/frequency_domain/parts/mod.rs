//! Comparison of what the parts of the data say about the parameters, without fitting them one by one.

mod comparison;
mod linearised;
mod split;

use std::borrow::Cow;

use mechid_model::Parameter;
use mechid_spectra::frf::Frf;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::DVector;

use super::output_error_fit::{EndLoads, sampled_weight_inflation};
use super::unknown_noise::white_noise_at;
use crate::Estimate;
use crate::limits::{MAX_SENSITIVITIES, PARTS, SHARPENING_ROUNDS, SHARPENING_SETTLED};
use crate::relations::Relations;
use linearised::Linearised;

pub use comparison::{Difference, PartsComparison};
pub use split::{Part, Split};

/// A fit at its optimum, linearised, of which parts can be compared.
///
/// The residual e and its sensitivities Q, orthonormal, are weighted by the noise, and what the transients of open
/// records explain is removed from both. A part p, cut out by D_p with Σ D_p = I, moves the estimate by Qᵀ D_p e: these
/// scores have the sum zero and, if the parts differ by noise alone, the covariance of (I − QQᵀ) D_p Q.
pub struct PartsOfFit<'a> {
    data: &'a FrequencyData,
    parameters: Vec<Parameter>,
    /// Most likely values, in the order of the parameters.
    values: DVector<f64>,
    /// At those values.
    linear: Linearised,
    /// Averaged responses, whose errors the window ties together from line to line, if the data are such.
    responses: Option<&'a [(Frf, Vec<usize>)]>,
    /// Variance of a score over that of the noise stated, by weights that are sampled.
    inflation: f64,
    /// Degrees of freedom of the level of the noise; `None` where only the residual shows it.
    known: Option<f64>,
}

impl<'a> PartsOfFit<'a> {
    /// Linearises a fit of `data`, with the loads of the `ends` of its open records, at the most likely parameters near
    /// the `estimate`. The noise is that which the data state; otherwise it has the form of `spectrum`, or is white, and
    /// the residual shows its level. `None` for large fits, for data without any noise, and where the sensitivities are
    /// dependent.
    pub fn new(
        data: &'a FrequencyData,
        estimate: &Estimate,
        ends: Option<&EndLoads>,
        spectrum: Option<&'a NoiseSpectrum>,
    ) -> Option<Self> {
        let unknowns = estimate.unknowns();
        if 2 * data.dof() * data.len() * unknowns.independent() * PARTS > MAX_SENSITIVITIES {
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
            data,
        })
    }
    /// The same of a fit of averaged responses, each with the degrees of freedom of its forces, counted from 0; `data`
    /// are those of all of them. `None` as for [`PartsOfFit::new`], and where the errors of the lines are not known.
    pub fn of_responses(
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
