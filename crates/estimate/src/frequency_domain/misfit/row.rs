//! One spectral line at one set of parameters, in reusable buffers.

use nalgebra::{Complex, DMatrix, DVector, DVectorView};

use super::{ComplexMatrix, ComplexVector, cholesky};

/// One row of the data at one set of parameters.
#[derive(Clone)]
pub(super) struct Row {
    /// Dynamic stiffness K + iωC − ω²M, overwritten by its elimination.
    dynamic: ComplexMatrix,
    /// Receptance G = (K + iωC − ω²M)⁻¹.
    receptance: ComplexMatrix,
    /// Modelled displacement G F.
    displacement: ComplexVector,
    /// Displacement G F̂ under the most likely force F̂; G F for an exact force.
    likely: ComplexVector,
    /// Weighted receptance L⁻¹ G.
    white_receptance: ComplexMatrix,
    /// Weighted error L⁻¹ e.
    white: ComplexVector,
}

impl Row {
    pub(super) fn new(n: usize) -> Self {
        let (square, vector) = (DMatrix::zeros(n, n), DVector::zeros(n));
        Self {
            dynamic: square.clone(),
            receptance: square.clone(),
            displacement: vector.clone(),
            likely: vector.clone(),
            white_receptance: square,
            white: vector,
        }
    }

    pub(super) fn displacement(&self) -> &ComplexVector {
        &self.displacement
    }

    /// Displacement under the most likely force, given its noise and the measured displacement.
    pub(super) fn likely_displacement(&self) -> &ComplexVector {
        &self.likely
    }

    pub(super) fn receptance(&self) -> &ComplexMatrix {
        &self.receptance
    }

    pub(super) fn white_receptance(&self) -> &ComplexMatrix {
        &self.white_receptance
    }

    /// Scales L⁻¹, which gives the row another weight.
    pub(super) fn scale(&mut self, by: f64) {
        self.white.scale_mut(by);
        self.white_receptance.scale_mut(by);
    }

    pub(super) fn white(&self) -> &ComplexVector {
        &self.white
    }

    /// Computes G and G F; returns `false` if G does not exist.
    pub(super) fn model(
        &mut self,
        [m, c, k]: &[DMatrix<f64>; 3],
        omega: f64,
        force: DVectorView<'_, Complex<f64>>,
    ) -> bool {
        for ((to, m), (c, k)) in self.dynamic.iter_mut().zip(m).zip(c.iter().zip(k)) {
            *to = Complex::new(k - omega * omega * m, omega * c);
        }
        self.receptance.fill_with_identity();
        if !solve_in_place(&mut self.dynamic, &mut self.receptance) {
            return false;
        }
        let (one, zero) = (Complex::from(1.0), Complex::from(0.0));
        self.displacement.gemv(one, &self.receptance, &force, zero);
        self.likely.copy_from(&self.displacement);
        self.displacement.iter().all(|z| z.is_finite())
    }

    /// Computes L⁻¹e and L⁻¹G for a given L; returns `false` if L is singular.
    pub(super) fn whiten(
        &mut self,
        measured: DVectorView<'_, Complex<f64>>,
        lower: &ComplexMatrix,
    ) -> bool {
        self.white.copy_from(&measured);
        self.white -= &self.displacement;
        self.white_receptance.copy_from(&self.receptance);
        lower.solve_lower_triangular_mut(&mut self.white)
            && lower.solve_lower_triangular_mut(&mut self.white_receptance)
    }

    /// Whitens like [`Row::whiten`], with L from the covariance of displacements and forces, and
    /// computes the most likely force F̂ = F − Q (L Lᴴ)⁻¹ e with Q = E[ΔF ΔXᴴ] − E[ΔF ΔFᴴ] Gᴴ.
    pub(super) fn whiten_both(
        &mut self,
        measured: DVectorView<'_, Complex<f64>>,
        force: DVectorView<'_, Complex<f64>>,
        covariance: &ComplexMatrix,
    ) -> bool {
        let n = self.receptance.nrows();
        let block = |i: usize, j: usize| covariance.view((i * n, j * n), (n, n));
        let adjoint = self.receptance.adjoint();
        let cross = block(1, 0) - block(1, 1) * &adjoint;
        let total = block(0, 0) - block(0, 1) * &adjoint - &self.receptance * &cross;
        let Some(lower) = cholesky(total) else { return false };
        if !self.whiten(measured, &lower) {
            return false;
        }
        let mut whitened_twice = self.white.clone();
        lower.ad_solve_lower_triangular_mut(&mut whitened_twice);
        self.likely = &self.receptance * (force - cross * whitened_twice);
        true
    }
}

/// Replaces B by A⁻¹B by elimination with row exchanges and overwrites A; returns `false` for a
/// singular A.
///
/// The operations are those of an LU decomposition in a library, but without allocation: this runs
/// once per line and step, and the matrices are tiny.
fn solve_in_place(a: &mut ComplexMatrix, b: &mut ComplexMatrix) -> bool {
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
            // Both are right to the condition number times rounding.
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
