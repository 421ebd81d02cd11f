//! Real Schur form of a matrix.
//!
//! The implementation of nalgebra chooses shifts that suffer from cancellation and has no
//! exceptional shifts, so that it does not converge if several eigenvalues are equal up to
//! rounding.

use nalgebra::{Complex, DMatrix, Hessenberg, Vector3};

use crate::NumericsError;
use crate::limits::{PATIENCE, SWEEPS};
use crate::linear_algebra::{check_finite, check_square};

/// Real Schur form A = Q T Qᵀ, all size × size, with Q orthogonal and T quasi-upper-triangular.
///
/// ```
/// use mechid_numerics::RealSchur;
/// use nalgebra::dmatrix;
///
/// // A quarter turn: eigenvalues ±i.
/// let schur = RealSchur::new(dmatrix![0.0, -1.0; 1.0, 0.0])?;
/// assert_eq!(schur.blocks, [(0, 2)]);
/// assert!((schur.eigenvalues()[0].im - 1.0).abs() < 1e-15);
/// # Ok::<(), mechid_numerics::NumericsError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RealSchur {
    /// The Schur vectors Q, in columns, dimensionless.
    pub q: DMatrix<f64>,
    /// T, square, zero below its diagonal blocks, in the unit of the matrix.
    pub t: DMatrix<f64>,
    /// Diagonal blocks of T in order: first row, and size 1 or 2. A block of size 2 may also have
    /// two real eigenvalues.
    pub blocks: Vec<(usize, usize)>,
}

impl RealSchur {
    /// Computes the Schur form of the square matrix `a`, in any unit, by Francis' double-shift QR
    /// iteration, with exceptional shifts.
    ///
    /// # Errors
    /// [`NumericsError::NotSquare`], [`NumericsError::EntryNotFinite`],
    /// [`NumericsError::NotConverged`].
    ///
    /// # Source
    /// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), algorithms 7.5.1 and 7.5.2.
    pub fn new(a: DMatrix<f64>) -> Result<Self, NumericsError> {
        check_square(&a)?;
        check_finite(&a)?;
        let size = a.nrows();
        if size < 2 {
            let blocks = (0..size).map(|at| (at, 1)).collect();
            return Ok(Self { q: DMatrix::identity(size, size), t: a, blocks });
        }
        let norm = a.norm();
        let (mut q, mut t) = Hessenberg::new(a).unpack();
        let mut blocks = Vec::new();
        let (mut end, mut sweeps) = (size, 0);
        while end > 0 {
            let last = end - 1;
            let start =
                first_of_unreduced(&mut t, last, if sweeps < PATIENCE { 0.0 } else { norm });
            if last - start < 2 {
                blocks.push((start, end - start));
                end = start;
                sweeps = 0;
                continue;
            }
            sweeps += 1;
            if sweeps > SWEEPS {
                return Err(NumericsError::NotConverged { rows: size, columns: size });
            }
            sweep(&mut t, &mut q, start, last, sweeps);
        }
        blocks.reverse();
        Ok(Self { q, t, blocks })
    }

    /// Returns the eigenvalues, in the unit of the matrix and the order of the blocks; in a
    /// conjugate pair, the one with Im λ > 0 comes first.
    pub fn eigenvalues(&self) -> Vec<Complex<f64>> {
        self.blocks.iter().flat_map(|&(at, size)| self.block_eigenvalues(at, size)).collect()
    }

    fn block_eigenvalues(&self, at: usize, size: usize) -> Vec<Complex<f64>> {
        let t = |i: usize, j: usize| self.t[(at + i, at + j)];
        if size == 1 {
            return vec![Complex::from(t(0, 0))];
        }
        let mean = 0.5 * (t(0, 0) + t(1, 1));
        let half_gap = 0.5 * (t(0, 0) - t(1, 1));
        let discriminant = half_gap * half_gap + t(0, 1) * t(1, 0);
        let root = discriminant.abs().sqrt();
        if discriminant < 0.0 {
            vec![Complex::new(mean, root), Complex::new(mean, -root)]
        } else {
            vec![Complex::from(mean + root), Complex::from(mean - root)]
        }
    }
}

/// Searches upwards from `last` for the first negligible subdiagonal entry, sets it to zero, and
/// returns its row; returns 0 if no entry is negligible.
fn first_of_unreduced(h: &mut DMatrix<f64>, last: usize, norm: f64) -> usize {
    for at in (1..=last).rev() {
        let neighbours = h[(at, at)].abs() + h[(at - 1, at - 1)].abs();
        if h[(at, at - 1)].abs() <= f64::EPSILON * neighbours.max(norm) {
            h[(at, at - 1)] = 0.0;
            return at;
        }
    }
    0
}

