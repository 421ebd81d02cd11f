//! The periodic steady state, solved for instead of waited for.

use mechid_model::{Response, SecondOrderSystem};
use mechid_signal::Sampling;
use nalgebra::{DMatrix, DVector, Dyn, LU};

use crate::driver::Sampled;
use crate::force::ForceTable;
use crate::run::{Motion, Run};
use crate::transition::Transition;
use crate::{IntegrateError, SampledForce, Scheme};

/// The response that repeats with the force, whose samples are one period (samples × n, in N).
///
/// Over one period the scheme is an affine map of its own state, z_N = Φ z_0 + g. The state that
/// repeats solves (I − Φ) z_0 = g; g comes from one pass from rest, the response from a second one.
/// So it costs about two passes, plus the powers of a small matrix, however light the damping.
/// Where it does not close to rounding, the gap is taken through the same solve once more.
///
/// # Errors
/// Those of [`integrate`](crate::integrate()), and [`IntegrateError::NoPeriodicState`] if the free
/// motion repeats too: a rigid body, or a scheme that sees an undamped mode exactly on a line.
///
/// # Source
/// Nayfeh & Balachandran, *Applied Nonlinear Dynamics* (1995), on shooting for periodic solutions;
/// of a linear system the first step of it is exact.
pub fn integrate_periodic<'a>(
    scheme: &dyn Scheme,
    system: &SecondOrderSystem,
    force: impl Into<SampledForce<'a>>,
) -> Result<Response, IntegrateError> {
    let table = ForceTable::periodic(scheme, system.dof(), force.into())?;
    let (samples, dof) = (table.sampling().len(), system.dof());
    let mut stepper = scheme.prepare(system, table.sampling().dt())?;
    let period = Period::of(&Transition::of(stepper.as_mut()), table.sampling())?;
    let mut run = Run::new(stepper, table.sampling().dt());
    let mut motion = Motion::zeros(samples, dof);
    run.advance(&table, 0, samples, &mut motion);
    let scale = period.norm(&run.state);
    let mut start = period.repeat(&run.state);
    let mut gap_before = f64::INFINITY;
    // The first pass yields the answer; more only where rounding over the period leaves a gap.
    for _ in 0..4 {
        run.state.copy_from_slice(&start);
        motion.set(0, &start);
        run.advance(&table, 0, samples, &mut motion);
        let gap: Vec<f64> = run.state.iter().zip(&start).map(|(end, begin)| end - begin).collect();
        let size = period.norm(&gap) / scale.max(period.norm(&start));
        if size <= 4.0 * f64::EPSILON || size > 0.1 * gap_before || !size.is_finite() {
            break;
        }
        gap_before = size;
        start.iter_mut().zip(period.repeat(&gap)).for_each(|(z, dz)| *z += dz);
    }
    motion.into_response(&table)
}

/// As [`integrate_periodic`] for a force given as a function of time with the period of
/// `sampling`; `force(t, f)` writes the n components at t (s) into `f` (N).
///
/// # Errors
/// Those of [`integrate_periodic`]; [`IntegrateError::NotFinite`] if the function yields a NaN or
/// infinity.
pub fn integrate_periodic_function(
    scheme: &dyn Scheme,
    system: &SecondOrderSystem,
    sampling: Sampling,
    mut force: impl FnMut(f64, &mut [f64]),
) -> Result<Response, IntegrateError> {
    let sampled = Sampled::of(scheme, system.dof(), sampling, &mut force)?;
    integrate_periodic(scheme, system, sampled.force())
}

/// I − Φ, factored in balanced coordinates.
struct Period {
    factored: LU<f64, Dyn, Dyn>,
    /// z = `scales` ∘ (balanced z): makes the numbers comparable, whatever the units.
    scales: DVector<f64>,
}

impl Period {
    fn of(transition: &Transition, sampling: Sampling) -> Result<Self, IntegrateError> {
        let mut change = transition.change.clone();
        let scales = Transition::balance(&mut change).ok_or(IntegrateError::NoPeriodicState {
            period: sampling.duration(),
            reciprocal_condition: 0.0,
            rounding: f64::EPSILON,
        })?;
        let steps = sampling.len();
        let over_period = -power_less_identity(&change, steps);
        // Each step's matrix is known to ε of its change, each product to ε of its result.
        let rounding = f64::EPSILON
            * (steps as f64 * change.norm() + f64::from(steps.ilog2() + 1) * over_period.norm());
        let factored = over_period.clone().lu();
        let smallest = smallest_singular_value(&over_period, &factored);
        if !(smallest > 4.0 * rounding && rounding.is_finite()) {
            return Err(IntegrateError::NoPeriodicState {
                period: sampling.duration(),
                reciprocal_condition: smallest / over_period.norm().max(1.0),
                rounding: 4.0 * rounding / over_period.norm().max(1.0),
            });
        }
        Ok(Self { factored, scales })
    }

    /// The state that g = `gained` over one period from rest repeats from.
    fn repeat(&self, gained: &[f64]) -> Vec<f64> {
        let mut rhs = DVector::from_column_slice(gained).component_div(&self.scales);
        self.factored.solve_mut(&mut rhs);
        rhs.component_mul(&self.scales).as_slice().to_vec()
    }

    /// Largest balanced entry.
    fn norm(&self, state: &[f64]) -> f64 {
        state.iter().zip(&self.scales).fold(0.0, |most, (z, s)| f64::max(most, (z / s).abs()))
    }
}

/// (I + D)^`exponent` − I by repeated squaring, never forming I + D, which would lose digits.
fn power_less_identity(change: &DMatrix<f64>, exponent: usize) -> DMatrix<f64> {
    let mut power = DMatrix::zeros(change.nrows(), change.ncols());
    let mut square = change.clone();
    let mut left = exponent;
    loop {
        if left & 1 == 1 {
            power = &power + &square + &power * &square;
        }
        left >>= 1;
        if left == 0 {
            return power;
        }
        square = 2.0 * &square + &square * &square;
    }
}

/// By inverse iteration on the normal matrix; 0 if the factorisation has a zero pivot.
fn smallest_singular_value(matrix: &DMatrix<f64>, factored: &LU<f64, Dyn, Dyn>) -> f64 {
    let transposed = matrix.transpose().lu();
    if !(factored.is_invertible() && transposed.is_invertible()) {
        return 0.0;
    }
    let mut direction = DVector::from_fn(matrix.nrows(), |i, _| 1.0 + 0.37 * (i % 5) as f64);
    let mut smallest = f64::INFINITY;
    // A handful settles the order of magnitude, which is all that is asked for.
    for _ in 0..6 {
        direction.normalize_mut();
        transposed.solve_mut(&mut direction);
        factored.solve_mut(&mut direction);
        smallest = direction.norm().sqrt().recip();
    }
    smallest
}
