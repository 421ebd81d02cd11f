//! Gram matrices of complex rows that are Kronecker products.

use nalgebra::{DMatrix, DMatrixView};
use pulp::{Arch, Simd, WithSimd};

use crate::lanes::dot;
use crate::limits::NARROW_PRODUCT;

/// Returns 2 Re Σ φ̄_a φ_b H_ij, summed over lines, for rows φ ⊗ W with H = WᴴW, in the squared
/// unit of φ times the unit of H. The result has one row for each pair a ≤ b and dof² columns; H_ij
/// belongs to column i + dof·j. Pairs have the order (0, 0), (0, 1), (1, 1), (0, 2), …
///
/// `regressors` has φ: 2 lines × columns, the real parts of all lines first. `weights` has the
/// Hermitian H: lines × dof², the real parts of the pairs i ≤ j first, then the imaginary parts of
/// the pairs i < j; [`real_part`] and [`imaginary_part`] return their columns.
///
/// The result does not depend on the number of threads.
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
    let mut sums = DMatrix::zeros(q * (q + 1) / 2, dof * dof);
    if dof <= NARROW_PRODUCT {
        let pair = vec![0.0; lines];
        Arch::new().dispatch(Narrow { regressors, weights, dof, pair, sums: &mut sums });
    } else {
        add_wide(regressors, weights, dof, &mut sums);
    }
    // For i < j, there is one sum for the real part and one for the imaginary part of H_ij. The
    // product for H_ij is the first sum plus the second; the product for H_ji is the first sum
    // minus the second.
    let mut products = sums.clone();
    for j in 0..dof {
        for i in 0..=j {
            let real = sums.column(real_part(i, j));
            let [upper, lower] = [i + dof * j, j + dof * i];
            products.column_mut(upper).copy_from(&real);
            if i < j {
                let imaginary = sums.column(imaginary_part(i, j, dof));
                products.column_mut(lower).copy_from(&(real - imaginary));
                let mut upper = products.column_mut(upper);
                upper += imaginary;
            }
        }
    }
    products
}

/// Returns the column of the weights of [`gram`] with the real part of H_ij, i ≤ j.
///
/// # Source
/// Ours.
pub fn real_part(i: usize, j: usize) -> usize {
    j * (j + 1) / 2 + i
}

/// Returns the column of the weights of [`gram`] with the imaginary part of H_ij, i < j.
///
/// # Source
/// Ours.
pub fn imaginary_part(i: usize, j: usize, dof: usize) -> usize {
    real_part(0, dof) + j * (j - 1) / 2 + i
}

/// Real or imaginary part of 2 φ̄_a φ_b; the imaginary part has the opposite sign.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Real,
    Imaginary,
}

impl Part {
    /// Returns the first column and the number of columns of the weights that contain this part
    /// (real or imaginary) of H.
    fn columns(self, dof: usize) -> (usize, usize) {
        let real = real_part(0, dof);
        match self {
            Self::Real => (0, real),
            Self::Imaginary => (real, dof * dof - real),
        }
    }

    /// Returns the real part of 2 φ̄_a φ_b, or its imaginary part with the opposite sign; `a` and
    /// `b` are the pairs (real part, imaginary part) of φ_a and φ_b.
    #[inline(always)]
    fn product(self, a: (f64, f64), b: (f64, f64)) -> f64 {
        match self {
            Self::Real => 2.0 * (a.0 * b.0 + a.1 * b.1),
            Self::Imaginary => 2.0 * (a.1 * b.0 - a.0 * b.1),
        }
    }
}

/// Arguments of the sums for few degrees of freedom. The sums are dot products over the lines;
/// `pulp` compiles them for each width of vector registers.
struct Narrow<'a> {
    regressors: DMatrixView<'a, f64>,
    weights: DMatrixView<'a, f64>,
    dof: usize,
    /// Real or imaginary part of 2 φ̄_a φ_b on every line.
    pair: Vec<f64>,
    sums: &'a mut DMatrix<f64>,
}

impl WithSimd for Narrow<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { regressors, weights, dof, mut pair, sums } = self;
        let lines = weights.nrows();
        let column = |at: usize| regressors.column(at).data.into_slice().split_at(lines);
        let mut row = 0;
        for b in 0..regressors.ncols() {
            for a in 0..=b {
                let ((re_a, im_a), (re_b, im_b)) = (column(a), column(b));
                for part in [Part::Real, Part::Imaginary] {
                    let (first, count) = part.columns(dof);
                    if count == 0 {
                        continue;
                    }
                    let both = re_a.iter().zip(im_a).zip(re_b.iter().zip(im_b));
                    for (to, ((re_a, im_a), (re_b, im_b))) in pair.iter_mut().zip(both) {
                        *to = part.product((*re_a, *im_a), (*re_b, *im_b));
                    }
                    for at in first..first + count {
                        sums[(row, at)] = dot(&pair, weights.column(at).data.into_slice());
                    }
                }
                row += 1;
            }
        }
    }
}

