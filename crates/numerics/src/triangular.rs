//! Reduction of any number of rows to one small triangle, block by block.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::lanes::{LANES, dot, rest, total};
use crate::limits::SMALLEST_NORM;

/// Number of rows reduced at a time: a block of a dozen columns fits into the first-level cache.
const BLOCK_ROWS: usize = 256;

/// Number of rows that one thread reduces. It is fixed, so that the results do not depend on the
/// number of threads.
const SEGMENT_ROWS: usize = 16_384;

/// Triangular factor R of A = Q R, computed from row blocks of A; Q is never formed.
///
/// RᵀR = AᵀA, but without squaring the condition number: each block is rotated into R by
/// Householder reflections of \[R; block\]. The memory is one block and R for any number of rows.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 5.2 (Householder QR); Demmel,
/// Grigori, Hoemmen & Langou (2012), SIAM J. Sci. Comput. 34, A206–A239 (row-blocked QR).
#[derive(Debug, Clone)]
pub struct TriangularFactor {
    columns: usize,
    rows: usize,
    /// Triangle R, columns × columns, upper triangular.
    r: DMatrix<f64>,
    /// Entries of one block of rows, stored column by column.
    block: Vec<f64>,
    /// `true` for each column that contains a value other than 0, although the squares of all its
    /// values underflow to 0.
    vanished: Vec<bool>,
}

impl TriangularFactor {
    /// Creates the factor of a matrix with this many columns and no rows yet.
    pub fn new(columns: usize) -> Self {
        Self { columns, rows: 0, r: DMatrix::zeros(0, 0), block: Vec::new(), vanished: Vec::new() }
    }

    /// Allocates memory when the first rows are added; the caller has checked that these rows have
    /// `self.columns` columns.
    fn allocate(&mut self) {
        if self.r.ncols() != self.columns {
            self.r = DMatrix::zeros(self.columns, self.columns);
            self.block = vec![0.0; BLOCK_ROWS * self.columns];
            self.vanished = vec![false; self.columns];
        }
    }

    /// Returns the number of rows so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Returns R: columns × columns, upper triangular; 0 × 0 before the first rows.
    pub fn r(&self) -> &DMatrix<f64> {
        &self.r
    }

