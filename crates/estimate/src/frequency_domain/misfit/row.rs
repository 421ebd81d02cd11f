//! One spectral line at one set of parameters, in buffers that are reused.

use mechid_model::Parameter;
use nalgebra::{Complex, DMatrix, DVector, DVectorView};

use super::{ComplexMatrix, ComplexVector, cholesky};

/// One row of the data at one set of parameters.
pub(super) struct Row {
    /// K + iωC − ω²M, eliminated.
    dynamic: ComplexMatrix,
    /// G = (K + iωC − ω²M)⁻¹.
    receptance: ComplexMatrix,
    /// G F.
    displacement: ComplexVector,
    /// L⁻¹ G.
    white_receptance: ComplexMatrix,
    /// L⁻¹ e.
    white: ComplexVector,
    /// With a noisy force: how the covariance depends on the parameters.
    spread: Option<Spread>,
}

/// Parts of a covariance that depends on the parameters.
struct Spread {
    /// L.
    lower: ComplexMatrix,
    /// Q = E[ΔF ΔXᴴ] − E[ΔF ΔFᴴ] Gᴴ.
    cross: ComplexMatrix,
    /// G Q L⁻ᴴ.
    white_cross: ComplexMatrix,
}

impl Row {
    pub(super) fn new(n: usize) -> Self {
        let (square, vector) = (DMatrix::zeros(n, n), DVector::zeros(n));
        Self {
            dynamic: square.clone(),
            receptance: square.clone(),
            displacement: vector.clone(),
            white_receptance: square,
            white: vector,
            spread: None,
        }
    }

    pub(super) fn displacement(&self) -> &ComplexVector {
        &self.displacement
    }

    pub(super) fn white_receptance(&self) -> &ComplexMatrix {
        &self.white_receptance
    }

    pub(super) fn white(&self) -> &ComplexVector {
        &self.white
    }

    /// G and G F; `false` if G does not exist.
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
        self.displacement.iter().all(|z| z.is_finite())
    }

    /// L⁻¹e and L⁻¹G for a given L; `false` if L cannot be inverted.
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

    /// As [`Row::whiten`], with L from the covariance of displacements and forces.
    pub(super) fn whiten_both(
        &mut self,
        measured: DVectorView<'_, Complex<f64>>,
        covariance: &ComplexMatrix,
    ) -> bool {
        let Some(spread) = Spread::new(covariance, &self.receptance) else { return false };
        let exists = self.whiten(measured, &spread.lower);
        self.spread = Some(spread);
        exists
    }

    /// G F̂ with the force F̂ = F − Q (L Lᴴ)⁻¹ e that, within its noise, agrees best with
    /// the displacement.
    pub(super) fn most_likely_displacement(
        &self,
        force: DVectorView<'_, Complex<f64>>,
    ) -> ComplexVector {
        let Some(spread) = &self.spread else { return self.displacement.clone() };
        let mut whitened_twice = self.white.clone();
        spread.lower.ad_solve_lower_triangular_mut(&mut whitened_twice);
        &self.receptance * (force - &spread.cross * whitened_twice)
    }

    /// −Φ(S) L⁻¹e, with S = L⁻¹ dC L⁻ᴴ the relative change of the covariance and Φ its lower
    /// triangle with half the diagonal: the derivative of L⁻¹ applied to e.
    pub(super) fn subtract_change_of_spread(
        &self,
        parameter: &Parameter,
        power: Complex<f64>,
        white: &mut ComplexVector,
    ) {
        let Some(spread) = &self.spread else { return };
        let u = self.white_receptance.column(parameter.row());
        let v = spread.white_cross.row(parameter.column());
        for i in 0..white.len() {
            for j in 0..=i {
                let change = power * u[i] * v[j] + (power * u[j] * v[i]).conj();
                let share = if i == j { 0.5 } else { 1.0 };
                white[i] -= change * share * self.white[j];
            }
        }
    }
}

impl Spread {
    fn new(covariance: &ComplexMatrix, receptance: &ComplexMatrix) -> Option<Self> {
        let n = receptance.nrows();
        let block = |i: usize, j: usize| covariance.view((i * n, j * n), (n, n));
        let cross = block(1, 0) - block(1, 1) * receptance.adjoint();
        let passed = receptance * &cross;
        let total = block(0, 0) - block(0, 1) * receptance.adjoint() - &passed;
        let lower = cholesky(total)?;
        let mut white = passed.adjoint();
        lower.solve_lower_triangular_mut(&mut white).then_some(())?;
        Some(Self { lower, cross, white_cross: white.adjoint() })
    }
}

/// B ← A⁻¹B by elimination with row exchanges; A is used up. `false` for a singular A.
///
/// The same operations as a library's LU, without its allocation: this runs once per line
/// and step, and the matrices are tiny.
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
        for i in j + 1..n {
            let factor = a[(i, j)] * inverse;
            for k in j + 1..n {
                let above = a[(j, k)];
                a[(i, k)] -= factor * above;
            }
            for k in 0..n {
                let above = b[(j, k)];
                b[(i, k)] -= factor * above;
            }
        }
    }
    for k in 0..n {
        for i in (0..n).rev() {
            let mut sum = b[(i, k)];
            for j in i + 1..n {
                sum -= a[(i, j)] * b[(j, k)];
            }
            b[(i, k)] = sum / a[(i, i)];
        }
    }
    true
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
            let condition = 1.0 / mechid_model::linear_algebra::singular_values(a.clone()).unwrap().min();
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
