//! Reruns of Appendices B and E, whose settings the text leaves open.

use mechid::estimate::Unknowns;
use mechid::estimate::time_domain::{Discretisation, Extent, TimeDomain};
use mechid::integrate::integrate_periodic;
use mechid::model::npi_sampling;
use mechid::signal::{Interpolation, Multisine, Phases, Record, lines, resample::refine};
use mechid_problems::steffen_rade;
use nalgebra::DMatrix;

use super::super::case::{Case, Machine};
use super::super::published::Method;
use super::super::simulate::{correct, scheme};
use super::super::slips::one_sample_early;
use super::evidence::Source;
use super::rerun::percent;

/// How intermediate points are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refinement {
    /// On the straight line.
    Linear {
        /// Points in every interval.
        points: usize,
    },
    /// On the not-a-knot cubic spline.
    Spline {
        /// Points in every interval.
        points: usize,
    },
}

/// Errors in K and C, in per cent, of Euler's estimator on a refined Newmark motion of 128 samples.
///
/// # Errors
/// The words of the step that fails.
pub fn refined_errors(refinement: Refinement, npi: f64) -> Result<Vec<f64>, String> {
    let case = Case { machine: Machine::SDOF, nt: 128, npi };
    let coarse = correct(case, Method::Newmark)?;
    let (points, method) = match refinement {
        Refinement::Linear { points } => (points, Interpolation::Linear),
        Refinement::Spline { points } => (points, Interpolation::NotAKnotSpline),
    };
    let fine = |record: &Record| refine(record, points + 1, method).map_err(|e| e.to_string());
    let system = case.machine.system();
    let unknowns = Unknowns::known_mass(system.mass()).map_err(|e| e.to_string())?;
    let fit = TimeDomain::new(Discretisation::Euler, Extent::Open)
        .fit(
            &fine(coarse.response.displacement())?,
            &fine(coarse.response.velocity())?,
            &fine(&coarse.force)?,
            &unknowns,
        )
        .map_err(|e| e.to_string())?;
    let estimate = fit.estimate();
    let listed = case.machine.listed(&estimate.stiffness(), &estimate.damping());
    Ok(percent(&listed, case.machine))
}

/// Errors of both damped frequencies and damping ratios, in per cent: two masses of Steffen &
/// Rade (1991), a force of 1 N on every line of the second one, 2048 samples, NPI 2 on the higher
/// damped frequency, Euler's estimator.
///
/// # Errors
/// The words of the step that fails.
pub fn modal_errors(source: Source, method: Method) -> Result<Vec<f64>, String> {
    let system = steffen_rade();
    let truth = system.modes().map_err(|e| e.to_string())?;
    let highest = truth.iter().map(|m| m.damped_frequency()).fold(0.0, f64::max);
    let sampling = npi_sampling(2.0, 2048, highest).map_err(|e| e.to_string())?;
    let signal = Multisine::flat(lines::full(sampling), 1.0, Phases::SchroederBinary)
        .and_then(|m| m.sample(sampling))
        .map_err(|e| e.to_string())?;
    let data = DMatrix::from_fn(2048, 2, |k, c| if c == 1 { signal.channel(0)[k] } else { 0.0 });
    let force = Record::new(sampling, data).map_err(|e| e.to_string())?;
    let response =
        integrate_periodic(scheme(method).as_ref(), &system, &force).map_err(|e| e.to_string())?;
    let leads = source == Source::Printed && method == Method::CentralDifference;
    let displacement = if leads {
        one_sample_early(response.displacement())
    } else {
        response.displacement().clone()
    };
    let unknowns = Unknowns::known_mass(system.mass()).map_err(|e| e.to_string())?;
    let found = TimeDomain::new(Discretisation::Euler, Extent::WholePeriod)
        .fit(&displacement, response.velocity(), &force, &unknowns)
        .map_err(|e| e.to_string())?
        .estimate()
        .system()
        .map_err(|e| e.to_string())?
        .modes()
        .map_err(|e| e.to_string())?;
    let error = |found: f64, truth: f64| 100.0 * ((found - truth) / truth).abs();
    let pairs = found.iter().zip(&truth).flat_map(|(f, t)| {
        [
            error(f.damped_frequency(), t.damped_frequency()),
            error(f.damping_ratio(), t.damping_ratio()),
        ]
    });
    Ok(pairs.collect())
}
