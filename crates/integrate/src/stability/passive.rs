//! Systems that can only lose energy, and their highest frequencies.

use mechid_model::Matrix;
use mechid_numerics::krylov::start_vector::start_vector;
use mechid_numerics::linear_algebra::hermitian_eigen;
use nalgebra::{DMatrix, DVector};
use nalgebra_sparse::csr::CsrMatrix;

use crate::error::IntegrateError;
use crate::limits;
use crate::sparse::{combination, is_positive_definite};
use crate::stepping::effective_matrix::Equations;
use crate::system::System;

/// Returns whether M is proved symmetric and positive definite, and C and K symmetric and positive
/// semidefinite, by diagonal dominance or by factorisations without exchanges.
pub(crate) fn is_passive(system: &dyn System) -> bool {
    let symmetric = [Matrix::Mass, Matrix::Damping, Matrix::Stiffness]
        .map(|which| Symmetric::from_system(system, which));
    let [Some(mass), Some(damping), Some(stiffness)] = symmetric else { return false };
    mass.is_definite() && damping.is_semidefinite() && stiffness.is_semidefinite()
}

/// Returns whether all eigenvalues of M⁻¹A are below `limit`; A is one of the symmetric matrices of
/// a passive system.
pub(super) fn is_below(system: &dyn System, which: Matrix, limit: f64) -> bool {
    let matrices = system.matrices();
    let difference = match matrices.dense() {
        Some(dense) => Symmetric::Dense(dense.mass() * limit - dense.matrix(which)),
        None => {
            let (mass, matrix) = (matrices.sparse(Matrix::Mass), matrices.sparse(which));
            Symmetric::Sparse(combination(&[(limit, &mass), (-1.0, &matrix)]).0)
        }
    };
    difference.is_definite()
}

/// A symmetric matrix.
enum Symmetric {
    Dense(DMatrix<f64>),
    Sparse(CsrMatrix<f64>),
}

impl Symmetric {
    fn from_system(system: &dyn System, which: Matrix) -> Option<Self> {
        let matrices = system.matrices();
        let close = |a: f64, b: f64| (a - b).abs() <= limits::ASYMMETRY * (a.abs() + b.abs());
        match matrices.dense() {
            Some(dense) => {
                let matrix = dense.matrix(which);
                let n = matrix.nrows();
                let symmetric =
                    (0..n).all(|j| (0..j).all(|i| close(matrix[(i, j)], matrix[(j, i)])));
                symmetric.then(|| Self::Dense(matrix.clone()))
            }
            None => {
                let matrix = matrices.sparse(which);
                let transposed = matrix.transpose();
                let difference = combination(&[(1.0, &matrix), (-1.0, &transposed)]);
                // The difference is compared with the sizes of the terms, row by row.
                let symmetric = difference.0.row_iter().zip(&difference.1).all(|(row, size)| {
                    row.values().iter().all(|v| v.abs() <= limits::ASYMMETRY * size)
                });
                symmetric.then(|| Self::Sparse(matrix.into_owned()))
            }
        }
    }

    fn is_definite(&self) -> bool {
        self.is_dominant(true)
            || match self {
                Self::Dense(matrix) => matrix.clone().cholesky().is_some(),
                Self::Sparse(matrix) => is_positive_definite(matrix),
            }
    }

    fn is_semidefinite(&self) -> bool {
        if self.is_dominant(false) {
            return true;
        }
        let sizes = self.row_sums();
        let largest = sizes.iter().fold(0.0, |most, v| f64::max(most, *v));
        let shift: Vec<f64> =
            sizes.iter().map(|size| limits::SEMIDEFINITE_SHIFT * (size + 1e-3 * largest)).collect();
        let shifted = match self {
            Self::Dense(matrix) => {
                let mut matrix = matrix.clone();
                (0..shift.len()).for_each(|i| matrix[(i, i)] += shift[i]);
                Self::Dense(matrix)
            }
            Self::Sparse(matrix) => {
                let shift = mechid_model::lumped(&shift);
                Self::Sparse(combination(&[(1.0, matrix), (1.0, &shift)]).0)
            }
        };
        shifted.is_definite()
    }

    /// Returns whether every diagonal entry is at least the sum of the moduli of the other entries
    /// of its row, or larger if `strictly`. The matrix is then positive semidefinite, or positive
    /// definite if `strictly`.
    fn is_dominant(&self, strictly: bool) -> bool {
        let sums = self.row_sums();
        let diagonal = |i: usize| match self {
            Self::Dense(matrix) => matrix[(i, i)],
            Self::Sparse(matrix) => matrix.get_entry(i, i).map_or(0.0, |entry| entry.into_value()),
        };
        sums.iter().enumerate().all(|(i, &sum)| {
            let pivot = diagonal(i);
            let off_diagonal = sum - pivot.abs();
            if strictly {
                pivot > off_diagonal * (1.0 + 1e-9)
            } else {
                pivot >= off_diagonal - limits::SEMIDEFINITE_SHIFT * sum
            }
        })
    }

