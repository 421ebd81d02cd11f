//! Cholesky factors of symmetric positive definite matrices, by `faer`.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::cholesky::{
    SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::{Par, Side};
use nalgebra_sparse::csc::CscMatrix;
use nalgebra_sparse::csr::CsrMatrix;

use crate::sparse::NotFactored;
use crate::sparse::general::{pattern, reciprocal_condition};
use crate::sparse::panels::{Columns, Panels};

/// Factors of a matrix in minimum-degree order. Rows and columns are scaled by the sizes of their
/// terms. These factors have far fewer entries than a band, or than LU factors with exchanges of
/// rows.
#[derive(Debug)]
pub(crate) struct CholeskyFactors {
    panels: Panels,
    /// Row of the matrix that corresponds to each row of the factors, and the scale of this row of
    /// the matrix: 1 / √(size of its terms).
    order: Vec<(u32, f64)>,
    /// The right-hand side in the order of the factors.
    scratch: Vec<f64>,
}

/// The elimination order of a symmetric matrix, found before the factorisation.
pub(crate) struct CholeskyPlan {
    matrix: CscMatrix<f64>,
    symbolic: SymbolicCholesky<usize>,
    scales: Vec<f64>,
}

impl CholeskyPlan {
    /// Returns the elimination order of `matrix` if the matrix is symmetric. `sizes` has, for each
    /// row, the sum of the moduli of the terms of its entries.
    pub(crate) fn new(matrix: &CsrMatrix<f64>, sizes: &[f64]) -> Option<Self> {
        let columns = CscMatrix::from(matrix);
        // The columns of a symmetric matrix are its rows.
        let symmetric =
            columns.pattern() == matrix.pattern() && columns.values() == matrix.values();
        if !symmetric || sizes.iter().any(|size| !(*size > 0.0 && size.is_finite())) {
            return None;
        }
        let scales: Vec<f64> = sizes.iter().map(|size| size.sqrt().recip()).collect();
        let mut matrix = columns;
        for (i, j, value) in matrix.triplet_iter_mut() {
            *value *= scales[i] * scales[j];
        }
        let order = SymmetricOrdering::Amd;
        let pattern = pattern(&matrix);
        let symbolic =
            factorize_symbolic_cholesky(pattern, Side::Lower, order, Default::default()).ok()?;
        Some(Self { matrix, symbolic, scales })
    }

    /// Returns the number of entries that a solve reads.
    pub(crate) fn work(&self) -> usize {
        2 * self.symbolic.len_val()
    }

    /// Factors the matrix, unless the factors need more than `limit` bytes; none if it is not
    /// positive definite.
    pub(crate) fn factor(self, limit: u64) -> Result<Option<CholeskyFactors>, NotFactored> {
        let Self { matrix, symbolic, scales } = self;
        let bytes = (symbolic.len_val() as u64).saturating_mul(size_of::<f64>() as u64);
        if bytes > limit {
            return Err(NotFactored::TooLarge { bytes, limit });
        }
        let mut values = vec![0.0; symbolic.len_val()];
        let workspace = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let Ok(mut workspace) = MemBuffer::try_new(workspace) else { return Ok(None) };
        let factored = symbolic.factorize_numeric_llt(
            &mut values,
            SparseColMatRef::new(pattern(&matrix), matrix.values()),
            Side::Lower,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut workspace),
            Default::default(),
        );
        if factored.is_err() {
            return Ok(None);
        }
        drop((matrix, workspace));
        let panels = Panels::from_columns(&Columns::new(&symbolic, &values));
        let order: Vec<u32> = match symbolic.perm() {
            Some(order) => order.arrays().0.iter().map(|row| *row as u32).collect(),
            None => (0..scales.len() as u32).collect(),
        };
        let order: Vec<_> = order.into_iter().map(|row| (row, scales[row as usize])).collect();
        let scratch = vec![0.0; order.len()];
        let factors = CholeskyFactors { panels, order, scratch };
        match reciprocal_condition(scales.len(), |vector| factors.panels.solve(vector)) {
            reciprocal if reciprocal > f64::EPSILON => Ok(Some(factors)),
            reciprocal => Err(NotFactored::Singular(reciprocal)),
        }
    }
}

