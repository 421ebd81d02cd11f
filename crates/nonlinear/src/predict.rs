//! Response of a nonlinear system to a measured force.

use mechid_estimate::EstimateError;
use mechid_model::{InitialState, NonlinearSystem, Response, ResponseQuantity, exact_periodic};
use mechid_numerics::check_size;
use mechid_numerics::gauss_newton::{Residuals, minimise_residuals};
use mechid_numerics::time_limit;
use mechid_signal::{Extent, Record};
use nalgebra::{DMatrix, DVector};

use super::limits::SEARCH_STEPS;
use super::simulate::{Course, Direction, FineForce, Tangent};
use crate::limits::{PREDICTION_CLOSED, PREDICTION_SHOTS};

/// Computes displacement, velocity and acceleration of a nonlinear system under a sampled force
/// (N). For an open record the motion begins at `start`. For a whole period the motion is the
/// steady state; the search for it begins at `start`.
///
/// Between the samples the force is band-limited, not held or linear: for a hardening spring with a
/// third harmonic near resonance, the difference is several times the noise of a good sensor. The
/// classical Runge–Kutta method is used with a step that is halved until the remaining error of the
/// displacement is about 10⁻⁵ of its peak; the steady state without nonlinear terms is exact, line
/// by line. A hardening spring may have several steady states; the returned one is near `start`.
///
/// # Errors
/// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) for a wrong number of channels,
/// [`EstimateError::TooStiff`] if the fastest mode is too fast for the sampling,
/// [`EstimateError::Diverged`] if the response overflows, [`EstimateError::NoSteadyState`] if the
/// search does not converge.
///
/// # Source
/// Hairer, Nørsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), section
/// II.1; Seydel, *Practical Bifurcation and Stability Analysis*, 3rd ed. (2010), chapter 7
/// (shooting for periodic solutions).
pub fn predict(
    system: &NonlinearSystem,
    force: &Record,
    extent: Extent,
    start: &InitialState,
) -> Result<Response, EstimateError> {
    let n = system.dof();
    check_size("channels of the force", n, force.channels())?;
    check_size("degrees of freedom of the initial state", n, start.dof())?;
    if extent == Extent::WholePeriod && system.terms().is_empty() {
        return Ok(exact_periodic(system.linear(), force)?);
    }
    let fine = FineForce::sufficient(force, system, extent, start)?;
    let start = match extent {
        Extent::Open => start.clone(),
        Extent::WholePeriod => steady_start(system, force, &fine, start)?,
    };
    let course = Tangent::new(system, &[]).simulate(&fine, &start);
    let Course { state, .. } = course.ok_or(EstimateError::Diverged { len: force.len() })?;
    let record =
        |part: usize| Record::new(force.sampling(), state.columns(part * n, n).into_owned());
    Ok(Response::new(record(0)?, record(1)?, record(2)?)?)
}

/// Returns the initial state of the steady state: the state that is reached again after one period
/// of the force. The method is Newton's (shooting).
fn steady_start(
    system: &NonlinearSystem,
    force: &Record,
    fine: &FineForce,
    start: &InitialState,
) -> Result<InitialState, EstimateError> {
    let n = system.dof();
    let directions: Vec<Direction> = (0..2 * n).map(Direction::Initial).collect();
    let mut tangent = Tangent::new(system, &directions);
    let none = EstimateError::NoSteadyState { period: force.sampling().duration() };
    let mut state = DVector::from_iterator(
        2 * n,
        start.displacement().iter().chain(start.velocity().iter()).copied(),
    );
    for _ in 0..PREDICTION_SHOTS {
        let Some(course) = tangent.simulate(fine, &initial(&state)?) else { return Err(none) };
        let end = course.end.column(0).into_owned();
        let gap = &end - &state;
        let size = course.state.amax();
        if gap.amax() <= PREDICTION_CLOSED * size || size == 0.0 {
            return initial(&end);
        }
        let closing = DMatrix::identity(2 * n, 2 * n) - course.end.columns(1, 2 * n);
        // The state after one period is the next estimate if the matrix is singular or the step too
        // large.
        state = match closing.lu().solve(&gap) {
            Some(step) if step.iter().all(|s| s.is_finite()) && step.amax() <= size => state + step,
            _ => end,
        };
    }
    Err(none)
}

