//! Checks of a record before a fit in the time domain.

use std::f64::consts::TAU;

use mechid_estimate::time_domain::{TimeDomain, Transitions};
use mechid_estimate::{EquationOfMotion, Estimate, EstimateError, Unknowns};
use mechid_model::{Discretisation, Response, SecondOrderSystem};
use mechid_numerics::{NumericsError, RealSchur};
use mechid_signal::measures::persistent_excitation_order;
use mechid_signal::{Record, Spectrum};

use super::finding::{Finding, ModeLimit};
use super::thresholds::EXCITED_LINE;

/// Checks excitation, conditioning and step before a time-domain fit of displacement (m), velocity
/// (m/s) and force (N) of one record or several that are fitted together, since one shaker at a time
/// excites one degree of freedom each.
///
/// # Errors
/// [`EstimateError::NoDof`] without a record; as [`Transitions::push`], and
/// [`NumericsError::TooFewRows`].
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
    let mut findings = excitation(records.iter().map(|record| record[2]), 2 * dof + 1 + next);
    let (condition_number, undetermined) = rows.condition(method.discretisation())?;
    findings.push(Finding::Conditioning { condition_number, undetermined });
    findings.push(step(&rows, method.discretisation())?);
    Ok(findings)
}

/// Checks excitation, conditioning and step before the equation of motion is fitted sample by sample to
/// responses (x, ẋ, ẍ) and forces (N) of one record or several that are fitted together.
///
/// # Errors
/// Those of [`EquationOfMotion::push_rows`] and [`EquationOfMotion::solve`].
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
    let mut findings = excitation(forces, unknowns_of_an_equation(unknowns));
    findings.push(conditioning(&estimate));
    if let (Ok(system), Some((_, force))) = (estimate.system(), records.first()) {
        let [frequency_hz, samples_per_period] = highest_mode(&system, force.sampling().dt())?;
        let limit = ModeLimit::AtSamples;
        findings.push(Finding::HighestMode { frequency_hz, samples_per_period, limit });
    }
    Ok(findings)
}

/// Conditioning of the regressors that an estimate was found from.
pub(super) fn conditioning(estimate: &Estimate) -> Finding {
    let (condition_number, undetermined) = (estimate.condition(), estimate.undetermined().len());
    Finding::Conditioning { condition_number, undetermined }
}

/// Number of unknowns in the equation of motion that has most.
pub(super) fn unknowns_of_an_equation(unknowns: &Unknowns) -> usize {
    let free = unknowns.free();
    let of = |equation| free.iter().filter(|p| p.row() == equation).count();
    (0..unknowns.dof()).map(of).max().unwrap_or(0)
}

/// Natural frequency (Hz) of the highest mode that oscillates, and samples per period of it; where none does, the
/// geometric mean of all: a fast decay needs no samples of its own.
pub(super) fn highest_mode(system: &SecondOrderSystem, dt: f64) -> Result<[f64; 2], EstimateError> {
    let modes = system.modes()?;
    let oscillating = modes.iter().filter(|mode| mode.oscillates());
    let highest = match oscillating.map(|mode| mode.natural_frequency()).reduce(f64::max) {
        Some(highest) => highest,
        None => {
            let logarithms = modes.iter().map(|mode| mode.natural_frequency().ln());
            (logarithms.sum::<f64>() / modes.len().max(1) as f64).exp()
        }
    };
    Ok([highest / TAU, TAU / (highest * dt)])
}

/// Order of persistent excitation of each force in the record that excites it most, against the number of
/// states and inputs, or of unknowns.
fn excitation<'a>(records: impl Iterator<Item = &'a Record>, needed: usize) -> Vec<Finding> {
    let mut orders: Vec<usize> = Vec::new();
    for force in records {
        let spectrum = Spectrum::of(force);
        orders.resize(orders.len().max(force.channels()), 0);
        for (channel, order) in orders.iter_mut().enumerate() {
            let excited = persistent_excitation_order(&spectrum, channel, EXCITED_LINE);
            *order = (*order).max(excited.unwrap_or(0));
        }
    }
    let finding = |(force, order)| Finding::PersistentExcitation { force, order, needed };
    orders.into_iter().enumerate().map(finding).collect()
}

/// Checks whether a record of any response quantity is one whole period of a steady state: the
/// curvature across the seam, where the last sample is followed by the first, against the RMS
/// curvature inside ([`Finding::Seam`]). In a whole period the seam is like any other place.
///
/// # Source
/// Ours.
pub fn periodicity(response: &Record) -> Finding {
    periodicity_across(response, response)
}

/// Checks the seam as [`periodicity`] does, of a period too long to be held in memory: the RMS
/// curvature is that of its `beginning`; `end` is its last two samples, or more (samples × channels,
/// the same quantity and channels).
///
/// # Panics
/// If `end` has fewer channels.
///
/// # Source
/// Ours.
pub fn periodicity_across(beginning: &Record, end: &Record) -> Finding {
    let ratio = |channel: usize| {
        let (x, end) = (beginning.channel(channel), end.channel(channel));
        let [last_but_one, last] = [2, 1].map(|back| end[(2 * end.len() - back) % end.len()]);
        let curvature = |x: [f64; 3]| x[0] - 2.0 * x[1] + x[2];
        let inside: f64 = x.windows(3).map(|x| curvature([x[0], x[1], x[2]]).powi(2)).sum();
        let rms = (inside / x.len().saturating_sub(2).max(1) as f64).sqrt();
        let after = curvature([last, x[0], x[1 % x.len()]]);
        let seam = after.abs().max(curvature([last_but_one, last, x[0]]).abs());
        if seam == 0.0 { 0.0 } else { seam / rms }
    };
    Finding::Seam { ratio: (0..beginning.channels()).map(ratio).fold(0.0, f64::max) }
}

/// Highest mode that the data suggest (force held between samples), against the step.
fn step(rows: &Transitions, discretisation: Discretisation) -> Result<Finding, EstimateError> {
    let exact = match rows.state_matrix(Discretisation::ZeroOrderHold) {
        Ok(matrix) => matrix,
        Err(EstimateError::Numerics(NumericsError::NoLogarithm { eigenvalue })) => {
            return Ok(Finding::NoLogarithm { eigenvalue });
        }
        Err(other) => return Err(other),
    };
    let eigenvalues = RealSchur::new(exact.clone())?.eigenvalues();
    let highest = eigenvalues.iter().map(|l| l.norm()).fold(0.0, f64::max);
    let limit = if discretisation == Discretisation::Euler {
        let n = rows.dof();
        let euler = rows.state_matrix(Discretisation::Euler)?;
        let bias = (euler.rows(n, n) - exact.rows(n, n)).norm() / exact.rows(n, n).norm();
        ModeLimit::Euler { bias }
    } else {
        ModeLimit::BetweenSamples
    };
    let (frequency_hz, samples_per_period) = (highest / TAU, TAU / (highest * rows.dt()));
    Ok(Finding::HighestMode { frequency_hz, samples_per_period, limit })
}
