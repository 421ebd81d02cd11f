//! Samples of a force that is given as a function of time.

use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

use crate::error::IntegrateError;
use crate::schemes::scheme::Scheme;
use crate::stepping::sampled_force::SampledForce;
use crate::stepping::stepper::check_finite;

/// Samples of a function of time at the instants that a scheme needs.
pub(crate) struct FunctionSamples {
    samples: Record,
    middle: Option<Record>,
}

impl FunctionSamples {
    pub(crate) fn from_function(
        scheme: &dyn Scheme,
        dof: usize,
        sampling: Sampling,
        force: &mut impl FnMut(f64, &mut [f64]),
    ) -> Result<Self, IntegrateError> {
        let samples = sample(dof, sampling, 0.0, force)?;
        let inner = scheme.inner_instant().map(|part| sample(dof, sampling, part, force));
        let middle = inner.transpose()?;
        Ok(Self { samples, middle })
    }

    pub(crate) fn force(&self) -> SampledForce<'_> {
        match &self.middle {
            None => SampledForce::from(&self.samples),
            Some(middle) => SampledForce::with_mid_step(&self.samples, middle),
        }
    }
}

/// Returns the force at t = (k + `shift`) Δt for every k.
fn sample(
    dof: usize,
    sampling: Sampling,
    shift: f64,
    force: &mut impl FnMut(f64, &mut [f64]),
) -> Result<Record, IntegrateError> {
    let mut data = DMatrix::zeros(sampling.len(), dof);
    let mut row = vec![0.0; dof];
    for k in 0..sampling.len() {
        let time = (k as f64 + shift) * sampling.dt();
        force(time, &mut row);
        check_finite("the force", &row, time)?;
        data.row_mut(k).iter_mut().zip(&row).for_each(|(entry, f)| *entry = *f);
    }
    Ok(Record::new(sampling, data)?)
}
