//! Products of a sparse matrix with a vector.

use nalgebra_sparse::csr::CsrMatrix;

/// A matrix in the form that multiplies fastest: by diagonals, or by rows.
#[derive(Debug)]
pub(crate) enum Product {
    /// Values along diagonals: the column less the row, the first row, and the values.
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

/// Number of rows that are worked on at a time, so that they stay in the cache.
const BLOCK: usize = 1024;

impl Product {
    pub(crate) fn of(matrix: &CsrMatrix<f64>) -> Self {
        let n = matrix.nrows();
        // By n − 1 plus column less row.
        let mut counts = vec![0_usize; 2 * n - 1];
        for (i, j, value) in matrix.triplet_iter() {
            counts[n - 1 + j - i] += usize::from(*value != 0.0);
        }
        let used: Vec<usize> = (0..2 * n - 1).filter(|at| counts[*at] > 0).collect();
        // Along diagonals two or more entries are taken at once and no column is looked up.
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
        let mut place = vec![0; 2 * n - 1];
        used.iter().enumerate().for_each(|(k, at)| place[*at] = k);
        for (i, j, value) in matrix.triplet_iter().filter(|(_, _, value)| **value != 0.0) {
            let diagonal = &mut diagonals[place[n - 1 + j - i]];
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

    /// y ← y − A x.
    pub(crate) fn subtract(&self, x: &[f64], y: &mut [f64]) {
        match self {
            Self::Diagonals(diagonals) => {
                for (block, y) in y.chunks_mut(BLOCK).enumerate() {
                    let first = block * BLOCK;
                    for diagonal in diagonals {
                        diagonal.subtract(x, first, y);
                    }
                }
            }
            Self::Rows { starts, columns, values } => {
                for (y, ends) in y.iter_mut().zip(starts.windows(2)) {
                    let row = ends[0] as usize..ends[1] as usize;
                    let entries = values[row.clone()].iter().zip(&columns[row]);
                    let sum: f64 = entries.map(|(value, j)| value * x[*j as usize]).sum();
                    *y -= sum;
                }
            }
        }
    }
}

impl Diagonal {
    /// Subtracts the diagonal times `x` from the rows `first ..` of y.
    fn subtract(&self, x: &[f64], first: usize, y: &mut [f64]) {
        let begin = first.max(self.row);
        let end = (first + y.len()).min(self.row + self.values.len());
        if begin >= end {
            return;
        }
        let values = &self.values[begin - self.row..end - self.row];
        let x = &x[begin - self.row + self.column..];
        for ((y, value), x) in y[begin - first..].iter_mut().zip(values).zip(x) {
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
        assert!(matches!(Product::of(&banded), Product::Diagonals(_)));
        assert!(matches!(Product::of(&scattered), Product::Rows { .. }));
        let x = DVector::from_fn(n, |i, _| (i as f64).sin());
        for matrix in [banded, scattered] {
            let mut y = vec![1.0; n];
            Product::of(&matrix).subtract(x.as_slice(), &mut y);
            let expected = DVector::from_element(n, 1.0) - DMatrix::from(&matrix) * &x;
            let gap = (DVector::from_vec(y) - &expected).amax();
            assert!(gap <= 1e-15 * expected.amax(), "{gap:e}");
        }
    }
}
