//! Simulation of an experiment: excitation, response, noise.

mod error;
#[cfg(feature = "report")]
mod figure;
mod machine;
#[cfg(feature = "parquet")]
mod runs;
mod schemes;
mod stepped;
mod summary;

use mechid_analysis::AnalysisError;
use mechid_analysis::sweep::{Simulated, SweepSettings, SweepSummary, sweep_experiment};
use mechid_integrate::{Convention, Scheme};
use mechid_io::{Experiment, Level, ResponseKind};
use mechid_model::{Instability, ModelError, Response};
use mechid_signal::{Record, SignalError, noise};
use nalgebra::DMatrix;

pub use self::error::SimulateError;
use self::machine::Described;
pub use self::machine::SimulatedSystem;
#[cfg(feature = "parquet")]
pub use self::runs::{RunsSummary, simulate_runs};
use self::schemes::{interpolated, scheme};
pub use self::stepped::Multiplier;
use self::stepped::{Stepped, stepped};
pub use self::summary::{
    FreeGrowth, LargestMultiplier, SchemeConvention, SimulatedChannel, SimulatedMode,
    SimulatedTerms, SimulationSummary,
};

/// Result of [`simulate`]: the true response and the measured record.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// The machine; for a nonlinear one, its linear part.
    pub system: SimulatedSystem,
    /// The nonlinear terms of the machine; `None` for a linear one.
    pub nonlinear: Option<SimulatedTerms>,
    /// Kind of the response: steady state, or response from initial conditions.
    pub response_kind: ResponseKind,
    /// Number of periods of the force.
    pub periods: usize,
    /// Scheme that computed the response, with its parameters.
    pub scheme: String,
    /// Conventions that the scheme uses.
    pub conventions: Vec<Convention>,
    /// Degrees of freedom, counted from 0, of the force channels.
    pub forced: Vec<usize>,
    /// Degrees of freedom, counted from 0, of the response channels.
    pub outputs: Vec<usize>,
    /// The force without noise, in N: samples × `forced`.
    pub force: Record,
    /// The response without noise: samples × `outputs`.
    pub response: Response,
    /// The force with its noise.
    pub measured_force: Record,
    /// The response with its noise.
    pub measured_response: Response,
    /// The fastest growing free response of an unstable machine; not computed for a sparse one.
    pub instability: Option<Instability>,
    /// The largest Floquet multiplier of the periodic response of a nonlinear machine.
    pub multiplier: Option<Multiplier>,
}

/// Simulates an experiment.
///
/// ```
/// use mechid::io::Experiment;
///
/// let experiment = Experiment::parse("machine.json", r#"{
///     "system": { "mass": 10, "damping": 180, "stiffness": 5000 },
///     "sampling": { "samples": 64, "rate_hz": 30 },
///     "excitation": [{ "lines": "odd", "amplitude": 5 }],
///     "periods": 2
/// }"#)?;
/// let simulation = mechid::simulate(&experiment)?;
/// assert_eq!(simulation.response.displacement().len(), 128);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`SimulateError`] for a wrong description, or a response that does not exist.
pub fn simulate(experiment: &Experiment) -> Result<Simulation, SimulateError> {
    let machine = Described::new(experiment)?;
    let instability = machine.instability()?;
    let (forced, outputs) = (experiment.forced()?, experiment.outputs()?);
    let period = experiment.force()?;
    machine.refuse_unstable_periodic(experiment, instability, period.sampling())?;
    let force = repeated(&period, experiment.periods)?;
    let scheme = scheme(experiment)?;
    let Stepped { response, multiplier } = match &scheme {
        None if experiment.response != ResponseKind::Periodic => {
            return Err(SimulateError::ExactFromRest);
        }
        None => machine.exact_periodic(experiment, &period)?.into(),
        Some(scheme) => by_steps(experiment, &**scheme, &machine, [&period, &force], instability)?,
    };
    let response = match experiment.response {
        ResponseKind::Periodic => map(&response, |_, r| repeated(r, experiment.periods))?,
        ResponseKind::FromRest | ResponseKind::From(_) => response,
    };
    let response = match &machine.linear {
        // The dense solution has all degrees of freedom, so the recorded ones are selected.
        SimulatedSystem::Dense(_) if !outputs.iter().copied().eq(0..response.dof()) => {
            let selected =
                |_, r: &Record| Record::new(r.sampling(), r.data().select_columns(&outputs));
            map(&response, selected)?
        }
        SimulatedSystem::Dense(_) | SimulatedSystem::Sparse(_) => response,
    };
    let (measured_force, measured_response) = with_noise(experiment, &force, &response)?;
    Ok(Simulation {
        scheme: scheme
            .as_ref()
            .map_or("exact: through the receptance, line by line".into(), |s| s.name()),
        conventions: scheme.map_or_else(Vec::new, |s| s.conventions()),
        system: machine.linear,
        nonlinear: machine.nonlinear,
        response_kind: experiment.response.clone(),
        periods: experiment.periods,
        forced,
        outputs,
        force,
        response,
        measured_force,
        measured_response,
        instability,
        multiplier,
    })
}

