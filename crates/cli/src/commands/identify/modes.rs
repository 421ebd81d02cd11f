//! Natural frequencies and damping ratios with the uncertainty of the matrices they come from.

use std::f64::consts::TAU;

use mechid::estimate::{Estimate, Parameter};
use mechid::model::{Matrix, Mode, SecondOrderSystem};
use nalgebra::{Complex, DVector};

use super::report::{ModeRow, Uncertain};
use crate::error::CliError;

/// The modes of the identified system; standard errors by linear propagation of the covariance.
pub fn rows(estimate: &Estimate, level: f64) -> Result<Vec<ModeRow>, CliError> {
    let system = estimate.system()?;
    let (m, c, k) = (system.mass(), system.damping(), system.stiffness());
    let adjoint = SecondOrderSystem::new(m.transpose(), c.transpose(), k.transpose())?;
    let parameters: Vec<Parameter> = estimate.parameters().map(|p| p.parameter).collect();
    let covariance = estimate.covariance();
    // A transposed system has the same eigenvalues, so both lists come in the same order.
    let pairs = system.modes()?.into_iter().zip(adjoint.modes()?);
    pairs
        .map(|(mode, left)| {
            let gradient = gradient(&system, &mode, &left, &parameters);
            let uncertain = |value: f64, gradient: DVector<f64>| {
                let variance = (gradient.transpose() * covariance * &gradient)[0];
                Uncertain::new(value, variance.max(0.0).sqrt(), estimate, level)
            };
            let (lambda, omega) = (mode.eigenvalue(), mode.natural_frequency());
            // d|λ| = Re(λ* dλ)/|λ| and dζ = d(−Re λ/|λ|).
            let frequency = gradient.map(|d| (lambda.conj() * d).re / omega);
            let ratio = gradient.zip_map(&frequency, |d, f| (lambda.re * f / omega - d.re) / omega);
            Ok(ModeRow {
                oscillates: mode.oscillates(),
                natural_frequency_hz: uncertain(omega / TAU, frequency / TAU)?,
                damped_frequency_hz: mode.damped_frequency_hz(),
                damping_ratio: uncertain(mode.damping_ratio(), ratio)?,
            })
        })
        .collect()
}

/// ∂λ/∂θ for every parameter θ, with the right and left shapes φ and ψ of λ:
///
/// ```text
/// ∂λ/∂m_ij = −λ² ψ_i φ_j / s    ∂λ/∂c_ij = −λ ψ_i φ_j / s    ∂λ/∂k_ij = −ψ_i φ_j / s
/// s = ψᵀ (2λ M + C) φ
/// ```
///
/// # Source
/// The first-order perturbation of (λ²M + λC + K) φ = 0, multiplied from the left by ψᵀ.
fn gradient(
    system: &SecondOrderSystem,
    mode: &Mode,
    left: &Mode,
    parameters: &[Parameter],
) -> DVector<Complex<f64>> {
    let (lambda, phi, psi) = (mode.eigenvalue(), mode.shape(), left.shape());
    let slope = system.mass().zip_map(system.damping(), |m, c| 2.0 * lambda * m + c);
    let scale = (psi.transpose() * slope * phi)[0];
    DVector::from_iterator(
        parameters.len(),
        parameters.iter().map(|p| {
            let power = match p.matrix() {
                Matrix::Mass => lambda * lambda,
                Matrix::Damping => lambda,
                Matrix::Stiffness => Complex::from(1.0),
            };
            -power * psi[p.row()] * phi[p.column()] / scale
        }),
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;

    /// Difference quotients of the eigenvalues themselves.
    #[test]
    fn gradients_agree_with_difference_quotients() {
        let matrices = [
            dmatrix![2.0, 0.1; 0.0, 3.0],
            dmatrix![0.3, 0.1; -0.2, 0.2],
            dmatrix![50.0, 7.0; -4.0, 90.0],
        ];
        let system = |m: &[nalgebra::DMatrix<f64>; 3]| {
            SecondOrderSystem::new(m[0].clone(), m[1].clone(), m[2].clone()).unwrap()
        };
        let transposed = system(&matrices.clone().map(|m| m.transpose()));
        let base = system(&matrices);
        let (modes, left) = (base.modes().unwrap(), transposed.modes().unwrap());
        let parameters = mechid::estimate::Unknowns::unknown_mass(2).unwrap().free();
        for (which, (mode, left)) in modes.iter().zip(&left).enumerate() {
            let found = gradient(&base, mode, left, &parameters);
            for (at, p) in parameters.iter().enumerate() {
                let nudged = |step: f64| {
                    let mut moved = matrices.clone();
                    moved[p.matrix() as usize][(p.row(), p.column())] += step;
                    system(&moved).modes().unwrap()[which].eigenvalue()
                };
                let step = 1e-5;
                let quotient = (nudged(step) - nudged(-step)) / (2.0 * step);
                // Rounding of eigenvalues (about 1e-14) over the step.
                assert!((found[at] - quotient).norm() < 1e-7, "{p}: {} {quotient}", found[at]);
            }
        }
    }
}
