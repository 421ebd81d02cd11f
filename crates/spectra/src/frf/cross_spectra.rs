//! Averaged cross-spectra of forces and responses, and the frequency responses from them.

use mechid_numerics::linear_algebra::hermitian_eigen;
use nalgebra::{Complex, DMatrix, DVector, Dyn, MatrixView, U1};
use statrs::distribution::{Beta, ContinuousCDF};

use super::ComplexMatrix;
use crate::SpectraError;
use crate::limits::FORCE_TOLERANCE;

/// Amplitudes of all channels at one line.
type Amplitudes<'a> = MatrixView<'a, Complex<f64>, U1, Dyn, U1, Dyn>;

/// Cross-spectra of one line: summed over segments, then averaged.
#[derive(Debug, Clone)]
pub(super) struct CrossSpectra {
    force: ComplexMatrix,
    pub(super) motion_force: ComplexMatrix,
    pub(super) motion: ComplexMatrix,
}

/// Adds a bᴴ. The function runs once per segment and line, so it does not allocate memory.
fn accumulate(sum: &mut ComplexMatrix, a: &Amplitudes<'_>, b: &Amplitudes<'_>) {
    for (mut column, b) in sum.column_iter_mut().zip(b.iter()) {
        for (entry, a) in column.iter_mut().zip(a.iter()) {
            *entry += a * b.conj();
        }
    }
}

impl CrossSpectra {
    pub(super) fn new(inputs: usize, outputs: usize) -> Self {
        Self {
            force: DMatrix::zeros(inputs, inputs),
            motion_force: DMatrix::zeros(outputs, inputs),
            motion: DMatrix::zeros(outputs, outputs),
        }
    }

    /// Adds the amplitudes of forces and responses in one segment.
    pub(super) fn add(&mut self, f: &Amplitudes<'_>, x: &Amplitudes<'_>) {
        accumulate(&mut self.force, f, f);
        accumulate(&mut self.motion_force, x, f);
        accumulate(&mut self.motion, x, x);
    }

    /// Returns the mean over this many segments.
    pub(super) fn mean(&self, pieces: usize) -> Self {
        let count = Complex::new(pieces as f64, 0.0);
        Self {
            force: &self.force / count,
            motion_force: &self.motion_force / count,
            motion: &self.motion / count,
        }
    }

    /// Adds the sums over other segments.
    pub(super) fn merge(&mut self, other: &Self) {
        self.force += &other.force;
        self.motion_force += &other.motion_force;
        self.motion += &other.motion;
    }

    /// Returns the sum of |F|² of a force.
    pub(super) fn force_power(&self, input: usize) -> f64 {
        self.force[(input, input)].re
    }

    /// Returns the ratio of two amplitudes: the part of the force `input` that is coherent with the
    /// force `driver`, divided by `driver`; 0 if `driver` is zero.
    pub(super) fn force_ratio(&self, input: usize, driver: usize) -> Complex<f64> {
        let power = self.force_power(driver);
        if power > 0.0 { self.force[(input, driver)] / power } else { Complex::ZERO }
    }

    /// Returns the sums restricted to some of the forces.
    pub(super) fn select_inputs(&self, inputs: &[usize]) -> Self {
        Self {
            force: self.force.select_rows(inputs).select_columns(inputs),
            motion_force: self.motion_force.select_columns(inputs),
            motion: self.motion.clone(),
        }
    }

    /// Returns −ln p for each response. If response and force are not related, p is the probability
    /// of a partial coherence (given the other forces) at least as large as observed, for this many
    /// independent averages. `None` if the forces are dependent.
    pub(super) fn evidence_of_motion(&self, input: usize, averages: f64) -> Option<Vec<f64>> {
        let inverse = self.inverse_force(0.0).ok()?;
        let h = &self.motion_force * &inverse;
        let explained = &h * self.motion_force.adjoint();
        let spare = averages - inverse.nrows() as f64;
        let of_motion = (0..h.nrows()).filter_map(|o| {
            let unexplained = (self.motion[(o, o)] - explained[(o, o)]).re;
            let share = h[(o, input)].norm_sqr() / inverse[(input, input)].re;
            (unexplained > 0.0).then(|| spare * (share / unexplained).ln_1p())
        });
        Some(of_motion.collect())
    }

