//! Decompositions of small matrices, which return `None` if the decomposition does not converge or
//! an entry is not finite.

use mechid_model::{RealSchur, linear_algebra};
use nalgebra::{Complex, ComplexField, DMatrix, DVector, Dyn, SVD, SymmetricEigen};

/// Distance of the shift of inverse iteration from the eigenvalue, relative to the norm of the
/// matrix. It is large enough for a regular factorisation, and small enough that one step separates
/// the eigenvector.
const SHIFT: f64 = 1e-13;

/// Number of steps of inverse iteration. The first step reduces the components of other
/// eigenvectors to rounding errors, the second step removes these rounding errors.
const STEPS: usize = 2;

pub(crate) fn svd<T: ComplexField<RealField = f64>>(
    matrix: DMatrix<T>,
) -> Option<SVD<T, Dyn, Dyn>> {
    linear_algebra::svd(matrix).ok()
}

pub(crate) fn singular_values<T: ComplexField<RealField = f64>>(
    matrix: DMatrix<T>,
) -> Option<DVector<f64>> {
    linear_algebra::singular_values(matrix).ok()
}

pub(crate) fn hermitian_eigen<T: ComplexField<RealField = f64>>(
    matrix: DMatrix<T>,
) -> Option<SymmetricEigen<T, Dyn>> {
    linear_algebra::hermitian_eigen(matrix).ok()
}

/// Returns the eigenvalues of a real matrix.
pub(crate) fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    RealSchur::new(matrix.clone()).ok().map(|schur| schur.eigenvalues())
}

/// Returns the eigenvector, of unit length, of a real matrix for a given eigenvalue, by inverse
/// iteration.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 7.6.1.
pub(crate) fn eigenvector(
    matrix: &DMatrix<f64>,
    eigenvalue: Complex<f64>,
) -> Option<DVector<Complex<f64>>> {
    let len = matrix.nrows();
    let shift = eigenvalue + SHIFT * matrix.norm();
    let mut shifted = matrix.map(Complex::from);
    for i in 0..len {
        shifted[(i, i)] -= shift;
    }
    let factor = shifted.lu();
    // A fixed start vector without structure: it is not orthogonal to the eigenvector, and results
    // are reproducible.
    let entry = |i: usize| ((i as f64 + 1.0) * 2.3f64.sqrt()).fract() + 0.25;
    let mut vector = DVector::from_fn(len, |i, _| Complex::from(entry(i)));
    for _ in 0..STEPS {
        vector = factor.solve(&vector)?;
        let norm = vector.norm();
        if !(norm.is_finite() && norm > 0.0) {
            return None;
        }
        vector /= Complex::from(norm);
    }
    Some(vector)
}

/// Returns the unit vector v with the smallest ‖A v‖ for a square complex matrix A.
pub(crate) fn null_vector(matrix: DMatrix<Complex<f64>>) -> Option<DVector<Complex<f64>>> {
    let last = matrix.ncols().checked_sub(1)?;
    let rows = svd(matrix)?.v_t?;
    Some(rows.row(last).adjoint())
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;

    #[test]
    fn vectors_solve_their_equations() {
        let matrix = dmatrix![0.0, 1.0, 0.0; -4.0, -0.2, 1.0; 0.3, 0.0, -2.0];
        for eigenvalue in eigenvalues(&matrix).unwrap() {
            let vector = eigenvector(&matrix, eigenvalue).unwrap();
            let gap = matrix.map(Complex::from) * &vector - &vector * eigenvalue;
            assert!(gap.norm() < 1e-12, "{gap}");
            let mut singular = matrix.map(Complex::from);
            for i in 0..3 {
                singular[(i, i)] -= eigenvalue;
            }
            let null = null_vector(singular).unwrap();
            assert!((null.dotc(&vector).norm() - 1.0).abs() < 1e-12);
        }
        assert!(eigenvalues(&dmatrix![f64::NAN]).is_none());
    }
}
