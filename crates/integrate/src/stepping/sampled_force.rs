//! The force of a simulation: samples, and the values after and between them.

use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

use crate::error::IntegrateError;
use crate::schemes::scheme::Scheme;
use crate::stepping::stepper::Instant;

/// A sampled force, one channel per degree of freedom, in N.
///
/// A `&Record` converts into a `SampledForce`; [`with_mid_step`](Self::with_mid_step) adds the
/// force within the steps for schemes that need it.
#[derive(Debug, Clone, Copy)]
pub struct SampledForce<'a> {
    samples: &'a Record,
    mid_step: Option<&'a Record>,
}

impl<'a> From<&'a Record> for SampledForce<'a> {
    fn from(samples: &'a Record) -> Self {
        Self { samples, mid_step: None }
    }
}

impl<'a> SampledForce<'a> {
    /// Creates a force from samples and the forces within the steps: sample k of `mid_step` is the
    /// force at t = (k + ½) Δt. `mid_step` has as many samples as `samples`; the last sample of
    /// `mid_step` is used only in periodic simulations.
    pub fn with_mid_step(samples: &'a Record, mid_step: &'a Record) -> Self {
        Self { samples, mid_step: Some(mid_step) }
    }

    /// Returns the samples of a force with twice the step, and its values within these steps;
    /// `None` for an odd number of samples.
    pub(crate) fn with_twice_the_step(self) -> Option<[Record; 2]> {
        let Self { samples, .. } = self;
        let sampling = samples.sampling();
        let half = (sampling.len() / 2).max(1);
        let twice = Sampling::new(2.0 * sampling.dt(), half).ok()?;
        let every_second = |first: usize| {
            let value = |row: usize, channel: usize| samples.data()[(2 * row + first, channel)];
            Record::new(twice, DMatrix::from_fn(half, samples.channels(), value)).ok()
        };
        let is_even = sampling.len().is_multiple_of(2);
        is_even.then(|| Some([every_second(0)?, every_second(1)?])).flatten()
    }
}

/// Every value of the force that a simulation may need, without copying the samples.
#[derive(Debug)]
pub(crate) struct ForceTable<'a> {
    samples: &'a Record,
    mid_step: Option<&'a Record>,
    /// Forces at the two instants after the last sample.
    after: [Vec<f64>; 2],
    /// Degree of freedom of each channel; `None` if channel i acts on degree of freedom i.
    forced: Option<&'a [usize]>,
    dof: usize,
}

impl<'a> ForceTable<'a> {
    /// Creates a force that repeats after its last sample.
    pub(crate) fn periodic(
        scheme: &dyn Scheme,
        dof: usize,
        force: SampledForce<'a>,
    ) -> Result<Self, IntegrateError> {
        check(scheme, dof, force)?;
        let len = force.samples.len();
        let after = [0, 1].map(|k| row(force.samples, k % len));
        Ok(Self { samples: force.samples, mid_step: force.mid_step, after, forced: None, dof })
    }

    /// Creates a force that ends with its last sample. The value after the last sample extrapolates
    /// the line through the last two samples, so that a load interpolated across the end is equal
    /// to a load projected from the last step.
    pub(crate) fn ending(
        scheme: &dyn Scheme,
        dof: usize,
        force: SampledForce<'a>,
    ) -> Result<Self, IntegrateError> {
        check(scheme, dof, force)?;
        let last = row(force.samples, force.samples.len() - 1);
        let before = row(force.samples, force.samples.len().saturating_sub(2));
        let line = last.iter().zip(&before).map(|(l, b)| 2.0 * l - b).collect();
        let (samples, mid_step, after) = (force.samples, force.mid_step, [line, last]);
        Ok(Self { samples, mid_step, after, forced: None, dof })
    }

    /// Returns the same force for a system with `dof` degrees of freedom; channel c acts on degree
    /// of freedom `forced[c]`.
    pub(crate) fn acting_on(self, forced: &'a [usize], dof: usize) -> Self {
        Self { forced: Some(forced), dof, ..self }
    }

    /// Returns the same force with given values after the last sample.
    pub(crate) fn continued(mut self, next: Vec<f64>) -> Self {
        self.after[0] = next;
        self
    }

    pub(crate) fn sampling(&self) -> Sampling {
        self.samples.sampling()
    }

    pub(crate) fn dof(&self) -> usize {
        self.dof
    }

    /// Returns whether every degree of freedom has a channel of the force.
    pub(crate) fn is_complete(&self) -> bool {
        self.forced.is_none()
    }

    /// Writes the force at `instant` of step `k` into `out`, at its degrees of freedom.
    pub(crate) fn load(&self, instant: Instant, k: usize, out: &mut [f64]) {
        let (record, k) = match instant {
            Instant::Now => (Some(self.samples), k),
            Instant::Middle => (self.mid_step, k),
            Instant::Next => (Some(self.samples), k + 1),
            Instant::Beyond => (Some(self.samples), k + 2),
        };
        let Some(record) = record else { return };
        match k.checked_sub(record.len()) {
            None => {
                // A force without channels has no values at all.
                let values = record.data().as_slice().get(k..).unwrap_or(&[]);
                self.act(values.iter().step_by(record.len()), out);
            }
            Some(after) => self.act(self.after[after].iter(), out),
        }
    }

    /// Writes one value for each channel into `out`.
    fn act<'v>(&self, values: impl Iterator<Item = &'v f64>, out: &mut [f64]) {
        match self.forced {
            None => out.iter_mut().zip(values).for_each(|(out, value)| *out = *value),
            Some(forced) => forced.iter().zip(values).for_each(|(&at, value)| out[at] = *value),
        }
    }

    /// Returns channel `c` of the force at `instant` of step `from` and later steps, up to the last
    /// sample.
    pub(crate) fn stream(&self, instant: Instant, from: usize, c: usize) -> &[f64] {
        let (record, from) = match instant {
            Instant::Now => (Some(self.samples), from),
            Instant::Middle => (self.mid_step, from),
            Instant::Next => (Some(self.samples), from + 1),
            Instant::Beyond => (Some(self.samples), from + 2),
        };
        record.and_then(|r| r.channel(c).get(from..)).unwrap_or(&[])
    }

    /// Returns the forces at samples 0 ..= `last`.
    pub(crate) fn early(&self, last: usize) -> Vec<Vec<f64>> {
        let end = self.samples.len() - 1;
        let full = |k: usize| {
            let mut full = vec![0.0; self.dof];
            self.load(Instant::Now, k.min(end), &mut full);
            full
        };
        (0..=last).map(full).collect()
    }
}

fn check(scheme: &dyn Scheme, dof: usize, force: SampledForce<'_>) -> Result<(), IntegrateError> {
    let samples = force.samples;
    if samples.channels() != dof {
        return Err(IntegrateError::Components { what: "the force", got: samples.channels(), dof });
    }
    let Some(middle) = force.mid_step else {
        if scheme.inner_instant().is_some() {
            return Err(IntegrateError::MidStepMissing { scheme: scheme.name() });
        }
        return Ok(());
    };
    if middle.channels() != dof {
        let got = middle.channels();
        return Err(IntegrateError::Components { what: "the mid-step force", got, dof });
    }
    if samples.check_same_sampling(middle).is_err() {
        return Err(IntegrateError::MidStepSampling {
            got: middle.len(),
            got_dt: middle.sampling().dt(),
            expected: samples.len(),
            dt: samples.sampling().dt(),
        });
    }
    Ok(())
}

fn row(record: &Record, k: usize) -> Vec<f64> {
    record.data().row(k).iter().copied().collect()
}