    /// Returns −ln p for the coherence γ² of a force with the other forces. If the forces are not
    /// related, p is the probability of a coherence at least as large as observed; 1 − γ² has a
    /// beta distribution in this case.
    pub(super) fn evidence_of_forces(&self, input: usize, averages: f64) -> Option<f64> {
        let inverse = self.inverse_force(0.0).ok()?;
        let other_forces = inverse.nrows() as f64 - 1.0;
        let apart = (1.0 / (self.force_power(input) * inverse[(input, input)].re)).clamp(0.0, 1.0);
        let p = Beta::new(averages - other_forces, other_forces).ok()?.cdf(apart);
        Some(-p.max(f64::MIN_POSITIVE).ln())
    }

    /// Returns S_FF⁻¹; an error if the forces are dependent.
    pub(super) fn inverse_force(&self, frequency_hz: f64) -> Result<ComplexMatrix, SpectraError> {
        let inputs = self.force.nrows();
        let size = self.force.diagonal().map(|s| s.re.sqrt());
        let scaled =
            DMatrix::from_fn(inputs, inputs, |i, j| self.force[(i, j)] / (size[i] * size[j]));
        let eigenvalues = if size.min() > 0.0 {
            hermitian_eigen(scaled.clone())?.eigenvalues
        } else {
            DVector::from_element(1, 0.0)
        };
        let ratio = eigenvalues.min() / eigenvalues.max();
        if ratio.is_nan() || ratio < FORCE_TOLERANCE {
            let reciprocal_condition = if ratio.is_nan() { 0.0 } else { ratio.max(0.0) };
            return Err(SpectraError::DependentForces { frequency_hz, reciprocal_condition });
        }
        let mut inverse = DMatrix::identity(inputs, inputs);
        scaled.lu().solve_mut(&mut inverse);
        Ok(DMatrix::from_fn(inputs, inputs, |i, j| inverse[(i, j)] / (size[i] * size[j])))
    }

    pub(super) fn h2(&self) -> Option<ComplexMatrix> {
        if self.force.nrows() == 1 {
            let h = DMatrix::from_fn(self.motion.nrows(), 1, |o, _| {
                self.motion[(o, o)] / self.motion_force[(o, 0)].conj()
            });
            return h.iter().all(|z| z.is_finite()).then_some(h);
        }
        // The equation H S_FX = S_XX is transposed, so that the unknown H is the right-hand factor,
        // as the solver requires.
        let solution = self.motion_force.map(|z| z.conj()).lu().solve(&self.motion.transpose());
        solution.map(|h| h.transpose()).filter(|h| h.iter().all(|z| z.is_finite()))
    }

    /// Returns the Hv estimate of each response: a ratio of entries of an eigenvector of the
    /// cross-spectra of forces and response. The eigenvector is that of the smallest eigenvalue.
    pub(super) fn hv(&self) -> Result<ComplexMatrix, SpectraError> {
        let (outputs, inputs) = self.motion_force.shape();
        let mut h = DMatrix::zeros(outputs, inputs);
        for o in 0..outputs {
            let power = self.motion[(o, o)].re;
            if power == 0.0 {
                continue;
            }
            let size = |i: usize| if i < inputs { self.force[(i, i)].re } else { power }.sqrt();
            let scaled = DMatrix::from_fn(inputs + 1, inputs + 1, |i, j| {
                let s = match (i < inputs, j < inputs) {
                    (true, true) => self.force[(i, j)],
                    (false, true) => self.motion_force[(o, j)],
                    (true, false) => self.motion_force[(o, i)].conj(),
                    (false, false) => self.motion[(o, o)],
                };
                s / (size(i) * size(j))
            });
            let eigen = hermitian_eigen(scaled)?;
            let least = eigen.eigenvectors.column(eigen.eigenvalues.imin());
            for i in 0..inputs {
                // The eigenvector satisfies aᴴ z = 0 for the scaled z = (forces, response).
                h[(o, i)] = -(least[i] / least[inputs]).conj() * size(inputs) / size(i);
            }
        }
        Ok(h)
    }
}
