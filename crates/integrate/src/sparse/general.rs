//! LU factors of any sparse matrix, real or complex, by the crate `faer`.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use mechid_numerics::krylov::start_vector::pseudo_random;
use nalgebra::ComplexField;
use nalgebra_sparse::csc::CscMatrix;

use crate::limits;
use crate::sparse::{NotFactored, fill};

/// Factors of a matrix with columns in an order of little fill-in (COLAMD). Rows are scaled by the
/// sizes of their terms, and exchanged for stability.
pub(crate) struct GeneralLu<T> {
    symbolic: SymbolicLu<usize>,
    numeric: NumericLu<usize, T>,
    /// Reciprocal of the size of the terms of each row.
    scales: Vec<f64>,
    scratch: MemBuffer,
}

impl<T> GeneralLu<T>
where
    T: ComplexField<RealField = f64> + faer::traits::ComplexField,
{
    /// Factors `matrix`, unless the factors need more than `limit` bytes. `sizes` has, for each
    /// row, the sum of the moduli of the terms of its entries.
    pub(crate) fn new(
        mut matrix: CscMatrix<T>,
        sizes: &[f64],
        limit: u64,
    ) -> Result<Self, NotFactored> {
        const SINGULAR: NotFactored = NotFactored::Singular(0.0);
        if sizes.iter().any(|size| !(*size > 0.0 && size.is_finite())) {
            return Err(SINGULAR);
        }
        let scales: Vec<f64> = sizes.iter().map(|size| size.recip()).collect();
        for (i, _, value) in matrix.triplet_iter_mut() {
            *value *= T::from_real(scales[i]);
        }
        let pattern = pattern(&matrix);
        let view = SparseColMatRef::new(pattern, matrix.values());
        let symbolic = factorize_symbolic_lu(pattern, Default::default()).map_err(|_| SINGULAR)?;
        let entries = fill::entries(matrix.pattern(), symbolic.col_perm().arrays().0);
        let bytes = entries.saturating_mul(size_of::<T>() as u64);
        if bytes > limit {
            return Err(NotFactored::TooLarge { bytes, limit });
        }
        let workspace = symbolic.factorize_numeric_lu_scratch::<T>(Par::Seq, Default::default());
        let mut workspace = MemBuffer::try_new(workspace).map_err(|_| SINGULAR)?;
        let mut numeric = NumericLu::new();
        symbolic
            .factorize_numeric_lu(
                &mut numeric,
                view,
                Par::Seq,
                MemStack::new(&mut workspace),
                Default::default(),
            )
            .map_err(|_| SINGULAR)?;
        let scratch = symbolic.solve_in_place_scratch::<T>(1, Par::Seq);
        let scratch = MemBuffer::try_new(scratch).map_err(|_| SINGULAR)?;
        let mut factors = Self { symbolic, numeric, scales, scratch };
        match reciprocal_condition(factors.scales.len(), |vector| factors.solve_scaled(vector)) {
            // NaN (from a pivot of zero) fails the test too.
            reciprocal if reciprocal > f64::EPSILON => Ok(factors),
            reciprocal => Err(NotFactored::Singular(reciprocal)),
        }
    }

    /// Replaces the right-hand side `b` by the solution.
    pub(crate) fn solve(&mut self, b: &mut [T]) {
        b.iter_mut().zip(&self.scales).for_each(|(b, scale)| *b *= T::from_real(*scale));
        self.solve_scaled(b);
    }

    fn solve_scaled(&mut self, b: &mut [T]) {
        let n = b.len();
        LuRef::new_unchecked(&self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(b, n, 1),
            Par::Seq,
            MemStack::new(&mut self.scratch),
        );
    }
}

/// Estimates the reciprocal condition of a scaled matrix, whose largest entry is at most 1: the
/// smallest ratio of the norms of A x and x that a few inverse iterations with `solve` find.
pub(super) fn reciprocal_condition<T>(n: usize, mut solve: impl FnMut(&mut [T])) -> f64
where
    T: ComplexField<RealField = f64>,
{
    let mut vector: Vec<T> = pseudo_random(0).take(n).map(T::from_real).collect();
    let mut growth = 0.0_f64;
    for _ in 0..limits::CONDITION_STEPS {
        let before = largest(&vector);
        vector.iter_mut().for_each(|v| *v /= T::from_real(before));
        solve(&mut vector);
        let after = largest(&vector);
        if !after.is_finite() {
            return 0.0;
        }
        growth = growth.max(after);
    }
    growth.recip()
}

/// Returns whether the symmetric `matrix` has a Cholesky factor.
pub(super) fn has_cholesky_factor(matrix: &CscMatrix<f64>) -> bool {
    SparseColMatRef::new(pattern(matrix), matrix.values()).sp_cholesky(Side::Lower).is_ok()
}

pub(super) fn pattern<T>(matrix: &CscMatrix<T>) -> SymbolicSparseColMatRef<'_, usize> {
    let (offsets, rows) = (matrix.col_offsets(), matrix.row_indices());
    SymbolicSparseColMatRef::new_checked(matrix.nrows(), matrix.ncols(), offsets, None, rows)
}

