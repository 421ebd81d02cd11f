//! Divided differences of the exponential, accurate for roots of an oscillator that are far apart,
//! close together or equal.
//!
//! The functions are φ₀(z) = exp z and φ_{k+1}(z) = (φ_k(z) − 1/k!) / z. The responses of an
//! oscillator with roots λ₁, λ₂ are divided differences φ_k[λ₁t, λ₂t]: one expression for all
//! values of the damping. The three expressions of textbooks (underdamped, critical, overdamped)
//! lose digits near critical damping.
//!
//! # Source
//! Higham (2008), Functions of Matrices, chapter 10 (the φ functions) and appendix B.16 (divided
//! differences).

use nalgebra::Complex;

type C = Complex<f64>;

/// Number of terms of a power series for |z| < 1; the next term is below 1/20! < ε/2.
const TERMS: usize = 20;

/// Returns φ_k(z) = (φ_{k−1}(z) − 1/(k−1)!) / z, with φ₀(z) = exp z.
pub(crate) fn phi(k: usize, z: C) -> C {
    if k > 0 && z.norm() < 1.0 {
        // The series Σ z^j / (j + k)! is summed from the small terms up.
        return (0..TERMS).rev().fold(C::from(0.0), |sum, j| (sum * z + 1.0) / (j + k) as f64)
            / factorial(k - 1);
    }
    (0..k).fold(z.exp(), |lower, j| (lower - 1.0 / factorial(j)) / z)
}

/// Returns the divided difference φ_k[a, b] = (φ_k(a) − φ_k(b)) / (a − b), and its limit φ_k′(a)
/// for a = b.
pub(crate) fn phi_divided(k: usize, a: C, b: C) -> C {
    let (large, small) = if a.norm() < b.norm() { (b, a) } else { (a, b) };
    if k == 0 {
        let half_gap = 0.5 * (large - small);
        return if half_gap.norm() < 1.0 {
            (0.5 * (large + small)).exp() * sinhc(half_gap)
        } else {
            (large.exp() - small.exp()) / (large - small)
        };
    }
    if large.norm() < 1.0 {
        return series(k, large, small);
    }
    // The Leibniz rule gives (z φ_k)[a, b] = a φ_k[a, b] + φ_k(b) = φ_{k−1}[a, b].
    (phi_divided(k - 1, large, small) - phi(k, small)) / large
}

/// Returns Σ_j h_j(a, b) / (j + k + 1)! where h_j is the sum of all products of j factors, each of
/// them a or b.
fn series(k: usize, a: C, b: C) -> C {
    let mut sum = C::from(0.0);
    let (mut products, mut power) = (C::from(1.0), C::from(1.0));
    let mut weight = 1.0 / factorial(k + 1);
    for j in 0..TERMS {
        sum += products * weight;
        power *= b;
        products = a * products + power;
        weight /= (j + k + 2) as f64;
    }
    sum
}

/// Returns sinh(z) / z.
fn sinhc(z: C) -> C {
    // For |z| < 1e-8 the term z²/6 of the series 1 + z²/6 + … is below the rounding ε.
    if z.norm() < 1e-8 { C::from(1.0) } else { z.sinh() / z }
}

fn factorial(k: usize) -> f64 {
    (1..=k).map(|j| j as f64).product()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PANELS: usize = 400;

    /// Returns φ_k[a, b] = ∫₀¹ φ_k′(b + s (a − b)) ds by Simpson's rule; φ_k′(z) is the sum of 120
    /// terms of its series Σ (j + 1) z^j / (j + k + 1)!.
    fn by_quadrature(k: usize, a: C, b: C) -> C {
        let derivative = |z: C| {
            let (mut sum, mut power, mut weight) =
                (C::from(0.0), C::from(1.0), 1.0 / factorial(k + 1));
            for j in 0..120 {
                sum += power * weight * (j as f64 + 1.0);
                power *= z;
                weight /= (j + k + 2) as f64;
            }
            sum
        };
        let at = |i: usize| derivative(b + (a - b) * (i as f64 / PANELS as f64));
        let inner: C = (1..PANELS).map(|i| at(i) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
        (at(0) + at(PANELS) + inner) / (3.0 * PANELS as f64)
    }

    #[test]
    fn known_values() {
        let z = C::from;
        let e = std::f64::consts::E;
        for (found, expected) in [
            (phi(0, z(1.0)), e),
            (phi(1, z(1.0)), e - 1.0),
            (phi(2, z(1.0)), e - 2.0),
            (phi(1, z(0.0)), 1.0),
            (phi(2, z(0.0)), 0.5),
            (phi(3, z(0.0)), 1.0 / 6.0),
            (phi_divided(0, z(1.0), z(1.0)), e),
            (phi_divided(1, z(0.0), z(0.0)), 0.5),
            (phi_divided(2, z(0.0), z(0.0)), 1.0 / 6.0),
            // φ₁′(z) = ((z − 1) eᶻ + 1) / z².
            (phi_divided(1, z(2.0), z(2.0)), (e * e + 1.0) / 4.0),
        ] {
            assert!((found - expected).norm() < 4e-16 * expected, "{found} {expected}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(128))]
        #[test]
        fn agrees_with_the_integral(
            k in 0usize..3, re in -4.0..1.0f64, im in -4.0..4.0f64,
            log_gap in -12.0..0.7f64, angle in 0.0..6.3f64,
        ) {
            let a = C::new(re, im);
            let b = a + C::from_polar(10f64.powf(log_gap), angle);
            let (found, expected) = (phi_divided(k, a, b), by_quadrature(k, a, b));
            // The tolerance is the sum of two errors: the remainder of Simpson's rule (no
            // derivative of φ_k exceeds exp of the largest real part) and the rounding of a series
            // with terms up to e⁹.
            let size = a.re.max(b.re).max(0.0).exp();
            let simpson = ((a - b).norm() / PANELS as f64).powi(4) / 180.0 * size;
            let tolerance = simpson + 1e-11 * size;
            prop_assert!((found - expected).norm() < tolerance, "{} {}", found, expected);
            // The values for two neighbouring b must agree to rounding.
            let step = phi_divided(k, a, b) - phi_divided(k, a, b * (1.0 + 1e-15));
            prop_assert!(step.norm() < 1e-13 * size);
        }
    }
}
