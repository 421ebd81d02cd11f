//! The record an experiment would give: excitation, response, noise.

#[cfg(feature = "report")]
mod figure;
#[cfg(feature = "parquet")]
mod runs;
mod schemes;
mod summary;

use mechid_analysis::AnalysisError;
use mechid_analysis::sweep::{Simulated, SweepSettings, SweepSummary, sweep_experiment};
use mechid_integrate::{
    AllowUnstable, Convention, IntegrateError, Matrices, PeriodicOrbit, SampledForce, Scheme,
    SelectedDofs, SystemWithForces, TermForces, growth_per_period, integrate, integrate_periodic,
    integrate_periodic_selected, integrate_selected, periodic_orbit, periodic_orbit_selected,
    sparse_steady_state,
};
use mechid_io::{Experiment, IoError, Level, NonlinearDescription, ResponseKind};
use mechid_model::{
    InitialState, Instability, ModelError, Response, SecondOrderSystem, SparseSystem,
    exact_periodic,
};
use mechid_signal::{Record, Sampling, SignalError, message, noise};
use nalgebra::{Complex, DMatrix};

#[cfg(feature = "parquet")]
pub use self::runs::{RunsSummary, simulate_runs};
use self::schemes::{has_given_start, interpolated, scheme};
pub use self::summary::{
    FreeGrowth, LargestMultiplier, SchemeConvention, SimulatedChannel, SimulatedMode,
    SimulatedTerms, SimulationSummary,
};

/// Result of [`simulate`]: the true response and the measured record.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// The machine; of a nonlinear one, the linear part.
    pub system: SimulatedSystem,
    /// The nonlinear terms of the machine; `None` of a linear one.
    pub nonlinear: Option<SimulatedTerms>,
    /// Kind of the response: the steady state, or one with a beginning.
    pub response_kind: ResponseKind,
    /// Number of periods of the force.
    pub periods: usize,
    /// Scheme that computed the response, with its parameters.
    pub scheme: String,
    /// The scheme's conventions in force.
    pub conventions: Vec<Convention>,
    /// Degrees of freedom, counted from 0, that the channels of the force act on.
    pub forced: Vec<usize>,
    /// Degrees of freedom, counted from 0, of the channels of the response.
    pub outputs: Vec<usize>,
    /// The force without noise, in N: samples × `forced`.
    pub force: Record,
    /// The response without noise: samples × `outputs`.
    pub response: Response,
    /// The force with its noise.
    pub measured_force: Record,
    /// The response with its noise.
    pub measured_response: Response,
    /// The fastest growing free response of an unstable machine; of a sparse one it is not computed.
    pub instability: Option<Instability>,
    /// The largest Floquet multiplier of the periodic response of a nonlinear machine.
    pub multiplier: Option<Multiplier>,
}

/// The factor by which a disturbance of a periodic response is multiplied in each period: a complex number
/// without unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Multiplier {
    /// The factor.
    pub value: Complex<f64>,
    /// Error to which it is known (pure number).
    pub error: f64,
}

/// M, C and K of a simulated machine, as they are stored.
#[derive(Debug, Clone, PartialEq)]
pub enum SimulatedSystem {
    /// All entries.
    Dense(SecondOrderSystem),
    /// The non-zero entries, of a large machine in Matrix Market files.
    Sparse(SparseSystem),
}

impl SimulatedSystem {
    /// Number of degrees of freedom.
    pub fn dof(&self) -> usize {
        match self {
            Self::Dense(system) => system.dof(),
            Self::Sparse(system) => system.dof(),
        }
    }

    /// M (kg), C (N·s/m) and K (N/m), each n × n, as they are stored.
    pub fn matrices(&self) -> Matrices<'_> {
        match self {
            Self::Dense(system) => Matrices::Dense(system),
            Self::Sparse(system) => Matrices::Sparse(system),
        }
    }

    /// The system, if all entries of its matrices are stored.
    pub fn dense(&self) -> Option<&SecondOrderSystem> {
        match self {
            Self::Dense(system) => Some(system),
            Self::Sparse(_) => None,
        }
    }
}

