//! Sparse matrices: products, and factorisations of what is banded after reordering.

mod banded;
mod ordering;
mod product;

use nalgebra_sparse::csr::CsrMatrix;

use banded::BandedLu;
use ordering::Ordering;
pub(crate) use product::Product;

/// A sparse matrix factored once for many solves.
#[derive(Debug)]
pub(crate) struct SparseLu {
    ordering: Ordering,
    factors: BandedLu,
    scratch: Vec<f64>,
}

impl SparseLu {
    /// Factors `matrix`, the rows of which are sums of terms of the given `sizes`; the smallest
    /// pivot relative to the size of its row if that is no more than rounding.
    pub(crate) fn new(matrix: &CsrMatrix<f64>, sizes: &[f64]) -> Result<Self, f64> {
        let ordering = Ordering::narrowing(matrix.pattern());
        let factors = BandedLu::new(matrix, &ordering, sizes)?;
        Ok(Self { ordering, factors, scratch: vec![0.0; matrix.nrows()] })
    }

    /// Solves for `b`, in place.
    pub(crate) fn solve(&mut self, b: &mut [f64]) {
        if self.ordering.is_natural() {
            return self.factors.solve(b);
        }
        self.ordering.gather(b, &mut self.scratch);
        self.factors.solve(&mut self.scratch);
        self.ordering.scatter(&self.scratch, b);
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
    BandedLu::has_positive_pivots(matrix, &Ordering::narrowing(matrix.pattern()))
}
