//! Decompositions that always end and never panic, for any entries of the matrix.
//!
//! The decompositions of nalgebra iterate without a bound, and panic or do not return if an entry
//! is not finite. Here the entries are checked, the iterations counted, and failure is an error.

#![allow(clippy::disallowed_methods, reason = "the only module that may call these iterations")]

use nalgebra::{ComplexField, DMatrix, DVector, Dyn, SVD, SymmetricEigen};

use crate::NumericsError;
use crate::limits::{EXPONENTIAL_NORM, ITERATIONS, NEGLIGIBLE};

/// Returns the singular value decomposition A = U Σ Vᴴ of a rows × columns matrix, with decreasing
/// singular values in the unit of A, and both sets of singular vectors.
///
/// # Errors
/// [`NumericsError::EntryNotFinite`], [`NumericsError::NotConverged`].
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 8.6.
///
/// ```
/// use mechid_numerics::linear_algebra::svd;
/// use nalgebra::dmatrix;
///
/// let decomposition = svd(dmatrix![3.0, 0.0; 0.0, -5.0])?;
/// assert_eq!(decomposition.singular_values.as_slice(), [5.0, 3.0]);
/// assert!(svd(dmatrix![f64::NAN, 0.0; 0.0, 1.0]).is_err());
/// # Ok::<(), mechid_numerics::NumericsError>(())
/// ```
pub fn svd<T: ComplexField<RealField = f64>>(
    matrix: DMatrix<T>,
) -> Result<SVD<T, Dyn, Dyn>, NumericsError> {
    decomposed(matrix, true, 5.0 * f64::EPSILON)
}

/// Returns the singular values of a rows × columns matrix in decreasing order, in its unit.
///
/// # Errors
/// As [`svd`].
///
/// # Source
/// As [`svd`].
pub fn singular_values<T: ComplexField<RealField = f64>>(
    matrix: DMatrix<T>,
) -> Result<DVector<f64>, NumericsError> {
    decomposed(matrix, false, 5.0 * f64::EPSILON).map(|svd| svd.singular_values)
}

/// Returns the decomposition, converged to `tolerance` relative to the largest entry.
fn decomposed<T: ComplexField<RealField = f64>>(
    mut matrix: DMatrix<T>,
    vectors: bool,
    tolerance: f64,
) -> Result<SVD<T, Dyn, Dyn>, NumericsError> {
    let (rows, columns) = matrix.shape();
    check_finite(&matrix)?;
    clear_negligible(&mut matrix);
    if matrix.is_empty() {
        let u = vectors.then(|| DMatrix::zeros(rows, 0));
        let v_t = vectors.then(|| DMatrix::zeros(0, columns));
        return Ok(SVD { u, v_t, singular_values: DVector::zeros(0) });
    }
    let limit = ITERATIONS * rows.min(columns);
    let mut svd = SVD::try_new_unordered(matrix, vectors, vectors, tolerance, limit)
        .filter(|svd| svd.singular_values.iter().all(|s| s.is_finite()))
        .filter(|svd| [&svd.u, &svd.v_t].iter().all(|part| sound(part.as_ref())))
        .ok_or(NumericsError::NotConverged { rows, columns })?;
    svd.sort_by_singular_values();
    Ok(svd)
}

/// Returns the eigenvalues, unsorted and in the unit of the matrix, and the eigenvectors of a
/// Hermitian n × n matrix; only its lower triangle is read.
///
/// # Errors
/// [`NumericsError::NotSquare`], [`NumericsError::EntryNotFinite`],
/// [`NumericsError::NotConverged`].
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 8.3.
pub fn hermitian_eigen<T: ComplexField<RealField = f64>>(
    mut matrix: DMatrix<T>,
) -> Result<SymmetricEigen<T, Dyn>, NumericsError> {
    let (rows, columns) = matrix.shape();
    check_square(&matrix)?;
    check_finite(&matrix)?;
    clear_negligible(&mut matrix);
    if matrix.is_empty() {
        return Ok(SymmetricEigen { eigenvectors: matrix, eigenvalues: DVector::zeros(0) });
    }
    SymmetricEigen::try_new(matrix, f64::EPSILON, ITERATIONS * rows)
        .filter(|eigen| eigen.eigenvalues.iter().all(|l| l.is_finite()))
        .ok_or(NumericsError::NotConverged { rows, columns })
}

/// Returns the exponential of an n × n matrix of pure numbers.
///
/// # Errors
/// [`NumericsError::NotSquare`], [`NumericsError::EntryNotFinite`];
/// [`NumericsError::ExponentialOverflow`] if the 1-norm of the matrix exceeds 1e11, or if its
/// exponential exceeds the largest number of type `f64`.
///
/// # Source
/// Al-Mohy & Higham (2009), SIAM J. Matrix Anal. Appl. 31, 970–989 (scaling and squaring).
///
/// ```
/// use mechid_numerics::linear_algebra::exponential;
/// use nalgebra::dmatrix;
///
/// assert_eq!(exponential(&dmatrix![0.0, 2.0; 0.0, 0.0])?, dmatrix![1.0, 2.0; 0.0, 1.0]);
/// assert!(exponential(&dmatrix![1e3, 0.0; 0.0, 1.0]).is_err());
/// # Ok::<(), mechid_numerics::NumericsError>(())
/// ```
pub fn exponential(matrix: &DMatrix<f64>) -> Result<DMatrix<f64>, NumericsError> {
    check_square(matrix)?;
    check_finite(matrix)?;
    let sums = matrix.column_iter().map(|column| column.iter().map(|v| v.abs()).sum());
    let norm = sums.fold(0.0, f64::max);
    if matrix.is_empty() {
        return Ok(matrix.clone());
    }
    Some(matrix)
        .filter(|_| norm <= EXPONENTIAL_NORM)
        .map(DMatrix::exp)
        .filter(|eigenvalues| eigenvalues.iter().all(|v| v.is_finite()))
        .ok_or(NumericsError::ExponentialOverflow { norm })
}

