//! Reruns of Appendices B and E, whose settings the text leaves open.

use mechid::model::Discretisation;
use mechid::signal::Interpolation;
use nalgebra::Complex;

use super::super::case::{Case, Machine};
use super::super::published::Method;
use super::super::simulate::{correct, scheme};
use super::super::slips::one_sample_early;
use super::super::{interpolated, modal_tables};
use super::evidence::Source;
use super::rerun::percent;

/// Errors in K and C, in per cent, of Euler's estimator on a Newmark motion of 128 samples, with
/// `points` interpolated points in every interval.
///
/// # Errors
/// The message of the step that fails.
pub fn refined_errors(
    points: usize,
    interpolation: Interpolation,
    npi: f64,
) -> Result<Vec<f64>, String> {
    let case = Case { machine: Machine::SDOF, nt: 128, npi };
    let coarse = correct(case, Method::Newmark)?;
    let estimates =
        interpolated::refined(&coarse, points + 1, interpolation, Discretisation::Euler)?;
    Ok(percent(&estimates, case.machine))
}

/// Errors, in per cent, of the damped frequency, the damping ratio and the shape ratio of both
/// modes.
///
/// # Errors
/// The message of the step that fails.
pub fn modal_errors(
    source: Source,
    method: Method,
    npi: f64,
    discretisation: Discretisation,
) -> Result<Vec<f64>, String> {
    let (force, motion) = modal_tables::simulate(scheme(method).as_ref(), npi)?;
    let leads = source == Source::Printed && method == Method::CentralDifference;
    let displacement =
        if leads { one_sample_early(motion.displacement()) } else { motion.displacement().clone() };
    let estimates =
        modal_tables::identified(&force, &displacement, motion.velocity(), discretisation)?;
    let error = |f: Complex<f64>, t: Complex<f64>| 100.0 * (f - t).norm() / t.norm();
    let pairs = estimates.into_iter().flatten().zip(modal_tables::theory()?.into_iter().flatten());
    Ok(pairs.map(|(f, t)| error(f, t)).collect())
}