/// Runs an experiment.
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
/// [`SimulateError`]: what is wrong with the description, or a response that does not exist.
pub fn simulate(experiment: &Experiment) -> Result<Simulation, SimulateError> {
    let machine = Described::of(experiment)?;
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
        Some(scheme) => {
            let within = scheme.inner_instant();
            let middle = within.map(|part| match interpolated(experiment, &period, part)? {
                Some(middle) => Ok(middle),
                None => Ok::<_, SimulateError>(experiment.force_within_steps(part)?),
            });
            let middle = middle.transpose()?;
            match experiment.response {
                ResponseKind::Periodic => {
                    stepped(experiment, &**scheme, &machine, &period, middle.as_ref())?
                }
                ResponseKind::FromRest | ResponseKind::From(_) => {
                    let middle = middle.map(|m| repeated(&m, experiment.periods)).transpose()?;
                    stepped(experiment, &**scheme, &machine, &force, middle.as_ref())
                        .map_err(|error| error.of_unstable(instability))?
                }
            }
        }
    };
    let response = match experiment.response {
        ResponseKind::Periodic => map(&response, |_, r| repeated(r, experiment.periods))?,
        ResponseKind::FromRest | ResponseKind::From(_) => response,
    };
    let response = match &machine.linear {
        // All degrees of freedom were computed.
        SimulatedSystem::Dense(_) if !outputs.iter().copied().eq(0..response.dof()) => {
            let selected =
                |_, r: &Record| Record::new(r.sampling(), r.data().select_columns(&outputs));
            map(&response, selected)?
        }
        SimulatedSystem::Dense(_) | SimulatedSystem::Sparse(_) => response,
    };
    let noise = experiment.noise;
    let add = |record: &Record, stream: u64, level: Option<Level>| match (level, noise) {
        (Some(level), Some(noise)) => {
            // One seed for the experiment, one stream for each quantity.
            noise::add_white(record, level.into(), noise.seed.wrapping_mul(4).wrapping_add(stream))
        }
        _ => Ok(record.clone()),
    };
    let measured_force = add(&force, 0, noise.and_then(|n| n.force))?;
    let levels = noise.map_or([None; 3], |n| [n.displacement, n.velocity, n.acceleration]);
    let measured_response = map(&response, |which, r| add(r, which as u64 + 1, levels[which]))?;
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

/// Computes the response of a described machine to `force` (samples × the degrees of freedom that
/// [`Experiment::forced`] tells, in N) in the place of its excitation, by its scheme and from its start; noise and number of periods do not count.
///
/// # Errors
/// As [`simulate`]; [`IntegrateError::MidStepMissing`] if the scheme asks for the exact force between
/// the samples.
pub fn respond(experiment: &Experiment, force: &Record) -> Result<Response, SimulateError> {
    let machine = Described::of(experiment)?;
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
        .map_err(|error| error.of_unstable(instability))
}

/// The machine of an experiment.
struct Described {
    linear: SimulatedSystem,
    nonlinear: Option<SimulatedTerms>,
}

impl Described {
    fn of(experiment: &Experiment) -> Result<Self, SimulateError> {
        let terms = experiment.nonlinear()?.filter(|described| !described.terms.is_empty());
        let nonlinear = terms.map(|NonlinearDescription { terms, coefficients, .. }| {
            SimulatedTerms { terms: terms.clone(), coefficients: coefficients.clone() }
        });
        let linear = match experiment.sparse_system() {
            Some(sparse) => SimulatedSystem::Sparse(sparse.clone()),
            None => SimulatedSystem::Dense(experiment.system()?),
        };
        Ok(Self { linear, nonlinear })
    }

    /// The growth of the free response of a linear machine; that of a nonlinear one may end by itself.
    fn instability(&self) -> Result<Option<Instability>, ModelError> {
        match (&self.linear, &self.nonlinear) {
            (SimulatedSystem::Dense(system), None) => system.instability(),
            (SimulatedSystem::Sparse(_), None) | (_, Some(_)) => Ok(None),
        }
    }

    /// A steady state of an unstable machine solves its equations, but no run reaches it.
    fn refuse_unstable_periodic(
        &self,
        experiment: &Experiment,
        instability: Option<Instability>,
        period: Sampling,
    ) -> Result<(), SimulateError> {
        if experiment.response != ResponseKind::Periodic {
            return Ok(());
        }
        if let Some(instability) = instability {
            return Err(SimulateError::UnstablePeriodic { instability });
        }
        let growth = match (&self.linear, &self.nonlinear) {
            (SimulatedSystem::Sparse(system), None) => growth_per_period(system, period)?,
            _ => None,
        };
        match growth {
            Some(factor) => Err(SimulateError::UnstableOrbit { multiplier: factor.into() }),
            None => Ok(()),
        }
    }

