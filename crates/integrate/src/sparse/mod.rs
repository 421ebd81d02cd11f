//! Sparse matrices: products, and factorisations by band or, where that is wide, by `faer`: of Cholesky for
//! matrices that are found to be symmetric and positive definite, LU for any others, without exchanges of rows where
//! the pattern is nearly symmetric and the pivots allow it.

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

use crate::IntegrateError;
use banded::BandedLu;
pub(crate) use general::GeneralLu;
use ordering::Ordering;
pub(crate) use product::Product;
use symmetric::{CholeskyFactors, Plan};
use unsymmetric::{UnsymmetricFactors, UnsymmetricPlan};

/// Most diagonals of a matrix that is factored by band: about where solutions with a grid in two dimensions
/// take as long either way, 0.4 GB for 100,000 degrees of freedom.
const WIDEST_BAND: usize = 256;

/// Number of diagonals up to which no other factors are looked for.
const NARROW_BAND: usize = 32;

/// Reason why a matrix was not factored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum NotFactored {
    /// The smallest pivot relative to the size of its row (or the reciprocal condition) is no more than
    /// rounding.
    Singular(f64),
    /// The factors take at least so many bytes, and may not.
    TooLarge { bytes: u64, limit: u64 },
}

impl NotFactored {
    /// The error of a system with `dof` degrees of freedom, that of a singular matrix being `singular`.
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

/// A sparse matrix factored once for many solves.
pub(crate) enum SparseLu {
    /// Factors after reordering to a narrow band.
    Banded {
        /// The order of that band.
        ordering: Ordering,
        /// Factors in that order.
        factors: BandedLu,
        /// The right-hand side in that order.
        scratch: Vec<f64>,
    },
    /// Factors of a matrix that is symmetric and positive definite.
    Symmetric(Box<CholeskyFactors>),
    /// Factors of a matrix with a pattern that is nearly symmetric, and pivots that need no exchanges.
    Unsymmetric(Box<UnsymmetricFactors>),
    /// Factors of a matrix of any pattern.
    General(Box<GeneralLu<f64>>),
}

impl SparseLu {
    /// Factors `matrix`, the rows of which are sums of terms of the given `sizes`, unless the factors
    /// take more than `limit` bytes.
    pub(crate) fn new(
        matrix: &CsrMatrix<f64>,
        sizes: &[f64],
        limit: u64,
    ) -> Result<Self, NotFactored> {
        let ordering = Ordering::narrowing(matrix.pattern());
        let diagonals = ordering.diagonals(matrix.pattern());
        if diagonals > NARROW_BAND
            && let Some(plan) = Plan::of(matrix, sizes)
            // An entry that is looked up takes about as long as two of a band.
            && (diagonals > WIDEST_BAND || 2 * plan.work() < diagonals * matrix.nrows())
            && let Some(factors) = plan.factor(limit)?
        {
            return Ok(Self::Symmetric(Box::new(factors)));
        }
        let is_sized = sizes.iter().all(|size| *size > 0.0 && size.is_finite());
        if diagonals > NARROW_BAND
            && is_sized
            && let Some(plan) = UnsymmetricPlan::of(matrix)
            && (diagonals > WIDEST_BAND || 2 * plan.work() < diagonals * matrix.nrows())
            && let Some(factors) = plan.factor(matrix, sizes, limit)?
        {
            return Ok(Self::Unsymmetric(Box::new(factors)));
        }
        if diagonals > WIDEST_BAND {
            let factors = GeneralLu::new(CscMatrix::from(matrix), sizes, limit)?;
            return Ok(Self::General(Box::new(factors)));
        }
        let factors = BandedLu::new(matrix, &ordering, sizes).map_err(NotFactored::Singular)?;
        Ok(Self::Banded { ordering, factors, scratch: vec![0.0; matrix.nrows()] })
    }

    /// Solves for `b`, in place.
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

/// Σ scaleᵢ Aᵢ of square matrices of one size, and the sizes of the sums' terms, row by row.
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

/// Returns whether the symmetric `matrix` is positive definite: whether elimination without exchanges meets
/// positive pivots only.
pub(crate) fn is_positive_definite(matrix: &CsrMatrix<f64>) -> bool {
    let ordering = Ordering::narrowing(matrix.pattern());
    match ordering.diagonals(matrix.pattern()) > WIDEST_BAND {
        true => general::has_cholesky_factor(&CscMatrix::from(matrix)),
        false => BandedLu::has_positive_pivots(matrix, &ordering),
    }
}

/// Numbers between −½ and ½ without structure, the same on every run; `number` chooses among many rows of
/// them.
pub(crate) fn scattered(number: usize) -> impl Iterator<Item = f64> {
    let mut seed = 0x9E37_79B9_7F4A_7C15_u64.wrapping_mul(2 * number as u64 + 1);
    std::iter::repeat_with(move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    })
}
