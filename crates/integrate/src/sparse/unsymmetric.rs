//! LU factors without exchanges, for matrices with a nearly symmetric pattern, such as those of
//! gyroscopic forces and bearings.

use faer::Side;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use mechid_numerics::krylov::start_vector::pseudo_random;
use nalgebra_sparse::csc::CscMatrix;
use nalgebra_sparse::csr::CsrMatrix;

use crate::limits;
use crate::sparse::general::{pattern, reciprocal_condition};
use crate::sparse::panels::{Columns, Panels};
use crate::sparse::{NotFactored, combination};

/// Factors L U of a matrix A in the minimum-degree order for the pattern of A + Aᵀ. Rows and
/// columns are scaled by the sizes of their terms. L and U have the pattern of a Cholesky factor,
/// with far fewer entries than a band, or than factors with exchanges of rows.
///
/// # Source
/// George & Liu, *Computer Solution of Large Sparse Positive Definite Systems* (1981), chapter 5
/// (lists of the columns that change the next one); Golub & Van Loan, *Matrix Computations*, 4th
/// ed. (2013), section 4.3.4, on LU without exchanges where the symmetric part is definite.
#[derive(Debug)]
pub(crate) struct UnsymmetricFactors {
    /// Factor L, with the pivots on its diagonal; `upper` is Uᵀ, with a diagonal of 1.
    lower: Panels,
    upper: Panels,
    /// Row of the matrix for each row of the factors, and 1 / √(size of its terms).
    order: Vec<(u32, f64)>,
    /// The right-hand side in the order of the factors.
    scratch: Vec<f64>,
}

/// The elimination order of a matrix, found from its pattern before the factorisation.
pub(crate) struct UnsymmetricPlan {
    symbolic: SymbolicCholesky<usize>,
}

impl UnsymmetricPlan {
    /// Returns the elimination order of `matrix`; `None` if a factorisation column by column would
    /// take too long.
    pub(crate) fn new(matrix: &CsrMatrix<f64>) -> Option<Self> {
        let both = combination(&[(1.0, matrix), (1.0, &matrix.transpose())]).0;
        let columns = CscMatrix::from(&both);
        let one_by_one = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(
            pattern(&columns),
            Side::Lower,
            SymmetricOrdering::Amd,
            one_by_one,
        )
        .ok()?;
        let plan = Self { symbolic };
        let (starts, _) = plan.columns()?;
        let operations =
            starts.windows(2).map(|ends| 2.0 * ((ends[1] - ends[0]) as f64).powi(2)).sum::<f64>();
        (operations < limits::COLUMN_OPERATIONS).then_some(plan)
    }

    /// Returns the number of entries that a solve reads.
    pub(crate) fn work(&self) -> usize {
        2 * self.symbolic.len_val()
    }

