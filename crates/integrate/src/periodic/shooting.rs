//! The map of a scheme over one period of the force, computed step by step.

use mechid_model::{InitialState, Response};
use nalgebra::DVector;

use crate::error::IntegrateError;
use crate::limits;
use crate::schemes::scheme::Scheme;
use crate::stepping::sampled_force::ForceTable;
use crate::stepping::simulation::{Motion, Simulation};
use crate::system::System;

/// The map of a scheme over one period of the force.
pub(crate) struct Shooting<'a> {
    simulation: Simulation,
    table: ForceTable<'a>,
    dof: usize,
    /// Scales of the entries of a state: the largest displacement for displacements, and so on.
    pub(crate) scales: DVector<f64>,
}

impl<'a> Shooting<'a> {
    /// Prepares the scheme, with all scales equal to 1.
    pub(crate) fn new(
        scheme: &dyn Scheme,
        system: &dyn System,
        table: ForceTable<'a>,
    ) -> Result<Self, IntegrateError> {
        let mut simulation = Simulation::new(scheme, system, table.sampling().dt())?;
        let scales = DVector::from_element(simulation.stepper().state_len(), 1.0);
        Ok(Self { simulation, table, dof: system.dof(), scales })
    }

    fn samples(&self) -> usize {
        self.table.sampling().len()
    }

    /// Period of the force, in s.
    pub(crate) fn period(&self) -> f64 {
        self.table.sampling().duration()
    }

    /// Returns the maximum number of vectors of a Krylov space.
    pub(crate) fn most_vectors(&self) -> usize {
        let bytes = 8 * self.scales.len();
        (limits::SEARCH_BYTES / bytes).clamp(2, limits::SEARCH_VECTORS)
    }

    /// Starts from `guess`, simulates `settling` periods, and returns the state after them; one
    /// more pass sets the scales.
    pub(crate) fn settle(
        &mut self,
        guess: &InitialState,
        settling: usize,
    ) -> Result<DVector<f64>, IntegrateError> {
        let first = self.simulation.stepper().first();
        let mut motions = vec![vec![0.0; 3 * self.dof]; first + 1];
        self.simulation.start(guess, &self.table.early(first), &mut motions)?;
        let mut state = DVector::from_column_slice(&self.simulation.state);
        // The remaining steps of the first period lead to the first sample of the next period.
        if first > 0 {
            state = self.pass(&state, first % self.samples())?;
        }
        for _ in 0..settling {
            state = self.pass(&state, 0)?;
        }
        self.measure(&state)?;
        Ok(state)
    }

    /// Sets the scales from a pass that begins in `state`: the largest displacement, velocity and
    /// acceleration (and the scheme's memory), or 1 without motion. Returns the state at the end.
    pub(crate) fn measure(&mut self, state: &DVector<f64>) -> Result<DVector<f64>, IntegrateError> {
        let dof = self.dof;
        let mut sizes = vec![0.0_f64; state.len().div_ceil(dof)];
        self.simulation.restart(state.as_slice());
        for k in 0..self.samples() {
            self.simulation.step(&self.table, k)?;
            for (size, part) in sizes.iter_mut().zip(self.simulation.state.chunks(dof)) {
                *size = part.iter().fold(*size, |most, z| most.max(z.abs()));
            }
        }
        let size = |part: usize| if sizes[part] > 0.0 { sizes[part] } else { 1.0 };
        self.scales = DVector::from_fn(state.len(), |i, _| size(i / dof));
        Ok(DVector::from_column_slice(&self.simulation.state))
    }

    /// Returns the state at the end of the period, from `state` at sample `from`.
    pub(crate) fn pass(
        &mut self,
        state: &DVector<f64>,
        from: usize,
    ) -> Result<DVector<f64>, IntegrateError> {
        self.simulation.restart(state.as_slice());
        for k in from..self.samples() {
            self.simulation.step(&self.table, k)?;
        }
        Ok(DVector::from_column_slice(&self.simulation.state))
    }

    /// Takes only the last step of a period, from a state of zero, and returns the state after this
    /// step.
    pub(crate) fn state_after_last_step_from_rest(
        &mut self,
    ) -> Result<DVector<f64>, IntegrateError> {
        self.simulation.step(&self.table, self.samples() - 1)?;
        Ok(DVector::from_column_slice(&self.simulation.state))
    }

    /// Returns the change of the state over a period, relative to the scales.
    pub(crate) fn gap(&mut self, state: &DVector<f64>) -> Result<DVector<f64>, IntegrateError> {
        let end = self.pass(state, 0)?;
        Ok((end - state).component_div(&self.scales))
    }

    /// Returns the largest modulus of the entries of a gap, or NaN if an entry is NaN.
    pub(crate) fn largest_modulus(gap: &DVector<f64>) -> f64 {
        // `amax` would ignore NaN.
        gap.iter().fold(0.0, |most, r| if r.abs() <= most { most } else { r.abs() })
    }

    /// Writes the change of the state at the end of the period for a small change of the state at
    /// the beginning along `direction`, per unit of this change, into `derivative`. Both states are
    /// relative to the scales.
    pub(crate) fn derivative(
        &mut self,
        state: &DVector<f64>,
        direction: &[f64],
        derivative: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let largest = direction.iter().fold(0.0, |most: f64, d| most.max(d.abs()));
        let by = limits::SHOOTING_DIFFERENCE / largest;
        let direction = DVector::from_column_slice(direction).component_mul(&self.scales);
        let ahead = self.pass(&(state + &direction * by), 0)?;
        let difference = ahead - self.pass(&(state - &direction * by), 0)?;
        let column = difference.component_div(&self.scales) / (2.0 * by);
        derivative.copy_from_slice(column.as_slice());
        Ok(())
    }

    /// Writes the state at the end of a period without force into `end`; `state` is the state at
    /// the beginning, and both are relative to the scales. For a linear system, this map is also
    /// the derivative of the state over a period under any force.
    pub(crate) fn free(&mut self, state: &[f64], end: &mut [f64]) -> Result<(), IntegrateError> {
        let begin = DVector::from_column_slice(state).component_mul(&self.scales);
        self.simulation.restart(begin.as_slice());
        for _ in 0..self.samples() {
            self.simulation.free_step()?;
        }
        let values = self.simulation.state.iter().zip(&self.scales);
        end.iter_mut().zip(values).for_each(|(end, (z, scale))| *end = z / scale);
        Ok(())
    }

    /// Returns the response that begins in `state`, written into `motion`, which has one sample for
    /// each sample of a period.
    pub(crate) fn response(
        mut self,
        state: &DVector<f64>,
        mut motion: Motion<'_>,
    ) -> Result<Response, IntegrateError> {
        self.simulation.restart(state.as_slice());
        motion.set(0, state.as_slice());
        self.simulation.advance(&self.table, 0, self.samples(), &mut motion)?;
        motion.into_response(&self.table)
    }
}
