//! Responses to a sampled force without discretisation error: the reference solutions of the tests.
//!
//! A sampled force defines a motion only together with its course between the samples:
//!
//! | Functions | Between the samples the force is |
//! |---|---|
//! | [`exact_zoh`], [`exact_zoh_periodic`] | held at the sample on the left (as a converter does) |
//! | [`exact_foh`], [`exact_foh_periodic`] | on the straight line from sample to sample |
//! | [`exact_harmonic`], [`exact_harmonic_periodic`] | the sum of its spectral lines |
//!
//! The periodic functions return the motion that repeats with the period `len · dt` of the force,
//! the others start from a given state. x, ẋ and ẍ belong to the same instants. A held force, and
//! the acceleration with it, jumps at every sample: ẍ is the limit from the right, with the force
//! after the jump.

use mechid_model::{InitialState, ModelError, Response, SecondOrderSystem};
use mechid_numerics::linear_algebra::singular_values;
use mechid_signal::{Record, Spectrum};
use nalgebra::{Complex, DMatrix, DVector};

use crate::error::ProblemError;
use crate::transition::{Between, Transition};

/// Response from `start` to a force held between samples (samples × dof, in N).
///
/// # Errors
/// [`ProblemError::Model`] if force or state do not fit the system,
/// [`ProblemError::StepTooLong`] if ω Δt exceeds 10⁶,
/// [`ProblemError::Signal`] if an unstable motion overflows.
pub fn exact_zoh(
    system: &SecondOrderSystem,
    force: &Record,
    start: &InitialState,
) -> Result<Response, ProblemError> {
    from_start(system, force, start, Between::Held)
}

/// Response from `start` to a force linear between samples (samples × dof, in N).
///
/// # Errors
/// The errors of [`exact_zoh`].
pub fn exact_foh(
    system: &SecondOrderSystem,
    force: &Record,
    start: &InitialState,
) -> Result<Response, ProblemError> {
    from_start(system, force, start, Between::Linear)
}

/// Periodic response to a force held between samples, one period (samples × dof, in N).
///
/// # Errors
/// [`ProblemError::NoPeriodicMotion`] if there is no periodic response or more than one; otherwise
/// the errors of [`exact_zoh`].
pub fn exact_zoh_periodic(
    system: &SecondOrderSystem,
    force: &Record,
) -> Result<Response, ProblemError> {
    periodic(system, force, Between::Held)
}

/// Periodic response to a force linear between samples, one period (samples × dof, in N).
///
/// # Errors
/// The errors of [`exact_zoh_periodic`].
pub fn exact_foh_periodic(
    system: &SecondOrderSystem,
    force: &Record,
) -> Result<Response, ProblemError> {
    periodic(system, force, Between::Linear)
}

/// Periodic response to the band-limited force through the samples of one period: each line n of
/// the response is the receptance at n·ω0 times line n of the force.
///
/// At the Nyquist frequency (periods of even length) the samples show only a cosine; the force
/// applied there is that cosine.
///
/// # Errors
/// [`ProblemError::Model`] if the number of force channels differs from the number of degrees of
/// freedom, or if a line of the period (driven or not) is an undamped resonance.
///
/// # Source
/// Clough & Penzien, *Dynamics of Structures*, the chapter on periodic loading (line by line).
pub fn exact_harmonic_periodic(
    system: &SecondOrderSystem,
    force: &Record,
) -> Result<Response, ProblemError> {
    let got = force.channels();
    if got != system.dof() {
        return Err(ModelError::ForceChannels { got, dof: system.dof() }.into());
    }
    let forces = Spectrum::from_record(force);
    let mut lines = [(); 3].map(|()| DMatrix::zeros(forces.len(), got));
    for n in 0..forces.len() {
        let omega = forces.omega(n);
        let x = system.receptance(omega)? * forces.lines().row(n).transpose();
        let i_omega = Complex::new(0.0, omega);
        for (power, quantity) in lines.iter_mut().enumerate() {
            quantity.set_row(n, &x.map(|z| z * i_omega.powi(power as i32)).transpose());
        }
    }
    let record = |lines| Spectrum::from_lines(force.sampling(), lines)?.to_record();
    let [x, v, a] = lines.map(record);
    Ok(Response::new(x?, v?, a?)?)
}

