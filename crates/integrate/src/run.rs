//! The stepping loop: the prepared stepper itself, or its transition at fixed size for few
//! degrees of freedom.

use mechid_model::{InitialState, Response};
use mechid_signal::{Record, SignalError};
use nalgebra::DMatrix;

use crate::force::ForceTable;
use crate::transition::Transition;
use crate::{IntegrateError, Loads, Stepper, System};

/// Displacement, velocity and acceleration, samples × observed degrees of freedom.
#[derive(Debug)]
pub(crate) struct Motion<'a> {
    parts: [DMatrix<f64>; 3],
    /// The degree of freedom of each column, if not all in their order.
    observed: Option<&'a [usize]>,
    dof: usize,
}

impl<'a> Motion<'a> {
    pub(crate) fn zeros(samples: usize, dof: usize) -> Self {
        Self { parts: [(); 3].map(|()| DMatrix::zeros(samples, dof)), observed: None, dof }
    }

    /// The same for some of the `dof` degrees of freedom.
    pub(crate) fn observed(samples: usize, dof: usize, observed: &'a [usize]) -> Self {
        Self { observed: Some(observed), dof, ..Self::zeros(samples, observed.len()) }
    }

    /// Writes the motion `[x, ẋ, ẍ]` of all degrees of freedom at sample `k`.
    pub(crate) fn set(&mut self, k: usize, motion: &[f64]) {
        for (part, values) in self.parts.iter_mut().zip(motion.chunks_exact(self.dof)) {
            match self.observed {
                None => values.iter().enumerate().for_each(|(c, value)| part[(k, c)] = *value),
                Some(observed) => {
                    observed.iter().enumerate().for_each(|(c, &at)| part[(k, c)] = values[at]);
                }
            }
        }
    }

    /// Samples `from .. from + len` of every column: n of x, n of ẋ, n of ẍ.
    fn columns(&mut self, from: usize, len: usize) -> Vec<&mut [f64]> {
        let rows = self.parts[0].nrows();
        let columns = self.parts.iter_mut().flat_map(|p| p.as_mut_slice().chunks_exact_mut(rows));
        columns.map(|c| &mut c[from..from + len]).collect()
    }

    /// The response on the time axis of `table`.
    pub(crate) fn into_response(self, table: &ForceTable<'_>) -> Result<Response, IntegrateError> {
        let dof = |channel: usize| self.observed.map_or(channel, |observed| observed[channel]);
        let record = |data| match Record::new(table.sampling(), data) {
            Err(SignalError::NotFinite { sample, channel, .. }) => {
                Err(IntegrateError::Overflow { sample, component: dof(channel) + 1 })
            }
            other => other.map_err(IntegrateError::from),
        };
        let [x, v, a] = self.parts;
        Ok(Response::new(record(x)?, record(v)?, record(a)?)?)
    }
}

/// A stepper on its way through a force, with all the memory the way needs.
pub(crate) struct Run {
    stepper: Box<dyn Stepper>,
    dt: f64,
    transition: Option<Transition>,
    pub(crate) state: Vec<f64>,
    change: Vec<f64>,
    /// Rounding errors kept from `state` so far.
    owed: Vec<f64>,
    /// The forces of the present step, by [`Instant`](crate::Instant).
    rows: [Vec<f64>; 4],
}

/// Numbers of the state that are computed between two messages about the progress.
const NUMBERS_PER_MESSAGE: usize = 1 << 20;

/// Number of degrees of freedom up to which a step is one small matrix product of fixed size.
const FIXED_SIZE_DOF: usize = 2;

impl Run {
    pub(crate) fn new(mut stepper: Box<dyn Stepper>, system: &dyn System, dt: f64) -> Self {
        let (n, len) = (stepper.dof(), stepper.state_len());
        let linear = system.nonlinear_forces().is_empty();
        let transition = (linear && n <= FIXED_SIZE_DOF)
            .then(|| Transition::of(stepper.as_mut()))
            .filter(|transition| resolves(transition, dt, n));
        let rows = [(); 4].map(|()| vec![0.0; n]);
        let [state, change, owed] = [(); 3].map(|()| vec![0.0; len]);
        Self { stepper, dt, transition, state, change, owed, rows }
    }

    /// Starts the stepper and keeps the state it starts in.
    pub(crate) fn start(
        &mut self,
        initial: &InitialState,
        early: &[Vec<f64>],
        motions: &mut [Vec<f64>],
    ) -> Result<(), IntegrateError> {
        self.stepper.start(initial, early, motions, &mut self.state)
    }

    /// Goes on from `state`.
    pub(crate) fn restart(&mut self, state: &[f64]) {
        self.state.copy_from_slice(state);
        self.owed.fill(0.0);
    }

    pub(crate) fn stepper(&mut self) -> &mut dyn Stepper {
        self.stepper.as_mut()
    }

    /// Takes steps `from .. to`, writing the motion at samples `from + 1 ..= to` as far as
    /// `motion` has them.
    pub(crate) fn advance(
        &mut self,
        table: &ForceTable<'_>,
        from: usize,
        to: usize,
        motion: &mut Motion<'_>,
    ) -> Result<(), IntegrateError> {
        let done = self.advance_fixed(table, from, to, motion);
        let steps_per_message = (NUMBERS_PER_MESSAGE / self.state.len()).max(1);
        for k in done..to {
            if k % steps_per_message == 0 {
                log::trace!("step {k} of {to}");
            }
            self.step(table, k)?;
            if k + 1 < motion.parts[0].nrows() {
                motion.set(k + 1, &self.state);
            }
        }
        Ok(())
    }