    fn exact_periodic(
        &self,
        experiment: &Experiment,
        force: &Record,
    ) -> Result<Response, SimulateError> {
        match (&self.nonlinear, &self.linear) {
            (Some(_), _) => Err(SimulateError::ExactNonlinear),
            (None, SimulatedSystem::Dense(system)) => Ok(exact_periodic(system, force)?),
            (None, SimulatedSystem::Sparse(system)) => {
                let (forced, observed) = (experiment.forced()?, experiment.outputs()?);
                let dofs = SelectedDofs { forced: &forced, observed: &observed };
                Ok(sparse_steady_state(system, dofs, force)?)
            }
        }
    }

    /// M, C and K with the forces of the terms.
    fn with_forces(&self) -> Result<SystemWithForces<'_>, SimulateError> {
        let system = match &self.linear {
            SimulatedSystem::Dense(system) => SystemWithForces::new(system),
            SimulatedSystem::Sparse(system) => SystemWithForces::new(system),
        };
        match &self.nonlinear {
            None => Ok(system),
            Some(SimulatedTerms { terms, coefficients }) => {
                let forces = TermForces::new(terms, coefficients)?;
                Ok(system.with(forces)?)
            }
        }
    }
}

/// Periods of the force from rest after which a steady state of a nonlinear machine is searched for.
const SETTLING: usize = 50;

/// Excess over 1 of a Floquet multiplier that rounding makes of a double one, such as that of a machine
/// without damping: about the root of what the multipliers are known to (pure number).
const MULTIPLIER_ROUNDING: f64 = 1e-4;

/// A response, and of one that repeats of a nonlinear machine what becomes of disturbances.
struct Stepped {
    response: Response,
    multiplier: Option<Multiplier>,
}

impl From<Response> for Stepped {
    fn from(response: Response) -> Self {
        Self { response, multiplier: None }
    }
}

/// Steps through one force record, or through the period that repeats.
fn stepped(
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
    // Of a sparse machine the force has the columns of some degrees of freedom.
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
            let rest = InitialState::rest(machine.linear.dof());
            let orbit = match dofs {
                None => periodic_orbit(scheme, &system, force, &rest, SETTLING),
                Some(dofs) => {
                    periodic_orbit_selected(scheme, &system, dofs, force, &rest, SETTLING)
                }
            };
            stayed_on(&orbit.map_err(SimulateError::of_orbit)?)
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

/// The response of an orbit, unless its largest multiplier is known to lead away from it.
fn stayed_on(orbit: &PeriodicOrbit) -> Result<Stepped, SimulateError> {
    let multiplier = match orbit.multipliers().first() {
        Some(value) => Multiplier { value: *value, error: orbit.multiplier_error() },
        // It overflows.
        None => Multiplier { value: f64::INFINITY.into(), error: 0.0 },
    };
    if multiplier.value.norm() > 1.0 + MULTIPLIER_ROUNDING + multiplier.error {
        return Err(SimulateError::UnstableOrbit { multiplier: multiplier.value });
    }
    Ok(Stepped { response: orbit.response().clone(), multiplier: Some(multiplier) })
}

/// A simulation that cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// The description is wrong.
    #[error(transparent)]
    Io(#[from] IoError),
    /// The scheme refuses.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// The system has no such response.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A record cannot be made.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// The exact scheme has no time steps, and so no start.
    #[error(
        "the scheme \"exact\" gives the periodic response only: choose another one for a response that \
         starts from rest or from a given motion"
    )]
    ExactFromRest,
    /// The exact scheme is that of linear machines.
    #[error(
        "the scheme \"exact\" is for linear machines: choose another one for nonlinear terms, such as \
         newmark or runge-kutta-4, and steps that are short against the fastest motion"
    )]
    ExactNonlinear,
    /// A periodic response has no start.
    #[error(
        "a periodic response has no start: give displacements for Houbolt's first steps only with a \
         response from rest or from a given motion"
    )]
    GivenStartPeriodic,
    /// An unstable machine reaches no steady state.
    #[error(
        "the machine is unstable, {instability}: it reaches no periodic response; choose \
         \"response\": \"from-rest\" and a record of a few doublings"
    )]
    UnstablePeriodic {
        /// The growing free response.
        instability: Instability,
    },
    /// A periodic response that no run stays on, of a nonlinear machine or a large one.
    #[error(
        "the periodic response is unstable: each period multiplies a disturbance by {} (the largest \
         Floquet multiplier), so that no machine stays on it; choose \"response\": \"from-rest\" to see \
         where the response goes, or another amplitude or frequency",
        multiplier_text(*.multiplier)
    )]
    UnstableOrbit {
        /// The largest Floquet multiplier (pure number).
        multiplier: Complex<f64>,
    },
    /// The search for the periodic response of a nonlinear machine ends without one.
    #[error(
        "no response that repeats every {period} s was found from rest and {SETTLING} periods: the best \
         changes by {missed:.1e} of its size in a period. Choose \"response\": \"from-rest\" to see where \
         the response goes; where it repeats after several periods of the force only, describe these as \
         one (`samples`, `lines`)",
        period = message::number(*period)
    )]
    NoPeriodicOrbit {
        /// Period of the force, in seconds.
        period: f64,
        /// Change in a period, relative to the largest displacement, velocity or acceleration.
        missed: f64,
    },
    /// The response of an unstable machine overflows.
    #[error("the machine is unstable, {instability}: {error}; choose a shorter record")]
    UnstableOverflow {
        /// The growing free response.
        instability: Instability,
        /// Place of the overflow.
        #[source]
        error: IntegrateError,
    },
}

