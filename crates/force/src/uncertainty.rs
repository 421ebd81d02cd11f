//! Propagation of the uncertainty of an identified machine to the force.

use mechid_model::{Matrix, Parameter, SecondOrderSystem, UncertainSystem};
use mechid_signal::Record;
use nalgebra::{DMatrix, DVector};

use crate::{ForceError, IdentifiedForce};

/// Part of a standard error by which an entry is changed for a derivative.
const STEP: f64 = 0.1;

/// The force that `find` gives for `system`, the uncertainty of the system added to its standard
/// error: variance + gᵀ Σ g at every sample, g the derivatives of the force with respect to the
/// uncertain entries (delta method). Likewise what it may leave of the measured channels
/// ([`Unexplained::machine`](crate::Unexplained)).
///
/// The derivatives are central differences over a tenth of a standard error: exact for
/// [`continuous`](crate::continuous()), in which the force is linear in the entries. Where `find`
/// chooses a parameter of its own, give it the parameter once chosen ([`Rule::Given`],
/// [`Tuning::Given`]): what is wanted is the effect of the machine, not of another choice.
///
/// It is the uncertainty that the covariance describes; a biased identification is biased still.
///
/// Cost: 2 p + 1 calls of `find` for p uncertain entries.
///
/// # Errors
/// What `find` returns; [`ForceError::Model`] if a changed mass matrix is singular.
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
    let (system, covariance) = (machine.system(), machine.covariance());
    let force = find(system)?;
    let (mut forces, mut rests) = (Vec::new(), Vec::new());
    for (i, &parameter) in machine.parameters().iter().enumerate() {
        let step = STEP * covariance[(i, i)].sqrt();
        if step == 0.0 {
            forces.push(DMatrix::zeros(force.record().len(), system.dof()));
            rests.extend(force.rest().map(|rest| rest.left() * 0.0));
            continue;
        }
        let above = find(&changed(system, parameter, step)?)?;
        let below = find(&changed(system, parameter, -step)?)?;
        forces.push((above.record().data() - below.record().data()) / (2.0 * step));
        if let (Some(above), Some(below)) = (above.rest(), below.rest()) {
            rests.push((above.left() - below.left()) / (2.0 * step));
        }
    }
    let mut variance = propagated(covariance, force.record().data().shape(), &forces);
    if let Some(error) = force.standard_error() {
        variance.zip_apply(error.data(), |sum, noise| *sum += noise * noise);
    }
    let error = Record::new(force.record().sampling(), variance.map(f64::sqrt))?;
    let rest = force.rest().cloned().map(|rest| {
        let variance = propagated(covariance, rest.left().shape(), &rests);
        rest.with_machine(&variance)
    });
    Ok(force.with_standard_error(Some(error)).with_rest(rest))
}

/// gᵀ Σ g at every place of a matrix of this shape, g the derivatives there, one matrix per
/// parameter.
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

/// The system with one entry changed.
fn changed(
    system: &SecondOrderSystem,
    entry: Parameter,
    by: f64,
) -> Result<SecondOrderSystem, ForceError> {
    let [m, c, k] = Matrix::ALL.map(|which| {
        let mut matrix = system.matrix(which).clone();
        if which == entry.matrix() {
            matrix[(entry.row(), entry.column())] += by;
        }
        matrix
    });
    Ok(SecondOrderSystem::new(m, c, k)?)
}
