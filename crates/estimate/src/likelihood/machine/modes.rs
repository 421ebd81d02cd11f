//! Modes of an identified machine, with standard errors due to the uncertainty of its parameters.

use mechid_model::elements::{Assembly, Power};
use mechid_model::{Mode, SecondOrderSystem};
use nalgebra::{Complex, DMatrix, DVector};

use super::MachineEstimate;
use super::system::constant_speed;
use crate::likelihood::LikelihoodError;

/// A mode with standard errors.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineMode {
    /// Eigenvalue and shape.
    pub mode: Mode,
    /// Standard error of the natural frequency |λ|, in rad/s.
    pub natural_frequency_error: f64,
    /// Standard error of the damping ratio.
    pub damping_ratio_error: f64,
}

/// Relative difference between an eigenvalue and the shift of the inverse iteration for its left
/// eigenvector.
const SHIFT: f64 = 1e-7;

impl MachineEstimate {
    /// Returns the modes of [`MachineEstimate::system`] by rising frequency, without structural
    /// damping.
    ///
    /// # Errors
    /// As [`MachineEstimate::system`], and if the eigenvalues do not converge.
    ///
    /// # Source
    /// Adhikari (1999), AIAA Journal 37, 1452–1458 (derivatives of the eigenvalues of damped
    /// systems).
    pub fn modes(&self) -> Result<Vec<MachineMode>, LikelihoodError> {
        let system = self.system()?;
        let modes = system.modes().map_err(|error| LikelihoodError::Machine(error.into()))?;
        Ok(modes.into_iter().map(|mode| self.mode(&system, mode)).collect())
    }

    fn mode(&self, system: &SecondOrderSystem, mode: Mode) -> MachineMode {
        let lambda = mode.eigenvalue();
        let slopes = slopes(&self.assembly, &self.likelihood.values(), system, &mode);
        let size = lambda.norm();
        let error = |gradient: DVector<f64>| {
            gradient.dot(&(&self.likelihood.covariance * &gradient)).max(0.0).sqrt()
        };
        // ∂|λ| = Re(λ̄ ∂λ)/|λ| and ζ = −Re λ/|λ|.
        let of_size = |slope: &Complex<f64>| (lambda.conj() * slope).re / size;
        let (frequency_error, damping_error) =
            match slopes {
                None => (f64::NAN, f64::NAN),
                Some(slopes) => (
                    error(slopes.map(|slope| of_size(&slope))),
                    error(slopes.map(|slope| {
                        -slope.re / size + lambda.re * of_size(&slope) / (size * size)
                    })),
                ),
            };
        MachineMode {
            mode,
            natural_frequency_error: frequency_error,
            damping_ratio_error: damping_error,
        }
    }
}

/// Returns ∂λ/∂θ = −ψᵀ ∂D φ / ψᵀ D′ φ with the left and right eigenvectors ψ and φ of the dynamic
/// stiffness D(λ) and D′ = dD/dλ; `None` for coincident eigenvalues.
fn slopes(
    assembly: &Assembly,
    values: &[f64],
    system: &SecondOrderSystem,
    mode: &Mode,
) -> Option<DVector<Complex<f64>>> {
    let (lambda, n) = (mode.eigenvalue(), system.dof());
    let near = lambda * (1.0 + SHIFT);
    let complex = |matrix: &DMatrix<f64>| matrix.map(Complex::from);
    let dynamic = complex(system.mass()) * (near * near)
        + complex(system.damping()) * near
        + complex(system.stiffness());
    let phi = mode.shape();
    let factors = dynamic.transpose().lu();
    let mut psi = DVector::from_fn(n, |at, _| Complex::new(1.0 + 0.3 * (at % 7) as f64, 0.1));
    for _ in 0..3 {
        psi = factors.solve(&psi)?;
        let norm = psi.norm();
        (norm.is_finite() && norm > 0.0).then_some(())?;
        psi.unscale_mut(norm);
    }
    let slope = complex(system.mass()) * (lambda * 2.0) + complex(system.damping());
    let denominator = psi.dot(&(slope * phi));
    let mut slopes = DVector::<Complex<f64>>::zeros(values.len());
    let speed = constant_speed(assembly.speed());
    for term in assembly.terms().iter().filter(|term| term.power != Power::Hysteresis) {
        if term.is_known() {
            continue;
        }
        let factor = term.power.at_eigenvalue(lambda, speed);
        let mut work = Complex::default();
        term.for_each_entry(n, |row, column, value| {
            if column < n {
                work += psi[row] * phi[column] * value;
            }
        });
        for (parameter, by) in term.derivatives(values) {
            slopes[parameter] -= factor * work * by / denominator;
        }
    }
    slopes.iter().all(|slope| slope.is_finite()).then_some(slopes)
}
