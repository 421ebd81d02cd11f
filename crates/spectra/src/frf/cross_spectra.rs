//! Averaged cross-spectra of forces and motions, and the responses they give.

use mechid_numerics::linear_algebra::hermitian_eigen;
use nalgebra::{Complex, DMatrix, DVector, Dyn, MatrixView, U1};
use statrs::distribution::{Beta, ContinuousCDF};

use super::ComplexMatrix;
use crate::SpectraError;
use crate::limits::FORCE_TOLERANCE;

/// Amplitudes of all channels at one line.
type Amplitudes<'a> = MatrixView<'a, Complex<f64>, U1, Dyn, U1, Dyn>;

/// Cross-spectra of one line: summed over pieces, then averaged.
#[derive(Debug, Clone)]
pub(super) struct CrossSpectra {
    force: ComplexMatrix,
    pub(super) motion_force: ComplexMatrix,
    pub(super) motion: ComplexMatrix,
}

/// Adds a bᴴ, once per piece and line: nothing is allocated.
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

    /// Adds the amplitudes of forces and motions in one piece.
    pub(super) fn add(&mut self, f: &Amplitudes<'_>, x: &Amplitudes<'_>) {
        accumulate(&mut self.force, f, f);
        accumulate(&mut self.motion_force, x, f);
        accumulate(&mut self.motion, x, x);
    }

    /// The mean over so many pieces.
    pub(super) fn mean(&self, pieces: usize) -> Self {
        let count = Complex::new(pieces as f64, 0.0);
        Self {
            force: &self.force / count,
            motion_force: &self.motion_force / count,
            motion: &self.motion / count,
        }
    }

    /// Adds the sums of other pieces.
    pub(super) fn merge(&mut self, other: &Self) {
        self.force += &other.force;
        self.motion_force += &other.motion_force;
        self.motion += &other.motion;
    }

    /// Sum of |F|² of a force.
    pub(super) fn force_power(&self, input: usize) -> f64 {
        self.force[(input, input)].re
    }

    /// Amplitude of a force over that of another one, as far as the two are in common; 0 where that one is.
    pub(super) fn force_ratio(&self, input: usize, driver: usize) -> Complex<f64> {
        let power = self.force_power(driver);
        if power > 0.0 { self.force[(input, driver)] / power } else { Complex::ZERO }
    }

    /// The sums of some of the forces.
    pub(super) fn of_inputs(&self, inputs: &[usize]) -> Self {
        Self {
            force: self.force.select_rows(inputs).select_columns(inputs),
            motion_force: self.motion_force.select_columns(inputs),
            motion: self.motion.clone(),
        }
    }

    /// −ln p of each motion, that it has nothing in common with a force beyond the others, from so many
    /// independent averages; `None` if the forces are dependent.
    pub(super) fn evidence_of_motion(&self, input: usize, averages: f64) -> Option<Vec<f64>> {
        let inverse = self.inverse_force(0.0).ok()?;
        let h = &self.motion_force * &inverse;
        let explained = &h * self.motion_force.adjoint();
        let spare = averages - inverse.nrows() as f64;
        let of_motion = (0..h.nrows()).filter_map(|o| {
            let left = (self.motion[(o, o)] - explained[(o, o)]).re;
            let share = h[(o, input)].norm_sqr() / inverse[(input, input)].re;
            (left > 0.0).then(|| spare * (share / left).ln_1p())
        });
        Some(of_motion.collect())
    }

    /// −ln p that a force has nothing in common with the others, likewise: 1 − γ² is a beta variate then.
    pub(super) fn evidence_of_forces(&self, input: usize, averages: f64) -> Option<f64> {
        let inverse = self.inverse_force(0.0).ok()?;
        let others = inverse.nrows() as f64 - 1.0;
        let apart = (1.0 / (self.force_power(input) * inverse[(input, input)].re)).clamp(0.0, 1.0);
        let p = Beta::new(averages - others, others).ok()?.cdf(apart);
        Some(-p.max(f64::MIN_POSITIVE).ln())
    }

    /// S_FF⁻¹, refused where the forces do not act independently.
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
        // H S_FX = S_XX, transposed for a solution from the left.
        let solution = self.motion_force.map(|z| z.conj()).lu().solve(&self.motion.transpose());
        solution.map(|h| h.transpose()).filter(|h| h.iter().all(|z| z.is_finite()))
    }

    /// Per motion, the eigenvector of least power of the cross-spectra of forces and motion.
    pub(super) fn hv(&self) -> Result<ComplexMatrix, SpectraError> {
        let (outputs, inputs) = self.motion_force.shape();
        let mut h = DMatrix::zeros(outputs, inputs);
        for o in 0..outputs {
            let power = self.motion[(o, o)].re;
            if power == 0.0 {
                continue;
            }
            let size = |i: usize| if i < inputs { self.force[(i, i)].re } else { power }.sqrt();
            let all = DMatrix::from_fn(inputs + 1, inputs + 1, |i, j| {
                let s = match (i < inputs, j < inputs) {
                    (true, true) => self.force[(i, j)],
                    (false, true) => self.motion_force[(o, j)],
                    (true, false) => self.motion_force[(o, i)].conj(),
                    (false, false) => self.motion[(o, o)],
                };
                s / (size(i) * size(j))
            });
            let eigen = hermitian_eigen(all)?;
            let least = eigen.eigenvectors.column(eigen.eigenvalues.imin());
            for i in 0..inputs {
                // aᴴ z = 0 for the scaled z = (forces, motion).
                h[(o, i)] = -(least[i] / least[inputs]).conj() * size(inputs) / size(i);
            }
        }
        Ok(h)
    }
}
