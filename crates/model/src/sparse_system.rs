//! Linear systems with sparse matrices: M ẍ + C ẋ + K x = F.

use nalgebra_sparse::coo::CooMatrix;
use nalgebra_sparse::csr::CsrMatrix;

use crate::{Matrix, ModelError, SecondOrderSystem};

/// Linear system M ẍ + C ẋ + K x = F with n degrees of freedom and sparse matrices of any symmetry.
///
/// ```
/// use mechid_model::{SparseSystem, band, triplets};
///
/// // A chain of 100,000 masses of 1 kg on springs of 900 N/m, a damper of 3 N·s/m at its end.
/// let n = 100_000;
/// let mass = band(n, &[(0, 1.0)]);
/// let damping = triplets(n, [(n - 1, n - 1, 3.0)])?;
/// let stiffness = band(n, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
/// assert_eq!(SparseSystem::new(mass, damping, stiffness)?.dof(), n);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
///
/// A [`CsrMatrix`] can also be created from a dense matrix: `CsrMatrix::from(&dense)`.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseSystem {
    mass: CsrMatrix<f64>,
    damping: CsrMatrix<f64>,
    stiffness: CsrMatrix<f64>,
    factor_limit: u64,
}

impl SparseSystem {
    /// Default memory limit for the factors of the matrices, in bytes.
    pub const FACTOR_LIMIT: u64 = 4_000_000_000;

    /// Creates a system from the n×n matrices M (kg), C (N·s/m) and K (N/m).
    ///
    /// # Errors
    /// [`ModelError::Shape`], [`ModelError::NotFinite`], [`ModelError::NoDof`], and
    /// [`ModelError::SingularMass`] if M has a row or a column of zeros, or is diagonal with
    /// entries that span more than 15 decades. Any other singular M is detected when it is
    /// factored.
    pub fn new(
        mass: CsrMatrix<f64>,
        damping: CsrMatrix<f64>,
        stiffness: CsrMatrix<f64>,
    ) -> Result<Self, ModelError> {
        let dof = mass.nrows();
        if dof == 0 {
            return Err(ModelError::NoDof);
        }
        for (matrix, entries) in
            [(Matrix::Mass, &mass), (Matrix::Damping, &damping), (Matrix::Stiffness, &stiffness)]
        {
            let (rows, columns) = (entries.nrows(), entries.ncols());
            if (rows, columns) != (dof, dof) {
                return Err(ModelError::Shape { matrix, rows, columns, dof });
            }
            check_finite(matrix, entries.triplet_iter().map(|(i, j, v)| (i, j, *v)))?;
        }
        let reciprocal_condition = mass_spread(&mass);
        if reciprocal_condition < 1e-15 {
            return Err(ModelError::SingularMass { reciprocal_condition });
        }
        Ok(Self { mass, damping, stiffness, factor_limit: Self::FACTOR_LIMIT })
    }

    /// Returns the system with another memory limit, in bytes, for the factors of its matrices:
    /// fill-in makes the factors of three-dimensional bodies large and slow.
    pub fn with_factor_limit(self, bytes: u64) -> Self {
        Self { factor_limit: bytes, ..self }
    }

    /// Returns the memory limit for the factors of the matrices, in bytes.
    pub fn factor_limit(&self) -> u64 {
        self.factor_limit
    }

    /// Number of degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.mass.nrows()
    }

    /// Returns one of the three matrices by name, n×n, in kg, N·s/m or N/m.
    pub fn matrix(&self, which: Matrix) -> &CsrMatrix<f64> {
        match which {
            Matrix::Mass => &self.mass,
            Matrix::Damping => &self.damping,
            Matrix::Stiffness => &self.stiffness,
        }
    }
}

impl From<&SecondOrderSystem> for SparseSystem {
    /// Converts a dense system; zeros are not stored.
    fn from(dense: &SecondOrderSystem) -> Self {
        Self {
            mass: CsrMatrix::from(dense.mass()),
            damping: CsrMatrix::from(dense.damping()),
            stiffness: CsrMatrix::from(dense.stiffness()),
            factor_limit: Self::FACTOR_LIMIT,
        }
    }
}

/// Returns the `dof`×`dof` matrix with the given (row, column, value) entries, counted from 0, in
/// the unit of the values; entries with the same indices are added, as in the assembly of elements.
///
/// # Errors
/// [`ModelError::EntryOutside`] if a row or column is not below `dof`.
pub fn triplets(
    dof: usize,
    entries: impl IntoIterator<Item = (usize, usize, f64)>,
) -> Result<CsrMatrix<f64>, ModelError> {
    let mut coo = CooMatrix::new(dof, dof);
    entries.into_iter().try_for_each(|(row, column, value)| {
        if row >= dof || column >= dof {
            return Err(ModelError::EntryOutside { row: row + 1, column: column + 1, dof });
        }
        coo.push(row, column, value);
        Ok(())
    })?;
    Ok(CsrMatrix::from(&coo))
}