/// Response from `start` to the band-limited force: the sum of the periodic response and a free
/// decay. The initial state of the free decay is `start` minus the initial state of the periodic
/// response.
///
/// # Errors
/// The errors of [`exact_harmonic_periodic`] and [`exact_zoh`].
///
/// # Source
/// The sources of [`exact_harmonic_periodic`] and [`exact_zoh`], by superposition.
pub fn exact_harmonic(
    system: &SecondOrderSystem,
    force: &Record,
    start: &InitialState,
) -> Result<Response, ProblemError> {
    start.check_dof(system.dof())?;
    let steady = exact_harmonic_periodic(system, force)?;
    let first = |r: &Record| r.data().row(0).transpose();
    let gap = InitialState::new(
        start.displacement() - first(steady.displacement()),
        start.velocity() - first(steady.velocity()),
    )?;
    let no_force = Record::new(force.sampling(), DMatrix::zeros(force.len(), force.channels()))?;
    let free = exact_zoh(system, &no_force, &gap)?;
    let sum = |p: &Record, q: &Record| Record::new(p.sampling(), p.data() + q.data());
    Ok(Response::new(
        sum(steady.displacement(), free.displacement())?,
        sum(steady.velocity(), free.velocity())?,
        sum(steady.acceleration(), free.acceleration())?,
    )?)
}

fn from_start(
    system: &SecondOrderSystem,
    force: &Record,
    start: &InitialState,
    between: Between,
) -> Result<Response, ProblemError> {
    start.check_dof(system.dof())?;
    let transition = Transition::new(system, force.sampling().dt(), between)?;
    transition.check(force.channels())?;
    let state = transition.state(start.displacement(), start.velocity());
    Ok(run(&transition, force, state)?.0)
}

fn periodic(
    system: &SecondOrderSystem,
    force: &Record,
    between: Between,
) -> Result<Response, ProblemError> {
    let transition = Transition::new(system, force.sampling().dt(), between)?;
    transition.check(force.channels())?;
    // z(T) = Φᴺ z(0) + s, with s the state after a period from rest; z(T) = z(0) gives (I − Φᴺ)
    // z(0) = s.
    let size = 2 * system.dof();
    let (_, from_rest) = run(&transition, force, DVector::zeros(size))?;
    let over_period = transition.phi.pow(u32::try_from(force.len()).expect("fits in memory"));
    let growth = over_period.norm();
    let closing = DMatrix::identity(size, size) - over_period;
    let mut reciprocal_condition = 0.0;
    // An unstable system may overflow over the period; a matrix with infinite entries has no
    // singular values.
    if growth.is_finite() {
        // The smallest singular value is not divided by the largest one, as in a condition number:
        // without damping, all singular values of I − Φᴺ may be zero up to rounding.
        reciprocal_condition = singular_values(closing.clone())?.min() / (1.0 + growth);
    }
    // Φᴺ is a product of N matrices, which has a rounding error of about N ε.
    let resolved = reciprocal_condition > 4.0 * f64::EPSILON * force.len() as f64;
    let start = if resolved { closing.lu().solve(&from_rest) } else { None };
    let start = start.ok_or(ProblemError::NoPeriodicMotion {
        period: force.sampling().duration(),
        reciprocal_condition,
    })?;
    Ok(run(&transition, force, start)?.0)
}

/// Returns the response at every sample, and the state one step after the last sample. At the end
/// of this step, the force has the value of the first sample, as if the record repeats.
fn run(
    transition: &Transition,
    force: &Record,
    mut state: DVector<f64>,
) -> Result<(Response, DVector<f64>), ProblemError> {
    let forces = force.data().transpose();
    let samples = force.len();
    let mut motion = [(); 3].map(|()| DMatrix::zeros(forces.nrows(), samples));
    for k in 0..samples {
        let first = forces.column(k).into_owned();
        let last = forces.column((k + 1) % samples).into_owned();
        for (quantity, values) in motion.iter_mut().zip(transition.motion(&state, &first)) {
            quantity.set_column(k, &values);
        }
        state = transition.step(&state, &first, &last);
    }
    let record = |quantity: &DMatrix<f64>| Record::new(force.sampling(), quantity.transpose());
    let [x, v, a] = &motion;
    Ok((Response::new(record(x)?, record(v)?, record(a)?)?, state))
}