pub(super) fn initial(state: &DVector<f64>) -> Result<InitialState, EstimateError> {
    let n = state.len() / 2;
    Ok(InitialState::new(state.rows(0, n).into_owned(), state.rows(n, n).into_owned())?)
}

/// Returns the initial state with which [`predict`] fits the measured responses of an open record
/// best; the error of each channel is divided by the size of the channel.
///
/// Use only the first samples, over some time constants of the system: later samples do not depend
/// on the initial state.
///
/// # Errors
/// As [`predict`]; [`NumericsError::Size`](mechid_numerics::NumericsError::Size) or
/// [`EstimateError::Signal`] if the responses do not match the force,
/// [`EstimateError::NotConverged`].
///
/// # Source
/// As [`predict`], with section I.14 for the derivatives.
pub fn fitted_start(
    system: &NonlinearSystem,
    force: &Record,
    measured: &[(ResponseQuantity, &Record)],
) -> Result<InitialState, EstimateError> {
    let rule = mechid_model::Discretisation::FirstOrderHold;
    let linear = mechid_estimate::fitted_start(system.linear(), force, rule, measured)?;
    let fine = FineForce::sufficient(force, system, Extent::Open, &linear)?;
    let n = system.dof();
    let directions: Vec<Direction> = (0..2 * n).map(Direction::Initial).collect();
    let state = linear.displacement().iter().chain(linear.velocity().iter()).copied();
    let theta = DVector::from_iterator(2 * n, state);
    let mut problem =
        Start { system, directions: &directions, fine: &fine, measured, course: None };
    let minimum = minimise_residuals(&mut problem, theta, SEARCH_STEPS)
        .filter(|minimum| minimum.converged || time_limit::is_over());
    initial(&minimum.ok_or(EstimateError::NotConverged { searches: 1, steps: 0 })?.parameters)
}

/// Measured minus predicted response as a function of the initial state.
struct Start<'a> {
    system: &'a NonlinearSystem,
    directions: &'a [Direction],
    fine: &'a FineForce,
    measured: &'a [(ResponseQuantity, &'a Record)],
    course: Option<Course>,
}

impl Start<'_> {
    /// Returns, for each measured channel, the column of the state, the samples, and the reciprocal
    /// of the norm of the samples.
    fn channels(&self) -> impl Iterator<Item = (usize, &[f64], f64)> {
        let n = self.system.dof();
        self.measured.iter().flat_map(move |(kind, record)| {
            (0..n).map(move |dof| {
                let size = record.column(dof).norm();
                let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
                (kind.derivative_order() * n + dof, record.channel(dof), scale)
            })
        })
    }
}

impl Residuals for Start<'_> {
    fn len(&self) -> usize {
        self.channels().map(|(_, samples, _)| samples.len()).sum()
    }

    fn residual(&mut self, theta: &DVector<f64>, residual: &mut DVector<f64>) -> bool {
        let Ok(start) = initial(theta) else { return false };
        let course = Tangent::new(self.system, self.directions).simulate(self.fine, &start);
        let Some(course) = course else { return false };
        let mut at = 0;
        for (column, samples, scale) in self.channels() {
            for (k, measured) in samples.iter().enumerate() {
                residual[at + k] = scale * (measured - course.state[(k, column)]);
            }
            at += samples.len();
        }
        self.course = Some(course);
        true
    }

    fn jacobian(&self, jacobian: &mut DMatrix<f64>) {
        jacobian.fill(f64::NAN);
        let Some(course) = &self.course else { return };
        let mut at = 0;
        for (column, samples, scale) in self.channels() {
            for (d, derivative) in course.derivatives.iter().enumerate() {
                for k in 0..samples.len() {
                    jacobian[(at + k, d)] = -scale * derivative[(k, column)];
                }
            }
            at += samples.len();
        }
    }
}
