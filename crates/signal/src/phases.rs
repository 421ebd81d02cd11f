//! Phase laws of a multisine.

use std::f64::consts::{PI, TAU};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::{SignalError, finite};

/// Choice of the phases φ_n of a multisine Σ A_n cos(n ω0 t + φ_n).
#[derive(Debug, Clone, PartialEq)]
pub enum Phases {
    /// Schroeder's law for the power spectrum of the multisine, see [`schroeder`].
    Schroeder,
    /// Schroeder's law with phases 0 or π only, see [`schroeder_binary`]; N is one more than
    /// the number of the last line, so lines 1 … Nt/2 − 1 have the dissertation's N = Nt/2.
    SchroederBinary,
    /// Independent, uniform over the circle, drawn from a seeded generator.
    Random {
        /// Seed of the generator.
        seed: u64,
    },
    /// All zero: the largest possible crest factor, an impulse train.
    Zero,
    /// Given by the caller in rad, one per line.
    Given(Vec<f64>),
}

impl Phases {
    /// Returns one phase per line, in rad.
    pub(crate) fn values(
        &self,
        lines: &[usize],
        amplitudes: &[f64],
    ) -> Result<Vec<f64>, SignalError> {
        match self {
            Self::Schroeder => Ok(schroeder(lines, amplitudes)),
            Self::SchroederBinary => {
                let last = lines.last().copied().unwrap_or(0);
                let (first, step) = first_and_step(lines);
                Ok(schroeder_binary(lines, (last - first) / step + 2))
            }
            Self::Random { seed } => {
                let mut rng = ChaCha8Rng::seed_from_u64(*seed);
                Ok(lines.iter().map(|_| TAU * rng.random::<f64>()).collect())
            }
            Self::Zero => Ok(vec![0.0; lines.len()]),
            Self::Given(phases) if phases.len() != lines.len() => {
                Err(SignalError::PerLine { what: "phases", lines: lines.len(), got: phases.len() })
            }
            Self::Given(phases) => phases.iter().map(|p| finite("phase", *p)).collect(),
        }
    }
}

/// Schroeder's phases for an arbitrary power spectrum, in rad.
///
/// ```text
/// φ_n = φ_1 − 2π Σ_{l<n} (n − l) p_l ,   p_l = A_l² / Σ A²
/// ```
///
/// with φ_1 = 0 at the first line: the signal spends a time in proportion to its power on each
/// line, like a swept sine. Line numbers are counted from the first line in steps of the common
/// spacing d (2 for odd lines): such a signal repeats, up to sign, after 1/d of the period, and the
/// sweep fills this part once. For N flat lines φ_n = −π n (n − 1) / N.
///
/// # Source
/// Schroeder (1970), *Synthesis of low-peak-factor signals and binary sequences with low
/// autocorrelation*, IEEE Trans. Inf. Theory 16, 85–89. Dissertation section 4.3.
pub fn schroeder(lines: &[usize], amplitudes: &[f64]) -> Vec<f64> {
    let largest = amplitudes.iter().fold(0.0_f64, |m, a| m.max(*a));
    let power = |a: &f64| if largest > 0.0 { (a / largest).powi(2) } else { 0.0 };
    let total: f64 = amplitudes.iter().map(power).sum();
    let (_, step) = first_and_step(lines);
    let (mut phase, mut share) = (0.0_f64, 0.0_f64);
    let mut previous = None;
    let mut phases = Vec::with_capacity(lines.len());
    for (&line, a) in lines.iter().zip(amplitudes) {
        if let Some(previous) = previous {
            // Each step to the next line adds the sum of the powers of all earlier lines to Σ (n −
            // l) p_l.
            phase += (line.abs_diff(previous) / step) as f64 * share;
        }
        phases.push(0.0 - TAU * phase.fract());
        share += if total > 0.0 { power(a) / total } else { 0.0 };
        previous = Some(line);
    }
    phases
}

