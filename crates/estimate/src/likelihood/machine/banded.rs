//! Elimination of a sparse complex matrix within its band, after a reordering for a small band
//! width.

use nalgebra::{Complex, DMatrix};

/// Returns an order of rows and columns that moves the entries of a symmetric pattern near the
/// diagonal.
///
/// # Source
/// George & Liu, *Computer Solution of Large Sparse Positive Definite Systems* (1981), section 4.3
/// (reverse Cuthill–McKee).
pub(super) fn order(neighbours: &[Vec<usize>]) -> Vec<usize> {
    let degree = |at: &usize| neighbours[*at].len();
    let mut visited = vec![false; neighbours.len()];
    let mut order: Vec<usize> = Vec::with_capacity(neighbours.len());
    let mut starts: Vec<usize> = (0..neighbours.len()).collect();
    starts.sort_by_key(degree);
    for start in starts {
        if visited[start] {
            continue;
        }
        visited[start] = true;
        order.push(start);
        let mut next = order.len() - 1;
        while next < order.len() {
            let mut fresh: Vec<usize> =
                neighbours[order[next]].iter().copied().filter(|at| !visited[*at]).collect();
            fresh.sort_by_key(degree);
            fresh.dedup();
            for at in fresh {
                visited[at] = true;
                order.push(at);
            }
            next += 1;
        }
    }
    order.reverse();
    order
}

/// Returns the largest distance of an entry from the diagonal if rows and columns have this order.
pub(super) fn half_band(neighbours: &[Vec<usize>], order: &[usize]) -> usize {
    let mut index = vec![0; order.len()];
    order.iter().enumerate().for_each(|(at, dof)| index[*dof] = at);
    let distances = neighbours
        .iter()
        .enumerate()
        .flat_map(|(row, columns)| columns.iter().map(move |column| (row, *column)));
    distances.map(|(row, column)| index[row].abs_diff(index[column])).max().unwrap_or(0)
}

/// A square band matrix with entries up to `half` columns from the diagonal.
pub(super) struct Banded {
    order: usize,
    half: usize,
    /// Rows of 3 `half` + 1 entries, from column i − half to i + 2 half, because row exchanges
    /// widen the band.
    rows: Vec<Complex<f64>>,
}

impl Banded {
    pub(super) fn zeros(order: usize, half: usize) -> Self {
        Self { order, half, rows: vec![Complex::default(); order * (3 * half + 1)] }
    }

    fn at(&self, row: usize, column: usize) -> usize {
        row * (3 * self.half + 1) + column + self.half - row
    }

    pub(super) fn add(&mut self, row: usize, column: usize, value: Complex<f64>) {
        let at = self.at(row, column);
        self.rows[at] += value;
    }

    /// Replaces the right-hand sides by the solution and overwrites the matrix; returns `false` for
    /// a singular matrix.
    ///
    /// # Source
    /// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 4.3.3 (band elimination
    /// with row exchanges).
    pub(super) fn solve(&mut self, sides: &mut DMatrix<Complex<f64>>) -> bool {
        let count = sides.ncols();
        let transposed = sides.transpose();
        // Row-major storage of the right-hand sides.
        let mut b: Vec<Complex<f64>> = transposed.as_slice().to_vec();
        for k in 0..self.order {
            if !self.eliminate(k, &mut b, count) {
                return false;
            }
        }
        for k in (0..self.order).rev() {
            let last = (k + 2 * self.half).min(self.order - 1);
            let (known, solved) = b.split_at_mut((k + 1) * count);
            let row = &mut known[k * count..];
            for column in k + 1..=last {
                let factor = self.rows[self.at(k, column)];
                let from = &solved[(column - k - 1) * count..(column - k) * count];
                subtract(row, from, factor);
            }
            let pivot = self.rows[self.at(k, k)];
            row.iter_mut().for_each(|value| *value /= pivot);
        }
        *sides = DMatrix::from_row_slice(self.order, count, &b);
        b.iter().all(|z| z.is_finite())
    }

    /// Performs one step of the elimination with the largest pivot of the column.
    fn eliminate(&mut self, k: usize, b: &mut [Complex<f64>], count: usize) -> bool {
        let lowest = (k + self.half).min(self.order - 1);
        let last = (k + 2 * self.half).min(self.order - 1);
        let size = |row: &usize| self.rows[self.at(*row, k)].norm_sqr();
        let Some(pivot) = (k..=lowest).max_by(|a, b| size(a).total_cmp(&size(b))) else {
            return false;
        };
        let largest = size(&pivot);
        if largest == 0.0 || !largest.is_finite() {
            return false;
        }
        if pivot != k {
            for column in k..=last {
                let (one, other) = (self.at(k, column), self.at(pivot, column));
                self.rows.swap(one, other);
            }
            (0..count).for_each(|side| b.swap(k * count + side, pivot * count + side));
        }
        let (from, width) = (self.at(k, k), last - k + 1);
        let inverse = self.rows[from].inv();
        for row in k + 1..=lowest {
            let to = self.at(row, k);
            let factor = self.rows[to] * inverse;
            if factor == Complex::default() {
                continue;
            }
            let (above, below) = self.rows.split_at_mut(to);
            subtract(&mut below[..width], &above[from..from + width], factor);
            let (above, below) = b.split_at_mut(row * count);
            subtract(&mut below[..count], &above[k * count..(k + 1) * count], factor);
        }
        true
    }
}

/// Replaces y by y − x·factor.
fn subtract(y: &mut [Complex<f64>], x: &[Complex<f64>], factor: Complex<f64>) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= x * factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn band_elimination_agrees_with_the_library() {
        for half in [0, 1, 3, 9] {
            let n = 10;
            let entry = |i: usize, j: usize| {
                let x = (1.7 * i as f64 + 2.9 * j as f64 + 0.3).sin();
                // A small diagonal causes row exchanges.
                let size = if i == j { 0.01 } else { 1.0 };
                Complex::new(x * size, (3.1 * x).cos() * size)
            };
            let mut banded = Banded::zeros(n, half);
            let dense = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) <= half {
                true => entry(i, j),
                false => Complex::default(),
            });
            for i in 0..n {
                for j in i.saturating_sub(half)..=(i + half).min(n - 1) {
                    banded.add(i, j, entry(i, j));
                }
            }
            let sides = DMatrix::from_fn(n, 2, |i, j| Complex::new(i as f64, j as f64 - 0.5));
            let mut solved = sides.clone();
            assert!(banded.solve(&mut solved));
            let expected = dense.lu().solve(&sides).unwrap();
            assert!((solved - &expected).norm() < 1e-11 * expected.norm(), "{half}");
        }
    }

    #[test]
    fn a_star_and_a_shuffled_chain_get_a_narrow_band() {
        let n = 40;
        let place = |at: usize| (at * 7) % n;
        let mut neighbours = vec![Vec::new(); n];
        for at in 0..n - 1 {
            neighbours[place(at)].push(place(at + 1));
            neighbours[place(at + 1)].push(place(at));
        }
        assert_eq!(half_band(&neighbours, &order(&neighbours)), 1);
    }

    #[test]
    fn singular_matrices_are_noticed() {
        let mut banded = Banded::zeros(3, 1);
        banded.add(0, 0, Complex::new(1.0, 0.0));
        assert!(!banded.solve(&mut DMatrix::identity(3, 3)));
    }
}
