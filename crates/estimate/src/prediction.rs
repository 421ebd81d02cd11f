//! Predicted response of an identified machine, for validation on a record that was not fitted.

mod ahead;
mod initial_state;
mod periodic;

use mechid_model::{Discretisation, InitialState, Response, SecondOrderSystem, StateTransition};
use mechid_numerics::check_size;
use mechid_numerics::linear_algebra::singular_values;
use mechid_signal::{Extent, Record};
use nalgebra::{DMatrix, DVector};

pub use self::ahead::missing_force;
pub use self::initial_state::{StartFit, fitted_start};
pub use self::periodic::predict_periodic;
use crate::EstimateError;

/// Returns the fit of a prediction to each channel, in per cent: 100 (1 − ‖y − ŷ‖ / ‖y − ȳ‖). A fit
/// of 100 is perfect; with 0 the prediction is as good as the mean ȳ, and with a negative fit it is
/// worse.
///
/// # Errors
/// [`EstimateError::Signal`] or [`NumericsError::Size`](mechid_numerics::NumericsError::Size) if
/// the records do not belong together.
///
/// # Source
/// Ljung, *System Identification: Theory for the User*, 2nd ed. (1999), chapter 16 (fit).
pub fn fit_percent(measured: &Record, predicted: &Record) -> Result<Vec<f64>, EstimateError> {
    measured.check_same_sampling(predicted)?;
    check_size("channels of the prediction", measured.channels(), predicted.channels())?;
    let around_mean = measured.without_mean();
    let gap = measured.data() - predicted.data();
    let norms = gap.column_iter().zip(around_mean.data().column_iter());
    Ok(norms.map(|(gap, motion)| 100.0 * (1.0 - gap.norm() / motion.norm())).collect())
}

/// Predicts the response of a machine to a sampled force (N). An open record begins at the initial
/// state `start`; for a whole period `start` is ignored, and the response is the steady state.
///
/// The discretisation defines the force between samples; for Euler's rule the force is held. The
/// acceleration follows from the equation of motion.
///
/// # Errors
/// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) for a wrong number of channels,
/// [`EstimateError::NoSteadyState`] if the machine has no steady state with this period,
/// [`EstimateError::Signal`] if an unstable motion overflows.
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
    check_size("channels of the force", system.dof(), force.channels())?;
    check_size("degrees of freedom of the initial state", system.dof(), start.dof())?;
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
    let [x, v, a] = step.responses(system, force, &state);
    let record = |data| Record::new(force.sampling(), data);
    Ok(Response::new(record(x)?, record(v)?, record(a)?)?)
}

/// Time step z⁺ = Φ z + Γ₀ F + Γ₁ F⁺ of the state (x, Δt ẋ).
struct Step {
    dt: f64,
    transition: DMatrix<f64>,
    /// Rows of the matrix \[Φ Γ₀ Γ₁\], which is multiplied by (z, F, F⁺).
    rows: Vec<f64>,
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
        let (now, next) = match discretisation {
            Discretisation::FirstOrderHold => (held - &ramp, ramp),
            Discretisation::Euler | Discretisation::ZeroOrderHold => (held, ramp * 0.0),
        };
        let beside = [&transition, &now, &next];
        let of_row = |row: usize| beside.into_iter().flat_map(move |matrix| matrix.row(row));
        let rows = (0..transition.nrows()).flat_map(|row| of_row(row).copied()).collect();
        Ok(Self { dt, transition, rows })
    }

    /// Returns displacement, velocity and acceleration at the samples, each samples × n, in one
    /// pass.
    fn responses(
        &self,
        system: &SecondOrderSystem,
        force: &Record,
        start: &DVector<f64>,
    ) -> [DMatrix<f64>; 3] {
        let (samples, n, loads) = (force.len(), system.dof(), force.data());
        let mut predicted = [(); 3].map(|()| DMatrix::zeros(samples, n));
        let [x, v, a] = &mut predicted;
        let (damping, stiffness) = (system.damping(), system.stiffness());
        let mass = system.mass().clone().lu();
        let (mut velocity, mut inertia) = (vec![0.0; n], DVector::zeros(n));
        let mut at = At::new(start.as_slice());
        for k in 0..samples {
            let (displacement, scaled) = at.state().split_at(n);
            for (velocity, scaled) in velocity.iter_mut().zip(scaled) {
                *velocity = scaled / self.dt;
            }
            for (i, inertia) in inertia.iter_mut().enumerate() {
                *inertia = loads[(k, i)]
                    - sum_of_products(damping.row(i).iter(), &velocity)
                    - sum_of_products(stiffness.row(i).iter(), displacement);
            }
            if n == 1 {
                inertia[0] /= system.mass()[0];
            } else {
                assert!(mass.solve_mut(&mut inertia), "the mass of a system is invertible");
            }
            for (dof, (displacement, velocity)) in displacement.iter().zip(&velocity).enumerate() {
                (x[(k, dof)], v[(k, dof)]) = (*displacement, *velocity);
                a[(k, dof)] = inertia[dof];
            }
            self.advance(force, k, &mut at);
        }
        predicted
    }

    /// Returns the state one step after the last sample.
    fn run(&self, force: &Record, start: &DVector<f64>) -> DVector<f64> {
        let mut at = At::new(start.as_slice());
        for k in 0..force.len() {
            self.advance(force, k, &mut at);
        }
        DVector::from_column_slice(at.state())
    }

    /// Advances the state by one step from a sample of the force; after its last sample, the force
    /// continues with its first sample.
    fn advance(&self, force: &Record, sample: usize, at: &mut At) {
        let (loads, next) = (force.data(), (sample + 1) % force.len());
        let size = at.next.len();
        let (now, later) = at.now[size..].split_at_mut(loads.ncols());
        for (dof, (now, later)) in now.iter_mut().zip(later).enumerate() {
            (*now, *later) = (loads[(sample, dof)], loads[(next, dof)]);
        }
        for (next, row) in at.next.iter_mut().zip(self.rows.chunks_exact(at.now.len())) {
            *next = sum_of_products(row.iter(), &at.now);
        }
        at.now[..size].copy_from_slice(&at.next);
    }

    /// Returns the initial state z of the periodic response: (I − Φᴺ) z equals the state after one
    /// period that began at rest.
    fn steady_state(&self, force: &Record) -> Result<DVector<f64>, EstimateError> {
        let size = self.transition.nrows();
        let from_rest = self.run(force, &DVector::zeros(size));
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

/// Buffers of a step: its input (z, F, F⁺) and the next state.
struct At {
    now: Vec<f64>,
    next: Vec<f64>,
}

impl At {
    fn new(state: &[f64]) -> Self {
        let mut now = state.to_vec();
        now.resize(2 * state.len(), 0.0);
        Self { now, next: state.to_vec() }
    }

    fn state(&self) -> &[f64] {
        &self.now[..self.next.len()]
    }

    fn set_state(&mut self, values: impl Iterator<Item = f64>) {
        self.now[..self.next.len()].iter_mut().zip(values).for_each(|(z, value)| *z = value);
    }
}

/// Returns Σ a_j b_j, summed from the first term to the last.
fn sum_of_products<'a>(a: impl Iterator<Item = &'a f64>, b: &[f64]) -> f64 {
    a.zip(b).map(|(a, b)| a * b).reduce(|sum, term| sum + term).unwrap_or(0.0)
}
