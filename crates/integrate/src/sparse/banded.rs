//! LU factors of a matrix whose non-zero entries are near the diagonal.

use nalgebra_sparse::csr::CsrMatrix;

use crate::limits;
use crate::sparse::ordering::Ordering;
use crate::sparse::tridiagonal::Tridiagonal;

/// Factors P A = L U with a unit diagonal of L, stored along the columns of the band.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 4.3.
#[derive(Debug)]
pub(crate) struct BandedLu {
    /// Number of diagonals of L below the main diagonal; `upper` counts those of U above the main
    /// diagonal.
    lower: usize,
    upper: usize,
    /// The columns of L below the diagonal, `lower` entries each.
    multipliers: Vec<f64>,
    /// For each column, the row that was exchanged with the row of the diagonal entry; empty if no
    /// rows were exchanged.
    exchanges: Vec<u32>,
    /// The columns of U above the diagonal, `upper` entries each, top row first.
    above: Vec<f64>,
    /// Reciprocals of the diagonal of U.
    reciprocals: Vec<f64>,
    /// Factors that are used for the solution if the matrix is tridiagonal.
    tridiagonal: Option<Box<Tridiagonal>>,
}

/// A band stored by columns, with space for the entries above it that exchanges of rows create.
struct Band {
    n: usize,
    lower: usize,
    upper: usize,
    entries: Vec<f64>,
}

impl Band {
    fn from_matrix(matrix: &CsrMatrix<f64>, ordering: &Ordering) -> Self {
        let n = matrix.nrows();
        let new_indices = ordering.new_indices(n);
        let (mut lower, mut upper) = (0, 0);
        for (i, j, _) in matrix.triplet_iter() {
            let (i, j) = (new_indices[i], new_indices[j]);
            lower = lower.max(i.saturating_sub(j));
            upper = upper.max(j.saturating_sub(i));
        }
        let mut band = Self { n, lower, upper, entries: vec![0.0; n * (2 * lower + upper + 1)] };
        for (i, j, value) in matrix.triplet_iter() {
            let at = band.at(new_indices[i], new_indices[j]);
            band.entries[at] = *value;
        }
        band
    }

    /// Returns the index of entry (i, j).
    fn at(&self, i: usize, j: usize) -> usize {
        j * (2 * self.lower + self.upper + 1) + self.lower + self.upper + i - j
    }

    /// Returns the number of rows below the diagonal of column `j` that can be non-zero.
    fn below(&self, j: usize) -> usize {
        self.lower.min(self.n - 1 - j)
    }

    /// Returns the row of the pivot of column `j`, counted from the diagonal.
    fn pivot(&self, j: usize) -> usize {
        let top = self.at(j, j);
        let column = &self.entries[top..=top + self.below(j)];
        let (mut at, mut most) = (0, column[0].abs() / limits::PIVOT_FRACTION);
        for (k, value) in column.iter().enumerate().skip(1) {
            if value.abs() > most {
                (at, most) = (k, value.abs());
            }
        }
        at
    }

    fn exchange(&mut self, i: usize, k: usize, columns: std::ops::RangeInclusive<usize>) {
        for j in columns {
            let (upper, lower) = (self.at(i, j), self.at(k, j));
            self.entries.swap(upper, lower);
        }
    }

    /// Eliminates the entries of column `j` below the diagonal, and updates the columns up to
    /// `last`.
    fn eliminate(&mut self, j: usize, last: usize) {
        let (top, below) = (self.at(j, j), self.below(j));
        let reciprocal = self.entries[top].recip();
        self.entries[top + 1..=top + below].iter_mut().for_each(|value| *value *= reciprocal);
        for column in j + 1..=last {
            let start = self.at(j, column);
            let (left, right) = self.entries.split_at_mut(start);
            let factor = right[0];
            if factor != 0.0 {
                let multipliers = &left[top + 1..=top + below];
                right[1..=below].iter_mut().zip(multipliers).for_each(|(a, l)| *a -= factor * l);
            }
        }
    }
}

impl BandedLu {
    /// Factors `matrix` in the given order of rows and columns; see [`super::SparseLu::new`].
    pub(crate) fn new(
        matrix: &CsrMatrix<f64>,
        ordering: &Ordering,
        sizes: &[f64],
    ) -> Result<Self, f64> {
        let mut band = Band::from_matrix(matrix, ordering);
        let n = band.n;
        let mut row_sizes = vec![0.0; n];
        ordering.gather(sizes, &mut row_sizes);
        let mut exchanges: Vec<u32> = (0..n as u32).collect();
        let (mut last, mut widest, mut exchanged) = (0, 0, false);
        let mut smallest = f64::INFINITY;
        for j in 0..n {
            let pivot = j + band.pivot(j);
            last = last.max((pivot + band.upper).min(n - 1));
            widest = widest.max(last - j);
            if pivot != j {
                band.exchange(j, pivot, j..=last);
                row_sizes.swap(j, pivot);
                exchanges[j] = pivot as u32;
                exchanged = true;
            }
            let relative = band.entries[band.at(j, j)].abs() / row_sizes[j];
            // NaN (from overflow) fails the test too.
            if !(relative > f64::EPSILON && row_sizes[j].is_finite()) {
                return Err(smallest.min(relative));
            }
            smallest = smallest.min(relative);
            band.eliminate(j, last);
        }
        if !exchanged {
            exchanges.clear();
        }
        let is_tridiagonal = (band.lower, widest) == (1, 1);
        let tridiagonal =
            if is_tridiagonal { Tridiagonal::factor(matrix, ordering).map(Box::new) } else { None };
        Ok(Self { tridiagonal, ..Self::packed(&band, widest, exchanges) })
    }

