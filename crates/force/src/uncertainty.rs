//! What an identified machine, not exactly known, means for the force.

use mechid_model::{Matrix, SecondOrderSystem};
use mechid_signal::Record;
use nalgebra::{DMatrix, DVector};

use crate::{ForceError, IdentifiedForce};

/// One entry of M, C or K, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Entry {
    /// Which of the three.
    pub matrix: Matrix,
    /// Its row, counted from 0.
    pub row: usize,
    /// Its column, counted from 0.
    pub column: usize,
}

/// The entries of M, C and K that are uncertain, and their covariance in the same order (SI
/// units); all other entries are known.
#[derive(Debug, Clone, PartialEq)]
pub struct SystemCovariance {
    entries: Vec<Entry>,
    covariance: DMatrix<f64>,
}

/// Part of a standard error by which an entry is moved to see what it does.
const STEP: f64 = 0.1;

impl SystemCovariance {
    /// The covariance of these entries.
    ///
    /// # Errors
    /// [`ForceError::CovarianceShape`] if it is not one row and column per entry,
    /// [`ForceError::Variance`] if it has a negative variance or an entry that is not finite,
    /// [`ForceError::RepeatedEntry`] if an entry is named twice.
    pub fn new(entries: Vec<Entry>, covariance: DMatrix<f64>) -> Result<Self, ForceError> {
        let (rows, columns) = covariance.shape();
        if (rows, columns) != (entries.len(), entries.len()) {
            return Err(ForceError::CovarianceShape { rows, columns, entries: entries.len() });
        }
        for (i, &Entry { matrix, row, column }) in entries.iter().enumerate() {
            let variance = covariance[(i, i)];
            if variance < 0.0 || covariance.column(i).iter().any(|value| !value.is_finite()) {
                return Err(ForceError::Variance { matrix, row, column, variance });
            }
            if entries[..i].contains(&entries[i]) {
                return Err(ForceError::RepeatedEntry { matrix, row, column });
            }
        }
        Ok(Self { entries, covariance })
    }

    /// Which entries, in the order of the covariance.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Their covariance, one row and column per entry, in the products of their units (kg, N·s/m, N/m).
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// gᵀ Σ g at every place of a matrix of this shape, g the derivatives there, one matrix per
    /// entry.
    fn variance(
        &self,
        (rows, columns): (usize, usize),
        derivatives: &[DMatrix<f64>],
    ) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |k, i| {
            let g =
                DVector::from_iterator(derivatives.len(), derivatives.iter().map(|d| d[(k, i)]));
            g.dot(&(&self.covariance * &g)).max(0.0)
        })
    }

    /// The system with one entry moved.
    fn moved(
        &self,
        system: &SecondOrderSystem,
        entry: Entry,
        by: f64,
    ) -> Result<SecondOrderSystem, ForceError> {
        let [m, c, k] = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness].map(|which| {
            let mut matrix = system.matrix(which).clone();
            if which == entry.matrix {
                matrix[(entry.row, entry.column)] += by;
            }
            matrix
        });
        Ok(SecondOrderSystem::new(m, c, k)?)
    }
}

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
/// [`ForceError::NoSuchEntry`] for an entry outside the matrices, and what `find` returns.
///
/// ```
/// use mechid_force::{Entry, SystemCovariance, continuous, with_uncertain_system};
/// use mechid_model::{Matrix, Response, SecondOrderSystem};
/// use mechid_signal::{Record, Sampling};
/// use nalgebra::dmatrix;
///
/// let sampling = Sampling::new(0.1, 3)?;
/// let wave = |values: [f64; 3]| Record::from_channel(sampling, values.to_vec());
/// let response = Response::new(wave([1.0, 2.0, 0.0])?, wave([0.5; 3])?, wave([0.0; 3])?)?;
/// let system = SecondOrderSystem::new(dmatrix![2.0], dmatrix![3.0], dmatrix![8.0])?;
///
/// // k is known to ±0.2 N/m: where x is 2 m, F is known to ±0.4 N.
/// let stiffness = Entry { matrix: Matrix::Stiffness, row: 0, column: 0 };
/// let known = SystemCovariance::new(vec![stiffness], dmatrix![0.2 * 0.2])?;
/// let force = with_uncertain_system(&system, &known, |s| continuous(s, &response))?;
/// let error = force.standard_error().unwrap();
/// assert!((error.channel(0)[1] - 0.4).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// [`Rule::Given`]: crate::Rule::Given
/// [`Tuning::Given`]: crate::Tuning::Given
pub fn with_uncertain_system(
    system: &SecondOrderSystem,
    known: &SystemCovariance,
    find: impl Fn(&SecondOrderSystem) -> Result<IdentifiedForce, ForceError>,
) -> Result<IdentifiedForce, ForceError> {
    let force = find(system)?;
    let dofs = system.dof();
    let (mut forces, mut rests) = (Vec::new(), Vec::new());
    for (i, &entry) in known.entries.iter().enumerate() {
        let Entry { matrix, row, column } = entry;
        if row >= dofs || column >= dofs {
            return Err(ForceError::NoSuchEntry { matrix, row, column, dofs });
        }
        let step = STEP * known.covariance[(i, i)].sqrt();
        if step == 0.0 {
            forces.push(DMatrix::zeros(force.record().len(), dofs));
            rests.extend(force.rest().map(|rest| rest.left() * 0.0));
            continue;
        }
        let above = find(&known.moved(system, entry, step)?)?;
        let below = find(&known.moved(system, entry, -step)?)?;
        forces.push((above.record().data() - below.record().data()) / (2.0 * step));
        if let (Some(above), Some(below)) = (above.rest(), below.rest()) {
            rests.push((above.left() - below.left()) / (2.0 * step));
        }
    }
    let mut variance = known.variance(force.record().data().shape(), &forces);
    if let Some(error) = force.standard_error() {
        variance.zip_apply(error.data(), |sum, noise| *sum += noise * noise);
    }
    let error = Record::new(force.record().sampling(), variance.map(f64::sqrt))?;
    let rest = force.rest().cloned().map(|rest| {
        let variance = known.variance(rest.left().shape(), &rests);
        rest.with_machine(&variance)
    });
    Ok(force.with_standard_error(Some(error)).with_rest(rest))
}
