//! Scheme of a description.

use mechid_integrate::{
    AlphaAcceleration, Bathe, CentralDifference, CentralDifferenceStart, GeneralisedAlpha, Houbolt,
    HouboltStart, MatrixExponential, Newmark, RungeKutta4, Scheme, SubStepForce, WilsonLoad,
    WilsonTheta,
};
use mechid_io::{
    Experiment, FirstDisplacements, FirstSteps, HeldOrLinear, LoadBeyond, MiddleLoad,
    ReturnedAcceleration, SchemeChoice, SubStepLoad,
};

use mechid_signal::resample::within_steps;
use mechid_signal::{Interpolation, Record};

use super::SimulateError;

/// Returns whether the description states the first displacements.
pub fn has_given_start(experiment: &Experiment) -> bool {
    matches!(experiment.scheme, SchemeChoice::Houbolt { start: FirstSteps::Given { .. } })
}

/// Creates the scheme; `None` for the exact steady state.
pub fn scheme(experiment: &Experiment) -> Result<Option<Box<dyn Scheme>>, SimulateError> {
    Ok(Some(match &experiment.scheme {
        SchemeChoice::Newmark { beta, gamma } => Box::new(Newmark::new(*beta, *gamma)?),
        SchemeChoice::CentralDifference { start } => Box::new(CentralDifference {
            start: match start {
                FirstDisplacements::Taylor => CentralDifferenceStart::Taylor,
                FirstDisplacements::Rest => CentralDifferenceStart::Rest,
            },
        }),
        SchemeChoice::Houbolt { start } => Box::new(Houbolt {
            start: match start {
                FirstSteps::AverageAcceleration => HouboltStart::AverageAcceleration,
                FirstSteps::CentralDifference => HouboltStart::CentralDifference,
                FirstSteps::Given { at_dt, at_2dt } => HouboltStart::Given {
                    at_dt: experiment.per_dof("the displacement at Δt", at_dt)?,
                    at_2dt: experiment.per_dof("the displacement at 2Δt", at_2dt)?,
                },
            },
        }),
        SchemeChoice::WilsonTheta { theta, load } => {
            Box::new(WilsonTheta::new(*theta)?.with_load(match load {
                LoadBeyond::Projected => WilsonLoad::Projected,
                LoadBeyond::Interpolated => WilsonLoad::Interpolated,
            }))
        }
        SchemeChoice::GeneralisedAlpha { rho_infinity, acceleration } => {
            returning(GeneralisedAlpha::new(*rho_infinity)?, *acceleration)
        }
        SchemeChoice::HhtAlpha { rho_infinity, acceleration } => {
            returning(GeneralisedAlpha::hilber_hughes_taylor(*rho_infinity)?, *acceleration)
        }
        SchemeChoice::WbzAlpha { rho_infinity, acceleration } => {
            returning(GeneralisedAlpha::wood_bossak_zienkiewicz(*rho_infinity)?, *acceleration)
        }
        SchemeChoice::Bathe { load } => Box::new(Bathe::HALVES.with_force(sub_step_force(*load))),
        SchemeChoice::RhoInfinityBathe { rho_infinity, load } => {
            Box::new(Bathe::new(*rho_infinity)?.with_force(sub_step_force(*load)))
        }
        SchemeChoice::MatrixExponential { load } => Box::new(match load {
            HeldOrLinear::Held => MatrixExponential::HELD,
            HeldOrLinear::Linear => MatrixExponential::LINEAR,
        }),
        SchemeChoice::RungeKutta4 { load } => Box::new(match load {
            MiddleLoad::Held => RungeKutta4::HELD,
            MiddleLoad::Linear => RungeKutta4::LINEAR,
            MiddleLoad::Exact | MiddleLoad::BandLimited | MiddleLoad::Spline => {
                RungeKutta4::SUPPLIED
            }
        }),
        _ => return Ok(None),
    }))
}

/// Returns the force at the inner instants of the steps, interpolated from one period `force`;
/// `None` if the scheme does not interpolate the samples.
pub fn interpolated(
    experiment: &Experiment,
    force: &Record,
    part: f64,
) -> Result<Option<Record>, SimulateError> {
    let SchemeChoice::RungeKutta4 { load } = &experiment.scheme else { return Ok(None) };
    let method = match load {
        MiddleLoad::BandLimited => Interpolation::BandLimited,
        MiddleLoad::Spline => Interpolation::NotAKnotSpline,
        MiddleLoad::Held | MiddleLoad::Linear | MiddleLoad::Exact => return Ok(None),
    };
    Ok(Some(within_steps(force, part, method)?))
}

fn returning(scheme: GeneralisedAlpha, acceleration: ReturnedAcceleration) -> Box<dyn Scheme> {
    Box::new(scheme.with_acceleration(match acceleration {
        ReturnedAcceleration::EquationOfMotion => AlphaAcceleration::EquationOfMotion,
        ReturnedAcceleration::Carried => AlphaAcceleration::Carried,
    }))
}

fn sub_step_force(load: SubStepLoad) -> SubStepForce {
    match load {
        SubStepLoad::Linear => SubStepForce::Linear,
        SubStepLoad::Exact => SubStepForce::Supplied,
    }
}