fn sound<T: ComplexField>(part: Option<&DMatrix<T>>) -> bool {
    part.is_none_or(|part| part.iter().all(ComplexField::is_finite))
}

fn clear_negligible<T: ComplexField<RealField = f64>>(matrix: &mut DMatrix<T>) {
    let floor = NEGLIGIBLE * matrix.camax();
    for entry in matrix.iter_mut().filter(|entry| (**entry).clone().norm1() < floor) {
        *entry = T::zero();
    }
}

/// Returns [`NumericsError::NotSquare`] for a matrix that is not square.
pub(crate) fn check_square<T>(matrix: &DMatrix<T>) -> Result<(), NumericsError> {
    let (rows, columns) = matrix.shape();
    if rows == columns { Ok(()) } else { Err(NumericsError::NotSquare { rows, columns }) }
}

/// Returns [`NumericsError::EntryNotFinite`] for a matrix with NaN or infinity.
pub(crate) fn check_finite<T: ComplexField>(matrix: &DMatrix<T>) -> Result<(), NumericsError> {
    match matrix.iter().position(|entry| !entry.is_finite()) {
        None => Ok(()),
        Some(at) => Err(NumericsError::EntryNotFinite {
            row: at % matrix.nrows(),
            column: at / matrix.nrows(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Complex, dmatrix};
    use proptest::prelude::*;

    use super::*;

    /// Numbers of every size, NaN and infinity.
    fn entry() -> impl Strategy<Value = f64> {
        prop_oneof![
            4 => -1.0..1.0f64,
            2 => (-320i32..308, -1.0..1.0f64).prop_map(|(e, m)| m * 10f64.powi(e)),
            2 => Just(0.0),
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::MAX), Just(5e-324)],
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]
        #[test]
        fn every_decomposition_of_any_matrix_ends(
            rows in 0usize..7, columns in 0usize..7, entries in prop::collection::vec(entry(), 49)
        ) {
            let matrix = DMatrix::from_fn(rows, columns, |i, j| entries[7 * i + j]);
            let finite = matrix.iter().all(|v| v.is_finite());
            let found = svd(matrix.clone());
            prop_assert!(finite || found.is_err());
            if let Ok(found) = found {
                let s = &found.singular_values;
                prop_assert!(s.as_slice().is_sorted_by(|a, b| a >= b));
                let (u, v_t) = (found.u.unwrap(), found.v_t.unwrap());
                // Large ratios of entries lose digits in the last step of nalgebra, the
                // decomposition of a 2 × 2 matrix.
                if matrix.iter().all(|v| *v == 0.0 || (1e-3..1.0).contains(&v.abs())) {
                    let gap = u * DMatrix::from_diagonal(s) * v_t - &matrix;
                    prop_assert!(gap.norm() < 1e-12, "{}", gap);
                }
            }
            let complex = matrix.map(|v| Complex::new(v, -0.3 * v));
            prop_assert!(finite || singular_values(complex).is_err());
            let square = DMatrix::from_fn(rows, rows, |i, j| entries[7 * i.max(j) + i.min(j)]);
            let _ = hermitian_eigen(square.clone());
            if let Ok(power) = exponential(&square) {
                prop_assert!(power.iter().all(|v| v.is_finite()));
            }
            let _ = crate::RealSchur::new(matrix);
        }
    }

    #[test]
    fn what_cannot_be_decomposed_is_told() {
        let tall: DMatrix<f64> = DMatrix::zeros(3, 2);
        let not_square = NumericsError::NotSquare { rows: 3, columns: 2 };
        assert_eq!(exponential(&tall), Err(not_square.clone()));
        assert_eq!(hermitian_eigen(tall).unwrap_err(), not_square);
        let infinite = dmatrix![1.0, 0.0; 0.0, f64::INFINITY];
        let expected = NumericsError::EntryNotFinite { row: 1, column: 1 };
        assert_eq!(svd(infinite.clone()).unwrap_err(), expected);
        assert_eq!(exponential(&infinite).unwrap_err(), expected);
        // The matrix is nilpotent, but the matrix of the absolute values of its entries is not, so
        // that the bound on the truncation error overflows.
        for large in [1e12, 1e40, 1e300] {
            let refused = exponential(&(dmatrix![1.0, 1.0; -1.0, -1.0] * large));
            assert_eq!(refused, Err(NumericsError::ExponentialOverflow { norm: 2.0 * large }));
        }
    }
}