    /// Adds rows whose columns are distributed over several adjacent matrices.
    ///
    /// Returns false, and adds no row, if a value is not finite or its square overflows.
    #[must_use]
    pub fn push(&mut self, parts: &[DMatrixView<'_, f64>]) -> bool {
        let rows = parts.first().map_or(0, |part| part.nrows());
        debug_assert_eq!(self.columns, parts.iter().map(|part| part.ncols()).sum::<usize>());
        if rows <= SEGMENT_ROWS {
            return self.push_range(parts, 0..rows);
        }
        let segment = |start: usize| {
            let mut factor = Self::new(self.columns);
            let range = start..rows.min(start + SEGMENT_ROWS);
            factor.push_range(parts, range).then_some(factor)
        };
        let starts = (0..rows.div_ceil(SEGMENT_ROWS)).into_par_iter().map(|s| s * SEGMENT_ROWS);
        let Some(segments) = starts.map(segment).collect::<Option<Vec<_>>>() else { return false };
        segments.iter().all(|segment| self.merge(segment))
    }

    fn push_range(&mut self, parts: &[DMatrixView<'_, f64>], rows: Range<usize>) -> bool {
        self.allocate();
        let before = self.r.clone();
        for start in rows.clone().step_by(BLOCK_ROWS) {
            let len = BLOCK_ROWS.min(rows.end - start);
            let columns = parts.iter().flat_map(|part| part.column_iter());
            for (target, column) in self.block.chunks_exact_mut(len).zip(columns) {
                target.copy_from_slice(&column.as_slice()[start..start + len]);
            }
            self.absorb(len);
        }
        // NaN and infinity persist in sums of squares, so R is not finite if a value is not finite;
        // an overflow has the same effect.
        if !self.r.iter().all(|v| v.is_finite()) {
            self.r = before;
            return false;
        }
        let columns = parts.iter().flat_map(|part| part.column_iter());
        for ((own, column), vanished) in self.r.column_iter().zip(columns).zip(&mut self.vanished) {
            if own.iter().all(|v| *v == 0.0) {
                *vanished |= column.rows(rows.start, rows.len()).iter().any(|v| *v != 0.0);
            }
        }
        self.rows += rows.len();
        true
    }

    /// Adds all rows of another factor; returns false, and adds no row, if a square overflows.
    #[must_use]
    pub fn merge(&mut self, other: &Self) -> bool {
        if other.r.is_empty() {
            return true;
        }
        let rows = self.rows + other.rows;
        let finite = self.push_range(&[other.r.as_view()], 0..other.columns);
        if finite {
            self.vanished.iter_mut().zip(&other.vanished).for_each(|(own, other)| *own |= other);
            self.stand_for(rows);
        }
        finite
    }

    /// Returns the index of the first column whose squares are too small to be distinguished from
    /// 0, and the largest entry of this column in R.
    pub fn too_small(&self) -> Option<(usize, f64)> {
        // The largest entry is used because the squares of small entries underflow.
        let sizes = self.r.column_iter().map(|column| column.amax()).enumerate();
        sizes.into_iter().find(|(at, size)| {
            if *size == 0.0 { self.vanished[*at] } else { *size < SMALLEST_NORM }
        })
    }

    /// Sets the number of original rows that the factor represents.
    pub fn stand_for(&mut self, rows: usize) {
        self.rows = rows;
    }

    /// Rotates the first `len` rows of the block buffer into R, two columns in one sweep.
    ///
    /// The function is compiled for every width of vector registers, and one version is chosen at
    /// run time. All versions split the sums into the same partial sums, so that the results do not
    /// depend on the processor.
    fn absorb(&mut self, len: usize) {
        Arch::new().dispatch(Absorb { factor: self, len });
    }

    #[inline(always)]
    fn reflect(&mut self, len: usize) {
        let columns = self.columns;
        let mut remaining = &mut self.block[..len * columns];
        let mut j = 0;
        while j + 1 < columns {
            let (pair, others) = remaining.split_at_mut(2 * len);
            let (x1, x2) = pair.split_at_mut(len);
            remaining = others;
            let first = Reflection::new(&mut self.r, j, x1);
            let d = dot(x1, x2);
            let w = first.apply(&mut self.r, j + 1, d);
            subtract(x2, w, x1, 0.0, x1);
            let second = Reflection::new(&mut self.r, j + 1, x2);
            // This is x1ᵀx2 after the change of x2. It is needed because both reflections are
            // applied to the other columns in one sweep.
            let across = dot(x1, x2);
            for (k, y) in remaining.chunks_exact_mut(len).enumerate() {
                let [d1, d2] = dots(x1, x2, y);
                let w1 = first.apply(&mut self.r, j + 2 + k, d1);
                let w2 = second.apply(&mut self.r, j + 2 + k, d2 - w1 * across);
                subtract(y, w1, x1, w2, x2);
            }
            j += 2;
        }
        if j < columns {
            Reflection::new(&mut self.r, j, remaining);
        }
    }
}

/// Arguments of the function that `pulp` compiles for each width of vector registers.
struct Absorb<'a> {
    factor: &'a mut TriangularFactor,
    len: usize,
}

impl WithSimd for Absorb<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.factor.reflect(self.len);
    }
}

/// H = I − τ u uᵀ with u = \[1; scale·x\], which clears x under the diagonal entry of R.
struct Reflection {
    row: usize,
    tau: f64,
    scale: f64,
}

impl Reflection {
    /// Creates the reflection for column `row` and writes the new diagonal entry into R.
    #[inline(always)]
    fn new(r: &mut DMatrix<f64>, row: usize, x: &[f64]) -> Self {
        let square = dot(x, x);
        if square == 0.0 {
            return Self { row, tau: 0.0, scale: 0.0 };
        }
        let alpha = r[(row, row)];
        // The sign of beta is opposite to that of alpha, so that alpha − beta has no cancellation.
        let beta = -(alpha * alpha + square).sqrt().copysign(alpha);
        r[(row, row)] = beta;
        Self { row, tau: (beta - alpha) / beta, scale: 1.0 / (alpha - beta) }
    }

