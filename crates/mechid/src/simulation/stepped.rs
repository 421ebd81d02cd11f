//! Responses by time steps, and the stability of periodic ones.

use mechid_integrate::{
    AllowUnstable, PeriodicOrbit, SampledForce, Scheme, SelectedDofs, integrate,
    integrate_periodic, integrate_periodic_selected, integrate_selected, periodic_orbit,
    periodic_orbit_selected,
};
use mechid_io::{Experiment, IoError, ResponseKind};
use mechid_model::{InitialState, Response};
use mechid_signal::Record;
use nalgebra::Complex;

use super::error::SETTLING;
use super::machine::Described;
use super::schemes::has_given_start;
use super::{SimulateError, SimulatedSystem};

/// Ratio of a disturbance of a periodic response after one period to the disturbance before it: a
/// complex number without unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Multiplier {
    /// The factor.
    pub value: Complex<f64>,
    /// Error of the factor without the error due to the time step of the scheme (pure number).
    pub error: f64,
    /// Error of the factor due to the time step of the scheme (pure number); `None` if it is not
    /// known.
    pub scheme_error: Option<f64>,
}

/// Maximum excess over 1 of the modulus of a Floquet multiplier that counts as rounding (pure
/// number). Rounding changes a double multiplier, such as that of an undamped machine, by about the
/// square root of the accuracy of a single multiplier.
const MULTIPLIER_ROUNDING: f64 = 1e-4;

/// Response, and for a periodic response of a nonlinear machine its largest multiplier.
pub(super) struct Stepped {
    pub(super) response: Response,
    pub(super) multiplier: Option<Multiplier>,
}

impl From<Response> for Stepped {
    fn from(response: Response) -> Self {
        Self { response, multiplier: None }
    }
}

/// Computes the response step by step, over one force record or over the period of a periodic
/// response.
pub(super) fn stepped(
    experiment: &Experiment,
    scheme: &dyn Scheme,
    machine: &Described,
    force: &Record,
    middle: Option<&Record>,
) -> Result<Stepped, SimulateError> {
    let unguarded = AllowUnstable(scheme);
    let scheme = if experiment.allow_unstable { &unguarded } else { scheme };
    let force = with_middle(force, middle);
    let system = machine.with_forces()?;
    // For a sparse machine, the force has columns for some of the degrees of freedom only.
    let sparse = matches!(machine.linear, SimulatedSystem::Sparse(_));
    let some = sparse.then(|| Ok::<_, IoError>((experiment.forced()?, experiment.outputs()?)));
    let some = some.transpose()?;
    let dofs = some.as_ref().map(|(forced, observed)| SelectedDofs { forced, observed });
    match experiment.response {
        ResponseKind::Periodic if has_given_start(experiment) => {
            Err(SimulateError::GivenStartPeriodic)
        }
        ResponseKind::Periodic if machine.nonlinear.is_none() => Ok(match dofs {
            None => integrate_periodic(scheme, &system, force)?.into(),
            Some(dofs) => integrate_periodic_selected(scheme, &system, dofs, force)?.into(),
        }),
        ResponseKind::Periodic => {
            let at_rest = InitialState::rest(machine.linear.dof());
            let orbit = match dofs {
                None => periodic_orbit(scheme, &system, force, &at_rest, SETTLING),
                Some(dofs) => {
                    periodic_orbit_selected(scheme, &system, dofs, force, &at_rest, SETTLING)
                }
            };
            stable_orbit_response(&orbit.map_err(SimulateError::from_orbit)?)
        }
        ResponseKind::FromRest | ResponseKind::From(_) => {
            let initial = experiment.initial_state()?;
            Ok(match dofs {
                None => integrate(scheme, &system, force, &initial)?.into(),
                Some(dofs) => integrate_selected(scheme, &system, dofs, force, &initial)?.into(),
            })
        }
    }
}

/// Returns the response of an orbit, or an error if its largest multiplier shows that the orbit is
/// unstable.
fn stable_orbit_response(orbit: &PeriodicOrbit) -> Result<Stepped, SimulateError> {
    let multiplier = match orbit.multipliers().first() {
        Some(value) => Multiplier {
            value: *value,
            error: orbit.multiplier_error(),
            scheme_error: orbit.scheme_error(),
        },
        // The multiplier overflows.
        None => Multiplier { value: f64::INFINITY.into(), error: 0.0, scheme_error: None },
    };
    if multiplier.value.norm() > 1.0 + MULTIPLIER_ROUNDING + multiplier.error {
        return Err(SimulateError::UnstableOrbit { multiplier: multiplier.value });
    }
    Ok(Stepped { response: orbit.response().clone(), multiplier: Some(multiplier) })
}

fn with_middle<'a>(force: &'a Record, middle: Option<&'a Record>) -> SampledForce<'a> {
    middle.map_or(SampledForce::from(force), |m| SampledForce::with_mid_step(force, m))
}
