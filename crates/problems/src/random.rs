//! Random systems that are stable by construction.

use mechid_model::SecondOrderSystem;
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Returns a stable system of `dof` degrees of freedom, the same for the same seed.
///
/// M is symmetric positive definite and full, C and K are full and non-symmetric, damping is not
/// proportional. With many degrees of freedom some modes are overdamped. With M = L Lᵀ the matrices
/// are
///
/// ```text
/// C = L (D + G) Lᵀ,      K = L (S + N) Lᵀ
/// ```
///
/// where S has eigenvalues ω² with ω from 5 to 60 rad/s; D has eigenvalues 2ζω with ζ from 0.05 to
/// 0.3 and ω in the same range; the eigenvectors of S and D are unrelated; and G and N are
/// skew-symmetric (gyroscopic and circulatory forces).
///
/// **Why it is stable.** An eigenvalue satisfies λ² + (d + ig) λ + (s + in) = 0, where d, ig, s and
/// in are the quadratic forms of D, G, S and N with its unit eigenvector. Both roots decay if d > 0
/// and d²s − d g n − n² > 0 (Routh's criterion for complex coefficients). With d₀, s₀ the smallest
/// eigenvalues of D, S, the bounds |g| ≤ √s₀ and |n| ≤ 0.4 d₀ √s₀ ensure that this expression is at
/// least (1 − 0.4 − 0.16) d₀² s₀.
///
/// # Panics
/// If `dof` is 0.
pub fn random_stable(dof: usize, seed: u64) -> SecondOrderSystem {
    let rng = &mut ChaCha8Rng::seed_from_u64(seed);
    let frequencies = spread(dof, 5.0, 60.0, rng);
    let rates = spread(dof, 5.0, 60.0, rng).map(|w| 2.0 * w * rng.random_range(0.05..0.3));
    let (slowest, least) = (frequencies.min(), rates.min());

    let factor = mass_factor(dof, rng);
    let stiffness = rotated(&frequencies.map(|w| w * w), rng);
    let damping = rotated(&rates, rng);
    let gyroscopic = skew(dof, slowest, rng);
    let circulatory = skew(dof, 0.4 * least * slowest, rng);

    let in_coordinates = |a: DMatrix<f64>| &factor * a * factor.transpose();
    SecondOrderSystem::new(
        &factor * factor.transpose(),
        in_coordinates(damping + gyroscopic),
        in_coordinates(stiffness + circulatory),
    )
    .expect("the factor of M has a diagonal of at least 1")
}

/// Returns log-uniform random values between two limits.
fn spread(dof: usize, low: f64, high: f64, rng: &mut ChaCha8Rng) -> DVector<f64> {
    DVector::from_fn(dof, |_, _| low * (high / low).powf(rng.random::<f64>()))
}

/// Returns a well-conditioned lower triangular matrix.
fn mass_factor(dof: usize, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    let coupling = 0.5 / dof as f64;
    DMatrix::from_fn(dof, dof, |i, j| match i.cmp(&j) {
        std::cmp::Ordering::Less => 0.0,
        std::cmp::Ordering::Equal => rng.random_range(1.0..3.0),
        std::cmp::Ordering::Greater => rng.random_range(-coupling..coupling),
    })
}

/// Returns a symmetric matrix with the given eigenvalues in random directions.
fn rotated(eigenvalues: &DVector<f64>, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    let q = gaussian(eigenvalues.len(), rng).qr().q();
    &q * DMatrix::from_diagonal(eigenvalues) * q.transpose()
}

/// Returns a skew-symmetric matrix whose spectral norm is at most `bound`.
fn skew(dof: usize, bound: f64, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    let a = gaussian(dof, rng);
    let skew = &a - a.transpose();
    // Singular values of a skew matrix come in pairs: the largest is at most ‖·‖F / √2.
    let norm = skew.norm() / std::f64::consts::SQRT_2;
    if norm > 0.0 { skew * (bound / norm) } else { skew }
}

fn gaussian(dof: usize, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    DMatrix::from_fn(dof, dof, |_, _| StandardNormal.sample(rng))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_stable_and_repeatable() {
        for dof in [1, 2, 3, 5, 8, 20] {
            for seed in 0..20 {
                let system = random_stable(dof, seed);
                assert_eq!(system, random_stable(dof, seed));
                let slowest =
                    system.eigenvalues().unwrap().iter().map(|l| l.re).fold(-1e9, f64::max);
                assert!(slowest < 0.0, "dof {dof}, seed {seed}: {slowest}");
            }
        }
    }

    #[test]
    fn they_are_truly_non_symmetric() {
        let system = random_stable(5, 3);
        for matrix in [system.damping(), system.stiffness()] {
            assert!((matrix - matrix.transpose()).norm() > 1e-3 * matrix.norm());
        }
    }
}