    /// Returns the index of the first entry of each column of the factors, and the row of every
    /// entry.
    fn columns(&self) -> Option<(&[usize], &[usize])> {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(symbolic) => {
                Some((symbolic.col_ptr(), symbolic.row_idx()))
            }
            SymbolicCholeskyRaw::Supernodal(_) => None,
        }
    }

    /// Factors `matrix`, unless the factors need more than `limit` bytes; `None` if exchanges of
    /// rows are necessary. `sizes` has, for each row, the sum of the moduli of the terms of its
    /// entries.
    pub(crate) fn factor(
        self,
        matrix: &CsrMatrix<f64>,
        sizes: &[f64],
        limit: u64,
    ) -> Result<Option<UnsymmetricFactors>, NotFactored> {
        let entries = self.symbolic.len_val();
        let bytes = (2 * entries as u64).saturating_mul(size_of::<f64>() as u64);
        if bytes > limit {
            return Err(NotFactored::TooLarge { bytes, limit });
        }
        let n = matrix.nrows();
        let scales: Vec<f64> = sizes.iter().map(|size| size.sqrt().recip()).collect();
        let order: Vec<usize> = match self.symbolic.perm() {
            Some(order) => order.arrays().0.to_vec(),
            None => (0..n).collect(),
        };
        let mut index = vec![0; n];
        order.iter().enumerate().for_each(|(at, row)| index[*row] = at);
        let scaled = Scaled {
            matrix,
            columns: CscMatrix::from(matrix),
            scales: &scales,
            order: &order,
            place: &index,
        };
        let Some([lower, upper]) = self.eliminated(&scaled) else { return Ok(None) };
        let [lower, upper] = [lower, upper]
            .map(|values| Panels::from_columns(&Columns::new(&self.symbolic, &values)));
        let order = order.iter().map(|row| (*row as u32, scales[*row])).collect();
        let mut factors = UnsymmetricFactors { lower, upper, order, scratch: vec![0.0; n] };
        let solve = |vector: &mut [f64]| {
            factors.lower.down(vector);
            factors.upper.up(vector);
        };
        let reciprocal = reciprocal_condition(n, solve);
        if reciprocal <= f64::EPSILON {
            // A factorisation with row exchanges may still succeed.
            return Ok(None);
        }
        Ok((factors.backward_error(matrix, sizes) < limits::BACKWARD_ERROR).then_some(factors))
    }

    /// Returns the entries of L and Uᵀ, column by column; `None` for a pivot of zero.
    fn eliminated(&self, matrix: &Scaled<'_>) -> Option<[Vec<f64>; 2]> {
        const NONE: usize = usize::MAX;
        let (starts, rows) = self.columns()?;
        let n = starts.len() - 1;
        let [mut lower, mut upper] = [(); 2].map(|()| vec![0.0; rows.len()]);
        let [mut column, mut row] = [(); 2].map(|()| vec![0.0; n]);
        // The earlier columns that change column k are a linked list: `first[k]` is its first
        // column, and `next[j]` is the column after column j. `at[j]` is the position in `rows` of
        // the first row ≥ k of column j.
        let [mut first, mut next, mut at] = [vec![NONE; n], vec![NONE; n], vec![0; n]];
        for k in 0..n {
            let entries = starts[k]..starts[k + 1];
            for i in &rows[entries.clone()] {
                (column[*i], row[*i]) = (0.0, 0.0);
            }
            matrix.scatter(k, &mut column, &mut row);
            let mut j = first[k];
            while j != NONE {
                let after = next[j];
                let from = at[j]..starts[j + 1];
                let (of_row, of_column) = (lower[from.start], upper[from.start]);
                let both = lower[from.clone()].iter().zip(&upper[from.clone()]);
                for (i, (l, u)) in rows[from.clone()].iter().zip(both) {
                    column[*i] -= l * of_column;
                    row[*i] -= u * of_row;
                }
                at[j] = from.start + 1;
                if at[j] < from.end {
                    let i = rows[at[j]];
                    (next[j], first[i]) = (first[i], j);
                }
                j = after;
            }
            let pivot = column[k];
            if !(pivot.abs() > 0.0 && pivot.is_finite()) {
                return None;
            }
            for p in entries.clone() {
                lower[p] = column[rows[p]];
                upper[p] = row[rows[p]] / pivot;
            }
            upper[entries.start] = 1.0;
            at[k] = entries.start + 1;
            if at[k] < entries.end {
                let i = rows[at[k]];
                (next[k], first[i]) = (first[i], k);
            }
        }
        Some([lower, upper])
    }
}

/// A matrix in the order of its factors, with scaled rows and columns.
struct Scaled<'a> {
    matrix: &'a CsrMatrix<f64>,
    columns: CscMatrix<f64>,
    scales: &'a [f64],
    order: &'a [usize],
    place: &'a [usize],
}

impl Scaled<'_> {
    /// Writes the entries of column and row `k` from the diagonal on.
    fn scatter(&self, k: usize, column: &mut [f64], row: &mut [f64]) {
        let diagonal = self.order[k];
        let (below, beside) = (self.columns.col(diagonal), self.matrix.row(diagonal));
        let lanes = [
            (below.row_indices(), below.values(), column),
            (beside.col_indices(), beside.values(), row),
        ];
        for (others, values, into) in lanes {
            for (other, value) in others.iter().zip(values) {
                let at = self.place[*other];
                if at >= k {
                    into[at] = value * self.scales[diagonal] * self.scales[*other];
                }
            }
        }
    }
}

