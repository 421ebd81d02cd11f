//! The five integrations of one case: as the equations require, and with the slips replayed.

use mechid::integrate::{
    CentralDifference, Houbolt, Newmark, RungeKutta4, SampledForce, Scheme, WilsonTheta,
    integrate_periodic,
};
use mechid::model::{KyxSign, Response};
use mechid::signal::Record;

use super::case::{Case, Machine};
use super::published::Method;
use super::slips::{Slip, one_sample_early, stage_loads};

/// Input of an estimator: one period of motion and force.
#[derive(Debug, Clone)]
pub struct Sequences {
    /// The simulated machine.
    pub machine: Machine,
    /// Displacement, velocity, acceleration.
    pub response: Response,
    /// The force that the estimator uses.
    pub force: Record,
}

/// Returns the integration scheme of a column of the tables, with the parameters of the
/// dissertation.
pub fn scheme(method: Method) -> Box<dyn Scheme> {
    match method {
        Method::Newmark => Box::new(Newmark::AVERAGE_ACCELERATION),
        Method::CentralDifference => Box::new(CentralDifference::default()),
        Method::Houbolt => Box::new(Houbolt::default()),
        Method::WilsonTheta => Box::new(WilsonTheta::new(1.4).expect("θ above 1")),
        _ => Box::new(RungeKutta4::LINEAR),
    }
}

/// The periodic steady state of a scheme on the system of eq. (4.2.3), without slips.
///
/// # Errors
/// The message of the integrator.
pub fn correct(case: Case, method: Method) -> Result<Sequences, String> {
    let machine = match case.machine {
        Machine::Bearing { .. } => Machine::Bearing { kyx: KyxSign::Minus },
        single => single,
    };
    let force = case.force();
    let response = integrate_periodic(scheme(method).as_ref(), &machine.system(), &force)
        .map_err(|e| format!("{}: {e}", method.name()))?;
    Ok(Sequences { machine, response, force })
}

/// Returns the sequences of the original programs, computed by this library with all slips.
///
/// # Errors
/// The message of the integrator.
pub fn slipped(case: Case, method: Method) -> Result<Sequences, String> {
    slipped_but(case, method, None)
}

/// Returns the sequences of the original programs with one slip undone, to find the cells that need
/// this slip.
///
/// # Errors
/// The message of the integrator.
pub fn slipped_but(case: Case, method: Method, undone: Option<Slip>) -> Result<Sequences, String> {
    let words = |e| format!("{}: {e}", method.name());
    let applied = |slip| undone != Some(slip);
    let kyx = if method != Method::Rk4 && applied(Slip::StiffnessSign) {
        KyxSign::Plus
    } else {
        KyxSign::Minus
    };
    let machine = match case.machine {
        Machine::Bearing { .. } => Machine::Bearing { kyx },
        single => single,
    };
    let (system, force) = (machine.system(), case.force());
    let response = if method == Method::Rk4 && applied(Slip::RungeKuttaStageLoads) {
        let (samples, middles) = stage_loads(&force);
        let loads = SampledForce::with_mid_step(&samples, &middles);
        integrate_periodic(&RungeKutta4::SUPPLIED, &system, loads).map_err(words)?
    } else {
        integrate_periodic(scheme(method).as_ref(), &system, &force).map_err(words)?
    };
    let response = match method {
        Method::CentralDifference if applied(Slip::CentralDifferenceLead) => {
            displacement_early(&response)
        }
        Method::WilsonTheta if applied(Slip::WilsonLoadLag) => all_early(&response),
        _ => response,
    };
    Ok(Sequences { machine, response, force })
}

/// Returns the response with only the displacement stored one sample early.
fn displacement_early(response: &Response) -> Response {
    stored(response, response.velocity().clone(), response.acceleration().clone())
}

/// Returns the response with all quantities stored one sample early.
fn all_early(response: &Response) -> Response {
    let (velocity, acceleration) = (response.velocity(), response.acceleration());
    stored(response, one_sample_early(velocity), one_sample_early(acceleration))
}

fn stored(response: &Response, velocity: Record, acceleration: Record) -> Response {
    let early = one_sample_early(response.displacement());
    Response::new(early, velocity, acceleration).expect("the same time axis")
}
