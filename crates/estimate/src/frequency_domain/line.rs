//! One spectral line at one set of parameters, in reusable buffers.

use nalgebra::{Complex, DMatrix, DVector, Dim, Dyn, Matrix, StorageMut};

use crate::elimination::solve_in_place;

type ComplexMatrix = DMatrix<Complex<f64>>;
type ComplexVector = DVector<Complex<f64>>;

/// Residual e = X − G(ω) F of one line at one set of parameters, in units of its noise.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on
/// maximum likelihood in errors-in-variables.
#[derive(Clone)]
pub(super) struct Line {
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
    /// Covariance L Lᴴ of e, and its factor L in the lower triangle.
    lower: ComplexMatrix,
    /// E[ΔF eᴴ]; the first rows belong to the forces with noise, the other rows are not used.
    cross: ComplexMatrix,
    /// Error (L Lᴴ)⁻¹e, weighted twice.
    twice: ComplexVector,
}

impl Line {
    pub(super) fn new(n: usize) -> Self {
        let (square, vector) = (DMatrix::zeros(n, n), DVector::zeros(n));
        Self {
            dynamic: square.clone(),
            receptance: square.clone(),
            displacement: vector.clone(),
            likely: vector.clone(),
            white_receptance: square.clone(),
            white: vector.clone(),
            lower: square.clone(),
            cross: square,
            twice: vector,
        }
    }

    pub(super) fn displacement(&self) -> &ComplexVector {
        &self.displacement
    }

    /// Displacement under the most likely force. The most likely force follows from the noise of
    /// the force and the measured displacement.
    pub(super) fn likely_displacement(&self) -> &ComplexVector {
        &self.likely
    }

    pub(super) fn receptance(&self) -> &ComplexMatrix {
        &self.receptance
    }

    pub(super) fn white_receptance(&self) -> &ComplexMatrix {
        &self.white_receptance
    }

    /// Matrix whose lower triangle is the factor L that [`Line::whiten_both`] computed.
    pub(super) fn lower(&self) -> &ComplexMatrix {
        &self.lower
    }

    /// Scales L⁻¹, which gives the line another weight.
    pub(super) fn scale(&mut self, by: f64) {
        self.white.scale_mut(by);
        self.white_receptance.scale_mut(by);
    }

    pub(super) fn white(&self) -> &ComplexVector {
        &self.white
    }

