//! Stability and accuracy of a scheme, derived from the stepping code itself.
//!
//! All results start from [`Transition::from_stepper`], which feeds unit states to the stepper of
//! the simulation itself. There is no second set of formulas that could be right while the code is
//! wrong.

pub(crate) mod accuracy;
mod fastest;
pub(crate) mod free_growth;
mod growth;
pub(crate) mod passive;
pub(crate) mod stable_steps;
pub(crate) mod step_limit;

use crate::error::IntegrateError;
use crate::limits;
use crate::schemes::scheme::Scheme;
use crate::stability::fastest::Fastest;
use crate::stability::growth::{Amplification, radius};
use crate::stability::step_limit::Examined;
use crate::stepping::transition::Transition;
use crate::system::System;
use mechid_numerics::krylov::arnoldi::dominant;

/// Returns the spectral radius of the amplification matrix of `scheme` on `system` at a step of
/// `dt` seconds.
///
/// All eigenvalues are computed, which takes the time of a few hundred solves of 3n equations. For
/// more than 200 degrees of freedom, the result is an estimate of the largest modulus after about a
/// hundred Arnoldi steps.
///
/// # Errors
/// The errors of [`Scheme::prepare_unchecked`].
///
/// # Source
/// Bathe & Wilson (1973); Hughes (1987), section 9.1.
pub fn spectral_radius(
    scheme: &dyn Scheme,
    system: &dyn System,
    dt: f64,
) -> Result<f64, IntegrateError> {
    let mut stepper = scheme.prepare_unchecked(system, dt)?;
    if system.dof() <= limits::DENSE_EIGENVALUE_DOF {
        return Ok(radius(&Transition::from_stepper(stepper.as_mut())));
    }
    let fastest = Fastest::new(system).rate()?;
    let mut amplification = Amplification::new(stepper.as_mut(), fastest);
    let mut start = amplification.start();
    let mut radius = f64::INFINITY;
    for _ in 0..3 {
        let Some(largest) =
            dominant(start, limits::ARNOLDI_STEPS, |z, next| amplification.apply(z, next))
        else {
            break;
        };
        radius = largest.value.norm();
        start = largest.vector.map(|v| v.re);
    }
    Ok(radius)
}

/// Returns the largest step at which `scheme` does not make the motion of `system` grow, in
/// seconds; `None` if there is no limit.
///
/// The search covers steps from a thousandth of the shortest time scale 1/|λ| of the system up to a
/// million times this time scale, in factors of √2. The first step at which the motion grows is
/// then refined to rounding by bisection. For an unstable system, twice the growth of the system
/// itself is allowed.
///
/// For sparse matrices, and for more than 20 degrees of freedom, the limit is that of a single
/// degree of freedom that moves along the fastest mode. Finding this mode takes a hundred products
/// with the matrices. If the system can only lose energy, factorisations then enclose its highest
/// frequency to one part in 10⁴. For other systems the highest frequency is known to about one part
/// in a thousand.
///
/// # Errors
/// The errors of [`Scheme::prepare_unchecked`], and [`IntegrateError::Unstable`] if not even the
/// smallest step is stable.
///
/// # Source
/// Hughes (1987), section 9.1.
pub fn critical_step(
    scheme: &dyn Scheme,
    system: &dyn System,
) -> Result<Option<f64>, IntegrateError> {
    limit_of(scheme, &Fastest::new(system))
}

/// Returns the step of [`critical_step`], in s, for each of several schemes, in the order of
/// `schemes`; the properties of the system are computed once.
///
/// # Errors
/// The errors of [`critical_step`].
///
/// # Source
/// The source of [`critical_step`].
pub fn critical_steps(
    schemes: &[&dyn Scheme],
    system: &dyn System,
) -> Result<Vec<Option<f64>>, IntegrateError> {
    let fastest = Fastest::new(system);
    schemes.iter().map(|scheme| limit_of(*scheme, &fastest)).collect()
}

fn limit_of(scheme: &dyn Scheme, fastest: &Fastest<'_>) -> Result<Option<f64>, IntegrateError> {
    let examined = Examined {
        name: &|| scheme.name(),
        prepare: &|system, dt| scheme.prepare_unchecked(system, dt),
        stable_steps: scheme.stable_steps(),
    };
    examined.limit(fastest)
}