/// Returns the largest modulus; NaN if an entry is NaN.
fn largest<T: ComplexField<RealField = f64>>(vector: &[T]) -> f64 {
    vector
        .iter()
        .map(|v| v.clone().modulus())
        .fold(0.0, |most: f64, v| if v <= most { most } else { v })
}

#[cfg(test)]
mod tests {
    use mechid_model::triplets;
    use mechid_numerics::linear_algebra::hermitian_eigen;
    use nalgebra::{Complex, DMatrix, DVector};
    use nalgebra_sparse::csr::CsrMatrix;

    use super::*;
    use crate::sparse::{Ordering, SparseLu, is_positive_definite};

    /// A matrix that couples every degree of freedom to a few distant ones, so that no order gives
    /// a narrow band; small diagonal entries make exchanges of rows necessary.
    fn wide(n: usize, diagonal: f64, skew: f64) -> CsrMatrix<f64> {
        let links = (0..n).flat_map(|i| [(i, (i * i + 1) % n), (i, (7 * i + 3) % n)]);
        let entries = links.flat_map(|(i, j)| [(i, j, -1.0 - skew), (j, i, -1.0 + skew)]);
        let own = (0..n).map(|i| (i, i, diagonal + 0.01 * (i % 13) as f64));
        triplets(n, own.chain(entries)).unwrap()
    }

    fn sizes(matrix: &CsrMatrix<f64>) -> Vec<f64> {
        matrix.row_iter().map(|row| row.values().iter().map(|v| v.abs()).sum()).collect()
    }

    #[test]
    fn solutions_of_wide_matrices_are_the_dense_ones() {
        for (diagonal, skew) in [(9.0, 0.0), (9.0, 0.4), (0.02, 0.4)] {
            let matrix = wide(700, diagonal, skew);
            let ordering = Ordering::narrowing(matrix.pattern());
            assert!(ordering.diagonals(matrix.pattern()) > limits::BAND_DIAGONALS);
            let x = DVector::from_fn(700, |i, _| (i as f64).sin());
            let b = &DMatrix::from(&matrix) * &x;
            let mut found = b.clone();
            let mut factors = SparseLu::new(&matrix, &sizes(&matrix), u64::MAX).unwrap();
            factors.solve(found.as_mut_slice());
            let residual = (&DMatrix::from(&matrix) * &found - b).amax();
            assert!(residual < 1e-12 * found.amax(), "{diagonal} {skew}: {residual:e}");
            if diagonal > 1.0 {
                assert!((found - x).amax() < 1e-12);
            }
        }
    }

    #[test]
    fn complex_solutions_are_the_dense_ones() {
        let matrix = wide(150, 4.0, 0.3);
        let dense = DMatrix::from(&matrix).map(|v| Complex::new(v, 0.3 * v * v));
        let x = DVector::from_fn(150, |i, _| Complex::new((i as f64).sin(), (i as f64).cos()));
        let mut found = &dense * &x;
        let sizes: Vec<f64> =
            dense.row_iter().map(|row| row.iter().map(|v| v.norm()).sum()).collect();
        let mut factors = GeneralLu::new(CscMatrix::from(&dense), &sizes, u64::MAX).unwrap();
        factors.solve(found.as_mut_slice());
        assert!((found - x).camax() < 1e-12);
    }

    #[test]
    fn singular_wide_matrices_are_refused() {
        // The matrix is the Laplacian of the links: equal displacements cause no force.
        let n = 700;
        let links = wide(n, 0.0, 0.0);
        let degree = |i: usize| -links.row(i).values().iter().sum::<f64>();
        let free = triplets(
            n,
            links
                .triplet_iter()
                .map(|(i, j, v)| (i, j, *v))
                .chain((0..n).map(|i| (i, i, degree(i)))),
        )
        .unwrap();
        let refused = SparseLu::new(&free, &sizes(&free), u64::MAX).err();
        assert!(matches!(refused, Some(NotFactored::Singular(r)) if r < 1e-15), "{refused:?}");
        // A matrix with an empty row and an empty column must be refused.
        let empty = triplets(
            n,
            wide(n, 9.0, 0.0)
                .triplet_iter()
                .filter_map(|(i, j, v)| (i != 5 && j != 5).then_some((i, j, *v))),
        );
        let empty = empty.unwrap();
        let mut row_sizes = sizes(&empty);
        assert!(SparseLu::new(&empty, &row_sizes, u64::MAX).is_err());
        row_sizes[5] = 1.0;
        assert!(SparseLu::new(&empty, &row_sizes, u64::MAX).is_err());
    }

    #[test]
    fn definiteness_of_wide_matrices_is_that_of_their_eigenvalues() {
        for (diagonal, definite) in [(9.0, true), (3.0, false)] {
            let matrix = wide(500, diagonal, 0.0);
            let lowest = hermitian_eigen(DMatrix::from(&matrix)).unwrap().eigenvalues.min();
            assert_eq!(lowest > 0.0, definite, "{lowest}");
            assert_eq!(is_positive_definite(&matrix), definite);
        }
    }
}