    /// Computes G and G F; returns `false` if G does not exist.
    pub(super) fn model<'f>(
        &mut self,
        [m, c, k]: &[DMatrix<f64>; 3],
        omega: f64,
        force: impl Iterator<Item = &'f Complex<f64>>,
    ) -> bool {
        for ((to, m), (c, k)) in self.dynamic.iter_mut().zip(m).zip(c.iter().zip(k)) {
            *to = Complex::new(k - omega * omega * m, omega * c);
        }
        self.receptance.fill_with_identity();
        if !solve_in_place(&mut self.dynamic, &mut self.receptance) {
            return false;
        }
        self.displacement.fill(Complex::ZERO);
        for (column, force) in self.receptance.column_iter().zip(force) {
            self.displacement.axpy(*force, &column, Complex::from(1.0));
        }
        self.likely.copy_from(&self.displacement);
        self.displacement.iter().all(|z| z.is_finite())
    }

    /// Computes L⁻¹e and L⁻¹G with the given L; returns `false` if L is singular.
    pub(super) fn whiten<'x>(
        &mut self,
        measured: impl Iterator<Item = &'x Complex<f64>>,
        lower: &ComplexMatrix,
    ) -> bool {
        for ((to, x), modelled) in self.white.iter_mut().zip(measured).zip(&self.displacement) {
            *to = x - modelled;
        }
        self.white_receptance.copy_from(&self.receptance);
        solve_lower(lower, &mut self.white) && solve_lower(lower, &mut self.white_receptance)
    }

    /// Whitens like [`Line::whiten`], with L from the covariance of displacements and forces, and
    /// computes the most likely force F̂ = F − Q (L Lᴴ)⁻¹ e with Q = E[ΔF ΔXᴴ] − E[ΔF ΔFᴴ] Gᴴ.
    /// Forces outside `noisy` are exact.
    pub(super) fn whiten_both<'x>(
        &mut self,
        measured: impl Iterator<Item = &'x Complex<f64>>,
        covariance: &ComplexMatrix,
        noisy: &[usize],
    ) -> bool {
        let n = self.receptance.nrows();
        let mut total = std::mem::replace(&mut self.lower, ComplexMatrix::zeros(0, 0));
        self.write_covariance(covariance, noisy, &mut total);
        let Some(lower) = lower_factor(total) else {
            self.lower = ComplexMatrix::zeros(n, n);
            return false;
        };
        let exists = self.whiten(measured, &lower);
        self.twice.copy_from(&self.white);
        lower.ad_solve_lower_triangular_mut(&mut self.twice);
        self.lower = lower;
        for (at, &force) in noisy.iter().enumerate() {
            let change: Complex<f64> =
                self.cross.row(at).iter().zip(&self.twice).map(|(q, w)| q * w).sum();
            self.likely.axpy(-change, &self.receptance.column(force), Complex::from(1.0));
        }
        exists
    }

    /// Writes Q and the lower triangle of L Lᴴ = [I −G] E[z zᴴ] [I −G]ᴴ, with the noise z = (ΔX,
    /// ΔF).
    fn write_covariance(
        &mut self,
        covariance: &ComplexMatrix,
        noisy: &[usize],
        total: &mut ComplexMatrix,
    ) {
        let n = self.receptance.nrows();
        for column in 0..n {
            for (at, &force) in noisy.iter().enumerate() {
                let mut cross = covariance[(n + force, column)];
                for &other in noisy {
                    let gain = self.receptance[(column, other)].conj();
                    cross -= covariance[(n + force, n + other)] * gain;
                }
                self.cross[(at, column)] = cross;
            }
            for row in column..n {
                let mut sum = covariance[(row, column)];
                for (at, &force) in noisy.iter().enumerate() {
                    sum -= covariance[(row, n + force)] * self.receptance[(column, force)].conj();
                    sum -= self.receptance[(row, force)] * self.cross[(at, column)];
                }
                total[(row, column)] = sum;
            }
        }
    }
}

/// Solves L X = B in place with the lower triangle of L; returns `false` if L is singular.
/// Independent noise has a diagonal L, which needs only one division for each entry.
pub(super) fn solve_lower<C: Dim, S: StorageMut<Complex<f64>, Dyn, C>>(
    lower: &ComplexMatrix,
    b: &mut Matrix<Complex<f64>, Dyn, C, S>,
) -> bool {
    let n = lower.nrows();
    let is_diagonal =
        (0..n).all(|column| (column + 1..n).all(|row| lower[(row, column)] == Complex::ZERO));
    if !is_diagonal {
        return lower.solve_lower_triangular_mut(b);
    }
    for (row, mut entries) in b.row_iter_mut().enumerate() {
        let scale = lower[(row, row)].re;
        if scale == 0.0 {
            return false;
        }
        entries.unscale_mut(scale);
    }
    true
}

/// Returns the indices of the forces that have noise, from the covariance of n displacements and n
/// forces.
pub(super) fn noisy_forces(covariance: &ComplexMatrix) -> impl Iterator<Item = usize> {
    let n = covariance.ncols() / 2;
    (0..n).filter(move |force| covariance.column(n + force).iter().any(|z| *z != Complex::ZERO))
}

/// Returns L in the lower triangle, from the lower triangle of a Hermitian positive definite matrix
/// L Lᴴ; `None` for any other matrix.
pub(super) fn lower_factor(matrix: ComplexMatrix) -> Option<ComplexMatrix> {
    // nalgebra does not reject negative pivots but computes their complex roots.
    let lower = matrix.cholesky()?.unpack_dirty();
    let n = lower.nrows();
    let positive = |z: Complex<f64>| z.re > 0.0 && z.im.abs() <= 1e-8 * z.re;
    (0..n).all(|at| positive(lower[(at, at)])).then_some(lower)
}