/// Schroeder's two-valued phases, 0 or π, for a flat spectrum of `harmonics` = N lines.
///
/// ```text
/// φ_n = π (⌊n² / 2N⌋ mod 2) ,   β_n = cos φ_n = 1 − 2 (⌊n² / 2N⌋ mod 2)
/// ```
///
/// Here n counts from 1 at the first line, in steps of the common spacing of the lines; for
/// lines 1, 2, 3 … it is the line number itself.
///
/// # Source
/// Dissertation eqs. (4.3.3)–(4.3.4) with their misprints corrected, after Schroeder (1970).
pub fn schroeder_binary(lines: &[usize], harmonics: usize) -> Vec<f64> {
    let (first, step) = first_and_step(lines);
    let n2 = 2 * harmonics.max(1) as u128;
    let sign_changes = |line: &usize| {
        let n = (line.abs_diff(first) / step) as u128 + 1;
        n.saturating_mul(n) / n2
    };
    lines.iter().map(|line| if sign_changes(line) % 2 == 0 { 0.0 } else { PI }).collect()
}

/// The first line and the greatest common divisor of the spacings (1 for a single line).
fn first_and_step(lines: &[usize]) -> (usize, usize) {
    let first = lines.first().copied().unwrap_or(1);
    let step = lines.windows(2).fold(0, |d, w| gcd(d, w[1].abs_diff(w[0])));
    (first, step.max(1))
}

/// Greatest common divisor, with gcd(0, b) = b.
pub(crate) fn gcd(a: usize, b: usize) -> usize {
    if a == 0 { b } else { gcd(b % a, a) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns Schroeder's phases, in rad, from the formula as printed in the source, a double sum.
    fn direct_schroeder(power: &[f64]) -> Vec<f64> {
        let total: f64 = power.iter().sum();
        (0..power.len())
            .map(|n| -TAU * (0..n).map(|l| (n - l) as f64 * power[l] / total).sum::<f64>())
            .collect()
    }

    fn same_angle(a: f64, b: f64) -> bool {
        ((a - b) / TAU - ((a - b) / TAU).round()).abs() < 1e-12
    }

    #[test]
    fn running_sum_is_schroeders_double_sum() {
        let amplitudes: [f64; 6] = [1.0, 0.5, 2.0, 0.0, 3.0, 1.5];
        let power: Vec<f64> = amplitudes.iter().map(|a| a * a).collect();
        let expected = direct_schroeder(&power);
        // A line of zero power inside the band is equivalent to a missing line.
        let with_gap = schroeder(&[1, 2, 3, 5, 6], &[1.0, 0.5, 2.0, 3.0, 1.5]);
        let all = schroeder(&[1, 2, 3, 4, 5, 6], &amplitudes);
        assert!(all.iter().zip(&expected).all(|(a, b)| same_angle(*a, *b)));
        assert!(same_angle(with_gap[3], expected[4]) && same_angle(with_gap[4], expected[5]));
    }

    #[test]
    fn flat_schroeder_phases_are_quadratic() {
        let n: Vec<usize> = (1..=31).collect();
        for (k, phase) in (1..).zip(schroeder(&n, &[2.0; 31])) {
            assert!(same_angle(phase, -PI * (k * (k - 1)) as f64 / 31.0), "line {k}");
        }
        // If only odd lines are excited, the k-th odd line must have the same phase as line k of a
        // multisine of consecutive lines.
        let odd: Vec<usize> = (0..31).map(|k| 2 * k + 1).collect();
        assert_eq!(schroeder(&odd, &[2.0; 31]), schroeder(&n, &[2.0; 31]));
    }

    #[test]
    fn two_valued_phases_by_hand() {
        // N = 8: n²/16 = 0.06 .25 .56 1 1.56 2.25 3.06, whole parts 0 0 0 1 1 2 3.
        let lines: Vec<usize> = (1..=7).collect();
        let expected = [0.0, 0.0, 0.0, PI, PI, 0.0, PI];
        assert_eq!(schroeder_binary(&lines, 8), expected);
        assert_eq!(Phases::SchroederBinary.values(&lines, &[1.0; 7]).unwrap(), expected);
    }

    #[test]
    fn random_phases_repeat_with_their_seed_and_bad_lists_are_refused() {
        let of = |p: Phases| p.values(&[1, 2, 5], &[1.0; 3]);
        assert_eq!(of(Phases::Random { seed: 7 }), of(Phases::Random { seed: 7 }));
        assert_ne!(of(Phases::Random { seed: 7 }), of(Phases::Random { seed: 8 }));
        let short = of(Phases::Given(vec![0.0; 2]));
        assert_eq!(short, Err(SignalError::PerLine { what: "phases", lines: 3, got: 2 }));
        assert!(of(Phases::Given(vec![0.0, f64::NAN, 0.0])).is_err());
    }
}