impl UnsymmetricFactors {
    /// Replaces the right-hand side `b` by the solution.
    pub(crate) fn solve(&mut self, b: &mut [f64]) {
        for (scaled, (row, scale)) in self.scratch.iter_mut().zip(&self.order) {
            *scaled = b[*row as usize] * scale;
        }
        self.lower.down(&mut self.scratch);
        self.upper.up(&mut self.scratch);
        for (solved, (row, scale)) in self.scratch.iter().zip(&self.order) {
            b[*row as usize] = solved * scale;
        }
    }

    /// Returns the largest residual of one solution, relative to the size of the row of the matrix
    /// and to the largest entry of the solution.
    fn backward_error(&mut self, matrix: &CsrMatrix<f64>, sizes: &[f64]) -> f64 {
        let b: Vec<f64> = pseudo_random(1)
            .zip(sizes)
            .take(matrix.nrows())
            .map(|(number, size)| number * size)
            .collect();
        let mut x = b.clone();
        self.solve(&mut x);
        let largest = x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let mut error = 0.0_f64;
        for ((row, b), size) in matrix.row_iter().zip(&b).zip(sizes) {
            let product: f64 =
                row.col_indices().iter().zip(row.values()).map(|(j, value)| value * x[*j]).sum();
            let missed = (product - b).abs() / (size * largest.max(1.0));
            error = if missed <= error { error } else { missed };
        }
        error
    }
}

#[cfg(test)]
mod tests {
    use mechid_model::triplets;
    use nalgebra::DVector;

    use super::*;
    use crate::sparse::SparseLu;

    /// A grid of `side` × `side` nodes with unsymmetric coupling; `diagonal` is the size of the
    /// diagonal entries.
    fn grid(side: usize, diagonal: f64) -> CsrMatrix<f64> {
        let at = |i: usize, j: usize| i * side + j;
        let mut entries = vec![];
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            entries.push((at(i, j), at(i, j), diagonal + 0.01 * i as f64));
            for (i2, j2) in [(i + 1, j), (i, j + 1)] {
                if i2 < side && j2 < side {
                    entries.push((at(i, j), at(i2, j2), -1.0 - 0.1 * j as f64 / side as f64));
                    entries.push((at(i2, j2), at(i, j), -0.7));
                }
            }
        }
        // This entry has no mirrored entry.
        entries.push((0, side * side - 1, 0.3));
        triplets(side * side, entries).unwrap()
    }

    fn sizes(matrix: &CsrMatrix<f64>) -> Vec<f64> {
        matrix.row_iter().map(|row| row.values().iter().map(|v| v.abs()).sum()).collect()
    }

    #[test]
    fn grids_that_are_not_symmetric_are_solved_without_exchanges() {
        for side in [24, 60] {
            let matrix = grid(side, 4.2);
            let mut factors = SparseLu::new(&matrix, &sizes(&matrix), u64::MAX).unwrap();
            assert!(matches!(factors, SparseLu::Unsymmetric(_)), "{side}");
            let x = DVector::from_fn(side * side, |i, _| (i as f64).sin());
            let mut found = &matrix * &x;
            factors.solve(found.as_mut_slice());
            assert!((found - x).amax() < 1e-12);
        }
    }

    #[test]
    fn what_needs_exchanges_is_factored_otherwise() {
        let matrix = grid(24, 1e-9);
        let mut factors = SparseLu::new(&matrix, &sizes(&matrix), u64::MAX).unwrap();
        assert!(!matches!(factors, SparseLu::Unsymmetric(_)));
        let x = DVector::from_fn(24 * 24, |i, _| (i as f64).cos());
        let mut found = &matrix * &x;
        factors.solve(found.as_mut_slice());
        assert!((found - x).amax() < 1e-8);
    }

    #[test]
    fn factors_beyond_the_limit_are_refused_before_they_are_computed() {
        let matrix = grid(60, 4.2);
        let refused = SparseLu::new(&matrix, &sizes(&matrix), 1000).err();
        assert!(matches!(refused, Some(NotFactored::TooLarge { limit: 1000, .. })), "{refused:?}");
    }
}
