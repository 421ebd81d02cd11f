//! Any number of rows reduced to one small triangle, block by block.

use nalgebra::{DMatrix, DMatrixView};

/// Rows reduced at a time: a block of a dozen columns stays in the first-level cache.
const BLOCK_ROWS: usize = 256;

/// The triangular factor R of A = Q R, built from row blocks of A; Q is never formed.
///
/// RᵀR = AᵀA, but without squaring the condition number: each block is rotated into R by
/// Householder reflections of \[R; block\]. Memory is one block and R, however many rows pass.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 5.2 (Householder QR);
/// Demmel, Grigori, Hoemmen & Langou (2012), SIAM J. Sci. Comput. 34, A206–A239 (row-blocked QR).
#[derive(Debug, Clone)]
pub(crate) struct TriangularFactor {
    columns: usize,
    rows: usize,
    /// columns × columns, upper triangular.
    r: DMatrix<f64>,
    /// One block, column after column.
    block: Vec<f64>,
}

impl TriangularFactor {
    pub(crate) fn new(columns: usize) -> Self {
        let r = DMatrix::zeros(columns, columns);
        Self { columns, rows: 0, r, block: vec![0.0; BLOCK_ROWS * columns] }
    }

    /// Rows seen so far.
    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// R: columns × columns, upper triangular.
    pub(crate) fn r(&self) -> &DMatrix<f64> {
        &self.r
    }

    /// Takes rows whose columns are spread over several matrices side by side.
    pub(crate) fn push(&mut self, parts: &[DMatrixView<'_, f64>]) {
        let rows = parts.first().map_or(0, |part| part.nrows());
        debug_assert_eq!(self.columns, parts.iter().map(|part| part.ncols()).sum::<usize>());
        let mut start = 0;
        while start < rows {
            let len = BLOCK_ROWS.min(rows - start);
            let columns = parts.iter().flat_map(|part| part.column_iter());
            for (target, column) in self.block.chunks_exact_mut(len).zip(columns) {
                for (to, from) in target.iter_mut().zip(column.rows(start, len).iter()) {
                    *to = *from;
                }
            }
            self.absorb(len);
            start += len;
        }
        self.rows += rows;
    }

    /// Takes everything another factor has seen.
    pub(crate) fn merge(&mut self, other: &Self) {
        let rows = self.rows + other.rows;
        self.push(&[other.r.as_view()]);
        self.stand_for(rows);
    }

    /// From now on the rows seen count as `rows`.
    pub(crate) fn stand_for(&mut self, rows: usize) {
        self.rows = rows;
    }

    /// Rotates the first `len` rows of the block buffer into R.
    fn absorb(&mut self, len: usize) {
        let (r, n) = (&mut self.r, self.columns);
        let mut rest = &mut self.block[..len * n];
        for j in 0..n {
            let (x, others) = rest.split_at_mut(len);
            rest = others;
            let square = dot(x, x);
            if square == 0.0 {
                continue;
            }
            let alpha = r[(j, j)];
            // H = I − τ u uᵀ with u = [1; x·scale], opposite sign against cancellation.
            let beta = -alpha.signum() * (alpha * alpha + square).sqrt();
            let (tau, scale) = ((beta - alpha) / beta, 1.0 / (alpha - beta));
            r[(j, j)] = beta;
            for (k, y) in rest.chunks_exact_mut(len).enumerate() {
                let w = tau * (r[(j, j + 1 + k)] + scale * dot(x, y));
                r[(j, j + 1 + k)] -= w;
                subtract(y, w * scale, x);
            }
        }
    }
}

/// xᵀy with eight partial sums, so that the processor's vector units are used.
fn dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (xs, x_rest) = x.as_chunks::<8>();
    let (ys, y_rest) = y.as_chunks::<8>();
    for (a, b) in xs.iter().zip(ys) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = x_rest.iter().zip(y_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

/// y ← y − factor·x.
fn subtract(y: &mut [f64], factor: f64, x: &[f64]) {
    for (a, b) in y.iter_mut().zip(x) {
        *a -= factor * b;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn matrix(rows: usize, columns: usize) -> impl Strategy<Value = DMatrix<f64>> {
        prop::collection::vec(-1.0..1.0f64, rows * columns)
            .prop_map(move |v| DMatrix::from_vec(rows, columns, v))
    }

    proptest! {
        /// The Gram matrix, formed explicitly, judges the factor; signs of rows are free.
        #[test]
        fn the_factor_has_the_gram_matrix_of_the_rows(
            (cut, a) in (1usize..700).prop_flat_map(|rows| (0..rows, matrix(rows, 5)))
        ) {
            let mut whole = TriangularFactor::new(5);
            whole.push(&[a.columns(0, 2), a.columns(2, 3)]);
            let mut parts = TriangularFactor::new(5);
            parts.push(&[a.rows(0, cut)]);
            let mut second = TriangularFactor::new(5);
            second.push(&[a.rows(cut, a.nrows() - cut)]);
            parts.merge(&second);
            prop_assert_eq!(parts.rows(), a.nrows());
            for factor in [whole, parts] {
                let gram = factor.r().tr_mul(factor.r());
                // 1e-13: rounding of a sum of 700 products of numbers below one.
                prop_assert!((gram - a.tr_mul(&a)).abs().max() < 1e-13 * a.nrows() as f64);
                prop_assert_eq!(factor.r().lower_triangle() , DMatrix::from_diagonal(&factor.r().diagonal()));
            }
        }
    }
}
