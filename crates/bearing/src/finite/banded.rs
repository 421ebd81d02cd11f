//! Symmetric positive definite matrices of a narrow band, and many right-hand sides.

use std::ops::Range;

/// A symmetric matrix with zeros at distances above `band` from the diagonal.
///
/// A row stores its entries from `band` before the diagonal up to the diagonal.
pub(super) struct Banded {
    band: usize,
    entries: Vec<f64>,
}

impl Banded {
    pub(super) fn zeros(size: usize, band: usize) -> Self {
        Self { band, entries: vec![0.0; size * (band + 1)] }
    }

    /// Returns the entry of rows `i` and `j`, whose distance is at most `band`.
    pub(super) fn get(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        self.entries[i * (self.band + 1) + self.band + j - i]
    }

    /// Entry of row `i` and column `j`, with `j` at most `i` and within the band.
    pub(super) fn at(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.entries[i * (self.band + 1) + self.band + j - i]
    }

    /// Entries of row `i` in the columns `from` to `to`.
    fn row(&self, i: usize, from: usize, to: usize) -> &[f64] {
        let start = i * (self.band + 1) + self.band - i;
        &self.entries[start + from..start + to]
    }

    /// Solves the equations for a range of unknowns; all other unknowns are zero. The part of the
    /// matrix for this range is overwritten by its Cholesky factor, and the rows of `right` for
    /// this range (`sides` entries per row) by the solution. `None` if the matrix is not positive
    /// definite.
    pub(super) fn solve(
        &mut self,
        unknowns: Range<usize>,
        right: &mut [f64],
        sides: usize,
    ) -> Option<()> {
        let Range { start, end } = unknowns;
        for i in start..end {
            let first = start.max(i.saturating_sub(self.band));
            for j in first..=i {
                let from = first.max(j.saturating_sub(self.band));
                let pairs = self.row(i, from, j).iter().zip(self.row(j, from, j));
                let pivot = self.row(i, j, j + 1)[0] - pairs.map(|(a, b)| a * b).sum::<f64>();
                *self.at(i, j) = if j < i {
                    pivot / self.row(j, j, j + 1)[0]
                } else if pivot > 0.0 && pivot.is_finite() {
                    pivot.sqrt()
                } else {
                    return None;
                };
            }
            let (before, here) = right.split_at_mut(i * sides);
            let here = &mut here[..sides];
            for (j, &factor) in (first..i).zip(self.row(i, first, i)) {
                subtract(here, factor, &before[j * sides..(j + 1) * sides]);
            }
            divide(here, self.row(i, i, i + 1)[0]);
        }
        for i in (start..end).rev() {
            let (before, here) = right.split_at_mut(i * sides);
            let here = &mut here[..sides];
            divide(here, self.row(i, i, i + 1)[0]);
            let first = start.max(i.saturating_sub(self.band));
            for (j, &factor) in (first..i).zip(self.row(i, first, i)) {
                subtract(&mut before[j * sides..(j + 1) * sides], factor, here);
            }
        }
        Some(())
    }
}

fn subtract(from: &mut [f64], factor: f64, row: &[f64]) {
    for (value, other) in from.iter_mut().zip(row) {
        *value -= factor * other;
    }
}

fn divide(row: &mut [f64], by: f64) {
    for value in row {
        *value /= by;
    }
}
