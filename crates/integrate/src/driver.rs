//! Integration from given initial values.

use mechid_model::{InitialState, Response};
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

use crate::force::ForceTable;
use crate::run::{Motion, Run};
use crate::scheme::check_finite;
use crate::{IntegrateError, SampledForce, Scheme, System};

/// The motion of `system` from `initial` under a sampled force (samples × n, in N).
///
/// Displacement, velocity and acceleration belong to the same instants as the samples of the
/// force, the first of them to t = 0.
///
/// # Errors
/// Those of [`Scheme::prepare`]; [`IntegrateError::Components`] if force or initial values do not
/// fit the system; [`IntegrateError::MidStepMissing`]; [`IntegrateError::NotAtRest`];
/// [`IntegrateError::Overflow`].
pub fn integrate<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    force: impl Into<SampledForce<'a>>,
    initial: &InitialState,
) -> Result<Response, IntegrateError> {
    let table = ForceTable::ending(scheme, system.dof(), force.into())?;
    let motion = Motion::zeros(table.sampling().len(), system.dof());
    run(scheme, system, &table, initial, motion)?.into_response(&table)
}

/// The displacement alone of what [`integrate`] computes, samples × n in m: a third of the memory,
/// which is what most of the time of few degrees of freedom goes into.
///
/// ```
/// use mechid_integrate::{Newmark, integrate, integrate_displacement};
/// use mechid_model::{InitialState, Sdof};
/// use mechid_signal::{Record, Sampling};
///
/// let system = Sdof::new(1.0, 0.2, 40.0)?.system();
/// let force = Record::from_channel(Sampling::new(0.01, 500)?, vec![1.0; 500])?;
/// let (scheme, rest) = (Newmark::AVERAGE_ACCELERATION, InitialState::rest(1));
/// let displacement = integrate_displacement(&scheme, &system, &force, &rest)?;
/// assert_eq!(&displacement, integrate(&scheme, &system, &force, &rest)?.displacement());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Those of [`integrate`].
pub fn integrate_displacement<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    force: impl Into<SampledForce<'a>>,
    initial: &InitialState,
) -> Result<Record, IntegrateError> {
    let table = ForceTable::ending(scheme, system.dof(), force.into())?;
    let motion = Motion::displacement(table.sampling().len(), system.dof());
    run(scheme, system, &table, initial, motion)?.into_displacement(&table)
}

/// Degrees of freedom, counted from 0, at which forces act and responses are kept.
///
/// With these an integration needs no memory that grows with degrees of freedom times samples.
#[derive(Debug, Clone, Copy)]
pub struct SelectedDofs<'a> {
    /// One for each channel of the force, none twice; no force acts on the others.
    pub forced: &'a [usize],
    /// One for each channel of the response.
    pub observed: &'a [usize],
}

impl SelectedDofs<'_> {
    pub(crate) fn check(&self, dof: usize) -> Result<(), IntegrateError> {
        let mut forced = vec![false; dof];
        for &at in self.forced {
            match forced.get_mut(at) {
                None => return Err(IntegrateError::DofOutside { index: at, dof }),
                Some(forced) if *forced => return Err(IntegrateError::ForcedTwice { index: at }),
                Some(forced) => *forced = true,
            }
        }
        match self.observed.iter().find(|at| **at >= dof) {
            Some(&at) => Err(IntegrateError::DofOutside { index: at, dof }),
            None => Ok(()),
        }
    }
}

/// The motion of some degrees of freedom of `system` from `initial` under a sampled force (in N)
/// on some: samples × `dofs.forced` in, samples × `dofs.observed` out.
///
/// ```
/// use mechid_integrate::{Newmark, SelectedDofs, integrate_selected};
/// use mechid_model::{InitialState, SparseSystem, band};
/// use mechid_signal::{Record, Sampling};
///
/// // A step of 1 N at one end of a chain of 1000; the wave has not reached the middle after 2 s.
/// let n = 1000;
/// let stiffness = band(n, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
/// let chain = SparseSystem::new(band(n, &[(0, 1.0)]), band(n, &[(0, 0.1)]), stiffness)?;
/// let force = Record::from_channel(Sampling::new(1e-2, 200)?, vec![1.0; 200])?;
/// let dofs = SelectedDofs { forced: &[0], observed: &[0, 500] };
/// let rest = InitialState::rest(n);
/// let response = integrate_selected(&Newmark::AVERAGE_ACCELERATION, &chain, dofs, &force, &rest)?;
/// let [near, far] = [0, 1].map(|channel| response.displacement().channel(channel)[199]);
/// assert!(near > 1e-4 && far.abs() < 1e-20);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Those of [`integrate`]; [`IntegrateError::DofOutside`] and [`IntegrateError::ForcedTwice`].
pub fn integrate_selected<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    dofs: SelectedDofs<'a>,
    force: impl Into<SampledForce<'a>>,
    initial: &InitialState,
) -> Result<Response, IntegrateError> {
    dofs.check(system.dof())?;
    let table = ForceTable::ending(scheme, dofs.forced.len(), force.into())?;
    let table = table.acting_on(dofs.forced, system.dof());
    let motion = Motion::observed(table.sampling().len(), system.dof(), dofs.observed);
    run(scheme, system, &table, initial, motion)?.into_response(&table)
}

/// The motion of `system` from `initial` under a force given as a function of time:
/// `force(t, f)` writes the n components at t (s) into `f` (N).
///
/// Every scheme gets the function's values at the instants where it looks at the force.
///
/// # Errors
/// Those of [`integrate`]; [`IntegrateError::NotFinite`] if the function yields a NaN or infinity.
pub fn integrate_function(
    scheme: &dyn Scheme,
    system: &dyn System,
    sampling: Sampling,
    initial: &InitialState,
    mut force: impl FnMut(f64, &mut [f64]),
) -> Result<Response, IntegrateError> {
    let sampled = Sampled::of(scheme, system.dof(), sampling, &mut force)?;
    let mut next = vec![0.0; system.dof()];
    let end = sampling.duration();
    force(end, &mut next);
    check_finite("the force", &next, end)?;
    let table = ForceTable::ending(scheme, system.dof(), sampled.force())?.continued(next);
    let motion = Motion::zeros(sampling.len(), system.dof());
    run(scheme, system, &table, initial, motion)?.into_response(&table)
}

/// A function of time sampled where a scheme needs it.
pub(crate) struct Sampled {
    samples: Record,
    middle: Option<Record>,
}

impl Sampled {
    pub(crate) fn of(
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

/// The force at t = (k + `shift`) Δt.
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

fn run<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    table: &ForceTable<'_>,
    initial: &InitialState,
    mut motion: Motion<'a>,
) -> Result<Motion<'a>, IntegrateError> {
    let dof = system.dof();
    initial.check_dof(dof)?;
    let sampling = table.sampling();
    let mut run = Run::new(scheme, system, sampling.dt())?;
    let first = run.stepper().first();
    let mut motions = vec![vec![0.0; 3 * dof]; first + 1];
    run.start(initial, &table.early(first), &mut motions)?;
    for (k, values) in motions.iter().enumerate().take(sampling.len()) {
        motion.set(k, values);
    }
    run.advance(table, first, (sampling.len() - 1).max(first), &mut motion)?;
    Ok(motion)
}
