//! Checks of a system of named elements after its fit.

use std::ops::Range;

use mechid_estimate::likelihood::machine::MachineEstimate;
use mechid_spectra::LineData;
use nalgebra::Complex;

use super::finding::Finding;
use super::limits::FREE_RESIDUALS;
use super::line_correlation::correlation_of_lines;
use super::misfit::{Misfit, NoiseSource};
use super::p_value::{CorrelationTest, PValue};
use super::parts::{RowParts, agreement};
use super::prior::PriorAgreement;
use super::search::SearchAgreement;
use super::whiteness::{Residual, Whiteness};

/// Tests the power of the residual against the noise if `source` states the origin of the noise
/// power ([`Finding::Misfit`]), parts of the data against each other ([`Finding::PartsAgreement`]),
/// priors against the data ([`Finding::PriorAgreement`]), and the agreement of several searches
/// ([`Finding::SearchAgreement`]).
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on model
/// validation.
pub fn after_machine_fit(estimate: &MachineEstimate, source: Option<NoiseSource>) -> Vec<Finding> {
    let likelihood = &estimate.likelihood;
    let mut findings = Vec::new();
    let misfit = likelihood.misfit_ratio.zip(likelihood.misfit_p_value).zip(source);
    findings.extend(misfit.map(|((ratio, p_value), source)| {
        Finding::Misfit(Misfit {
            ratio,
            p_value: PValue::new(p_value),
            source,
            concentration: None,
        })
    }));
    let compared = estimate.parts.iter().map(|parts| (parts.clone(), RowParts::Records));
    findings.extend(agreement(compared.collect()));
    for parameter in &likelihood.parameters {
        let tested = parameter.prior.and_then(|prior| Some((prior, prior.p_value?)));
        findings.extend(tested.map(|(prior, p_value)| {
            Finding::PriorAgreement(PriorAgreement {
                parameter: parameter.name.clone(),
                mean: prior.mean,
                standard_deviation: prior.standard_deviation,
                estimate: parameter.value,
                p_value: PValue::new(p_value),
            })
        }));
    }
    let (searches, agreeing) = (likelihood.searches, likelihood.agreeing());
    findings.push(Finding::SearchAgreement(SearchAgreement { searches, agreeing }));
    findings
}

/// Tests the residual of each output of one record of the data (its `rows`) for correlation from
/// line to line ([`Finding::Whiteness`]); empty if there are too few lines.
///
/// # Source
/// As [`after_machine_fit`].
pub fn whiteness_of_lines(
    estimate: &MachineEstimate,
    data: &LineData,
    rows: &Range<usize>,
) -> Vec<Finding> {
    let free = estimate.residual.len() as f64 - estimate.explained.ncols() as f64;
    if free < FREE_RESIDUALS {
        return Vec::new();
    }
    let outputs = data.outputs().ncols();
    let mut ascending: Vec<usize> = rows.clone().collect();
    ascending.sort_by(|a, b| data.omega()[*a].total_cmp(&data.omega()[*b]));
    let tested = (0..outputs).filter_map(|residual| {
        let complex = |values: &[f64]| -> Vec<Complex<f64>> {
            let at = |line: &usize| 2 * (outputs * line + residual);
            ascending
                .iter()
                .map(|line| Complex::new(values[at(line)], values[at(line) + 1]))
                .collect()
        };
        let explained: Vec<Vec<Complex<f64>>> =
            estimate.explained.column_iter().map(|q| complex(q.as_slice())).collect();
        let correlation =
            correlation_of_lines(&complex(estimate.residual.as_slice()), &explained, 1)?;
        Some(Finding::Whiteness(Whiteness {
            residual: Residual::Lines { residual },
            test: CorrelationTest::new(&correlation, false),
            span: None,
        }))
    });
    tested.collect()
}
