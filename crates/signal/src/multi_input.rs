//! Uncorrelated multisines for tests with several inputs.
//!
//! There are two ways to separate the inputs:
//!
//! - [`orthogonal`]: all inputs excite the same lines in as many experiments as inputs, with phases
//!   that make the inputs orthogonal across the experiments, line by line. Every line has full
//!   power.
//! - [`lines::interleaved`](crate::lines::interleaved): each input has its own lines, and one
//!   experiment is enough. Each line is then excited by only one input.

use std::f64::consts::{PI, TAU};

use crate::error::SignalError;
use crate::multisine::Multisine;
use crate::phases::Phases;

/// The matrix that makes inputs orthogonal across experiments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mixing {
    /// exp(i 2π e k / n) for experiment e and input k: any number of inputs.
    Dft,
    /// Sylvester's matrix with the entries ±1: the number of inputs must be a power of two. Only
    /// the sign of an input changes between experiments, so that every input keeps its crest
    /// factor.
    Hadamard,
}

impl Mixing {
    /// Phase added to input `k` of `n` in experiment `e`, in rad.
    fn phase(self, e: usize, k: usize, n: usize) -> f64 {
        match self {
            Self::Dft => TAU * ((e * k) % n) as f64 / n as f64,
            Self::Hadamard => PI * f64::from((e & k).count_ones() % 2),
        }
    }
}

/// Returns as many experiments as inputs: element `[e][k]` is the signal of input `k` in experiment
/// `e`.
///
/// With U_ek the complex amplitude of a line, the inputs are orthogonal:
///
/// ```text
/// Σ_e U_ej conj(U_ek) = n A_k² δ_jk
/// ```
///
/// The amplitudes are unchanged. Give each input its own phases (random, or of low crest factor
/// from different seeds), so that the inputs do not peak together in the first experiment.
///
/// # Errors
/// [`SignalError::TooFew`] for no inputs, [`SignalError::DifferentLines`] if the inputs do not
/// excite the same lines, [`SignalError::HadamardOrder`] if their number is not a power of two.
///
/// # Source
/// Guillaume, Pintelon and Schoukens on orthogonal multisines for multivariable frequency
/// response measurements; Pintelon and Schoukens, *System Identification: A Frequency Domain
/// Approach*.
pub fn orthogonal(
    inputs: &[Multisine],
    mixing: Mixing,
) -> Result<Vec<Vec<Multisine>>, SignalError> {
    let n = inputs.len();
    let Some(first) = inputs.first() else {
        return Err(SignalError::TooFew { what: "inputs of an orthogonal set", least: 1, got: 0 });
    };
    if let Some(input) = inputs.iter().position(|m| m.lines() != first.lines()) {
        return Err(SignalError::DifferentLines { input });
    }
    if mixing == Mixing::Hadamard && !n.is_power_of_two() {
        return Err(SignalError::HadamardOrder { order: n });
    }
    let turned = |m: &Multisine, by: f64| {
        let phases = m.phases().iter().map(|p| p + by).collect();
        m.clone().with_phases(Phases::Given(phases))
    };
    (0..n)
        .map(|e| {
            let inputs = inputs.iter().enumerate();
            inputs.map(|(k, m)| turned(m, mixing.phase(e, k, n))).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;
    use crate::sampling::Sampling;
    use crate::spectrum::Spectrum;

    fn inputs(n: u64) -> Vec<Multisine> {
        let input = |k| Multisine::flat(1..=9, 1.0 + k as f64, Phases::Random { seed: k }).unwrap();
        (0..n).map(input).collect()
    }

    #[test]
    fn every_line_is_orthogonal_across_experiments() {
        let s = Sampling::new(0.1, 20).unwrap();
        for (n, mixing) in [(3, Mixing::Dft), (4, Mixing::Dft), (4, Mixing::Hadamard)] {
            let experiments = orthogonal(&inputs(n), mixing).unwrap();
            assert_eq!(experiments.len(), n as usize);
            let amplitude = |e: usize, k: usize, line: usize| {
                Spectrum::from_record(&experiments[e][k].sample(s).unwrap()).line(line, 0)
            };
            for line in 1..=9 {
                for (j, k) in (0..n as usize).flat_map(|j| (0..n as usize).map(move |k| (j, k))) {
                    let product: Complex<f64> = (0..n as usize)
                        .map(|e| amplitude(e, j, line) * amplitude(e, k, line).conj())
                        .sum();
                    let expected = if j == k { n as f64 * (1.0 + k as f64).powi(2) } else { 0.0 };
                    assert!((product - expected).norm() < 1e-12, "{mixing:?} {line} {j} {k}");
                }
            }
        }
    }

    #[test]
    fn a_hadamard_matrix_keeps_crest_factors() {
        for experiment in orthogonal(&inputs(4), Mixing::Hadamard).unwrap() {
            for (mixed, own) in experiment.iter().zip(inputs(4)) {
                let change = mixed.crest_factor().unwrap() - own.crest_factor().unwrap();
                assert!(change.abs() < 1e-12);
            }
        }
    }

    #[test]
    fn impossible_sets_are_refused() {
        assert!(matches!(orthogonal(&[], Mixing::Dft), Err(SignalError::TooFew { .. })));
        let three = orthogonal(&inputs(3), Mixing::Hadamard);
        assert_eq!(three, Err(SignalError::HadamardOrder { order: 3 }));
        let mut mixed = inputs(2);
        mixed.push(Multisine::flat([1], 1.0, Phases::Zero).unwrap());
        assert_eq!(orthogonal(&mixed, Mixing::Dft), Err(SignalError::DifferentLines { input: 2 }));
    }
}