    /// One step through the stepper itself, from sample `k`.
    ///
    /// The sum is compensated: what a small step adds to a large state keeps its digits.
    ///
    /// # Source
    /// Higham, *Accuracy and Stability of Numerical Algorithms* (2002), section 4.3.
    pub(crate) fn step(&mut self, table: &ForceTable<'_>, k: usize) -> Result<(), IntegrateError> {
        for &instant in self.stepper.instants() {
            table.load(instant, k, &mut self.rows[instant as usize]);
        }
        let [now, middle, next, beyond] = &self.rows;
        let loads = Loads { time: k as f64 * self.dt, now, middle, next, beyond };
        self.stepper.change(&self.state, &loads, &mut self.change)?;
        for ((z, dz), owed) in self.state.iter_mut().zip(&self.change).zip(&mut self.owed) {
            let add = dz + *owed;
            let sum = *z + add;
            *owed = add - (sum - *z);
            *z = sum;
        }
        Ok(())
    }

    /// Takes as many steps as it can at fixed size; returns the step to go on with.
    fn advance_fixed(
        &mut self,
        table: &ForceTable<'_>,
        from: usize,
        to: usize,
        motion: &mut Motion<'_>,
    ) -> usize {
        let Some(transition) = &self.transition else { return from };
        if !table.is_complete() || motion.observed.is_some() {
            return from;
        }
        let n = table.dof();
        let mut streams = Vec::with_capacity(4);
        for (instant, _) in &transition.loads {
            streams.extend((0..n).map(|c| table.stream(*instant, from, c)));
        }
        let steps = streams.iter().map(|s| s.len()).min().unwrap_or(0).min(to - from);
        let steps = steps.min((motion.parts[0].nrows() - 1).saturating_sub(from));
        if steps == 0 {
            return from;
        }
        let mut columns = motion.columns(from + 1, steps);
        let state = &mut self.state;
        match (state.len(), streams.len(), n) {
            (3, 1, 1) => fixed::<3, 1, 3>(transition, state, &streams, &mut columns, steps),
            (3, 2, 1) => fixed::<3, 2, 3>(transition, state, &streams, &mut columns, steps),
            (4, 2, 1) => fixed::<4, 2, 3>(transition, state, &streams, &mut columns, steps),
            (4, 1, 1) => fixed::<4, 1, 3>(transition, state, &streams, &mut columns, steps),
            (6, 2, 2) => fixed::<6, 2, 6>(transition, state, &streams, &mut columns, steps),
            (6, 4, 2) => fixed::<6, 4, 6>(transition, state, &streams, &mut columns, steps),
            (8, 4, 2) => fixed::<8, 4, 6>(transition, state, &streams, &mut columns, steps),
            (8, 2, 2) => fixed::<8, 2, 6>(transition, state, &streams, &mut columns, steps),
            _ => return from,
        }
        from + steps
    }
}

/// Returns whether the step is small against every period, (ωΔt)² below about 1.
///
/// The entries of D are rounded, each once and for all, and of the order of (ωΔt)²: beyond that
/// limit a motion without damping would grow or decay by up to ε in every step. The stepper rounds
/// anew each time and keeps the energy.
fn resolves(transition: &Transition, dt: f64, n: usize) -> bool {
    (0..n).all(|i| (dt * transition.change[(n + i, i)]).abs() <= 1.0)
}

/// `steps` steps z += D z + B w of a state of `S` numbers under `W` loads, the first `O` numbers of
/// the state being stored.
fn fixed<const S: usize, const W: usize, const O: usize>(
    transition: &Transition,
    state: &mut [f64],
    streams: &[&[f64]],
    columns: &mut [&mut [f64]],
    steps: usize,
) {
    let d: [[f64; S]; S] =
        std::array::from_fn(|j| std::array::from_fn(|i| transition.change[(i, j)]));
    let n = W / transition.loads.len();
    let b: [[f64; S]; W] =
        std::array::from_fn(|j| std::array::from_fn(|i| transition.loads[j / n].1[(i, j % n)]));
    let mut z: [f64; S] = std::array::from_fn(|i| state[i]);
    let streams: [&[f64]; W] = std::array::from_fn(|j| &streams[j][..steps]);
    for k in 0..steps {
        let mut even = [0.0; S];
        let mut odd = z;
        for (b, w) in b.iter().zip(&streams) {
            let w = w[k];
            (0..S).for_each(|i| even[i] += b[i] * w);
        }
        for j in (0..S).step_by(2) {
            (0..S).for_each(|i| even[i] += d[j][i] * z[j]);
        }
        for j in (1..S).step_by(2) {
            (0..S).for_each(|i| odd[i] += d[j][i] * z[j]);
        }
        (0..S).for_each(|i| z[i] = odd[i] + even[i]);
        for (column, value) in columns[..O].iter_mut().zip(&z) {
            column[k] = *value;
        }
    }
    state.copy_from_slice(&z);
}
