//! The simulation: the prepared stepper itself, or its transition in matrices of fixed size for few
//! degrees of freedom.

use mechid_model::{InitialState, Response};
use mechid_signal::{Record, SignalError};
use nalgebra::DMatrix;

use crate::error::IntegrateError;
use crate::limits;
use crate::schemes::scheme::Scheme;
use crate::stepping::collocations::Collocations;
use crate::stepping::fixed_size::FixedSize;
use crate::stepping::sampled_force::ForceTable;
use crate::stepping::stepper::{Loads, Stepper};
use crate::system::System;

/// Displacement, velocity and acceleration, or displacement alone: samples × observed degrees of
/// freedom.
#[derive(Debug)]
pub(crate) struct Motion<'a> {
    parts: Vec<DMatrix<f64>>,
    /// Degree of freedom of each column; `None` if column i belongs to degree of freedom i.
    observed: Option<&'a [usize]>,
    dof: usize,
    /// True if all values are known to be finite.
    finite: bool,
}

impl<'a> Motion<'a> {
    pub(crate) fn zeros(samples: usize, dof: usize) -> Self {
        Self::with_parts(3, samples, dof)
    }

    /// Creates a motion that stores only the displacement.
    pub(crate) fn displacement(samples: usize, dof: usize) -> Self {
        Self::with_parts(1, samples, dof)
    }

    /// Creates the motion of some of the `dof` degrees of freedom.
    pub(crate) fn observed(samples: usize, dof: usize, observed: &'a [usize]) -> Self {
        Self { observed: Some(observed), dof, ..Self::zeros(samples, observed.len()) }
    }

    /// Creates a motion of zeros. The operating system supplies pages of zeros without writing
    /// them, so only the steps write to this memory.
    fn with_parts(parts: usize, samples: usize, dof: usize) -> Self {
        let part = |_| DMatrix::from_vec(samples, dof, vec![0.0; samples * dof]);
        Self { parts: (0..parts).map(part).collect(), observed: None, dof, finite: false }
    }

    /// Writes the motion `[x, ẋ, ẍ]` of all degrees of freedom at sample `k`.
    pub(crate) fn set(&mut self, k: usize, motion: &[f64]) {
        for (part, values) in self.parts.iter_mut().zip(motion.chunks_exact(self.dof)) {
            match self.observed {
                None => {
                    let samples = part.nrows();
                    let row = part.as_mut_slice()[k..].iter_mut().step_by(samples);
                    row.zip(values).for_each(|(kept, value)| *kept = *value);
                }
                Some(observed) => {
                    observed.iter().enumerate().for_each(|(c, &at)| part[(k, c)] = values[at]);
                }
            }
        }
    }

    /// Returns whether the samples up to `last` are finite.
    fn begins_finite(&self, last: usize) -> bool {
        let rows = (last + 1).min(self.parts[0].nrows());
        self.parts.iter().all(|part| part.rows(0, rows).iter().all(|value| value.is_finite()))
    }

    /// Returns samples `from .. from + len` of every column: n columns of x, then n columns of ẋ
    /// and n columns of ẍ, if they are stored.
    fn columns(&mut self, from: usize, len: usize) -> Vec<&mut [f64]> {
        let rows = self.parts[0].nrows();
        let columns = self.parts.iter_mut().flat_map(|p| p.as_mut_slice().chunks_exact_mut(rows));
        columns.map(|c| &mut c[from..from + len]).collect()
    }

    /// Returns the stored quantities on the time axis of `table`: the first `Q` of x, ẋ and ẍ.
    fn into_records<const Q: usize>(
        self,
        table: &ForceTable<'_>,
    ) -> Result<[Record; Q], IntegrateError> {
        let dof = |channel: usize| self.observed.map_or(channel, |observed| observed[channel]);
        let new = if self.finite { Record::from_finite } else { Record::new };
        let record = |data| match new(table.sampling(), data) {
            Err(SignalError::NotFinite { sample, channel, .. }) => {
                Err(IntegrateError::Overflow { sample, component: dof(channel) + 1 })
            }
            other => other.map_err(IntegrateError::from),
        };
        let records: Vec<Record> = self.parts.into_iter().map(record).collect::<Result<_, _>>()?;
        Ok(records.try_into().expect("as many as were asked for"))
    }

    /// Returns the response on the time axis of `table`.
    pub(crate) fn into_response(self, table: &ForceTable<'_>) -> Result<Response, IntegrateError> {
        let [x, v, a] = self.into_records(table)?;
        Ok(Response::new(x, v, a)?)
    }

    /// Returns the displacement on the time axis of `table`.
    pub(crate) fn into_displacement(
        self,
        table: &ForceTable<'_>,
    ) -> Result<Record, IntegrateError> {
        let [x] = self.into_records(table)?;
        Ok(x)
    }
}

/// A stepper with its state and all memory that a simulation needs.
pub(crate) struct Simulation {
    stepper: Box<dyn Stepper>,
    dt: f64,
    small: Option<Small>,
    pub(crate) state: Vec<f64>,
    change: Vec<f64>,
    /// Accumulated rounding errors of `state`.
    rounding_errors: Vec<f64>,
    /// The forces of the present step, by [`Instant`](crate::Instant).
    rows: [Vec<f64>; 4],
    /// Zeros, for a step without force.
    none: Vec<f64>,
}