impl CholeskyFactors {
    /// Replaces the right-hand side `b` by the solution.
    pub(crate) fn solve(&mut self, b: &mut [f64]) {
        for (scaled, (row, scale)) in self.scratch.iter_mut().zip(&self.order) {
            *scaled = b[*row as usize] * scale;
        }
        self.panels.solve(&mut self.scratch);
        for (solved, (row, scale)) in self.scratch.iter().zip(&self.order) {
            b[*row as usize] = solved * scale;
        }
    }
}

#[cfg(test)]
mod tests {
    use faer::sparse::linalg::cholesky::SymbolicCholeskyRaw;
    use mechid_model::triplets;
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::sparse::SparseLu;

    /// A grid of `side` × `side` × `layers` nodes, each coupled to its neighbours.
    fn grid(side: usize, layers: usize, diagonal: f64) -> CsrMatrix<f64> {
        let at = |i: usize, j: usize, k: usize| (k * side + i) * side + j;
        let mut entries = vec![];
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            for k in 0..layers {
                entries.push((at(i, j, k), at(i, j, k), diagonal + 0.01 * i as f64));
                let next = [(i + 1, j, k), (i, j + 1, k), (i, j, k + 1)];
                for (i2, j2, k2) in next.into_iter().filter(|n| n.0 < side && n.1 < side) {
                    if k2 < layers {
                        entries.push((at(i, j, k), at(i2, j2, k2), -1.0));
                        entries.push((at(i2, j2, k2), at(i, j, k), -1.0));
                    }
                }
            }
        }
        triplets(side * side * layers, entries).unwrap()
    }

    fn sizes(matrix: &CsrMatrix<f64>) -> Vec<f64> {
        matrix.row_iter().map(|row| row.values().iter().map(|v| v.abs()).sum()).collect()
    }

    /// The columns of flat grids are factored one by one, the columns of cubes in groups; both
    /// factorisations give the solution.
    #[test]
    fn grids_are_solved() {
        for (side, layers, joint) in [(24, 1, false), (20, 20, true)] {
            let matrix = grid(side, layers, 6.5);
            let n = matrix.nrows();
            let plan = CholeskyPlan::new(&matrix, &sizes(&matrix)).unwrap();
            assert_eq!(matches!(plan.symbolic.raw(), SymbolicCholeskyRaw::Supernodal(_)), joint);
            let mut factors = SparseLu::new(&matrix, &sizes(&matrix), u64::MAX).unwrap();
            assert!(matches!(factors, SparseLu::Symmetric(_)), "{side}");
            let x = DVector::from_fn(n, |i, _| (i as f64).sin());
            let mut found = &matrix * &x;
            factors.solve(found.as_mut_slice());
            assert!((found - x).amax() < 1e-13);
        }
    }

    #[test]
    fn what_is_not_definite_is_factored_otherwise() {
        // With this diagonal, the matrix has positive and negative eigenvalues.
        let matrix = grid(24, 1, 2.1);
        let mut factors = SparseLu::new(&matrix, &sizes(&matrix), u64::MAX).unwrap();
        assert!(!matches!(factors, SparseLu::Symmetric(_)));
        let x = DVector::from_fn(matrix.nrows(), |i, _| (i as f64).cos());
        let mut found = &DMatrix::from(&matrix) * &x;
        factors.solve(found.as_mut_slice());
        assert!((found - x).amax() < 1e-9);
    }

    #[test]
    fn factors_beyond_the_limit_are_refused_before_they_are_computed() {
        let matrix = grid(8, 8, 6.5);
        let refused = SparseLu::new(&matrix, &sizes(&matrix), 1000).err();
        let Some(NotFactored::TooLarge { bytes, limit: 1000 }) = refused else {
            panic!("{refused:?}")
        };
        assert!((50_000..1_000_000).contains(&bytes), "{bytes}");
    }
}
