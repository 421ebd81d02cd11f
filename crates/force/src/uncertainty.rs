//! Effect of the uncertainty of an identified system on the force.

use mechid_model::{NonlinearSystem, SecondOrderSystem, UncertainNonlinearSystem, UncertainSystem};
use mechid_signal::Record;
use nalgebra::{DMatrix, DVector};

use crate::error::ForceError;
use crate::identified::IdentifiedForce;
use crate::limits;

/// Returns the force that `find` computes for the identified system. The uncertainty of the system
/// is added to the variance of the force: variance + gᵀ Σ g at every sample, where g has the
/// derivatives of the force with respect to the uncertain entries (delta method). The residual of
/// the measured channels is treated likewise ([`Unexplained::system`](crate::Unexplained)).
///
/// The derivatives are central differences over a tenth of a standard error: exact for
/// [`continuous`](crate::continuous()), for which the force is linear in the entries. If `find`
/// chooses a parameter, fix it at the value of the first call ([`Rule::Given`], [`Tuning::Given`]):
/// the derivative should be the effect of the system, not of a different choice of the parameter.
///
/// The result covers the covariance only, not the bias of an identification.
///
/// Cost: 2 p + 1 calls of `find` for p uncertain entries.
///
/// # Errors
/// The errors of `find`; [`ForceError::Model`] if a changed mass matrix is singular.
///
/// ```
/// use mechid_force::{continuous, with_uncertain_system};
/// use mechid_model::{Parameter, Response, SecondOrderSystem, UncertainSystem};
/// use mechid_signal::{Record, Sampling};
/// use nalgebra::dmatrix;
///
/// let sampling = Sampling::new(0.1, 3)?;
/// let wave = |values: [f64; 3]| Record::from_channel(sampling, values.to_vec());
/// let response = Response::new(wave([1.0, 2.0, 0.0])?, wave([0.5; 3])?, wave([0.0; 3])?)?;
/// let system = SecondOrderSystem::new(dmatrix![2.0], dmatrix![3.0], dmatrix![8.0])?;
///
/// // k is known to ±0.2 N/m: where x is 2 m, F is known to ±0.4 N.
/// let stiffness = Parameter::named("k", 1)?;
/// let machine = UncertainSystem::new(system, vec![stiffness], dmatrix![0.2 * 0.2])?;
/// let force = with_uncertain_system(&machine, |s| continuous(s, &response))?;
/// let error = force.standard_error().unwrap();
/// assert!((error.channel(0)[1] - 0.4).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// [`Rule::Given`]: crate::Rule::Given
/// [`Tuning::Given`]: crate::Tuning::Given
pub fn with_uncertain_system(
    machine: &UncertainSystem,
    find: impl Fn(&SecondOrderSystem) -> Result<IdentifiedForce, ForceError>,
) -> Result<IdentifiedForce, ForceError> {
    let system = machine.system();
    propagate(find(system)?, machine.covariance(), |at, by| {
        find(&system.changed(machine.parameters()[at], by)?)
    })
}

/// Returns the force that `find` computes for a system with nonlinear terms. The uncertainty of all
/// parameters of the system is added to the standard error of the force. [`with_uncertain_system`]
/// does the same for a linear system.
///
/// # Errors
/// The errors of `find`; [`ForceError::Model`] if a changed system is impossible.
///
/// ```
/// use mechid_force::{continuous_nonlinear, with_uncertain_nonlinear_system};
/// use mechid_model::{
///     NonlinearParameter, NonlinearSystem, Response, Sdof, UncertainNonlinearSystem,
/// };
/// use mechid_signal::{Record, Sampling};
/// use nalgebra::dmatrix;
///
/// let sampling = Sampling::new(0.1, 3)?;
/// let wave = |values: [f64; 3]| Record::from_channel(sampling, values.to_vec());
/// let response = Response::new(wave([1.0, 2.0, 0.0])?, wave([0.5; 3])?, wave([0.0; 3])?)?;
/// let linear = Sdof::new(2.0, 3.0, 8.0)?.system();
/// let system = NonlinearSystem::new(linear, "k3: x^3".parse()?, vec![4.0])?;
///
/// // k3 is known to ±0.1 N/m³: where x is 2 m, F is known to ±0.8 N.
/// let cubic = NonlinearParameter::named("k3", &system)?;
/// let machine = UncertainNonlinearSystem::new(system, vec![cubic], dmatrix![0.1 * 0.1])?;
/// let force = with_uncertain_nonlinear_system(&machine, |s| continuous_nonlinear(s, &response))?;
/// let error = force.standard_error().unwrap();
/// assert!((error.channel(0)[1] - 0.8).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn with_uncertain_nonlinear_system(
    machine: &UncertainNonlinearSystem,
    find: impl Fn(&NonlinearSystem) -> Result<IdentifiedForce, ForceError>,
) -> Result<IdentifiedForce, ForceError> {
    let system = machine.system();
    propagate(find(system)?, machine.covariance(), |at, by| {
        find(&system.changed(machine.parameters()[at], by)?)
    })
}

/// Returns a force whose standard error includes the uncertainty of parameters with this
/// covariance; `changed(i, step)` returns the force if parameter i changes by `step`.
fn propagate(
    force: IdentifiedForce,
    covariance: &DMatrix<f64>,
    changed: impl Fn(usize, f64) -> Result<IdentifiedForce, ForceError>,
) -> Result<IdentifiedForce, ForceError> {
    let (mut forces, mut rests) = (Vec::new(), Vec::new());
    for at in 0..covariance.nrows() {
        let step = limits::PARAMETER_STEP * covariance[(at, at)].sqrt();
        if step == 0.0 {
            forces.push(force.record().data() * 0.0);
            rests.extend(force.residual().map(|residual| residual.matrix() * 0.0));
            continue;
        }
        let (above, below) = (changed(at, step)?, changed(at, -step)?);
        forces.push((above.record().data() - below.record().data()) / (2.0 * step));
        if let (Some(above), Some(below)) = (above.residual(), below.residual()) {
            rests.push((above.matrix() - below.matrix()) / (2.0 * step));
        }
    }
    let mut variance = propagated(covariance, force.record().data().shape(), &forces);
    if let Some(error) = force.standard_error() {
        variance.zip_apply(error.data(), |sum, noise| *sum += noise * noise);
    }
    let error = Record::new(force.record().sampling(), variance.map(f64::sqrt))?;
    let residual = force.residual().cloned().map(|residual| {
        let variance = propagated(covariance, residual.matrix().shape(), &rests);
        residual.with_system_variance(&variance)
    });
    Ok(force.with_standard_error(Some(error)).with_residual(residual))
}

/// Returns gᵀ Σ g for every entry of a matrix of this shape. The vector g has the derivatives of
/// the entry with respect to the parameters; `derivatives` has one matrix per parameter.
fn propagated(
    covariance: &DMatrix<f64>,
    (rows, columns): (usize, usize),
    derivatives: &[DMatrix<f64>],
) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |k, i| {
        let g = DVector::from_iterator(derivatives.len(), derivatives.iter().map(|d| d[(k, i)]));
        g.dot(&(covariance * &g)).max(0.0)
    })
}
