//! Sparse matrices: products and factorisations. Matrices with a narrow band are factored in band
//! form; otherwise `faer` factors symmetric positive definite matrices by Cholesky, and all other
//! matrices by LU. The LU factorisation exchanges no rows if the pattern is nearly symmetric and
//! the pivots are large enough.

mod banded;
mod fill;
mod general;
mod ordering;
mod panels;
mod product;
mod symmetric;
mod tridiagonal;
mod unsymmetric;

use nalgebra_sparse::csc::CscMatrix;
use nalgebra_sparse::csr::CsrMatrix;

use crate::error::IntegrateError;
use crate::limits;
use banded::BandedLu;
pub(crate) use general::GeneralLu;
use ordering::Ordering;
pub(crate) use product::Product;
use symmetric::{CholeskyFactors, CholeskyPlan};
use unsymmetric::{UnsymmetricFactors, UnsymmetricPlan};

/// Reason why a matrix was not factored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum NotFactored {
    /// The matrix is singular to rounding; the number is the smallest pivot, relative to the terms
    /// of its row, or the reciprocal condition.
    Singular(f64),
    /// The factors need at least this many bytes, more than the limit.
    TooLarge { bytes: u64, limit: u64 },
}

impl NotFactored {
    /// Returns the error for a system with `dof` degrees of freedom; `singular` creates the error
    /// for a singular matrix.
    pub(crate) fn or_singular(
        self,
        dof: usize,
        singular: impl FnOnce(f64) -> IntegrateError,
    ) -> IntegrateError {
        match self {
            Self::Singular(smallest) => singular(smallest),
            Self::TooLarge { bytes, limit } => {
                IntegrateError::FactorsTooLarge { dof, bytes, limit }
            }
        }
    }
}

/// A sparse matrix, factored once for many solves.
pub(crate) enum SparseLu {
    /// Factors after reordering to a narrow band.
    Banded {
        /// Order of rows and columns that gives the narrow band.
        ordering: Ordering,
        /// Factors of the reordered matrix.
        factors: BandedLu,
        /// The right-hand side in the order of the factors.
        scratch: Vec<f64>,
    },
    /// Factors of a matrix that is symmetric and positive definite.
    Symmetric(Box<CholeskyFactors>),
    /// LU factors, without exchanges of rows, of a matrix with a nearly symmetric pattern.
    Unsymmetric(Box<UnsymmetricFactors>),
    /// Factors of a matrix of any pattern.
    General(Box<GeneralLu<f64>>),
}

impl SparseLu {
    /// Factors `matrix`, unless the factors need more than `limit` bytes. `sizes` has, for each
    /// row, the sum of the moduli of the terms of its entries.
    pub(crate) fn new(
        matrix: &CsrMatrix<f64>,
        sizes: &[f64],
        limit: u64,
    ) -> Result<Self, NotFactored> {
        let ordering = Ordering::narrowing(matrix.pattern());
        let diagonals = ordering.diagonals(matrix.pattern());
        if diagonals > limits::NARROW_BAND_DIAGONALS
            && let Some(plan) = CholeskyPlan::new(matrix, sizes)
            // An entry that is addressed by an index takes about as much time as two entries of a
            // band matrix.
            && (diagonals > limits::BAND_DIAGONALS || 2 * plan.work() < diagonals * matrix.nrows())
            && let Some(factors) = plan.factor(limit)?
        {
            return Ok(Self::Symmetric(Box::new(factors)));
        }
        let is_sized = sizes.iter().all(|size| *size > 0.0 && size.is_finite());
        if diagonals > limits::NARROW_BAND_DIAGONALS
            && is_sized
            && let Some(plan) = UnsymmetricPlan::new(matrix)
            && (diagonals > limits::BAND_DIAGONALS || 2 * plan.work() < diagonals * matrix.nrows())
            && let Some(factors) = plan.factor(matrix, sizes, limit)?
        {
            return Ok(Self::Unsymmetric(Box::new(factors)));
        }
        if diagonals > limits::BAND_DIAGONALS {
            let factors = GeneralLu::new(CscMatrix::from(matrix), sizes, limit)?;
            return Ok(Self::General(Box::new(factors)));
        }
        let factors = BandedLu::new(matrix, &ordering, sizes).map_err(NotFactored::Singular)?;
        Ok(Self::Banded { ordering, factors, scratch: vec![0.0; matrix.nrows()] })
    }

    /// Replaces the right-hand side `b` by the solution.
    pub(crate) fn solve(&mut self, b: &mut [f64]) {
        match self {
            Self::Symmetric(factors) => factors.solve(b),
            Self::Unsymmetric(factors) => factors.solve(b),
            Self::General(factors) => factors.solve(b),
            Self::Banded { ordering, factors, .. } if ordering.is_natural() => factors.solve(b),
            Self::Banded { ordering, factors, scratch } => {
                ordering.gather(b, scratch);
                factors.solve(scratch);
                ordering.scatter(scratch, b);
            }
        }
    }
}

impl std::fmt::Debug for SparseLu {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Banded { factors, .. } => factors.fmt(f),
            Self::Symmetric(factors) => factors.fmt(f),
            Self::Unsymmetric(factors) => factors.fmt(f),
            Self::General(_) => f.write_str("GeneralLu"),
        }
    }
}

/// Returns Σ scaleᵢ Aᵢ of square matrices of one size, and for each row the sum of the moduli of
/// all terms.
pub(crate) fn combination(terms: &[(f64, &CsrMatrix<f64>)]) -> (CsrMatrix<f64>, Vec<f64>) {
    let n = terms[0].1.nrows();
    let (mut offsets, mut columns, mut values) = (Vec::with_capacity(n + 1), vec![], vec![]);
    let (mut sizes, mut place) = (vec![0.0; n], vec![usize::MAX; n]);
    let mut row_columns = Vec::new();
    let mut sums = vec![0.0; n];
    offsets.push(0);
    for (i, size) in sizes.iter_mut().enumerate() {
        row_columns.clear();
        for (scale, matrix) in terms.iter().filter(|(scale, _)| *scale != 0.0) {
            let row = matrix.row(i);
            for (&j, value) in row.col_indices().iter().zip(row.values()) {
                if place[j] != i {
                    place[j] = i;
                    sums[j] = 0.0;
                    row_columns.push(j);
                }
                sums[j] += scale * value;
                *size += (scale * value).abs();
            }
        }
        row_columns.sort_unstable();
        columns.extend_from_slice(&row_columns);
        values.extend(row_columns.iter().map(|&j| sums[j]));
        offsets.push(columns.len());
    }
    let matrix = CsrMatrix::try_from_csr_data(n, n, offsets, columns, values)
        .expect("columns are sorted and below n");
    (matrix, sizes)
}

/// Returns whether the symmetric `matrix` is positive definite: elimination without exchanges then
/// has only positive pivots.
pub(crate) fn is_positive_definite(matrix: &CsrMatrix<f64>) -> bool {
    let ordering = Ordering::narrowing(matrix.pattern());
    if ordering.diagonals(matrix.pattern()) > limits::BAND_DIAGONALS {
        general::has_cholesky_factor(&CscMatrix::from(matrix))
    } else {
        BandedLu::has_positive_pivots(matrix, &ordering)
    }
}
