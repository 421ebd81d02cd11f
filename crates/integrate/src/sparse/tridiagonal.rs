//! Factors of a tridiagonal matrix, eliminated from both ends at once.

use nalgebra_sparse::csr::CsrMatrix;

use crate::limits;
use crate::sparse::ordering::Ordering;

/// Elimination from both ends to the middle. Each row depends on the row before it, so that two
/// independent chains of rows take half the time of one chain.
///
/// # Source
/// Babuška (1972), SIAM Journal on Numerical Analysis 9, 53–77; van der Vorst (1987), Parallel
/// Computing 5, 45–54.
#[derive(Debug)]
pub(super) struct Tridiagonal {
    /// Multiplier of each row: the neighbouring row on the side of the nearer end, times this
    /// number, is subtracted from the row.
    multipliers: Vec<f64>,
    /// For each row, the off-diagonal entry on the side of the middle, divided by the pivot; for
    /// the first row of the lower half, the multiplier of the last elimination step.
    inward: Vec<f64>,
    /// Reciprocals of the pivots.
    reciprocals: Vec<f64>,
}

impl Tridiagonal {
    /// Factors `matrix`, which is tridiagonal in the given order; `None` if rows would have to be
    /// exchanged, or for fewer than four rows.
    pub(super) fn factor(matrix: &CsrMatrix<f64>, ordering: &Ordering) -> Option<Self> {
        let n = matrix.nrows();
        if n < 4 {
            return None;
        }
        let new_indices = ordering.new_indices(n);
        let [mut below, mut pivots, mut above] = [(); 3].map(|()| vec![0.0; n]);
        for (i, j, value) in matrix.triplet_iter() {
            let (i, j) = (new_indices[i], new_indices[j]);
            match j.checked_sub(i) {
                Some(0) => pivots[i] = *value,
                Some(_) => above[i] = *value,
                None => below[i] = *value,
            }
        }
        let half = n / 2;
        let mut multipliers = vec![0.0; n];
        let is_pivot = |pivot: f64, entry: f64| {
            pivot.abs() >= limits::PIVOT_FRACTION * entry.abs() && pivot != 0.0
        };
        for i in 1..half {
            is_pivot(pivots[i - 1], below[i]).then_some(())?;
            multipliers[i] = below[i] / pivots[i - 1];
            pivots[i] -= multipliers[i] * above[i - 1];
        }
        for i in (half..n - 1).rev() {
            is_pivot(pivots[i + 1], above[i]).then_some(())?;
            multipliers[i] = above[i] / pivots[i + 1];
            pivots[i] -= multipliers[i] * below[i + 1];
        }
        // The last step eliminates the upper half from the first row of the lower half.
        is_pivot(pivots[half - 1], below[half]).then_some(())?;
        let last = pivots[half];
        pivots[half] -= below[half] / pivots[half - 1] * above[half - 1];
        is_pivot(pivots[half], last).then_some(())?;
        let inward: Vec<f64> = (0..n)
            .map(|i| match i {
                // The last row of the elimination has only its pivot; this index stores the
                // multiplier of the last step.
                i if i == half => below[half] / pivots[half - 1],
                i if i < half => above[i] / pivots[i],
                i => below[i] / pivots[i],
            })
            .collect();
        let reciprocals: Vec<f64> = pivots.iter().map(|pivot| pivot.recip()).collect();
        let finite = inward.iter().chain(&reciprocals).all(|value| value.is_finite());
        finite.then_some(Self { multipliers, inward, reciprocals })
    }

    /// Solves A x = `b`, both in the order of the factors, in place.
    pub(super) fn solve(&self, b: &mut [f64]) {
        let n = self.multipliers.len();
        let half = n / 2;
        let (m, u, p) = (&self.multipliers[..n], &self.inward[..n], &self.reciprocals[..n]);
        let b = &mut b[..n];
        let (mut first, mut second) = (0.0, 0.0);
        for top in 0..half {
            let bottom = n - 1 - top;
            first = b[top] - m[top] * first;
            second = b[bottom] - m[bottom] * second;
            (b[top], b[bottom]) = (first, second);
        }
        // If the number of rows is odd, one row remains in the middle.
        if n - half > half {
            b[half] -= m[half] * second;
        }
        second = (b[half] - u[half] * first) * p[half];
        first = first * p[half - 1] - u[half - 1] * second;
        (b[half - 1], b[half]) = (first, second);
        for step in 1..half {
            let (top, bottom) = (half - 1 - step, half + step);
            first = b[top] * p[top] - u[top] * first;
            second = b[bottom] * p[bottom] - u[bottom] * second;
            (b[top], b[bottom]) = (first, second);
        }
        if n - half > half {
            b[n - 1] = b[n - 1] * p[n - 1] - u[n - 1] * second;
        }
    }
}