/// Adds the sums for many degrees of freedom by a matrix product: the matrix of all pairs (pairs ×
/// lines) times the weights.
fn add_wide(
    regressors: DMatrixView<'_, f64>,
    weights: DMatrixView<'_, f64>,
    dof: usize,
    sums: &mut DMatrix<f64>,
) {
    // After the transposition, the regressors of one line are contiguous.
    let transposed = regressors.transpose();
    let mut pairs = DMatrix::zeros(sums.nrows(), weights.nrows());
    for part in [Part::Real, Part::Imaginary] {
        Arch::new().dispatch(Pairs { transposed: &transposed, part, pairs: &mut pairs });
        let (first, count) = part.columns(dof);
        sums.columns_mut(first, count).gemm(1.0, &pairs, &weights.columns(first, count), 1.0);
    }
}

/// Arguments of the function that writes the real or the imaginary part of 2 φ̄_a φ_b into `pairs`
/// (pairs × lines).
struct Pairs<'a> {
    transposed: &'a DMatrix<f64>,
    part: Part,
    pairs: &'a mut DMatrix<f64>,
}

impl WithSimd for Pairs<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { transposed, part, pairs } = self;
        let (q, lines) = (transposed.nrows(), pairs.ncols());
        let (real, imaginary) = transposed.as_slice().split_at(q * lines);
        for line in 0..lines {
            let [re, im] = [real, imaginary].map(|values| &values[q * line..][..q]);
            let column = &mut pairs.as_mut_slice()[q * (q + 1) / 2 * line..];
            for b in 0..q {
                let of_b = (re[b], im[b]);
                let to = column[b * (b + 1) / 2..].iter_mut();
                for (to, (re, im)) in to.zip(re[..=b].iter().zip(im)) {
                    *to = part.product((*re, *im), of_b);
                }
            }
        }
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

    /// Reference: sums over the explicit rows of 45 lines and 5 regressors, with few and with many
    /// degrees of freedom.
    #[test]
    fn products_are_those_of_the_rows() {
        let (lines, q) = (45, 5);
        for dof in [1, 2, 3, 5] {
            let phi = |line: usize, at: usize| complex(17 * line + 3 * at);
            let w = |line: usize, i: usize, j: usize| complex(29 * line + 5 * i + 11 * j + 7);
            let h = |line: usize, i: usize, j: usize| -> Complex<f64> {
                (0..dof).map(|k| w(line, k, i).conj() * w(line, k, j)).sum()
            };
            let regressors = DMatrix::from_fn(2 * lines, q, |row, at| {
                let z = phi(row % lines, at);
                if row < lines { z.re } else { z.im }
            });
            let mut weights = DMatrix::zeros(lines, dof * dof);
            for (line, j) in (0..lines).flat_map(|line| (0..dof).map(move |j| (line, j))) {
                for i in 0..=j {
                    weights[(line, real_part(i, j))] = h(line, i, j).re;
                    if i < j {
                        weights[(line, imaginary_part(i, j, dof))] = h(line, i, j).im;
                    }
                }
            }
            let products = gram(regressors.as_view(), weights.as_view(), dof);
            for (column, i, j) in (0..dof * dof).map(|at| (at, at % dof, at / dof)) {
                let pairs = (0..q).flat_map(|b| (0..=b).map(move |a| (a, b)));
                for (row, (a, b)) in pairs.enumerate() {
                    let term = |line: usize| phi(line, a).conj() * phi(line, b) * h(line, i, j);
                    let expected: f64 = (0..lines).map(|line| 2.0 * term(line).re).sum();
                    // The tolerance is the rounding error of a sum of 45 terms below 100.
                    assert!((products[(row, column)] - expected).abs() < 1e-11, "{i} {j} {a} {b}");
                }
            }
        }
        let none = DMatrix::zeros(0, 3);
        assert_eq!(gram(none.as_view(), DMatrix::zeros(0, 4).as_view(), 2), DMatrix::zeros(6, 4));
        assert_eq!(gram(none.as_view(), DMatrix::zeros(0, 9).as_view(), 3), DMatrix::zeros(6, 9));
    }
}
