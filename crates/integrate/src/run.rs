//! The stepping loop: the prepared stepper itself, or its transition at fixed size for few
//! degrees of freedom.

use mechid_model::{InitialState, Response};
use mechid_signal::{Record, SignalError};
use nalgebra::DMatrix;

use crate::collocations::Collocations;
use crate::fixed_size::FixedSize;
use crate::force::ForceTable;
use crate::{IntegrateError, Loads, Scheme, Stepper, System};

/// Displacement, velocity and acceleration, or displacement alone: samples × observed degrees of
/// freedom.
#[derive(Debug)]
pub(crate) struct Motion<'a> {
    parts: Vec<DMatrix<f64>>,
    /// The degree of freedom of each column, if not all in their order.
    observed: Option<&'a [usize]>,
    dof: usize,
    /// Whether all values are known to be finite.
    finite: bool,
}

impl<'a> Motion<'a> {
    pub(crate) fn zeros(samples: usize, dof: usize) -> Self {
        Self::of_parts(3, samples, dof)
    }

    /// Displacement alone.
    pub(crate) fn displacement(samples: usize, dof: usize) -> Self {
        Self::of_parts(1, samples, dof)
    }

    /// The same for some of the `dof` degrees of freedom.
    pub(crate) fn observed(samples: usize, dof: usize, observed: &'a [usize]) -> Self {
        Self { observed: Some(observed), dof, ..Self::zeros(samples, observed.len()) }
    }

    /// The system hands out pages of zeros: they are written once, by the steps.
    fn of_parts(parts: usize, samples: usize, dof: usize) -> Self {
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

    /// Samples `from .. from + len` of every column: n of x, then n of ẋ and n of ẍ, if they are kept.
    fn columns(&mut self, from: usize, len: usize) -> Vec<&mut [f64]> {
        let rows = self.parts[0].nrows();
        let columns = self.parts.iter_mut().flat_map(|p| p.as_mut_slice().chunks_exact_mut(rows));
        columns.map(|c| &mut c[from..from + len]).collect()
    }

    /// The quantities kept on the time axis of `table`, `Q` of x, ẋ and ẍ.
    fn into_records<const Q: usize>(
        self,
        table: &ForceTable<'_>,
    ) -> Result<[Record; Q], IntegrateError> {
        let dof = |channel: usize| self.observed.map_or(channel, |observed| observed[channel]);
        let new = if self.finite { Record::of_finite } else { Record::new };
        let record = |data| match new(table.sampling(), data) {
            Err(SignalError::NotFinite { sample, channel, .. }) => {
                Err(IntegrateError::Overflow { sample, component: dof(channel) + 1 })
            }
            other => other.map_err(IntegrateError::from),
        };
        let records: Vec<Record> = self.parts.into_iter().map(record).collect::<Result<_, _>>()?;
        Ok(records.try_into().expect("as many as were asked for"))
    }

    /// The response on the time axis of `table`.
    pub(crate) fn into_response(self, table: &ForceTable<'_>) -> Result<Response, IntegrateError> {
        let [x, v, a] = self.into_records(table)?;
        Ok(Response::new(x, v, a)?)
    }

    /// The displacement on the time axis of `table`.
    pub(crate) fn into_displacement(
        self,
        table: &ForceTable<'_>,
    ) -> Result<Record, IntegrateError> {
        let [x] = self.into_records(table)?;
        Ok(x)
    }
}

/// A stepper on its way through a force, with all the memory the way needs.
pub(crate) struct Run {
    stepper: Box<dyn Stepper>,
    dt: f64,
    small: Option<Small>,
    pub(crate) state: Vec<f64>,
    change: Vec<f64>,
    /// Rounding errors kept from `state` so far.
    owed: Vec<f64>,
    /// The forces of the present step, by [`Instant`](crate::Instant).
    rows: [Vec<f64>; 4],
    /// No force.
    none: Vec<f64>,
}

/// The step of a small system as products of fixed size.
enum Small {
    Linear(FixedSize),
    Nonlinear(Collocations),
}

/// Steps that the stepper takes where a step of fixed size is not solved.
const STEPS_ASIDE: usize = 16;

/// Numbers of the state that are computed between two messages about the progress.
const NUMBERS_PER_MESSAGE: usize = 1 << 20;

impl Run {
    /// Prepares a scheme for a system and a step of `dt` seconds.
    pub(crate) fn new(
        scheme: &dyn Scheme,
        system: &dyn System,
        dt: f64,
    ) -> Result<Self, IntegrateError> {
        let mut stepper = scheme.prepare(system, dt)?;
        let (n, len) = (stepper.dof(), stepper.state_len());
        let small = match system.nonlinear_forces().is_empty() {
            true => FixedSize::of(stepper.as_mut(), dt).map(Small::Linear),
            false => Collocations::of(scheme, system, dt).map(Small::Nonlinear),
        };
        let rows = [(); 4].map(|()| vec![0.0; n]);
        let [state, change, owed] = [(); 3].map(|()| vec![0.0; len]);
        let none = vec![0.0; n];
        Ok(Self { stepper, dt, small, state, change, owed, rows, none })
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
        let (mut done, finite) = self.advance_small(table, from, to, motion);
        let steps_per_message = (NUMBERS_PER_MESSAGE / self.state.len()).max(1);
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
            if aside == STEPS_ASIDE && matches!(self.small, Some(Small::Nonlinear(_))) {
                aside = 0;
                let (ahead, _) = self.advance_small(table, done, to, motion);
                if ahead > done {
                    self.owed.fill(0.0);
                }
                done = ahead;
            }
        }
        // A sum is not finite if one of its terms is not: what has overflowed stays so to the end.
        let ends = self.state.iter().all(|z| z.is_finite());
        motion.finite = finite && ends && motion.begins_finite(from);
        Ok(())
    }

    /// One step through the stepper itself, from sample `k`.
    pub(crate) fn step(&mut self, table: &ForceTable<'_>, k: usize) -> Result<(), IntegrateError> {
        for &instant in self.stepper.instants() {
            table.load(instant, k, &mut self.rows[instant as usize]);
        }
        let [now, middle, next, beyond] = &self.rows;
        let loads = Loads { time: k as f64 * self.dt, now, middle, next, beyond };
        self.stepper.step(&mut self.state, &mut self.owed, &loads, &mut self.change)
    }

    /// One step without force through the stepper itself.
    pub(crate) fn free_step(&mut self) -> Result<(), IntegrateError> {
        let loads = Loads::none(&self.none);
        self.stepper.step(&mut self.state, &mut self.owed, &loads, &mut self.change)
    }

    /// Takes as many steps as it can at fixed size; returns the step to go on with, and whether the
    /// motion is finite so far.
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