/// Computes the periodic response from one period of the force, or the response to all periods from
/// initial conditions.
fn by_steps(
    experiment: &Experiment,
    scheme: &dyn Scheme,
    machine: &Described,
    [period, force]: [&Record; 2],
    instability: Option<Instability>,
) -> Result<Stepped, SimulateError> {
    let within = scheme.inner_instant();
    let middle = within.map(|part| match interpolated(experiment, period, part)? {
        Some(middle) => Ok(middle),
        None => Ok::<_, SimulateError>(experiment.force_within_steps(part)?),
    });
    let middle = middle.transpose()?;
    match experiment.response {
        ResponseKind::Periodic => stepped(experiment, scheme, machine, period, middle.as_ref()),
        ResponseKind::FromRest | ResponseKind::From(_) => {
            let middle = middle.map(|m| repeated(&m, experiment.periods)).transpose()?;
            stepped(experiment, scheme, machine, force, middle.as_ref())
                .map_err(|error| error.with_instability(instability))
        }
    }
}

/// Returns force and response with the noise of the experiment.
fn with_noise(
    experiment: &Experiment,
    force: &Record,
    response: &Response,
) -> Result<(Record, Response), SimulateError> {
    let noise = experiment.noise;
    let add = |record: &Record, stream: u64, level: Option<Level>| match (level, noise) {
        (Some(level), Some(noise)) => {
            // The experiment has one seed; each quantity gets a separate random sequence from it.
            noise::add_white(record, level.into(), noise.seed.wrapping_mul(4).wrapping_add(stream))
        }
        _ => Ok(record.clone()),
    };
    let measured_force = add(force, 0, noise.and_then(|n| n.force))?;
    let levels = noise.map_or([None; 3], |n| [n.displacement, n.velocity, n.acceleration]);
    let measured_response = map(response, |which, r| add(r, which as u64 + 1, levels[which]))?;
    Ok((measured_force, measured_response))
}

/// Computes the response of a described machine to `force` (samples × the degrees of freedom of
/// [`Experiment::forced`], in N) instead of the described excitation, with the described scheme and
/// initial conditions; noise and number of periods are ignored.
///
/// # Errors
/// As [`simulate`]; [`MidStepMissing`](mechid_integrate::IntegrateError::MidStepMissing) if the
/// scheme needs the exact force between the samples.
pub fn respond(experiment: &Experiment, force: &Record) -> Result<Response, SimulateError> {
    let machine = Described::new(experiment)?;
    let instability = machine.instability()?;
    machine.refuse_unstable_periodic(experiment, instability, force.sampling())?;
    let Some(scheme) = scheme(experiment)? else {
        return match experiment.response {
            ResponseKind::Periodic => machine.exact_periodic(experiment, force),
            ResponseKind::FromRest | ResponseKind::From(_) => Err(SimulateError::ExactFromRest),
        };
    };
    let within = scheme.inner_instant().map(|part| interpolated(experiment, force, part));
    let middle = within.transpose()?.flatten();
    stepped(experiment, &*scheme, &machine, force, middle.as_ref())
        .map(|stepped| stepped.response)
        .map_err(|error| error.with_instability(instability))
}

/// Repeats a period `periods` times.
fn repeated(period: &Record, periods: usize) -> Result<Record, SignalError> {
    let len = period.len();
    let sampling = period.sampling().with_len(len * periods)?;
    let data = period.data();
    Record::new(
        sampling,
        DMatrix::from_fn(len * periods, period.channels(), |k, c| data[(k % len, c)]),
    )
}

/// Applies a function to each record of a response.
fn map(
    response: &Response,
    change: impl Fn(usize, &Record) -> Result<Record, SignalError>,
) -> Result<Response, ModelError> {
    Response::new(
        change(0, response.displacement())?,
        change(1, response.velocity())?,
        change(2, response.acceleration())?,
    )
}

/// Simulates and identifies a described experiment at many sampling steps; `progress` is called
/// after each sampling step.
///
/// # Errors
/// As [`sweep_experiment`].
pub fn sweep(
    experiment: &Experiment,
    how: &SweepSettings,
    progress: &(dyn Fn() + Sync),
) -> Result<SweepSummary, AnalysisError> {
    let simulated = |at: &Experiment| {
        let simulation = simulate(at).map_err(|error| error.to_string())?;
        Ok(Simulated {
            force: simulation.measured_force,
            response: simulation.measured_response,
            whole_periods: matches!(at.response, ResponseKind::Periodic),
        })
    };
    sweep_experiment(experiment, how, &simulated, progress)
}
