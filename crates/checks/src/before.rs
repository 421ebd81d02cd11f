//! Checks of a record before a fit in the time domain.

use mechid_estimate::time_domain::{TimeDomain, Transitions};
use mechid_estimate::{EquationOfMotion, EstimateError, Unknowns};
use mechid_model::{Discretisation, Response};
use mechid_signal::Record;

use super::conditioning::{Conditioning, conditioning};
use super::excited_lines::unknowns_of_an_equation;
use super::finding::Finding;
use super::highest_mode::{HighestMode, ModeLimit, highest_mode};
use super::{highest_mode, persistent_excitation};

/// Checks excitation, conditioning and sampling interval before a time-domain fit of displacement
/// (m), velocity (m/s) and force (N) of one record, or of several records that are fitted together,
/// for example with one shaker at a time.
///
/// # Errors
/// [`EstimateError::NoDof`] without a record; as [`Transitions::push`], and
/// [`NumericsError::TooFewRows`](mechid_numerics::NumericsError::TooFewRows).
///
/// # Source
/// Ljung, *System Identification: Theory for the User*, 2nd ed. (1999), chapter 13 (persistence of
/// excitation); Belsley, Kuh & Welsch, *Regression Diagnostics* (1980), chapter 3 (conditioning);
/// the limits are ours.
pub fn before_fit(
    method: TimeDomain,
    records: &[[&Record; 3]],
) -> Result<Vec<Finding>, EstimateError> {
    let [first, ..] = records else { return Err(EstimateError::NoDof) };
    let dof = first[0].channels();
    let mut rows = Transitions::new(dof, first[0].sampling().dt())?;
    for [displacement, velocity, force] in records {
        rows.push(displacement, velocity, force, method.extent())?;
    }
    let next = usize::from(method.discretisation() == Discretisation::FirstOrderHold);
    let mut findings = persistent_excitation::excitation(
        records.iter().map(|record| record[2]),
        2 * dof + 1 + next,
    );
    let (condition_number, undetermined) = rows.condition(method.discretisation())?;
    findings.push(Finding::Conditioning(Conditioning { condition_number, undetermined }));
    findings.push(highest_mode::step(&rows, method.discretisation())?);
    Ok(findings)
}

/// Checks excitation, conditioning and sampling interval before the equation of motion is fitted
/// sample by sample to responses (x, ẋ, ẍ) and forces (N) of one record, or of several records that
/// are fitted together.
///
/// # Errors
/// As [`EquationOfMotion::push_rows`] and [`EquationOfMotion::solve`].
///
/// # Source
/// As [`before_fit`].
pub fn before_equation_of_motion(
    records: &[(&Response, &Record)],
    unknowns: &Unknowns,
) -> Result<Vec<Finding>, EstimateError> {
    let mut rows = EquationOfMotion::new(unknowns.dof());
    for (response, force) in records {
        let [x, v, a] = [response.displacement(), response.velocity(), response.acceleration()];
        let [x, v, a, force] = [x, v, a, *force].map(|record| record.data().as_view());
        rows.push_rows(a, v, x, force)?;
    }
    let estimate = rows.solve(unknowns)?;
    let forces = records.iter().map(|(_, force)| *force);
    let mut findings = persistent_excitation::excitation(forces, unknowns_of_an_equation(unknowns));
    findings.push(conditioning(&estimate));
    if let (Ok(system), Some((_, force))) = (estimate.system(), records.first()) {
        let [frequency_hz, samples_per_period] = highest_mode(&system, force.sampling().dt())?;
        let limit = ModeLimit::AtSamples;
        findings.push(Finding::HighestMode(HighestMode {
            frequency_hz,
            samples_per_period,
            limit,
        }));
    }
    Ok(findings)
}
