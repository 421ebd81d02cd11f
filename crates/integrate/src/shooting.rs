//! The map of a scheme over one period of the force, by its steps alone.

use mechid_model::{InitialState, Response};
use nalgebra::DVector;

use crate::force::ForceTable;
use crate::run::{Motion, Run};
use crate::{IntegrateError, Scheme, System};

/// Part of the largest displacement, velocity or acceleration that the state is moved by to form a
/// derivative: central differences, whose error is its square.
pub(crate) const DIFFERENCE: f64 = 1e-5;

/// Memory that the vectors of a search may take, in bytes.
const SEARCH_BYTES: usize = 1 << 30;

/// Number of vectors of a search in which no more are worth their passes over the period.
const MOST_VECTORS: usize = 1000;

/// The map of a scheme over one period of the force.
pub(crate) struct Shooting<'a> {
    run: Run,
    table: ForceTable<'a>,
    dof: usize,
    /// Sizes of the numbers of a state: the largest displacement for displacements, and so on.
    pub(crate) scales: DVector<f64>,
}

impl<'a> Shooting<'a> {
    /// Prepares the scheme; nothing is known of the sizes.
    pub(crate) fn new(
        scheme: &dyn Scheme,
        system: &dyn System,
        table: ForceTable<'a>,
    ) -> Result<Self, IntegrateError> {
        let mut run = Run::new(scheme, system, table.sampling().dt())?;
        let scales = DVector::from_element(run.stepper().state_len(), 1.0);
        Ok(Self { run, table, dof: system.dof(), scales })
    }

    fn samples(&self) -> usize {
        self.table.sampling().len()
    }

    /// Period of the force, in s.
    pub(crate) fn period(&self) -> f64 {
        self.table.sampling().duration()
    }

    /// Number of vectors that a search may keep.
    pub(crate) fn most_vectors(&self) -> usize {
        let each = 8 * self.scales.len();
        (SEARCH_BYTES / each).clamp(2, MOST_VECTORS)
    }

    /// The state after the start from `guess` and `settling` periods; the scales come from the last
    /// of them.
    pub(crate) fn settle(
        &mut self,
        guess: &InitialState,
        settling: usize,
    ) -> Result<DVector<f64>, IntegrateError> {
        let first = self.run.stepper().first();
        let mut motions = vec![vec![0.0; 3 * self.dof]; first + 1];
        self.run.start(guess, &self.table.early(first), &mut motions)?;
        let mut state = DVector::from_column_slice(&self.run.state);
        // What remains of the first period leads to the first sample of the next.
        if first > 0 {
            state = self.pass(&state, first % self.samples())?;
        }
        for _ in 0..settling {
            state = self.pass(&state, 0)?;
        }
        self.measure(&state)?;
        Ok(state)
    }

    /// Takes the scales from a pass that begins in `state`: the largest displacement, velocity and
    /// acceleration (and what the scheme remembers), 1 where nothing moves. Returns the state it ends in.
    pub(crate) fn measure(&mut self, state: &DVector<f64>) -> Result<DVector<f64>, IntegrateError> {
        let dof = self.dof;
        let mut sizes = vec![0.0_f64; state.len().div_ceil(dof)];
        self.run.restart(state.as_slice());
        for k in 0..self.samples() {
            self.run.step(&self.table, k)?;
            for (size, part) in sizes.iter_mut().zip(self.run.state.chunks(dof)) {
                *size = part.iter().fold(*size, |most, z| most.max(z.abs()));
            }
        }
        let size = |part: usize| if sizes[part] > 0.0 { sizes[part] } else { 1.0 };
        self.scales = DVector::from_fn(state.len(), |i, _| size(i / dof));
        Ok(DVector::from_column_slice(&self.run.state))
    }

    /// The state at the end of the period, from `state` at sample `from`.
    pub(crate) fn pass(
        &mut self,
        state: &DVector<f64>,
        from: usize,
    ) -> Result<DVector<f64>, IntegrateError> {
        self.run.restart(state.as_slice());
        for k in from..self.samples() {
            self.run.step(&self.table, k)?;
        }
        Ok(DVector::from_column_slice(&self.run.state))
    }

    /// The state that the last step of a period leaves of one at rest.
    pub(crate) fn last_step(&mut self) -> Result<DVector<f64>, IntegrateError> {
        self.run.step(&self.table, self.samples() - 1)?;
        Ok(DVector::from_column_slice(&self.run.state))
    }

    /// Change of the state in a period, in parts of the scales.
    pub(crate) fn gap(&mut self, state: &DVector<f64>) -> Result<DVector<f64>, IntegrateError> {
        let end = self.pass(state, 0)?;
        Ok((end - state).component_div(&self.scales))
    }

    /// Largest entry of a gap; NaN if one is.
    pub(crate) fn missed(gap: &DVector<f64>) -> f64 {
        // Not `amax`, which passes over NaN.
        gap.iter().fold(0.0, |most, r| if r.abs() <= most { most } else { r.abs() })
    }

    /// Derivative of the state at the end of the period in a direction of that at its beginning, both in
    /// parts of the scales.
    pub(crate) fn derivative(
        &mut self,
        state: &DVector<f64>,
        direction: &[f64],
        derivative: &mut [f64],
    ) -> Result<(), IntegrateError> {
        let largest = direction.iter().fold(0.0, |most: f64, d| most.max(d.abs()));
        let by = DIFFERENCE / largest;
        let direction = DVector::from_column_slice(direction).component_mul(&self.scales);
        let ahead = self.pass(&(state + &direction * by), 0)?;
        let difference = ahead - self.pass(&(state - &direction * by), 0)?;
        let column = difference.component_div(&self.scales) / (2.0 * by);
        derivative.copy_from_slice(column.as_slice());
        Ok(())
    }

    /// The state at the end of a period without force that begins in `state`, both in parts of the scales;
    /// of a linear system the derivative, whatever the force.
    pub(crate) fn free(&mut self, state: &[f64], end: &mut [f64]) -> Result<(), IntegrateError> {
        let begin = DVector::from_column_slice(state).component_mul(&self.scales);
        self.run.restart(begin.as_slice());
        for _ in 0..self.samples() {
            self.run.free_step()?;
        }
        let values = self.run.state.iter().zip(&self.scales);
        end.iter_mut().zip(values).for_each(|(end, (z, scale))| *end = z / scale);
        Ok(())
    }

    /// The response that begins in `state`, written into a `motion` of as many samples as a period has.
    pub(crate) fn response(
        mut self,
        state: &DVector<f64>,
        mut motion: Motion<'_>,
    ) -> Result<Response, IntegrateError> {
        self.run.restart(state.as_slice());
        motion.set(0, state.as_slice());
        self.run.advance(&self.table, 0, self.samples(), &mut motion)?;
        motion.into_response(&self.table)
    }
}
