//! Products of a sparse matrix with a vector.

use std::ops::Range;

use nalgebra_sparse::csr::CsrMatrix;

/// A matrix in the form with the fastest product: by diagonals, or by rows.
#[derive(Debug)]
pub(crate) enum Product {
    /// Values along diagonals; each diagonal has its first row, its first column and its values.
    Diagonals(Vec<Diagonal>),
    /// Values row by row.
    Rows { starts: Vec<u32>, columns: Vec<u32>, values: Vec<f64> },
}

#[derive(Debug)]
pub(crate) struct Diagonal {
    row: usize,
    column: usize,
    values: Vec<f64>,
}

/// Number of rows of a block that stays in the cache.
const BLOCK: usize = 1024;

impl Product {
    pub(crate) fn from_matrix(matrix: &CsrMatrix<f64>) -> Self {
        let n = matrix.nrows();
        // The index of a diagonal is n − 1 + column − row.
        let mut counts = vec![0_usize; 2 * n - 1];
        for (i, j, value) in matrix.triplet_iter() {
            counts[n - 1 + j - i] += usize::from(*value != 0.0);
        }
        let used: Vec<usize> = (0..2 * n - 1).filter(|at| counts[*at] > 0).collect();
        // Products along diagonals use vector instructions and no column indices; they are faster
        // if at most about half of the stored entries are zero.
        if used.len() * n > 2 * matrix.nnz() + n {
            return Self::by_rows(matrix);
        }
        let mut diagonals: Vec<Diagonal> = used
            .iter()
            .map(|at| {
                let (row, column) = ((n - 1).saturating_sub(*at), at.saturating_sub(n - 1));
                Diagonal { row, column, values: vec![0.0; n - row - column] }
            })
            .collect();
        let mut index = vec![0; 2 * n - 1];
        used.iter().enumerate().for_each(|(k, at)| index[*at] = k);
        for (i, j, value) in matrix.triplet_iter().filter(|(_, _, value)| **value != 0.0) {
            let diagonal = &mut diagonals[index[n - 1 + j - i]];
            diagonal.values[i - diagonal.row] = *value;
        }
        Self::Diagonals(diagonals)
    }

    fn by_rows(matrix: &CsrMatrix<f64>) -> Self {
        let narrow = |values: &[usize]| values.iter().map(|v| *v as u32).collect();
        Self::Rows {
            starts: narrow(matrix.row_offsets()),
            columns: narrow(matrix.col_indices()),
            values: matrix.values().to_vec(),
        }
    }

    /// Computes y ← y − Σ A x, one block of rows at a time.
    pub(crate) fn subtract(terms: &[(&Self, &[f64])], y: &mut [f64]) {
        for (block, y) in y.chunks_mut(BLOCK).enumerate() {
            for (product, x) in terms {
                product.subtract_rows(x, block * BLOCK, y);
            }
        }
    }

    /// Subtracts A x from the rows `first ..` of y.
    fn subtract_rows(&self, x: &[f64], first: usize, y: &mut [f64]) {
        match self {
            Self::Diagonals(diagonals) => {
                let (three, rest) = diagonals.as_chunks();
                three.iter().for_each(|diagonals| subtract_three(diagonals, x, first, y));
                rest.iter().for_each(|diagonal| diagonal.subtract(x, first, y));
            }
            Self::Rows { starts, columns, values } => {
                for (y, ends) in y.iter_mut().zip(starts[first..].windows(2)) {
                    let row = ends[0] as usize..ends[1] as usize;
                    let entries = values[row.clone()].iter().zip(&columns[row]);
                    let sum: f64 = entries.map(|(value, j)| value * x[*j as usize]).sum();
                    *y -= sum;
                }
            }
        }
    }
}

/// Subtracts three diagonals times `x` from the rows `first ..` of y, which is read and written
/// once.
fn subtract_three(diagonals: &[Diagonal; 3], x: &[f64], first: usize, y: &mut [f64]) {
    let rows_of_y = first..first + y.len();
    let rows = diagonals.iter().map(|diagonal| diagonal.rows(&rows_of_y));
    let common = rows.reduce(|a, b| a.start.max(b.start)..a.end.min(b.end)).unwrap_or(0..0);
    if common.is_empty() {
        return diagonals.iter().for_each(|diagonal| diagonal.subtract(x, first, y));
    }
    let (above, rest) = y.split_at_mut(common.start - first);
    let (y, below) = rest.split_at_mut(common.len());
    for diagonal in diagonals {
        diagonal.subtract(x, first, above);
        diagonal.subtract(x, common.end, below);
    }
    let [a, b, c] = diagonals.each_ref().map(|diagonal| diagonal.in_rows(&common, x));
    for (i, y) in y.iter_mut().enumerate() {
        *y = *y - a.0[i] * a.1[i] - b.0[i] * b.1[i] - c.0[i] * c.1[i];
    }
}

impl Diagonal {
    /// Returns the rows in `of` that have an entry on this diagonal.
    fn rows(&self, of: &Range<usize>) -> Range<usize> {
        of.start.max(self.row)..of.end.min(self.row + self.values.len())
    }

    /// Returns the entries in some rows, and the entries of `x` that multiply them.
    fn in_rows<'a>(&'a self, rows: &Range<usize>, x: &'a [f64]) -> (&'a [f64], &'a [f64]) {
        let values = rows.start - self.row..rows.end - self.row;
        let of_x = values.start + self.column..values.end + self.column;
        (&self.values[values], &x[of_x])
    }

    /// Subtracts the diagonal times `x` from the rows `first ..` of y.
    fn subtract(&self, x: &[f64], first: usize, y: &mut [f64]) {
        let rows = self.rows(&(first..first + y.len()));
        if rows.is_empty() {
            return;
        }
        let (values, x) = self.in_rows(&rows, x);
        for ((y, value), x) in y[rows.start - first..].iter_mut().zip(values).zip(x) {
            *y -= value * x;
        }
    }
}

#[cfg(test)]
mod tests {
    use mechid_model::{band, triplets};
    use nalgebra::{DMatrix, DVector};

    use super::*;

    #[test]
    fn both_forms_are_the_dense_product() {
        let n = 1200;
        let banded = band(n, &[(-40, 3.0), (-1, -0.5), (0, 2.0), (7, 1.25)]);
        let scattered = (0..n).flat_map(|i| [(i, i * 7 % n, 1.0 + i as f64), (i * 3 % n, i, -2.0)]);
        let scattered = triplets(n, scattered).unwrap();
        assert!(matches!(Product::from_matrix(&banded), Product::Diagonals(_)));
        assert!(matches!(Product::from_matrix(&scattered), Product::Rows { .. }));
        let x = DVector::from_fn(n, |i, _| (i as f64).sin());
        for matrix in [banded, scattered] {
            let mut y = vec![1.0; n];
            Product::subtract(&[(&Product::from_matrix(&matrix), x.as_slice())], &mut y);
            let expected = DVector::from_element(n, 1.0) - DMatrix::from(&matrix) * &x;
            let gap = (DVector::from_vec(y) - &expected).amax();
            assert!(gap <= 1e-15 * expected.amax(), "{gap:e}");
        }
    }
}