/// Returns the `dof`×`dof` diagonal matrix of the `dof` given values, in their unit: lumped masses,
/// springs or dampers to the ground.
pub fn lumped(values: &[f64]) -> CsrMatrix<f64> {
    let dof = values.len();
    let (offsets, columns) = ((0..=dof).collect(), (0..dof).collect());
    CsrMatrix::try_from_csr_data(dof, dof, offsets, columns, values.to_vec())
        .expect("one entry per row")
}

/// Returns the `dof`×`dof` matrix with one value (in its own unit) along each of the given
/// diagonals; offset 1 is the first diagonal above the main one, offset −1 the first below.
pub fn band(dof: usize, diagonals: &[(isize, f64)]) -> CsrMatrix<f64> {
    let mut coo = CooMatrix::new(dof, dof);
    for row in 0..dof {
        for &(offset, value) in diagonals {
            if let Some(column) = row.checked_add_signed(offset).filter(|column| *column < dof) {
                coo.push(row, column, value);
            }
        }
    }
    CsrMatrix::from(&coo)
}

/// Returns an error for the first entry that is not finite. Rows and columns of `entries` are
/// counted from 0; the error counts from 1.
fn check_finite(
    matrix: Matrix,
    entries: impl IntoIterator<Item = (usize, usize, f64)>,
) -> Result<(), ModelError> {
    match entries.into_iter().find(|(_, _, value)| !value.is_finite()) {
        None => Ok(()),
        Some((row, column, value)) => {
            Err(ModelError::NotFinite { matrix, row: row + 1, column: column + 1, value })
        }
    }
}

/// Returns 0 if M has an empty row or column. Otherwise returns the ratio of the smallest to the
/// largest magnitude of the entries of a diagonal M, and 1 for any other M.
fn mass_spread(mass: &CsrMatrix<f64>) -> f64 {
    let dof = mass.nrows();
    let (mut rows, mut columns) = (vec![0.0_f64; dof], vec![0.0_f64; dof]);
    let mut diagonal = true;
    for (i, j, value) in mass.triplet_iter() {
        rows[i] = rows[i].max(value.abs());
        columns[j] = columns[j].max(value.abs());
        diagonal &= i == j || *value == 0.0;
    }
    let least = rows.iter().chain(&columns).fold(f64::INFINITY, |least, v| least.min(*v));
    if least == 0.0 {
        return 0.0;
    }
    if diagonal { least / rows.iter().fold(0.0, |most, v| f64::max(most, *v)) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, dmatrix};

    use super::*;

    #[test]
    fn entries_at_one_place_are_added() {
        let k = triplets(2, [(0, 0, 3.0), (0, 1, -1.0), (0, 0, 2.0), (1, 1, 4.0)]).unwrap();
        assert_eq!(DMatrix::from(&k), dmatrix![5.0, -1.0; 0.0, 4.0]);
        let outside = triplets(2, [(0, 2, 3.0)]).unwrap_err();
        assert_eq!(outside, ModelError::EntryOutside { row: 1, column: 3, dof: 2 });
    }

    #[test]
    fn bands_end_at_the_border() {
        let k = band(3, &[(-1, -1.0), (0, 2.0), (2, 7.0)]);
        assert_eq!(DMatrix::from(&k), dmatrix![2.0, 0.0, 7.0; -1.0, 2.0, 0.0; 0.0, -1.0, 2.0]);
    }

    #[test]
    fn bad_matrices_are_refused_with_their_numbers() {
        let one = || lumped(&[1.0, 1.0]);
        let refused = SparseSystem::new(one(), lumped(&[1.0]), one()).unwrap_err();
        let expected = ModelError::Shape { matrix: Matrix::Damping, rows: 1, columns: 1, dof: 2 };
        assert_eq!(refused, expected);
        let refused = SparseSystem::new(one(), one(), lumped(&[1.0, f64::NAN])).unwrap_err();
        let here = |m| matches!(m, ModelError::NotFinite { row: 2, column: 2, .. });
        assert!(here(refused));
        for mass in [
            lumped(&[1.0, 0.0]),
            lumped(&[1.0, 1e-16]),
            triplets(2, [(0, 0, 1.0), (1, 0, 1.0)]).unwrap(),
        ] {
            let refused = SparseSystem::new(mass, one(), one()).unwrap_err();
            assert!(matches!(refused, ModelError::SingularMass { .. }), "{refused}");
        }
        let none = || lumped(&[]);
        assert_eq!(SparseSystem::new(none(), none(), none()), Err(ModelError::NoDof));
    }

    #[test]
    fn a_dense_system_keeps_its_entries() {
        let dense = SecondOrderSystem::new(
            dmatrix![2.0, 0.1; 0.0, 1.5],
            dmatrix![1.1, 0.0; -0.2, 0.9],
            dmatrix![30.0, -8.0; -11.0, 40.0],
        )
        .unwrap();
        let sparse = SparseSystem::from(&dense);
        for which in [Matrix::Mass, Matrix::Damping, Matrix::Stiffness] {
            assert_eq!(&DMatrix::from(sparse.matrix(which)), dense.matrix(which));
        }
        assert_eq!(sparse.matrix(Matrix::Damping).nnz(), 3);
    }
}