    /// Returns whether elimination without exchanges meets positive pivots only.
    pub(crate) fn has_positive_pivots(matrix: &CsrMatrix<f64>, ordering: &Ordering) -> bool {
        let mut band = Band::from_matrix(matrix, ordering);
        (0..band.n).all(|j| {
            let positive = band.entries[band.at(j, j)] > 0.0;
            if positive {
                band.eliminate(j, (j + band.upper).min(band.n - 1));
            }
            positive
        })
    }

    fn packed(band: &Band, upper: usize, exchanges: Vec<u32>) -> Self {
        let (n, lower) = (band.n, band.lower);
        let mut multipliers = vec![0.0; n * lower];
        let mut above = vec![0.0; n * upper];
        let mut reciprocals = vec![0.0; n];
        for j in 0..n {
            let (top, below) = (band.at(j, j), band.below(j));
            reciprocals[j] = band.entries[top].recip();
            multipliers[j * lower..j * lower + below]
                .copy_from_slice(&band.entries[top + 1..=top + below]);
            let height = upper.min(j);
            above[(j + 1) * upper - height..(j + 1) * upper]
                .copy_from_slice(&band.entries[top - height..top]);
        }
        Self { lower, upper, multipliers, exchanges, above, reciprocals, tridiagonal: None }
    }

    /// Solves A x = `b`, both in the order of the factors, in place.
    pub(crate) fn solve(&self, b: &mut [f64]) {
        if let Some(tridiagonal) = &self.tridiagonal {
            return tridiagonal.solve(b);
        }
        let n = self.reciprocals.len();
        for j in 0..n {
            if let Some(&k) = self.exchanges.get(j) {
                b.swap(j, k as usize);
            }
            let (head, tail) = b[j..].split_at_mut(1);
            let column = &self.multipliers[j * self.lower..(j + 1) * self.lower];
            tail.iter_mut().zip(column).for_each(|(b, l)| *b -= head[0] * l);
        }
        for j in (0..n).rev() {
            let (head, tail) = b.split_at_mut(j);
            tail[0] *= self.reciprocals[j];
            let height = self.upper.min(j);
            let column = &self.above[(j + 1) * self.upper - height..(j + 1) * self.upper];
            let rows = &mut head[j - height..];
            rows.iter_mut().zip(column).for_each(|(b, u)| *b -= tail[0] * u);
        }
    }
}

#[cfg(test)]
mod tests {
    use mechid_model::triplets;
    use nalgebra::{DMatrix, DVector};

    use super::*;

    /// Returns a matrix of pseudo-random entries in a band of `lower` and `upper` diagonals; its
    /// diagonal entries are small if `weak`.
    fn random(n: usize, lower: usize, upper: usize, weak: bool) -> CsrMatrix<f64> {
        let mut seed = 7_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut entries = vec![];
        for i in 0..n {
            for j in i.saturating_sub(lower)..(i + upper + 1).min(n) {
                let diagonal = if weak { 1e-3 } else { 4.0 };
                entries.push((i, j, if i == j { diagonal * next() } else { next() }));
            }
        }
        triplets(n, entries).unwrap()
    }

    #[test]
    fn banded_solutions_are_the_dense_ones() {
        for n in [1, 2, 4, 5, 40, 41] {
            for (lower, upper) in [(0, 0), (1, 1), (2, 1), (0, 3), (3, 3), (7, 5), (39, 39)] {
                for weak in [false, true] {
                    let matrix = random(n, lower, upper, weak);
                    let dense = DMatrix::from(&matrix);
                    let ordering = Ordering::narrowing(matrix.pattern());
                    let sizes: Vec<f64> =
                        dense.row_iter().map(|r| r.iter().map(|v| v.abs()).sum()).collect();
                    let Ok(factors) = BandedLu::new(&matrix, &ordering, &sizes) else {
                        panic!("n {n}, band {lower} {upper}");
                    };
                    let x = DVector::from_fn(n, |i, _| 1.0 + i as f64);
                    let mut b = &dense * &x;
                    let mut there = b.clone();
                    ordering.gather(b.as_slice(), there.as_mut_slice());
                    factors.solve(there.as_mut_slice());
                    ordering.scatter(there.as_slice(), b.as_mut_slice());
                    // A backward stable solution has a small residual at any condition number.
                    let residual = (&dense * &b - &dense * &x).amax();
                    let size = dense.amax() * b.amax() * n as f64;
                    assert!(residual <= 1e-14 * size, "n {n}, band {lower} {upper}: {residual:e}");
                }
            }
        }
    }

    #[test]
    fn a_pivot_of_rounding_is_refused() {
        // The two rows are equal, so that the second pivot vanishes.
        let matrix = triplets(2, [(0, 0, 1.0), (0, 1, 2.0), (1, 0, 1.0), (1, 1, 2.0)]).unwrap();
        let ordering = Ordering::narrowing(matrix.pattern());
        assert!(BandedLu::new(&matrix, &ordering, &[3.0, 3.0]).is_err_and(|p| p < 1e-15));
        assert!(BandedLu::new(&matrix, &ordering, &[f64::INFINITY, 3.0]).is_err());
    }
}
