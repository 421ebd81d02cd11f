//! The inverted operator of the equation of motion about a shift.

use mechid_model::{Matrix, SparseSystem};
use mechid_numerics::krylov::start_vector::numbered_start_vector;
use nalgebra::{Complex, DVector};
use nalgebra_sparse::coo::CooMatrix;
use nalgebra_sparse::csc::CscMatrix;
use nalgebra_sparse::csr::CsrMatrix;

use crate::error::IntegrateError;
use crate::limits;
use crate::modes::ModeSearch;
use crate::sparse::{GeneralLu, NotFactored, SparseLu, combination};

/// Operator x ↦ Re (A − σB)⁻¹B x, for the first-order form A z = λ B z of the equation of motion
/// with z = [φ; λφ / s].
pub(super) struct Inverse<'a> {
    system: &'a SparseSystem,
    pub(super) shift: Complex<f64>,
    /// Frequency s (rad/s) near the modes searched for, so that the halves φ and λφ / s of z have
    /// comparable sizes.
    pub(super) scale: f64,
    factors: Factors,
}

/// Factors of Q = K + σC + σ²M.
enum Factors {
    Real(SparseLu),
    Complex(Box<GeneralLu<Complex<f64>>>),
}

impl<'a> Inverse<'a> {
    pub(super) fn new(
        system: &'a SparseSystem,
        search: ModeSearch,
    ) -> Result<Self, IntegrateError> {
        match search {
            ModeSearch::Lowest => {
                Self::real(system, 0.0).or_else(|error: IntegrateError| {
                    if !matches!(error, IntegrateError::SingularShift { .. }) {
                        return Err(error);
                    }
                    // K is singular, because the machine is free to drift.
                    let omega = match highest_frequency(system) {
                        0.0 => 1.0,
                        omega => omega,
                    };
                    Self::real(system, -limits::FREE_SHIFT * omega)
                })
            }
            ModeSearch::NearOmega(omega) => Self::complex(system, Complex::new(0.0, omega)),
        }
    }

    /// Returns whether K is singular: the machine is free to drift.
    pub(super) fn is_free(system: &'a SparseSystem) -> bool {
        matches!(Self::real(system, 0.0), Err(IntegrateError::SingularShift { .. }))
    }

    /// Creates the operator about any shift.
    pub(super) fn near(
        system: &'a SparseSystem,
        shift: Complex<f64>,
    ) -> Result<Self, IntegrateError> {
        if shift.im.abs() > limits::REAL_SHIFT * shift.norm() {
            Self::complex(system, shift)
        } else {
            Self::real(system, shift.re)
        }
    }

    fn real(system: &'a SparseSystem, shift: f64) -> Result<Self, IntegrateError> {
        let (matrix, sizes) = real_part(system, shift.into());
        let factors = SparseLu::new(&matrix, &sizes, system.factor_limit())
            .map_err(|error| singular(system, shift.into(), error))?;
        let factors = Factors::Real(factors);
        let mut inverse = Self { system, shift: shift.into(), scale: shift.abs(), factors };
        if shift == 0.0 {
            inverse.scale = inverse.lowest();
        }
        Ok(inverse)
    }

    fn complex(system: &'a SparseSystem, shift: Complex<f64>) -> Result<Self, IntegrateError> {
        let (matrix, sizes) = dynamic_stiffness(system, shift);
        let factors = GeneralLu::new(matrix, &sizes, system.factor_limit())
            .map_err(|error| singular(system, shift, error))?;
        let factors = Factors::Complex(Box::new(factors));
        Ok(Self { system, shift, scale: shift.norm(), factors })
    }

    /// Sets the scale of the velocities (their divisor) to `omega` (rad/s), if the shift of the
    /// operator is zero and the present scale is far smaller; returns whether the scale was
    /// changed.
    ///
    /// For modes far above the scale, the numerical range of the operator has a size of 1/scale
    /// around zero. Until these modes converge, the estimates of their eigenvalues lie anywhere in
    /// this range.
    pub(super) fn rescale_if_far(&mut self, omega: f64) -> bool {
        let is_far = self.shift == Complex::ZERO
            && omega > limits::VELOCITY_SCALE_RATIO * self.scale
            && omega.is_finite();
        if is_far {
            self.scale = omega;
        }
        is_far
    }

    /// Estimates the lowest natural frequency (rad/s) without damping, by steps of x ← K⁻¹M x.
    fn lowest(&mut self) -> f64 {
        let n = self.system.dof();
        let Factors::Real(factors) = &mut self.factors else { return 1.0 };
        let mut x = numbered_start_vector(n, 0);
        let mut growth = 1.0;
        for _ in 0..limits::LOWEST_FREQUENCY_STEPS {
            let mut next = vec![0.0; n];
            subtract(self.system.matrix(Matrix::Mass), x.as_slice(), 1.0, &mut next);
            factors.solve(&mut next);
            let next = DVector::from_vec(next);
            growth = next.norm();
            if !(growth > 0.0 && growth.is_finite()) {
                return 1.0;
            }
            x = next / growth;
        }
        growth.sqrt().recip()
    }

