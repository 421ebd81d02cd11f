//! Checks of the tests of a bearing, before and after the fit.

use mechid_checks::{
    Finding, adjust_p_values, after_spectral_fit, before_spectral_fit, fluid_inertia, instability,
    mass_symmetry,
};
use mechid_estimate::frequency_domain::OutputErrorFit;
use mechid_estimate::{Estimate, Unknowns, identified_modes};
use mechid_model::{Parameter, SecondOrderSystem, UncertainSystem};
use mechid_signal::Extent;
use mechid_spectra::FrequencyData;
use nalgebra::DMatrix;

use super::BearingData;
use super::film::{Film, NAMED};
use crate::AnalysisError;
use crate::identify::checks::{CheckRow, When};
use crate::measurement::Channels;

/// A finding with its stage, and with a test if the finding concerns only this test.
type Placed<'a> = (When, Option<(&'a str, &'a Channels)>, Finding);

/// Returns all findings on the tests and on the baseline tests; the p-values are adjusted for the
/// number of statistical tests.
pub(super) fn rows(
    tests: &BearingData,
    baseline: Option<&BearingData>,
    film: &Film,
    stator_mass: f64,
) -> Result<Vec<CheckRow>, AnalysisError> {
    let mut findings = condition_findings(tests, &film.fit)?;
    if let Some((baseline, fit)) = baseline.zip(film.baseline_fit.as_ref()) {
        findings.extend(condition_findings(baseline, fit)?);
    }
    let mut after = |finding| findings.push((When::After, None, finding));
    instability_of_rig(film, stator_mass)?.into_iter().for_each(&mut after);
    if film.values().len() == NAMED.len() {
        mass_symmetry(&film.fit.estimate).into_iter().for_each(&mut after);
    } else {
        let test = film.inertia.map(|test| fluid_inertia(test.statistic, test.p_value));
        test.into_iter().for_each(&mut after);
    }
    adjust_p_values(findings.iter_mut().map(|(_, _, finding)| finding));
    let several = tests.records.len() + baseline.map_or(0, |b| b.records.len()) > 1;
    let unnamed = Channels::default();
    let row = |(when, test, finding): &Placed<'_>| {
        let name = test.filter(|_| several).map(|(name, _)| name.to_owned());
        CheckRow::new(*when, name, finding, test.map_or(&unnamed, |(_, channels)| channels))
    };
    Ok(findings.iter().map(row).collect())
}

/// Returns the findings on the tests of one condition of the rig (with the film, or the baseline
/// without it) and on their fit.
fn condition_findings<'a>(
    tests: &'a BearingData,
    fit: &OutputErrorFit,
) -> Result<Vec<Placed<'a>>, AnalysisError> {
    let test = |at: usize| {
        let record = &tests.records[at];
        Some((record.name.as_str(), &*record.channels))
    };
    let first = test(0);
    let before = before_spectral_fit(&tests.data, &Unknowns::unknown_mass(2)?)?;
    let mut findings: Vec<Placed<'a>> =
        before.into_iter().map(|finding| (When::Before, first, finding)).collect();
    for (at, record) in tests.records.iter().enumerate() {
        let before = record.before.iter();
        findings.extend(before.map(|finding| (When::Before, test(at), finding.clone())));
    }
    let residuals = after_spectral_fit(&data_of(tests), &fit.estimate, Extent::WholePeriod)?;
    for (at, residual) in residuals.records.iter().enumerate() {
        let after = residual.findings().into_iter();
        findings.extend(after.map(|finding| (When::After, test(at), finding)));
    }
    Ok(findings)
}

fn data_of(tests: &BearingData) -> Vec<FrequencyData> {
    tests.records.iter().map(|record| record.data.clone()).collect()
}

/// Returns the ratio of the residual power of all tests to the noise power if the residual of any
/// test significantly exceeds its noise. Returns 1 if none does, or if the noise is not known.
pub(super) fn excess(tests: &BearingData, fit: &OutputErrorFit) -> Result<f64, AnalysisError> {
    let residuals = after_spectral_fit(&data_of(tests), &fit.estimate, Extent::WholePeriod)?;
    let mut findings: Vec<Finding> =
        residuals.records.iter().flat_map(|residual| residual.findings()).collect();
    adjust_p_values(&mut findings);
    let exceeds = |finding: &Finding| match finding {
        Finding::Misfit(misfit) => misfit.p_value.is_significant() && misfit.ratio > 1.0,
        _ => false,
    };
    Ok(if findings.iter().any(exceeds) { fit.misfit_ratio.max(1.0) } else { 1.0 })
}

/// Returns a finding if a free response of the housing on the identified film would grow. A rig
/// with growing free responses could not have been tested, so the coefficients are doubtful.
fn instability_of_rig(film: &Film, stator_mass: f64) -> Result<Option<Finding>, AnalysisError> {
    let estimate: &Estimate = &film.fit.estimate;
    let matrix = |kind: usize| DMatrix::from_row_slice(2, 2, &film.rig.as_slice()[4 * kind..][..4]);
    let mass = matrix(2) + DMatrix::identity(2, 2) * stator_mass;
    let Ok(system) = SecondOrderSystem::new(mass, matrix(1), matrix(0)) else { return Ok(None) };
    let parameters: Vec<Parameter> = estimate.parameters().map(|p| p.parameter).collect();
    let rig = UncertainSystem::new(system, parameters, estimate.covariance() * film.excess)?;
    let modes = identified_modes(&rig, estimate.degrees_of_freedom())?;
    Ok(instability(&modes))
}
