//! Square roots and Sylvester equations of quasi-triangular matrices.

use nalgebra::{DMatrix, Matrix2, Matrix4, Vector4};

/// Returns (I + U)^½ − I of a quasi-triangular U, without forming I + U.
///
/// The result Y satisfies Y² + 2Y = U: this is the recurrence of Björck and Hammarling, shifted to
/// avoid cancellation for a small U.
///
/// # Source
/// Björck & Hammarling (1983), Linear Algebra Appl. 52/53, 127–140; Higham (1987), Linear Algebra
/// Appl. 88/89, 405–430 (real Schur form); Higham, *Functions of Matrices* (2008), algorithms 6.3
/// and 6.7.
pub(crate) fn shifted_root(u: &DMatrix<f64>, blocks: &[(usize, usize)]) -> DMatrix<f64> {
    let mut y = DMatrix::zeros(u.nrows(), u.ncols());
    for (at, &(start, width)) in blocks.iter().enumerate() {
        root_of_block(u, &mut y, start, width);
        // The blocks of a column are computed upwards, because each needs the blocks to its left
        // and below it.
        for &(row, height) in blocks[..at].iter().rev() {
            let inner = row + height..start;
            let mut right = Matrix2::zeros();
            for i in 0..height {
                for j in 0..width {
                    let products = inner.clone().map(|k| y[(row + i, k)] * y[(k, start + j)]);
                    right[(i, j)] = u[(row + i, start + j)] - products.sum::<f64>();
                }
            }
            solve_block(&mut y, None, (row, height), (start, width), right);
        }
    }
    y
}

/// Returns Y_bb for one diagonal block B of U: (B + det B/(1 + s + p) I)/s with p = √det(I + B) and
/// s = tr (I + B)^½ = √(tr(I + B) + 2p), by the Cayley–Hamilton theorem.
fn root_of_block(u: &DMatrix<f64>, y: &mut DMatrix<f64>, start: usize, width: usize) {
    if width == 1 {
        let value = u[(start, start)];
        y[(start, start)] = value / (1.0 + (1.0 + value).sqrt());
        return;
    }
    let b: Matrix2<f64> = u.fixed_view::<2, 2>(start, start).into_owned();
    let (trace, determinant) = (b.trace(), b.determinant());
    let p = (1.0 + trace + determinant).sqrt();
    let half_gap = 0.5 * (b[(0, 0)] - b[(1, 1)]);
    let imaginary_square = -(half_gap * half_gap + b[(0, 1)] * b[(1, 0)]);
    let real = 1.0 + 0.5 * trace;
    // For a pair of eigenvalues near the negative real axis, tr(I + B) + 2p suffers cancellation;
    // the imaginary part of the pair does not.
    let s = if real < 0.0 && imaginary_square > 0.0 {
        (2.0 * imaginary_square / (p - real)).sqrt()
    } else {
        (2.0 * (real + p)).sqrt()
    };
    let shift = Matrix2::identity() * (determinant / (1.0 + s + p));
    y.fixed_view_mut::<2, 2>(start, start).copy_from(&((b + shift) / s));
}

/// Returns the change Z of the result Y of [`shifted_root`] when U changes by E: the solution of Y
/// Z + Z Y + 2 Z = E. E may be a full matrix.
///
/// # Source
/// Golub & Van Loan, *Matrix Computations*, 4th ed. (2013), section 7.6.3 (Bartels–Stewart).
pub(crate) fn root_derivative(
    y: &DMatrix<f64>,
    blocks: &[(usize, usize)],
    e: &DMatrix<f64>,
) -> DMatrix<f64> {
    let size = y.nrows();
    let mut z = DMatrix::zeros(size, size);
    for &(start, width) in blocks {
        for &(row, height) in blocks.iter().rev() {
            let mut right = Matrix2::zeros();
            for i in 0..height {
                for j in 0..width {
                    let (at, to) = (row + i, start + j);
                    let below = (row + height..size).map(|k| y[(at, k)] * z[(k, to)]);
                    let before = (0..start).map(|k| z[(at, k)] * y[(k, to)]);
                    right[(i, j)] = e[(at, to)] - below.sum::<f64>() - before.sum::<f64>();
                }
            }
            solve_block(&mut z, Some(y), (row, height), (start, width), right);
        }
    }
    z
}

/// Solves Y_ii Z + Z Y_jj + 2 Z = `right` for one block Z of `z`. If `y` is `None`, Y is the part
/// of `z` computed so far.
fn solve_block(
    z: &mut DMatrix<f64>,
    y: Option<&DMatrix<f64>>,
    (row, height): (usize, usize),
    (start, width): (usize, usize),
    right: Matrix2<f64>,
) {
    let at = |i: usize, j: usize| y.unwrap_or(z)[(i, j)];
    if height == 1 && width == 1 {
        z[(row, start)] = right[(0, 0)] / (at(row, row) + at(start, start) + 2.0);
        return;
    }
    // Unknown (i, j) has the index 2 i + j; indices outside the block keep the equation z = 0.
    let mut equations = Matrix4::identity();
    let mut sides = Vector4::zeros();
    for i in 0..height {
        for j in 0..width {
            let here = 2 * i + j;
            equations[(here, here)] = 2.0;
            sides[here] = right[(i, j)];
        }
    }
    for i in 0..height {
        for j in 0..width {
            for k in 0..height {
                equations[(2 * i + j, 2 * k + j)] += at(row + i, row + k);
            }
            for k in 0..width {
                equations[(2 * i + j, 2 * i + k)] += at(start + k, start + j);
            }
        }
    }
    // The eigenvalues of Y have real parts above −1, so 2 plus the sum of two of them is never 0.
    let solution = equations.full_piv_lu().solve(&sides).unwrap_or_default();
    for i in 0..height {
        for j in 0..width {
            z[(row + i, start + j)] = solution[2 * i + j];
        }
    }
}
