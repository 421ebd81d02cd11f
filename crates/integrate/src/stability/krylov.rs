//! The eigenvalue of largest modulus of an operator that is known by its products alone.

use std::collections::VecDeque;
use std::convert::Infallible;

use nalgebra::{Complex, DMatrix, DVector};

use crate::arnoldi::{Arnoldi, Dominant};

/// Number of products in one round.
const ROUND: usize = 32;

/// A vector of norm 1 without structure, the same on every run.
pub(super) fn scattered(len: usize) -> DVector<f64> {
    scattered_number(len, 0)
}

/// One of many such vectors, by its number.
pub(crate) fn scattered_number(len: usize, number: usize) -> DVector<f64> {
    let vector = DVector::from_iterator(len, crate::sparse::scattered(number).take(len));
    vector.normalize()
}

/// Returns what one round of Arnoldi's iteration from `start` finds, `apply` writing A x into its
/// second argument; nothing if the numbers overflow.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 10.5.
pub(super) fn dominant(
    start: DVector<f64>,
    mut apply: impl FnMut(&[f64], &mut [f64]),
) -> Option<Dominant> {
    let most = ROUND.min(start.len());
    let mut space = Arnoldi::new(start, most);
    loop {
        let Ok(more) = space.extend(|x, y| {
            apply(x, y);
            Ok::<_, Infallible>(())
        });
        if !more {
            break;
        }
    }
    space.dominant()
}

/// The eigenvector of norm 1 of a `matrix` with no more than `below` diagonals under the main one to its
/// eigenvalue `value`, by inverse iteration; of a repeated eigenvalue one for each `number`.
pub(crate) fn eigenvector(
    matrix: &DMatrix<f64>,
    below: usize,
    value: Complex<f64>,
    number: usize,
) -> Option<DVector<Complex<f64>>> {
    let size = matrix.nrows();
    // Off the eigenvalue by rounding, so that the factors exist.
    let shift = value + Complex::from(f64::EPSILON * matrix.norm().max(f64::MIN_POSITIVE));
    let factors = HessenbergFactors::new(matrix, below, shift);
    let mut vector = scattered_number(size, number).map(Complex::from);
    for _ in 0..3 {
        factors.solve(&mut vector);
        vector /= Complex::from(vector.norm());
    }
    vector.iter().all(|v| v.re.is_finite() && v.im.is_finite()).then_some(vector)
}

/// L and U of A − σI with exchanges of rows, of a matrix with few diagonals under the main one: O(size²)
/// operations for each of them.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 4.3.4.
struct HessenbergFactors {
    below: usize,
    /// Rows of U from the diagonal on, one after the other.
    upper: Vec<Vec<Complex<f64>>>,
    /// Per column the row exchanged with, and the factors of the rows under it.
    steps: Vec<(usize, Vec<Complex<f64>>)>,
}

impl HessenbergFactors {
    fn new(matrix: &DMatrix<f64>, below: usize, shift: Complex<f64>) -> Self {
        let size = matrix.nrows();
        let entry = |i: usize, j: usize| {
            let own = Complex::from(matrix[(i, j)]);
            if i == j { own - shift } else { own }
        };
        let row = |i: usize| (i.saturating_sub(below)..size).map(|j| entry(i, j)).collect();
        // The rows that a column reaches; all begin with its entry.
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
                let factor = match top[0] == Complex::ZERO {
                    true => Complex::ZERO,
                    false => row[0] / top[0],
                };
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

    /// b ← (A − σI)⁻¹ b; not finite of a singular matrix.
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

    #[test]
    fn the_largest_of_many_eigenvalues_is_found() {
        // A block that turns and grows by 1.2 among 200 factors below 1.
        let apply = |x: &[f64], y: &mut [f64]| {
            for (i, (y, x)) in y.iter_mut().zip(x).enumerate() {
                *y = x * (0.9 * (i as f64 * 0.7).cos());
            }
            (y[0], y[1]) = (1.2 * (0.6 * x[0] - 0.8 * x[1]), 1.2 * (0.8 * x[0] + 0.6 * x[1]));
        };
        let found = dominant(scattered(202), apply).unwrap();
        assert!((found.value.norm() - 1.2).abs() < 1e-6, "{found:?}");
        assert!((found.value.im.abs() - 0.96).abs() < 1e-6);
        let inside: f64 = found.vector.iter().take(2).map(|v| v.norm_sqr()).sum();
        assert!((inside - 1.0).abs() < 1e-6, "{found:?}");
    }

    /// Judge: the matrix itself, and the dense factors of nalgebra.
    #[test]
    fn factors_of_few_diagonals_solve_as_dense_ones_do() {
        for (size, below) in [(1, 0), (1, 3), (3, 1), (4, 4), (9, 0), (9, 1), (12, 4)] {
            let number = |i: usize, j: usize| ((7 * i * i + 5 * j + 1) as f64).sin();
            let matrix = DMatrix::from_fn(size, size, |i, j| match i <= j + below {
                true => number(i, j),
                false => 0.0,
            });
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

    #[test]
    fn small_operators_are_exact() {
        let found = dominant(scattered(2), |x, y| (y[0], y[1]) = (3.0 * x[0], -4.0 * x[1]));
        let found = found.unwrap();
        assert!((found.value.re + 4.0).abs() < 1e-14, "{found:?}");
    }
}
