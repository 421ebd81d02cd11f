//! Predicted response of an identified machine, for validation on a record that was not fitted.

mod ahead;
mod periodic;
mod start;

pub use self::ahead::missing_force;
pub use self::periodic::predict_periodic;
pub use self::start::{StartFit, fitted_start};

use mechid_model::linear_algebra::singular_values;
use mechid_model::{Discretisation, InitialState, Response, SecondOrderSystem, StateTransition};
use mechid_signal::{Extent, Record};
use nalgebra::{DMatrix, DVector};

use crate::EstimateError;
use crate::least_squares::size;

/// Returns the part of the variation of each channel that a prediction explains, in per cent:
/// 100 (1 − ‖y − ŷ‖ / ‖y − ȳ‖). 100 is perfect, 0 no better than the mean, negative worse.
///
/// # Errors
/// [`EstimateError::Signal`] or [`EstimateError::Size`] if the records do not belong together.
///
/// # Source
/// Ljung, *System Identification: Theory for the User*, 2nd ed. (1999), chapter 16 (fit).
pub fn fit_percent(measured: &Record, predicted: &Record) -> Result<Vec<f64>, EstimateError> {
    measured.check_same_sampling(predicted)?;
    size("channels of the prediction", measured.channels(), predicted.channels())?;
    let around_mean = measured.without_mean();
    let gap = measured.data() - predicted.data();
    let norms = gap.column_iter().zip(around_mean.data().column_iter());
    Ok(norms.map(|(gap, own)| 100.0 * (1.0 - gap.norm() / own.norm())).collect())
}

/// Displacement and velocity of a machine under a sampled force (N), from `start` for an open
/// record, in the steady state for a whole period (`start` is not used then).
///
/// The force between samples is what the discretisation says; Euler's is taken as held. The
/// acceleration is the one of the equation of motion.
///
/// # Errors
/// [`EstimateError::Size`] for a wrong number of channels, [`EstimateError::NoSteadyState`] if
/// the machine has none with this period, [`EstimateError::Signal`] if an unstable motion
/// overflows.
///
/// # Source
/// Van Loan (1978), IEEE Trans. Automatic Control 23, 395–404 (the exact step); Åström &
/// Wittenmark, *Computer-Controlled Systems*, 3rd ed. (1997), chapter 2.
pub fn predict(
    system: &SecondOrderSystem,
    force: &Record,
    discretisation: Discretisation,
    extent: Extent,
    start: &InitialState,
) -> Result<Response, EstimateError> {
    size("channels of the force", system.dof(), force.channels())?;
    size("degrees of freedom of the initial state", system.dof(), start.dof())?;
    let step = Step::new(system, force.sampling().dt(), discretisation)?;
    let n = system.dof();
    let mut state = DVector::zeros(2 * n);
    match extent {
        Extent::Open => {
            state.rows_mut(0, n).copy_from(start.displacement());
            state.rows_mut(n, n).copy_from(&(start.velocity() * step.dt));
        }
        Extent::WholePeriod => state = step.steady_state(force)?,
    }
    let states = step.run(force, state).0;
    let displacement = states.columns(0, n).into_owned();
    let velocity = states.columns(n, n) / step.dt;
    let loads = force.data()
        - &velocity * system.damping().transpose()
        - &displacement * system.stiffness().transpose();
    let acceleration = solve_mass(system, &loads.transpose()).transpose();
    let record = |data| Record::new(force.sampling(), data);
    Ok(Response::new(record(displacement)?, record(velocity)?, record(acceleration)?)?)
}

/// z⁺ = Φ z + Γ₀ F + Γ₁ F⁺ on the state (x, Δt ẋ).
struct Step {
    dt: f64,
    transition: DMatrix<f64>,
    now: DMatrix<f64>,
    next: DMatrix<f64>,
}

impl Step {
    fn new(
        system: &SecondOrderSystem,
        dt: f64,
        discretisation: Discretisation,
    ) -> Result<Self, EstimateError> {
        let input = StateTransition::force_input(system, dt);
        let StateTransition { state: transition, held, ramp } =
            StateTransition::exact(system, dt, &input)?;
        Ok(match discretisation {
            Discretisation::FirstOrderHold => {
                Self { dt, transition, now: held - &ramp, next: ramp }
            }
            Discretisation::Euler | Discretisation::ZeroOrderHold => {
                Self { dt, transition, now: held, next: ramp * 0.0 }
            }
        })
    }

    /// States at the samples (samples × 2n), and one step after the last.
    fn run(&self, force: &Record, mut state: DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let (samples, loads) = (force.len(), force.data().transpose());
        let mut states = DMatrix::zeros(state.len(), samples);
        let mut next = state.clone();
        for k in 0..samples {
            states.set_column(k, &state);
            self.advance(&loads, k, &state, &mut next);
            std::mem::swap(&mut state, &mut next);
        }
        (states.transpose(), state)
    }

    /// From the state at a column of the loads to the next; the first column follows the last.
    fn advance(
        &self,
        loads: &DMatrix<f64>,
        at: usize,
        state: &DVector<f64>,
        next: &mut DVector<f64>,
    ) {
        next.gemv(1.0, &self.transition, state, 0.0);
        next.gemv(1.0, &self.now, &loads.column(at), 1.0);
        next.gemv(1.0, &self.next, &loads.column((at + 1) % loads.ncols()), 1.0);
    }

    /// The state that returns after the period: (I − Φᴺ) z = what rest leads to.
    fn steady_state(&self, force: &Record) -> Result<DVector<f64>, EstimateError> {
        let size = self.transition.nrows();
        let (_, from_rest) = self.run(force, DVector::zeros(size));
        let over = self.transition.pow(u32::try_from(force.len()).unwrap_or(u32::MAX));
        let growth = over.norm();
        let closing = DMatrix::identity(size, size) - over;
        let period = force.sampling().duration();
        let resolved = growth.is_finite() && {
            let smallest = singular_values(closing.clone())?.min();
            smallest > 4.0 * f64::EPSILON * force.len() as f64 * (1.0 + growth)
        };
        let state = if resolved { closing.lu().solve(&from_rest) } else { None };
        state.ok_or(EstimateError::NoSteadyState { period })
    }
}

fn solve_mass(system: &SecondOrderSystem, right: &DMatrix<f64>) -> DMatrix<f64> {
    system.mass().clone().lu().solve(right).expect("the mass of a system is invertible")
}
