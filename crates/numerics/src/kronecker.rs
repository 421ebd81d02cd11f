//! Gram matrices of complex rows that are Kronecker products.

use nalgebra::{DMatrix, DMatrixView};
use pulp::{Arch, Simd, WithSimd};

use crate::lanes::dot;
use crate::limits::PRODUCT_COLUMNS;

/// Returns 2 Re Σ φ̄_a φ_b H_ij, summed over lines, for rows φ ⊗ W of which H = WᴴW is known: pairs
/// a ≤ b × dof² (column i + dof·j), in the squared unit of φ times the unit of H. The pairs have
/// the order (0, 0), (0, 1), (1, 1), (0, 2), …
///
/// `regressors` has φ: 2 lines × columns, the real parts of all lines first. `weights` has the
/// Hermitian H: lines × dof². For i ≤ j the real part of H_ij is in column i + dof·j, and for i < j
/// the imaginary part is in column j + dof·i.
///
/// The result does not depend on the width of the vector registers.
///
/// # Panics
/// Panics if `weights` does not have one row for every line and dof² columns.
///
/// # Source
/// Van Loan (2000), J. Computational and Applied Mathematics 123, 85–100 (least squares with
/// Kronecker products).
///
/// ```
/// use mechid_numerics::kronecker::gram;
/// use nalgebra::dmatrix;
///
/// // One line with φ = (1 + 2i, 3) and H = 10.
/// let products = gram(dmatrix![1.0, 3.0; 2.0, 0.0].as_view(), dmatrix![10.0].as_view(), 1);
/// assert_eq!(products, dmatrix![100.0; 60.0; 180.0]);
/// ```
pub fn gram(
    regressors: DMatrixView<'_, f64>,
    weights: DMatrixView<'_, f64>,
    dof: usize,
) -> DMatrix<f64> {
    assert_eq!(regressors.nrows(), 2 * weights.nrows(), "real and imaginary parts of every line");
    assert_eq!(weights.ncols(), dof * dof, "one column for each part of H");
    let (q, lines) = (regressors.ncols(), weights.nrows());
    let mut products = DMatrix::zeros(q * (q + 1) / 2, dof * dof);
    if lines > 0 {
        let pair = [vec![0.0; lines], vec![0.0; lines]];
        Arch::new().dispatch(Products { regressors, weights, dof, pair, products: &mut products });
    }
    // From sums with the real and the imaginary parts to their sum and difference.
    for j in 0..dof {
        for i in 0..j {
            let (upper, lower) = (i + dof * j, j + dof * i);
            for row in 0..products.nrows() {
                let (re, im) = (products[(row, upper)], products[(row, lower)]);
                (products[(row, upper)], products[(row, lower)]) = (re + im, re - im);
            }
        }
    }
    products
}

/// Arguments of the function that `pulp` compiles for each width of vector registers.
struct Products<'a> {
    regressors: DMatrixView<'a, f64>,
    weights: DMatrixView<'a, f64>,
    dof: usize,
    /// Real and negative imaginary part of 2 φ̄_a φ_b on every line.
    pair: [Vec<f64>; 2],
    products: &'a mut DMatrix<f64>,
}

impl WithSimd for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.compute();
    }
}

impl Products<'_> {
    /// Writes Σ 2 Re(φ̄_a φ_b) Re H_ij and Σ −2 Im(φ̄_a φ_b) Im H_ij at the places of these parts of H.
    #[inline(always)]
    fn compute(self) {
        let Self { regressors, weights, dof, pair: [mut real, mut imaginary], products } = self;
        let (lines, columns) = (weights.nrows(), dof * dof);
        let part = |at: usize| regressors.column(at).data.into_slice().split_at(lines);
        // The columns of H that are in use at a time fit in the fastest cache.
        for first in (0..columns).step_by(PRODUCT_COLUMNS) {
            let range = first..columns.min(first + PRODUCT_COLUMNS);
            let mut row = 0;
            for b in 0..regressors.ncols() {
                for a in 0..=b {
                    let ((re_a, im_a), (re_b, im_b)) = (part(a), part(b));
                    write_sum(&mut real, 2.0, (re_a, re_b), 2.0, (im_a, im_b));
                    if dof > 1 {
                        write_sum(&mut imaginary, 2.0, (im_a, re_b), -2.0, (re_a, im_b));
                    }
                    for column in range.clone() {
                        let (i, j) = (column % dof, column / dof);
                        let factors = if i <= j { &real } else { &imaginary };
                        let weights = weights.column(column).data.into_slice();
                        products[(row, column)] = dot(factors, weights);
                    }
                    row += 1;
                }
            }
        }
    }
}

/// Writes f·x1·x2 + g·y1·y2.
#[inline(always)]
fn write_sum(to: &mut [f64], f: f64, (x1, x2): (&[f64], &[f64]), g: f64, y: (&[f64], &[f64])) {
    let factors = x1.iter().zip(x2).zip(y.0.iter().zip(y.1));
    for (to, ((x1, x2), (y1, y2))) in to.iter_mut().zip(factors) {
        *to = f * x1 * x2 + g * y1 * y2;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;

    fn number(at: usize) -> f64 {
        ((at * 7919 + 13) % 101) as f64 / 50.0 - 1.0
    }

    fn complex(at: usize) -> Complex<f64> {
        Complex::new(number(at), number(at + 57))
    }

    /// The rows, written out, judge the products: 45 lines of 5 regressors, up to 5 degrees of
    /// freedom, so that the parts of H are more than are in use at a time.
    #[test]
    fn products_are_those_of_the_rows() {
        let (lines, q) = (45, 5);
        for dof in [1, 2, 5] {
            let phi = |line: usize, at: usize| complex(17 * line + 3 * at);
            let w = |line: usize, i: usize, j: usize| complex(29 * line + 5 * i + 11 * j + 7);
            let h = |line: usize, i: usize, j: usize| -> Complex<f64> {
                (0..dof).map(|k| w(line, k, i).conj() * w(line, k, j)).sum()
            };
            let regressors = DMatrix::from_fn(2 * lines, q, |row, at| {
                let z = phi(row % lines, at);
                if row < lines { z.re } else { z.im }
            });
            let weights = DMatrix::from_fn(lines, dof * dof, |line, column| {
                let (i, j) = (column % dof, column / dof);
                if i <= j { h(line, i, j).re } else { h(line, j, i).im }
            });
            let products = gram(regressors.as_view(), weights.as_view(), dof);
            for (column, i, j) in (0..dof * dof).map(|at| (at, at % dof, at / dof)) {
                let pairs = (0..q).flat_map(|b| (0..=b).map(move |a| (a, b)));
                for (row, (a, b)) in pairs.enumerate() {
                    let term = |line: usize| phi(line, a).conj() * phi(line, b) * h(line, i, j);
                    let expected: f64 = (0..lines).map(|line| 2.0 * term(line).re).sum();
                    // Rounding of a sum of 45 terms below 100.
                    assert!((products[(row, column)] - expected).abs() < 1e-11, "{i} {j} {a} {b}");
                }
            }
        }
        let none = DMatrix::zeros(0, 3);
        assert_eq!(gram(none.as_view(), DMatrix::zeros(0, 4).as_view(), 2), DMatrix::zeros(6, 4));
    }
}