/// The number with four decimals, of a complex one its modulus too.
fn multiplier_text(multiplier: Complex<f64>) -> String {
    let number = |value: f64| message::number_to(value, 4);
    match multiplier.im {
        0.0 => format!("{}", number(multiplier.re)),
        im => format!(
            "{} ± {}i, of modulus {}",
            number(multiplier.re),
            number(im.abs()),
            number(multiplier.norm())
        ),
    }
}

impl SimulateError {
    /// Says of a failed search what the description of an experiment can change.
    fn of_orbit(error: IntegrateError) -> Self {
        match error {
            IntegrateError::NoOrbit { period, missed } => Self::NoPeriodicOrbit { period, missed },
            error => Self::Integrate(error),
        }
    }

    /// Adds the reason to the overflow of a run.
    fn of_unstable(self, instability: Option<Instability>) -> Self {
        match (self, instability) {
            (Self::Integrate(error @ IntegrateError::Overflow { .. }), Some(instability)) => {
                Self::UnstableOverflow { instability, error }
            }
            (error, _) => error,
        }
    }
}

fn with_middle<'a>(force: &'a Record, middle: Option<&'a Record>) -> SampledForce<'a> {
    middle.map_or(SampledForce::from(force), |m| SampledForce::with_mid_step(force, m))
}

/// A record of so many periods.
fn repeated(period: &Record, periods: usize) -> Result<Record, SignalError> {
    let len = period.len();
    let sampling = period.sampling().with_len(len * periods)?;
    let data = period.data();
    Record::new(
        sampling,
        DMatrix::from_fn(len * periods, period.channels(), |k, c| data[(k % len, c)]),
    )
}

/// A response made of another one, record by record.
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