/// Step of a small system, as matrix products of fixed size.
enum Small {
    Linear(FixedSize),
    Nonlinear(Collocations),
}

impl Simulation {
    /// Prepares a scheme for a system and a step of `dt` seconds.
    pub(crate) fn new(
        scheme: &dyn Scheme,
        system: &dyn System,
        dt: f64,
    ) -> Result<Self, IntegrateError> {
        let mut stepper = scheme.prepare(system, dt)?;
        let (n, len) = (stepper.dof(), stepper.state_len());
        let small = if system.nonlinear_forces().is_empty() {
            FixedSize::from_stepper(stepper.as_mut(), dt).map(Small::Linear)
        } else {
            Collocations::from_scheme(scheme, system, dt).map(Small::Nonlinear)
        };
        let rows = [(); 4].map(|()| vec![0.0; n]);
        let [state, change, rounding_errors] = [(); 3].map(|()| vec![0.0; len]);
        let none = vec![0.0; n];
        Ok(Self { stepper, dt, small, state, change, rounding_errors, rows, none })
    }

    /// Starts the stepper and stores its initial state.
    pub(crate) fn start(
        &mut self,
        initial: &InitialState,
        early: &[Vec<f64>],
        motions: &mut [Vec<f64>],
    ) -> Result<(), IntegrateError> {
        self.stepper.start(initial, early, motions, &mut self.state)
    }

    /// Continues from `state`.
    pub(crate) fn restart(&mut self, state: &[f64]) {
        self.state.copy_from_slice(state);
        self.rounding_errors.fill(0.0);
    }

    pub(crate) fn stepper(&mut self) -> &mut dyn Stepper {
        self.stepper.as_mut()
    }

    /// Takes steps `from .. to` and writes the motion at those of the samples `from + 1 ..= to`
    /// that `motion` has.
    pub(crate) fn advance(
        &mut self,
        table: &ForceTable<'_>,
        from: usize,
        to: usize,
        motion: &mut Motion<'_>,
    ) -> Result<(), IntegrateError> {
        let (mut done, finite) = self.advance_small(table, from, to, motion);
        let steps_per_message = (limits::NUMBERS_PER_MESSAGE / self.state.len()).max(1);
        let mut aside = 0;
        while done < to {
            if done % steps_per_message == 0 {
                log::trace!("step {done} of {to}");
            }
            self.step(table, done)?;
            done += 1;
            if done < motion.parts[0].nrows() {
                motion.set(done, &self.state);
            }
            aside += 1;
            if aside == limits::GENERAL_STEPS && matches!(self.small, Some(Small::Nonlinear(_))) {
                aside = 0;
                let (ahead, _) = self.advance_small(table, done, to, motion);
                if ahead > done {
                    self.rounding_errors.fill(0.0);
                }
                done = ahead;
            }
        }
        // A value that is not finite stays so in all later steps, so that the last state shows any
        // overflow.
        let ends = self.state.iter().all(|z| z.is_finite());
        motion.finite = finite && ends && motion.begins_finite(from);
        Ok(())
    }

    /// Takes one step from sample `k` by a call of the stepper, not by matrices of fixed size.
    pub(crate) fn step(&mut self, table: &ForceTable<'_>, k: usize) -> Result<(), IntegrateError> {
        for &instant in self.stepper.instants() {
            table.load(instant, k, &mut self.rows[instant as usize]);
        }
        let [now, middle, next, beyond] = &self.rows;
        let loads = Loads { time: k as f64 * self.dt, now, middle, next, beyond };
        self.stepper.step(&mut self.state, &mut self.rounding_errors, &loads, &mut self.change)
    }

    /// Takes one step without force by a call of the stepper, not by matrices of fixed size.
    pub(crate) fn free_step(&mut self) -> Result<(), IntegrateError> {
        let loads = Loads::none(&self.none);
        self.stepper.step(&mut self.state, &mut self.rounding_errors, &loads, &mut self.change)
    }

    /// Takes as many steps as possible with arrays of fixed size; returns the next step, and
    /// whether the motion is finite so far.
    fn advance_small(
        &mut self,
        table: &ForceTable<'_>,
        from: usize,
        to: usize,
        motion: &mut Motion<'_>,
    ) -> (usize, bool) {
        let none = (from, true);
        let transition = match &self.small {
            None => return none,
            Some(Small::Linear(fixed)) => fixed.transition(),
            Some(Small::Nonlinear(collocations)) => collocations.transition(),
        };
        if !table.is_complete() || motion.observed.is_some() {
            return none;
        }
        let n = table.dof();
        let mut streams = Vec::with_capacity(6);
        for (instant, _) in &transition.loads {
            streams.extend((0..n).map(|c| table.stream(*instant, from, c)));
        }
        let steps = streams.iter().map(|s| s.len()).min().unwrap_or(0).min(to - from);
        let steps = steps.min((motion.parts[0].nrows() - 1).saturating_sub(from));
        if steps == 0 {
            return none;
        }
        let mut columns = motion.columns(from + 1, steps);
        match &self.small {
            None => none,
            Some(Small::Linear(fixed)) => {
                match fixed.advance(&mut self.state, &streams, &mut columns, steps) {
                    Some(finite) => (from + steps, finite),
                    None => none,
                }
            }
            Some(Small::Nonlinear(collocations)) => {
                let steps = [from, steps];
                (from + collocations.advance(&mut self.state, &streams, &mut columns, steps), true)
            }
        }
    }
}
