//! Integrals over the pressurised half of a short bearing, in closed form.

use std::f64::consts::TAU;

/// Integrals ∫ cosᵇθ sinᵃθ / (1 − ε cos θ)ⁿ dθ from α − π to α, for a + b = 2 with n = 3 and for
/// a + b = 3 with n = 4.
///
/// # Source
/// Sommerfeld's substitution 1 − ε cos θ = (1 − ε²) / (1 + ε cos γ) makes them trigonometric
/// polynomials (Booker 1965).
#[derive(Debug, Clone, Copy)]
pub(super) struct Integrals {
    /// Integrals with n = 3 in the denominator, for the exponent a = 0, 1, 2 of the sine.
    pub(super) second: [f64; 3],
    /// Integrals with n = 4 in the denominator, for the exponent a = 0, 1, 2, 3 of the sine.
    pub(super) third: [f64; 4],
}

impl Integrals {
    /// Integrates up to the angle `end` in (−π, π], for an eccentricity below 1.
    pub(super) fn new(eccentricity: f64, end: f64) -> Self {
        let e = eccentricity;
        let q = (1.0 - e) * (1.0 + e);
        let root = q.sqrt();
        // `last` is the angle γ for θ = α, the end of the range; `first` is γ for θ = α − π, its
        // start. γ passes ±π where θ does.
        let (sin, cos) = end.sin_cos();
        let last = (root * sin).atan2(cos - e);
        let first = (-root * sin).atan2(-cos - e);
        let first = if first < last { first } else { first - TAU };
        // `mean` has the integrals ∫ cosᵏγ dγ, and `slope` returns the integrals ∫ cosᵏγ sinγ dγ.
        let ([s1, c1], [s0, c0]) = (<[f64; 2]>::from(last.sin_cos()), first.sin_cos().into());
        let span = last - first;
        let mean = [
            span,
            s1 - s0,
            0.5 * (span + s1 * c1 - s0 * c0),
            s1 - s0 - (s1.powi(3) - s0.powi(3)) / 3.0,
        ];
        let slope = |k: i32| -(c1.powi(k + 1) - c0.powi(k + 1)) / f64::from(k + 1);
        let (odd0, odd1, odd2) = (slope(0), slope(1), slope(2));
        Self {
            second: [
                (mean[2] + 2.0 * e * mean[1] + e * e * mean[0]) / (q * q * root),
                (odd1 + e * odd0) / (q * q),
                (mean[0] - mean[2]) / (q * root),
            ],
            third: [
                (mean[3] + 3.0 * e * mean[2] + 3.0 * e * e * mean[1] + e.powi(3) * mean[0])
                    / (q * q * q * root),
                (odd2 + 2.0 * e * odd1 + e * e * odd0) / (q * q * q),
                (mean[1] - mean[3] + e * (mean[0] - mean[2])) / (q * q * root),
                (odd0 - odd2) / (q * q),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Simpson's rule, as an independent reference for the closed form.
    fn by_quadrature(e: f64, end: f64, sines: i32, cosines: i32) -> f64 {
        let intervals = 20_000;
        let step = PI / f64::from(intervals);
        (0..=intervals)
            .map(|k| {
                let (sin, cos) = (end - PI + f64::from(k) * step).sin_cos();
                let weight = match k {
                    0 => 1.0,
                    _ if k == intervals => 1.0,
                    _ => f64::from(2 + 2 * (k % 2)),
                };
                let power = sines + cosines + 1;
                weight * sin.powi(sines) * cos.powi(cosines) / (1.0 - e * cos).powi(power)
            })
            .sum::<f64>()
            * step
            / 3.0
    }

    #[test]
    fn closed_forms_agree_with_quadrature() {
        for e in [0.0, 1e-9, 0.1, 0.5, 0.9] {
            for end in [-PI + 1e-9, -2.5, -1.0, -1e-12, 0.0, 1e-12, 0.3, 1.7, 3.0, PI] {
                let Integrals { second, third } = Integrals::new(e, end);
                // The tolerance is relative to the maximum of 1 / (1 − ε cos θ)ⁿ, which is 1 / (1 −
                // ε)ⁿ.
                let scale = |n: i32| 1e-10 / (1.0 - e).powi(n);
                for (sines, value) in (0..).zip(second) {
                    let expected = by_quadrature(e, end, sines, 2 - sines);
                    assert!((value - expected).abs() < scale(3), "{e} {end} {value} {expected}");
                }
                for (sines, value) in (0..).zip(third) {
                    let expected = by_quadrature(e, end, sines, 3 - sines);
                    assert!((value - expected).abs() < scale(4), "{e} {end} {value} {expected}");
                }
            }
        }
    }
}
