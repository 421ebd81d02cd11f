//! Errors of an integration.

use mechid_signal::message;

/// An integration that cannot be set up or carried out; every variant carries the offending
/// numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntegrateError {
    /// The time step is not a positive finite number of seconds.
    #[error("time step must be positive and finite, got {dt} s", dt = message::number(*dt))]
    TimeStep {
        /// The step given, in seconds.
        dt: f64,
    },
    /// A parameter of a scheme lies outside its range.
    #[error(
        "{scheme}: {parameter} must lie between {least} and {most}, got {value}",
        least = message::number(*least), most = message::number(*most), value = message::number(*value)
    )]
    Parameter {
        /// Name of the scheme.
        scheme: &'static str,
        /// Name of the parameter.
        parameter: &'static str,
        /// Smallest value allowed; parameters of schemes are pure numbers.
        least: f64,
        /// Largest value allowed, a pure number (may be infinite).
        most: f64,
        /// The value given, a pure number.
        value: f64,
    },
    /// A force, or an initial or starting vector, does not have one entry per degree of freedom.
    #[error(
        "{what} has {}, but the system has {}",
        message::count(*got, "component"), message::count(*dof, "degree of freedom")
    )]
    Components {
        /// Name of the input.
        what: &'static str,
        /// Components found.
        got: usize,
        /// Degrees of freedom of the system.
        dof: usize,
    },
    /// A degree of freedom was selected that the system does not have.
    #[error(
        "degree of freedom {index} (counted from 0) was selected, but the system has {}",
        message::count(*dof, "degree of freedom")
    )]
    DofOutside {
        /// The degree of freedom selected, counted from 0.
        index: usize,
        /// Degrees of freedom of the system.
        dof: usize,
    },
    /// Two channels of the force act on one degree of freedom.
    #[error("two forces act on degree of freedom {index} (counted from 0): add them first")]
    ForcedTwice {
        /// The degree of freedom, counted from 0.
        index: usize,
    },
    /// The mid-step forces have another number of samples, or another time step, than the force.
    #[error(
        "the mid-step forces have {} with steps of {got_dt} s, but the force has {expected} with steps of {dt} s: \
         they need the same sampling", message::count(*got, "sample"),
        got_dt = message::number(*got_dt), dt = message::number(*dt)
    )]
    MidStepSampling {
        /// Number of samples of the mid-step forces.
        got: usize,
        /// Time step of the mid-step forces, in seconds.
        got_dt: f64,
        /// Number of samples of the force.
        expected: usize,
        /// Step of the force, in seconds.
        dt: f64,
    },
    /// The scheme needs the force at an instant within the steps, but only samples were given.
    #[error(
        "{scheme} needs the force within each step: supply it, or choose a held or linear force"
    )]
    MidStepMissing {
        /// The scheme's name.
        scheme: String,
    },
    /// A value given or computed by the caller's function is NaN or infinite.
    #[error(
        "{what}, component {component}, is {value} at t = {time} s, not a finite number",
        time = message::number(*time), value = message::number(*value)
    )]
    NotFinite {
        /// Name of the input.
        what: &'static str,
        /// Component, counted from 1.
        component: usize,
        /// Instant, in seconds.
        time: f64,
        /// The value found.
        value: f64,
    },
    /// The mass matrix M is singular, but the scheme solves the equation of motion for the
    /// acceleration.
    #[error(
        "{scheme}: the mass matrix is singular (relative pivot {smallest:.1e}), so the acceleration \
         is not determined: every degree of freedom needs a mass; model rigid connections with fewer \
         degrees of freedom"
    )]
    SingularMass {
        /// Name of the scheme.
        scheme: &'static str,
        /// Smallest pivot of the factors of M, relative to the terms of its row (pure number).
        smallest: f64,
    },
    /// The effective mass matrix of the scheme is singular.
    #[error(
        "{scheme}: the effective mass matrix is singular at Δt = {dt} s (relative pivot {smallest:.1e}): \
         choose another step",
        dt = message::number(*dt)
    )]
    SingularEffectiveMass {
        /// Name of the scheme.
        scheme: &'static str,
        /// Time step, in seconds.
        dt: f64,
        /// Smallest pivot of the factors of the effective mass matrix, relative to the terms of its
        /// row (pure number).
        smallest: f64,
    },
    /// The factors of a matrix need more memory than the limit.
    #[error(
        "the LU factors of the {} need at least {:.2} GB, more than the limit of {:.2} GB: the factors \
         of a three-dimensional body have many additional entries. Use a coarser model, a scheme \
         whose matrix is diagonal (central-difference with lumped masses), or raise the limit \
         (`factor_memory_gb` of the system, `SparseSystem::with_factor_limit`); the computing \
         time then grows faster than the memory",
        message::count(*dof, "degree of freedom"), 1e-9 * *bytes as f64, 1e-9 * *limit as f64
    )]
    FactorsTooLarge {
        /// Degrees of freedom of the system.
        dof: usize,
        /// Memory of the factors without row exchanges, in bytes; row exchanges need more memory.
        bytes: u64,
        /// Limit, in bytes.
        limit: u64,
    },
    /// The matrix K + σC + σ²M of a search for modes is singular.
    #[error(
        "the dynamic stiffness of the {} at {omega} rad/s is singular (relative pivot {smallest:.1e}): \
         search for modes near another frequency",
        message::count(*dof, "degree of freedom"), omega = message::number(*omega)
    )]
    SingularShift {
        /// Im σ, in rad/s.
        omega: f64,
        /// Smallest pivot of the factors of the dynamic stiffness, relative to the terms of its row
        /// (pure number).
        smallest: f64,
        /// Degrees of freedom of the system.
        dof: usize,
    },
    /// The frequency near which modes are searched for is not positive and finite.
    #[error(
        "the frequency near which modes are searched for must be positive and finite, got {omega} rad/s",
        omega = message::number(*omega)
    )]
    SearchFrequency {
        /// The frequency given, in rad/s.
        omega: f64,
    },
    /// The number of modes that converged to rounding accuracy is smaller than the number
    /// requested.
    #[error(
        "only {found} of {} converged in a space of {vectors} vectors: ask for fewer modes, or for modes near \
         another frequency",
        message::count(*wanted, "mode")
    )]
    ModesNotConverged {
        /// Number of modes wanted.
        wanted: usize,
        /// Number of modes that converged.
        found: usize,
        /// Number of vectors of the space searched.
        vectors: usize,
    },
    /// Numbers overflow in a search for modes.
    #[error(
        "the search for modes overflows in a space of {}: the entries of the matrices differ by too many orders of magnitude",
        message::count(*vectors, "vector")
    )]
    ModesOverflow {
        /// Number of vectors of the space searched.
        vectors: usize,
    },
    /// The step makes the free motion of a stable system grow.
    #[error(
        "{scheme} is unstable at Δt = {dt} s: spectral radius {radius}; {}",
        limit_text(*.critical_step),
        dt = message::number(*dt), radius = message::number_to(*spectral_radius, 6)
    )]
    Unstable {
        /// The scheme's name.
        scheme: String,
        /// The step asked for, in seconds.
        dt: f64,
        /// Spectral radius of the amplification matrix at the requested step.
        spectral_radius: f64,
        /// Largest stable step in seconds, if there is one.
        critical_step: Option<f64>,
    },
    /// A start from rest was requested, but the initial velocity is not zero.
    #[error(
        "the start from rest needs zero initial velocity, but component {component} is {velocity} m/s",
        velocity = message::number(*velocity)
    )]
    NotAtRest {
        /// Component, counted from 1.
        component: usize,
        /// Velocity, in m/s.
        velocity: f64,
    },
    /// No unique response repeats with the period of the force: I − Φ is singular up to rounding.
    #[error(
        "the response that repeats every {period} s is not unique, because a free motion also has this period \
         (reciprocal condition {reciprocal_condition:.1e}, rounding {rounding:.1e}): add damping, or choose \
         another period",
        period = message::number(*period)
    )]
    NoPeriodicState {
        /// Period of the force, in seconds.
        period: f64,
        /// Reciprocal condition number of I − Φ, where Φ maps a state over one period of free
        /// motion.
        reciprocal_condition: f64,
        /// Reciprocal condition that rounding alone can cause.
        rounding: f64,
    },
    /// The periodic response of a large linear system was not found in the Krylov space.
    #[error(
        "the response that repeats every {period} s was not found to rounding accuracy: after {products} \
         passes over the period the best response still changes by {missed:.1e} of its size in a period, \
         because much of the free motion lasts longer than a period; choose a longer period",
        period = message::number(*period)
    )]
    PeriodNotClosed {
        /// Period of the force, in seconds.
        period: f64,
        /// Change of the state over a period, relative to the largest displacement, velocity or
        /// acceleration.
        missed: f64,
        /// Number of passes over the period.
        products: usize,
    },
    /// Newton's method found no periodic response of a nonlinear system.
    #[error(
        "no response that repeats every {period} s was found from this initial motion: the best response still \
         changes by {missed:.1e} of its size in a period; choose an initial motion nearer to the periodic \
         response, or a longer settling time",
        period = message::number(*period)
    )]
    NoOrbit {
        /// Period of the force, in seconds.
        period: f64,
        /// Change of the state over a period, relative to the largest displacement, velocity or
        /// acceleration.
        missed: f64,
    },
    /// Newton's method found no solution of the nonlinear equation of a step.
    #[error(
        "the nonlinear equation of motion was not solved at t = {time} s: after Newton's method the accelerations \
         still have an error of {residual:.1e} m/s²; choose smaller steps",
        time = message::number(*time)
    )]
    NotSolved {
        /// Instant, in seconds.
        time: f64,
        /// Residual of the accelerations, in m/s².
        residual: f64,
    },
    /// The system has nonlinear forces, which this scheme or analysis does not support.
    #[error("{what} is for linear systems, and this system has nonlinear forces")]
    LinearOnly {
        /// Scheme or analysis.
        what: &'static str,
    },
    /// The system has more degrees of freedom than the scheme allows.
    #[error("{scheme} allows at most {}, but the system has {dof}", message::count(*most, "degree of freedom"))]
    TooManyDof {
        /// Name of the scheme.
        scheme: &'static str,
        /// Degrees of freedom of the system.
        dof: usize,
        /// Maximum number of degrees of freedom that the scheme allows.
        most: usize,
    },
    /// The response overflows.
    #[error("the response overflows at sample {sample}, degree of freedom {component}")]
    Overflow {
        /// Sample, counted from 0.
        sample: usize,
        /// Degree of freedom, counted from 1.
        component: usize,
    },
    /// The damping ratio ζ of an accuracy analysis is outside the range 0 ≤ ζ < 1.
    #[error(
        "the damping ratio must be at least 0 and less than 1, got {damping_ratio}",
        damping_ratio = message::number(*damping_ratio)
    )]
    DampingRatio {
        /// The ratio given.
        damping_ratio: f64,
    },
    /// A system is not usable.
    #[error(transparent)]
    Model(#[from] mechid_model::ModelError),
    /// A signal is not usable.
    #[error(transparent)]
    Signal(#[from] mechid_signal::SignalError),
    /// A decomposition fails.
    #[error(transparent)]
    Numerics(#[from] mechid_numerics::NumericsError),
}

fn limit_text(critical_step: Option<f64>) -> String {
    match critical_step {
        Some(limit) => format!("the limit is Δt = {limit:.6e} s"),
        None => "no smaller step is stable either".to_owned(),
    }
}