/// Performs one double-shift step on rows and columns `start..=last`.
fn sweep(h: &mut DMatrix<f64>, q: &mut DMatrix<f64>, start: usize, last: usize, count: usize) {
    let (x, y, w) = if count.is_multiple_of(10) {
        // An exceptional shift has the size of the entries that do not converge.
        let size = h[(last, last - 1)].abs() + h[(last - 1, last - 2)].abs();
        (0.75 * size, 0.75 * size, -0.4375 * size * size)
    } else {
        let product = h[(last, last - 1)] * h[(last - 1, last)];
        (h[(last, last)], h[(last - 1, last - 1)], product)
    };
    // This is the first column of H² − (x + y) H + (x y − w) I, divided by h21. It is written with
    // differences, because the plain formula loses all digits to cancellation when the eigenvalues
    // are close together.
    let (r, s) = (x - h[(start, start)], y - h[(start, start)]);
    let mut bulge = Vector3::new(
        (r * s - w) / h[(start + 1, start)] + h[(start, start + 1)],
        h[(start + 1, start + 1)] - h[(start, start)] - r - s,
        h[(start + 2, start + 1)],
    );
    for k in start..last {
        let width = 3.min(last - k + 1);
        if k > start {
            let third = if width == 3 { h[(k + 2, k - 1)] } else { 0.0 };
            bulge = Vector3::new(h[(k, k - 1)], h[(k + 1, k - 1)], third);
        }
        if width == 2 {
            bulge.z = 0.0;
        }
        let Some(axis) = mirror_axis(bulge) else { continue };
        reflect_rows(h, axis, k, width, k.saturating_sub(1).max(start));
        reflect_columns(h, axis, k, width, (k + 4).min(last + 1));
        reflect_columns(q, axis, k, width, q.nrows());
        if k > start {
            // The reflection sets these entries to zero up to rounding; here they become exactly
            // zero.
            h.view_mut((k + 1, k - 1), (width - 1, 1)).fill(0.0);
        }
    }
}

/// Returns the unit normal of the reflection that maps `v` to the first axis; `None` if `v` is zero
/// or already on this axis.
fn mirror_axis(v: Vector3<f64>) -> Option<Vector3<f64>> {
    let largest = v.amax();
    if largest == 0.0 || (v.y == 0.0 && v.z == 0.0) {
        return None;
    }
    let mut axis = v / largest;
    axis.x += axis.norm().copysign(axis.x);
    Some(axis.normalize())
}

/// Replaces rows `at..at + width` of `a` by (I − 2 u uᵀ) times these rows, from column `from` on.
fn reflect_rows(a: &mut DMatrix<f64>, u: Vector3<f64>, at: usize, width: usize, from: usize) {
    for mut column in a.columns_range_mut(from..).column_iter_mut() {
        let part: f64 = (0..width).map(|i| u[i] * column[at + i]).sum();
        for i in 0..width {
            column[at + i] -= 2.0 * part * u[i];
        }
    }
}

/// Replaces columns `at..at + width` of the first `rows` rows of `a` by these columns times (I − 2
/// u uᵀ).
fn reflect_columns(a: &mut DMatrix<f64>, u: Vector3<f64>, at: usize, width: usize, rows: usize) {
    // The loop follows the column-major order of the memory.
    let len = a.nrows();
    let columns = &mut a.as_mut_slice()[at * len..(at + width) * len];
    let (first, others) = columns.split_at_mut(len);
    let (second, third) = others.split_at_mut(len);
    let pairs = first[..rows].iter_mut().zip(&mut second[..rows]);
    if third.is_empty() {
        for (p, q) in pairs {
            let part = 2.0 * (u.x * *p + u.y * *q);
            *p -= part * u.x;
            *q -= part * u.y;
        }
    } else {
        for ((p, q), r) in pairs.zip(&mut third[..rows]) {
            let part = 2.0 * (u.x * *p + u.y * *q + u.z * *r);
            *p -= part * u.x;
            *q -= part * u.y;
            *r -= part * u.z;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn check(a: &DMatrix<f64>) {
        let size = a.nrows();
        let RealSchur { q, t, blocks } = RealSchur::new(a.clone()).unwrap();
        let scale = 1e-14 * (1.0 + size as f64) * a.norm().max(f64::MIN_POSITIVE);
        assert!((&q * &t * q.transpose() - a).norm() <= scale);
        assert!((q.tr_mul(&q) - DMatrix::identity(size, size)).norm() < 1e-14 * size as f64);
        assert_eq!(blocks.iter().map(|(_, width)| width).sum::<usize>(), size);
        for (start, width) in blocks {
            for column in start..start + width {
                assert!((start + width..size).all(|row| t[(row, column)] == 0.0));
            }
        }
    }

    #[test]
    fn random_repeated_defective_and_zero_matrices_are_reduced() {
        for seed in 0..200 {
            let mut source = ChaCha8Rng::seed_from_u64(seed);
            let size = 1 + seed as usize % 12;
            let v: DMatrix<f64> =
                DMatrix::from_fn(size, size, |_, _| source.random_range(-1.0..1.0));
            check(&v);
            // The eigenvalues of this matrix differ only by rounding, and the matrix is full.
            let equal = DMatrix::from_diagonal_element(size, size, 0.7);
            let noise = v.map(|x| 1e-15 * x);
            check(&(equal + noise));
            let well: DMatrix<f64> = v + 3.0 * DMatrix::identity(size, size);
            let twice = DMatrix::from_fn(size, size, |i, j| if i == j { -0.3 } else { 0.0 })
                + DMatrix::from_fn(size, size, |i, j| if j == i + 1 { 1e-12 } else { 0.0 });
            check(&well.clone().lu().solve(&(twice * &well)).unwrap());
        }
        for size in 1..5 {
            check(&DMatrix::zeros(size, size));
            // Ordinary shifts do not change a cyclic permutation, so only the exceptional shifts
            // let the iteration converge.
            check(&DMatrix::from_fn(size, size, |i, j| f64::from((j + 1) % size == i)));
        }
    }
}
