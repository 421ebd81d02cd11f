//! Solution of the tiny systems of equations of a spectral line.

use nalgebra::{Complex, DMatrix};

/// Replaces B by A⁻¹B by elimination with row exchanges and overwrites A; returns `false` for a
/// singular A.
///
/// The operations are those of an LU decomposition in a library, but without allocation: the
/// function runs once per line and step, and the matrices are tiny.
pub(crate) fn solve_in_place(a: &mut DMatrix<Complex<f64>>, b: &mut DMatrix<Complex<f64>>) -> bool {
    let n = a.nrows();
    for j in 0..n {
        let pivot = (j..n).max_by(|p, q| a[(*p, j)].norm_sqr().total_cmp(&a[(*q, j)].norm_sqr()));
        let pivot = pivot.expect("at least the diagonal");
        let size = a[(pivot, j)].norm_sqr();
        if size == 0.0 || size.is_nan() {
            return false;
        }
        a.swap_rows(j, pivot);
        b.swap_rows(j, pivot);
        let inverse = a[(j, j)].inv();
        let (left, right) = a.as_mut_slice().split_at_mut((j + 1) * n);
        let factors = &mut left[j * n + j + 1..];
        factors.iter_mut().for_each(|f| *f *= inverse);
        for column in right.chunks_exact_mut(n).chain(b.as_mut_slice().chunks_exact_mut(n)) {
            let above = column[j];
            subtract(&mut column[j + 1..], factors, above);
        }
    }
    for column in b.as_mut_slice().chunks_exact_mut(n) {
        for j in (0..n).rev() {
            let upper = &a.as_slice()[j * n..=j * n + j];
            column[j] /= upper[j];
            let pivot = column[j];
            subtract(&mut column[..j], &upper[..j], pivot);
        }
    }
    true
}

/// Replaces y by y − x·factor.
fn subtract(y: &mut [Complex<f64>], x: &[Complex<f64>], factor: Complex<f64>) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= x * factor;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn elimination_agrees_with_the_library(
            entries in prop::collection::vec(-1.0..1.0f64, 18)
        ) {
            let a = DMatrix::from_fn(3, 3, |i, j| {
                Complex::new(entries[3 * i + j], entries[9 + 3 * i + j])
            });
            let condition = 1.0 / mechid_numerics::linear_algebra::singular_values(a.clone()).unwrap().min();
            let mut inverse = DMatrix::identity(3, 3);
            prop_assume!(condition < 1e6);
            prop_assert!(solve_in_place(&mut a.clone(), &mut inverse));
            let expected = a.lu().solve(&DMatrix::identity(3, 3)).unwrap();
            // The relative error of each of the two inverses is at most about the condition number
            // times the rounding error.
            prop_assert!((inverse - &expected).norm() < 1e-14 * condition * expected.norm());
        }
    }

    #[test]
    fn singular_matrices_are_noticed() {
        let one = Complex::from(1.0);
        let mut a = DMatrix::from_element(2, 2, one);
        assert!(!solve_in_place(&mut a, &mut DMatrix::identity(2, 2)));
        let mut a = DMatrix::from_element(1, 1, Complex::from(f64::NAN));
        assert!(!solve_in_place(&mut a, &mut DMatrix::identity(1, 1)));
    }
}
