//! Eigenvectors of matrices that have few diagonals below the main diagonal.

use std::collections::VecDeque;

use nalgebra::{Complex, DMatrix, DVector};

use crate::krylov::start_vector::numbered_start_vector;

/// Computes the eigenvector (norm 1, pure numbers) of a square `matrix` for its eigenvalue `value`
/// (in the unit of the matrix) by inverse iteration; `None` if numbers overflow. The matrix has at
/// most `below` diagonals below the main diagonal; for a multiple eigenvalue each `number` gives a
/// different eigenvector.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 7.6.1.
pub fn eigenvector(
    matrix: &DMatrix<f64>,
    below: usize,
    value: Complex<f64>,
    number: usize,
) -> Option<DVector<Complex<f64>>> {
    let size = matrix.nrows();
    // The shift differs from the eigenvalue by about one rounding error, so that the shifted matrix
    // is not singular and has factors.
    let shift = value + Complex::from(f64::EPSILON * matrix.norm().max(f64::MIN_POSITIVE));
    let factors = HessenbergFactors::new(matrix, below, shift);
    let mut vector = numbered_start_vector(size, number).map(Complex::from);
    for _ in 0..3 {
        factors.solve(&mut vector);
        vector /= Complex::from(vector.norm());
    }
    vector.iter().all(|v| v.re.is_finite() && v.im.is_finite()).then_some(vector)
}

/// L and U of A − σI with row exchanges, for a matrix with few diagonals below the main diagonal:
/// factorisation and solution need O(size²) operations each.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 4.3.4.
struct HessenbergFactors {
    below: usize,
    /// Rows of U from the diagonal on.
    upper: Vec<Vec<Complex<f64>>>,
    /// For each column: the offset from the diagonal to the pivot row that was exchanged, and the
    /// multipliers of the rows below the diagonal.
    steps: Vec<(usize, Vec<Complex<f64>>)>,
}

impl HessenbergFactors {
    fn new(matrix: &DMatrix<f64>, below: usize, shift: Complex<f64>) -> Self {
        let size = matrix.nrows();
        let entry = |i: usize, j: usize| {
            let value_at = Complex::from(matrix[(i, j)]);
            if i == j { value_at - shift } else { value_at }
        };
        let row = |i: usize| (i.saturating_sub(below)..size).map(|j| entry(i, j)).collect();
        // Active rows are those that the elimination of the column changes; each begins with its
        // entry in this column.
        let mut active: VecDeque<Vec<Complex<f64>>> = (0..size.min(below)).map(row).collect();
        let (mut upper, mut steps) = (Vec::with_capacity(size), Vec::with_capacity(size));
        for column in 0..size {
            if column + below < size {
                active.push_back(row(column + below));
            }
            let largest = (0..active.len())
                .max_by(|i, j| active[*i][0].norm_sqr().total_cmp(&active[*j][0].norm_sqr()));
            let pivot_row = largest.unwrap_or(0);
            active.swap(0, pivot_row);
            let Some(top) = active.pop_front() else { break };
            let factors = active.iter_mut().map(|row| {
                let factor = if top[0] == Complex::ZERO { Complex::ZERO } else { row[0] / top[0] };
                if factor != Complex::ZERO {
                    row.iter_mut().zip(&top).for_each(|(entry, top)| *entry -= factor * top);
                }
                row.remove(0);
                factor
            });
            let factors = factors.collect();
            upper.push(top);
            steps.push((pivot_row, factors));
        }
        Self { below, upper, steps }
    }

    /// Computes b ← (A − σI)⁻¹ b; the result is not finite if the matrix is singular.
    fn solve(&self, b: &mut DVector<Complex<f64>>) {
        for (column, (pivot, factors)) in self.steps.iter().enumerate() {
            b.swap_rows(column, column + pivot);
            let top = b[column];
            let under = b.as_mut_slice()[column + 1..].iter_mut().take(self.below);
            under.zip(factors).for_each(|(entry, factor)| *entry -= factor * top);
        }
        for (i, row) in self.upper.iter().enumerate().rev() {
            let sum: Complex<f64> =
                row[1..].iter().zip(&b.as_slice()[i + 1..]).map(|(u, b)| u * b).sum();
            b[i] = (b[i] - sum) / row[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The factors of a matrix with few diagonals below the main diagonal give the same solution as
    /// the dense factors of nalgebra, and this solution satisfies the equations.
    #[test]
    fn factors_of_few_diagonals_solve_as_dense_ones_do() {
        for (size, below) in [(1, 0), (1, 3), (3, 1), (4, 4), (9, 0), (9, 1), (12, 4)] {
            let number = |i: usize, j: usize| ((7 * i * i + 5 * j + 1) as f64).sin();
            let matrix =
                DMatrix::from_fn(
                    size,
                    size,
                    |i, j| if i <= j + below { number(i, j) } else { 0.0 },
                );
            let shift = Complex::new(0.3, 0.4);
            let dense =
                matrix.map(Complex::from) - DMatrix::from_diagonal_element(size, size, shift);
            let right = DVector::from_fn(size, |i, _| Complex::new(number(i, 3), number(i, 8)));
            let mut found = right.clone();
            HessenbergFactors::new(&matrix, below, shift).solve(&mut found);
            let expected = dense.clone().lu().solve(&right).unwrap();
            assert!((&found - &expected).norm() < 1e-12 * expected.norm(), "{size} {below}");
            assert!((dense * found - right).norm() < 1e-13, "{size} {below}");
        }
    }
}