    /// Applies the operator to z = [x; v/s]. Returns the real parts of y and w/s with w = x + σ y,
    /// where y solves Q y = −(M v + (C + σM) x) with Q = K + σC + σ²M.
    pub(super) fn apply(&mut self, z: &DVector<f64>) -> DVector<f64> {
        let n = self.system.dof();
        let (x, v) = z.as_slice().split_at(n);
        let mut right = vec![0.0; n];
        subtract(self.system.matrix(Matrix::Mass), v, self.scale, &mut right);
        subtract(self.system.matrix(Matrix::Damping), x, 1.0, &mut right);
        subtract(self.system.matrix(Matrix::Mass), x, self.shift.re, &mut right);
        let mut image = DVector::zeros(2 * n);
        match &mut self.factors {
            Factors::Real(factors) => {
                factors.solve(&mut right);
                for (i, y) in right.iter().enumerate() {
                    (image[i], image[n + i]) = (*y, (x[i] + self.shift.re * y) / self.scale);
                }
            }
            Factors::Complex(factors) => {
                let mut imaginary = vec![0.0; n];
                subtract(self.system.matrix(Matrix::Mass), x, self.shift.im, &mut imaginary);
                let parts = right.iter().zip(&imaginary);
                let mut y: Vec<_> = parts.map(|(re, im)| Complex::new(*re, *im)).collect();
                factors.solve(&mut y);
                for (i, y) in y.iter().enumerate() {
                    (image[i], image[n + i]) = (y.re, (x[i] + (self.shift * y).re) / self.scale);
                }
            }
        }
        image
    }

    /// Returns the eigenvalue of the system for the eigenvalue `theta` of the operator; of two
    /// candidates, the eigenvalue nearer to `about`.
    pub(super) fn eigenvalue(&self, theta: Complex<f64>, about: Complex<f64>) -> Complex<f64> {
        let omega = self.shift.im;
        if omega == 0.0 {
            return self.shift + theta.inv();
        }
        // θ = μ / (μ² + ω²), with λ = μ + Re σ and ω = Im σ.
        let root = (Complex::from(1.0) - theta * theta * (4.0 * omega * omega)).sqrt();
        let pair = [1.0, -1.0].map(|sign| (root * sign + 1.0) / (theta * 2.0) + self.shift.re);
        if (pair[0] - about).norm() < (pair[1] - about).norm() { pair[0] } else { pair[1] }
    }
}

fn singular(system: &SparseSystem, shift: Complex<f64>, error: NotFactored) -> IntegrateError {
    let dof = system.dof();
    error.or_singular(dof, |smallest| IntegrateError::SingularShift {
        omega: shift.im,
        smallest,
        dof,
    })
}

/// Computes y ← y − scale · A x.
fn subtract(matrix: &CsrMatrix<f64>, x: &[f64], scale: f64, y: &mut [f64]) {
    if scale == 0.0 {
        return;
    }
    for (y, row) in y.iter_mut().zip(matrix.row_iter()) {
        let sum: f64 = row.col_indices().iter().zip(row.values()).map(|(j, a)| a * x[*j]).sum();
        *y -= scale * sum;
    }
}

/// Returns the real part of K + σC + σ²M, and the size of its terms for each row.
fn real_part(system: &SparseSystem, shift: Complex<f64>) -> (CsrMatrix<f64>, Vec<f64>) {
    combination(&[
        (1.0, system.matrix(Matrix::Stiffness)),
        (shift.re, system.matrix(Matrix::Damping)),
        ((shift * shift).re, system.matrix(Matrix::Mass)),
    ])
}

/// Returns K + σC + σ²M, and the size of its terms for each row.
pub(crate) fn dynamic_stiffness(
    system: &SparseSystem,
    shift: Complex<f64>,
) -> (CscMatrix<Complex<f64>>, Vec<f64>) {
    let (real, sizes) = real_part(system, shift);
    let (imaginary, more) = combination(&[
        (shift.im, system.matrix(Matrix::Damping)),
        ((shift * shift).im, system.matrix(Matrix::Mass)),
    ]);
    let n = system.dof();
    let mut sum = CooMatrix::new(n, n);
    real.triplet_iter().for_each(|(i, j, v)| sum.push(i, j, Complex::new(*v, 0.0)));
    imaginary.triplet_iter().for_each(|(i, j, v)| sum.push(i, j, Complex::new(0.0, *v)));
    (CscMatrix::from(&sum), sizes.iter().zip(&more).map(|(a, b)| a + b).collect())
}

/// Returns √(‖K‖ / ‖M‖) (rad/s), an estimate of the size of the highest natural frequency.
pub(super) fn highest_frequency(system: &SparseSystem) -> f64 {
    let [mass, stiffness] =
        [Matrix::Mass, Matrix::Stiffness].map(|which| largest_row(system.matrix(which)));
    (stiffness / mass).sqrt()
}

/// Returns the largest sum of moduli of a row.
pub(super) fn largest_row(matrix: &CsrMatrix<f64>) -> f64 {
    let sums = matrix.row_iter().map(|row| row.values().iter().map(|v| v.abs()).sum());
    sums.fold(0.0, f64::max)
}