    /// Changes R in `column`; `dot` is the product of x with the part of this column in the block.
    /// Returns the multiple of x to be subtracted from this part.
    #[inline(always)]
    fn apply(&self, r: &mut DMatrix<f64>, column: usize, dot: f64) -> f64 {
        let w = self.tau * (r[(self.row, column)] + self.scale * dot);
        r[(self.row, column)] -= w;
        w * self.scale
    }
}

/// Returns x1ᵀy and x2ᵀy in one sweep.
#[inline(always)]
fn dots(x1: &[f64], x2: &[f64], y: &[f64]) -> [f64; 2] {
    const HALF: usize = LANES / 2;
    let (mut first, mut second) = ([0.0; HALF], [0.0; HALF]);
    let (x1s, x1_rest) = x1.as_chunks::<HALF>();
    let (x2s, x2_rest) = x2.as_chunks::<HALF>();
    let (ys, y_rest) = y.as_chunks::<HALF>();
    for ((a1, a2), b) in x1s.iter().zip(x2s).zip(ys) {
        for lane in 0..HALF {
            first[lane] += a1[lane] * b[lane];
            second[lane] += a2[lane] * b[lane];
        }
    }
    [total(first) + rest(x1_rest, y_rest), total(second) + rest(x2_rest, y_rest)]
}

/// Computes y ← y − f1·x1 − f2·x2.
#[inline(always)]
fn subtract(y: &mut [f64], f1: f64, x1: &[f64], f2: f64, x2: &[f64]) {
    for ((y, x1), x2) in y.iter_mut().zip(x1).zip(x2) {
        *y -= f1 * x1 + f2 * x2;
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

    #[test]
    fn every_width_of_vector_registers_gives_the_same_bits() {
        let block = (0..BLOCK_ROWS * 5).map(|k| (0.37 * k as f64).sin()).collect::<Vec<_>>();
        let mut factors = [TriangularFactor::new(5), TriangularFactor::new(5)];
        for len in [BLOCK_ROWS, 77] {
            let [chosen, plain] = &mut factors;
            chosen.allocate();
            plain.allocate();
            chosen.block.copy_from_slice(&block);
            plain.block.copy_from_slice(&block);
            chosen.absorb(len);
            plain.reflect(len);
        }
        let bits = |f: &TriangularFactor| f.r.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&factors[0]), bits(&factors[1]));
        assert!(factors[0].r.iter().any(|v| *v != 0.0));
    }

    proptest! {
        /// RᵀR must equal AᵀA, formed explicitly, and R must be upper triangular: these two
        /// properties determine R except for the signs of its rows.
        #[test]
        fn the_factor_has_the_gram_matrix_of_the_rows(
            (cut, a) in (1usize..700).prop_flat_map(|rows| (0..rows, matrix(rows, 5)))
        ) {
            let mut whole = TriangularFactor::new(5);
            prop_assert!(whole.push(&[a.columns(0, 2), a.columns(2, 3)]));
            let mut parts = TriangularFactor::new(5);
            prop_assert!(parts.push(&[a.rows(0, cut)]));
            let mut second = TriangularFactor::new(5);
            prop_assert!(second.push(&[a.rows(cut, a.nrows() - cut)]));
            prop_assert!(parts.merge(&second));
            prop_assert_eq!(parts.rows(), a.nrows());
            for factor in [whole, parts] {
                let gram = factor.r().tr_mul(factor.r());
                // The tolerance of 1e-13 is the rounding error of a sum of 700 products of numbers
                // below 1.
                prop_assert!((gram - a.tr_mul(&a)).abs().max() < 1e-13 * a.nrows() as f64);
                prop_assert_eq!(factor.r().lower_triangle() , DMatrix::from_diagonal(&factor.r().diagonal()));
            }
        }
    }
}