    /// Returns the sum of the moduli of the entries of each row.
    fn row_sums(&self) -> Vec<f64> {
        match self {
            Self::Dense(matrix) => {
                let mut sums = vec![0.0; matrix.nrows()];
                for column in matrix.column_iter() {
                    sums.iter_mut().zip(&column).for_each(|(sum, v)| *sum += v.abs());
                }
                sums
            }
            Self::Sparse(matrix) => {
                matrix.row_iter().map(|row| row.values().iter().map(|v| v.abs()).sum()).collect()
            }
        }
    }
}

/// Vector of norm 1 in the inner product with M, close to the eigenvector of the largest eigenvalue
/// of M⁻¹A.
pub(super) struct Top {
    pub(super) vector: DVector<f64>,
    /// Rayleigh quotient of the vector, in 1/s² or 1/s: at most the largest eigenvalue.
    pub(super) value: f64,
    /// Distance from `value`, in the same unit, within which there is an eigenvalue.
    residual: f64,
}

impl Top {
    /// Returns an upper bound of the largest eigenvalue, to a part in 10⁴, by bisection: M σ − A is
    /// positive definite for all σ above the largest eigenvalue.
    pub(super) fn above(&self, system: &dyn System, which: Matrix) -> f64 {
        let (mut low, mut high) = (self.value, self.value + self.residual);
        if high <= 0.0 {
            return 0.0;
        }
        high *= 1.0 + limits::ENCLOSURE_WIDTH;
        let mut raised = limits::ENCLOSURE_STEP;
        for _ in 0..limits::ENCLOSURE_FACTORISATIONS {
            if is_below(system, which, high) {
                break;
            }
            (low, high) = (high, high * (1.0 + raised));
            raised *= 2.0;
        }
        for _ in 0..limits::ENCLOSURE_FACTORISATIONS {
            if high - low <= limits::ENCLOSURE_WIDTH * low {
                break;
            }
            let middle = 0.5 * (low + high);
            *(if is_below(system, which, middle) { &mut high } else { &mut low }) = middle;
        }
        high
    }
}

/// Returns the result of Lanczos' iteration for the largest eigenvalue of M⁻¹A, where A is C or K
/// of a passive system.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 10.1; Parlett, *The Symmetric
/// Eigenvalue Problem* (1998), section 13.2, on the residual.
pub(super) fn top(equations: &Equations, which: Matrix) -> Result<Top, IntegrateError> {
    let n = equations.dof();
    let mut mass = equations.mass_only("Lanczos", 0.0)?;
    let zeros = vec![0.0; n];
    // The vectors qᵢ are orthonormal in the inner product with M; the products M qᵢ are stored,
    // too.
    let (mut basis, mut weighted): (Vec<DVector<f64>>, Vec<DVector<f64>>) = (vec![], vec![]);
    let (mut diagonal, mut beside): (Vec<f64>, Vec<f64>) = (vec![], vec![]);
    let mut next = start_vector(n);
    loop {
        let mut image = equations.times(Matrix::Mass, &next);
        let norm = next.dot(&image).max(0.0).sqrt();
        if !basis.is_empty() {
            beside.push(norm);
        }
        let scale = diagonal.iter().fold(0.0, |most, v| f64::max(most, v.abs()));
        let ended = !basis.is_empty() && norm <= 1e-14 * scale;
        if basis.len() == limits::LANCZOS_STEPS.min(n) || ended {
            break;
        }
        next /= norm;
        image /= norm;
        basis.push(next.clone());
        weighted.push(image);
        // The next vector is M⁻¹ A q, made orthogonal to all earlier ones; two passes are enough.
        let mut product = zeros.clone();
        match which {
            Matrix::Damping => mass.solve(0.0, next.as_slice(), &zeros, &mut product)?,
            _ => mass.solve(0.0, &zeros, next.as_slice(), &mut product)?,
        }
        next = -DVector::from_vec(product);
        diagonal.push(0.0);
        for _ in 0..2 {
            for (i, (q, mq)) in basis.iter().zip(&weighted).enumerate() {
                let part = mq.dot(&next);
                next.axpy(-part, q, 1.0);
                if i + 1 == basis.len() {
                    diagonal[i] += part;
                }
            }
        }
    }
    let m = diagonal.len();
    let tridiagonal = DMatrix::from_fn(m, m, |i, j| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => beside[i.min(j)],
        _ => 0.0,
    });
    let eigen = hermitian_eigen(tridiagonal)?;
    let at = eigen.eigenvalues.imax();
    let value = eigen.eigenvalues[at].max(0.0);
    let coordinates = eigen.eigenvectors.column(at);
    let residual = beside[m - 1] * coordinates[m - 1].abs();
    let mut vector = DVector::zeros(n);
    basis.iter().zip(&coordinates).for_each(|(q, y)| vector.axpy(*y, q, 1.0));
    Ok(Top { vector, value, residual })
}