/// Identifies a described experiment at many sampling steps, each simulated; `progress` is called after
/// each.
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

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_1_PI, FRAC_PI_2, PI};

    use super::*;

    /// Largest displacement error against the receptance, relative, for a scheme as JSON.
    fn error(scheme: &str, samples: usize) -> f64 {
        let text = format!(
            r#"{{ "system": {{ "mass": 10, "damping": 180, "stiffness": 5000 }},
                 "sampling": {{ "samples": {samples}, "rate_hz": {samples} }},
                 "excitation": [{{ "lines": "1:5", "amplitude": 5 }}],
                 "scheme": {scheme} }}"#
        );
        let simulation = simulate(&Experiment::parse("test.json", &text).unwrap()).unwrap();
        let truth = exact_periodic(simulation.system.dense().unwrap(), &simulation.force).unwrap();
        let (truth, found) =
            (truth.displacement().data(), simulation.response.displacement().data());
        (found - truth).amax() / truth.amax()
    }

    /// Judge: ẍ + 2 ẋ + x + x³ = F with F such that x = cos 2t, damped enough to be the only orbit.
    #[test]
    fn a_nonlinear_machine_goes_round_its_orbit() {
        let simulated = |scheme: &str, response: &str| {
            let text = format!(
                r#"{{ "system": {{ "mass": 1, "damping": 2, "stiffness": 1 }},
                     "nonlinear": {{ "terms": "k3: x1^3", "coefficients": [1] }},
                     "sampling": {{ "samples": 400, "rate_hz": {} }},
                     "excitation": [
                       {{ "kind": "harmonic", "amplitude": 2.25, "frequency_hz": {hz}, "phase_rad": {half} }},
                       {{ "kind": "harmonic", "amplitude": 4, "frequency_hz": {hz}, "phase_rad": {quarter} }},
                       {{ "kind": "harmonic", "amplitude": 0.25, "frequency_hz": {} }}],
                     "scheme": {scheme}, "response": {response} }}"#,
                400.0 * FRAC_1_PI,
                3.0 * FRAC_1_PI,
                hz = FRAC_1_PI,
                half = PI,
                quarter = FRAC_PI_2,
            );
            simulate(&Experiment::parse("test.json", &text).unwrap())
        };
        let error = |simulation: &Simulation| {
            let x = simulation.response.displacement();
            let each = x.sampling().times().zip(x.channel(0));
            each.map(|(t, x)| (x - (2.0 * t).cos()).abs()).fold(0.0, f64::max)
        };
        let start = r#"{ "from": { "displacement": 1 } }"#;
        for response in [r#""periodic""#, start] {
            let newmark = simulated(r#"{ "name": "newmark" }"#, response).unwrap();
            assert!(error(&newmark) < 1e-3, "{response}: {:e}", error(&newmark));
            let fourth = r#"{ "name": "runge-kutta-4", "load": "exact" }"#;
            let fourth = simulated(fourth, response).unwrap();
            assert!(error(&fourth) < 1e-7, "{response}: {:e}", error(&fourth));
            assert_eq!(fourth.nonlinear.unwrap().coefficients, [1.0]);
        }
        let exact = simulated(r#"{ "name": "exact" }"#, r#""periodic""#);
        assert!(matches!(exact, Err(SimulateError::ExactNonlinear)));
    }

    /// Judge: of ẍ + 1.5 ẋ − x + x³ = 0 at rest λ² + 1.5 λ − 1 = 0, so that a disturbance grows by e^(λT),
    /// λ = 1/2, in a period; at rest on the other side of zero, with + x, it dies out.
    #[test]
    fn an_orbit_that_no_machine_stays_on_is_refused() {
        let simulated = |stiffness: f64| {
            let text = format!(
                r#"{{ "system": {{ "mass": 1, "damping": 1.5, "stiffness": {stiffness} }},
                     "nonlinear": {{ "terms": "k3: x1^3", "coefficients": [1] }},
                     "sampling": {{ "samples": 200, "rate_hz": 100 }}, "excitation": [],
                     "scheme": {{ "name": "runge-kutta-4", "load": "linear" }},
                     "response": "periodic" }}"#
            );
            simulate(&Experiment::parse("test.json", &text).unwrap())
        };
        let refused = simulated(-1.0).unwrap_err();
        let SimulateError::UnstableOrbit { multiplier } = refused else { panic!("{refused}") };
        assert!((multiplier - std::f64::consts::E).norm() < 1e-6, "{multiplier}");
        assert!(refused.to_string().contains("a disturbance by 2.7183 "), "{refused}");
        // λ² + 1.5 λ + 1 = 0: of modulus 1, real part −3/4, over 2 s.
        let stable = simulated(1.0).unwrap();
        let Multiplier { value, error } = stable.multiplier.unwrap();
        assert!((value.norm() - (-1.5_f64).exp()).abs() < 1e-6 && error < 1e-6, "{value}");
        let told = stable.summary().unwrap().to_string();
        assert!(told.contains("multiplies a disturbance of the response by 0.2231 ± "), "{told}");
        assert!(told.contains("it is stable"), "{told}");
    }

    /// Judge: each mass of a chain gains energy at the rate −c / 2m = 0.1 1/s for 0.64 s.
    #[test]
    fn a_large_machine_that_grows_has_no_periodic_response() {
        let simulated = |damping: f64, scheme: &str| {
            let n = 200;
            let diagonal = |value: f64| {
                let at: Vec<usize> = (1..=n).collect();
                let values = vec![value; n];
                format!(
                    r#"{{ "size": {n}, "rows": {at:?}, "columns": {at:?}, "values": {values:?} }}"#
                )
            };
            let [m, c, k] = [2.0, damping, 800.0].map(diagonal);
            let text = format!(
                r#"{{ "system": {{ "mass": {m}, "damping": {c}, "stiffness": {k} }},
                     "sampling": {{ "samples": 64, "rate_hz": 100 }},
                     "excitation": [{{ "lines": "1:5", "amplitude": 5 }}], "outputs": [1],
                     "scheme": {{ "name": "{scheme}" }} }}"#
            );
            simulate(&Experiment::parse("test.json", &text).unwrap())
        };
        for scheme in ["newmark", "exact"] {
            let refused = simulated(-0.4, scheme).unwrap_err();
            let SimulateError::UnstableOrbit { multiplier } = refused else { panic!("{refused}") };
            assert!((multiplier.re - 0.064_f64.exp()).abs() < 1e-3, "{multiplier}");
            assert!(simulated(0.4, scheme).is_ok());
        }
    }

    #[test]
    fn runge_kutta_is_of_fourth_order_where_it_knows_the_force_at_mid_step() {
        let exact = r#"{ "name": "runge-kutta-4", "load": "exact" }"#;
        let linear = r#"{ "name": "runge-kutta-4", "load": "linear" }"#;
        let order = |scheme: &str| (error(scheme, 128) / error(scheme, 256)).log2();
        assert!((order(exact) - 4.0).abs() < 0.2, "{}", order(exact));
        assert!((order(linear) - 2.0).abs() < 0.2, "{}", order(linear));
    }
    fn unstable(response: &str, samples: usize) -> Result<Simulation, SimulateError> {
        let text = format!(
            r#"{{ "system": {{ "mass": 2, "damping": -0.4, "stiffness": 800 }},
                 "sampling": {{ "samples": {samples}, "rate_hz": 100 }},
                 "excitation": [{{ "lines": "1:5", "amplitude": 5 }}],
                 "scheme": {{ "name": "newmark" }}, "response": "{response}" }}"#
        );
        simulate(&Experiment::parse("test.json", &text).unwrap())
    }

    /// Judge: −c / 2m = 0.1 1/s.
    #[test]
    fn an_unstable_machine_has_no_periodic_response_and_is_told() {
        let refused = unstable("periodic", 64).unwrap_err();
        let SimulateError::UnstablePeriodic { instability } = refused else { panic!("{refused}") };
        assert!((instability.growth_rate() - 0.1).abs() < 1e-12);
        let found = unstable("from-rest", 64).unwrap().instability.unwrap();
        assert!((found.doubling_time() - 2f64.ln() / 0.1).abs() < 1e-9, "{found}");
        // e^(0.1 t) exceeds 1e308 at 7090 s.
        let refused = unstable("from-rest", 1 << 20).unwrap_err();
        assert!(matches!(refused, SimulateError::UnstableOverflow { .. }), "{refused}");
        assert!(refused.to_string().contains("doubles every 6.931 s"), "{refused}");
    }

    fn simulated(scheme: &str, response: &str) -> Result<Simulation, SimulateError> {
        let text = format!(
            r#"{{ "system": {{ "mass": 2, "damping": 0, "stiffness": 8 }},
                 "sampling": {{ "samples": 64, "rate_hz": 100 }},
                 "excitation": [],
                 "scheme": {scheme}, "response": {response} }}"#
        );
        simulate(&Experiment::parse("test.json", &text).unwrap())
    }

    /// Judge: x = x0 cos ωt + v0/ω sin ωt with ω = 2.
    #[test]
    fn a_free_motion_starts_where_it_is_told_to() {
        let from = r#"{ "from": { "displacement": 0.5, "velocity": -3 } }"#;
        let truth = |t: f64| 0.5 * (2.0 * t).cos() - 1.5 * (2.0 * t).sin();
        let given = format!(
            r#"{{ "name": "houbolt", "start": {{ "given": {{ "at_dt": {}, "at_2dt": {} }} }} }}"#,
            truth(0.01),
            truth(0.02)
        );
        for scheme in [r#"{ "name": "newmark" }"#, &given] {
            let simulation = simulated(scheme, from).unwrap();
            let x = simulation.response.displacement();
            for (k, t) in x.sampling().times().enumerate() {
                // Second order: (ωΔt)² = 4e-4 per unit of time and amplitude, 0.64 s of 1.6 m.
                assert!((x.channel(0)[k] - truth(t)).abs() < 4e-4, "{scheme} at {t} s");
            }
        }
        let x = simulated(&given, from).unwrap();
        assert!((x.response.displacement().channel(0)[2] - truth(0.02)).abs() < 1e-15);
        assert!(matches!(
            simulated(r#"{ "name": "exact" }"#, from),
            Err(SimulateError::ExactFromRest)
        ));
        let periodic = simulated(&given, r#""periodic""#);
        assert!(matches!(periodic, Err(SimulateError::GivenStartPeriodic)));
    }
}
