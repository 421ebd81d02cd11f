//! Sets of lines a multisine may excite.
//!
//! Each function returns ascending line numbers up to and including `last`; none of them contains
//! DC. [`Multisine::new`](crate::Multisine::new) refuses an empty set.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::error::SignalError;
use crate::sampling::Sampling;

/// Every line 1, 2, 3, … `last`.
pub fn all(last: usize) -> Vec<usize> {
    (1..=last).collect()
}

/// Every line strictly between DC and Nyquist of a period, the set of the dissertation's tables.
pub fn full(sampling: Sampling) -> Vec<usize> {
    all((sampling.len() - 1) / 2)
}

/// Odd lines 1, 3, 5, …: the even lines detect even nonlinearities, and the signal is half-wave
/// antisymmetric.
pub fn odd(last: usize) -> Vec<usize> {
    (1..=last).step_by(2).collect()
}

/// Odd-odd lines 1, 5, 9, …: the odd lines between them detect odd nonlinearities.
pub fn odd_odd(last: usize) -> Vec<usize> {
    (1..=last).step_by(4).collect()
}

/// Special odd lines 1, 3, 9, 11, 17, 19, …: two of every four odd lines.
///
/// # Source
/// Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, on detection lines
/// for nonlinear distortions.
pub fn special_odd(last: usize) -> Vec<usize> {
    odd(last).into_iter().filter(|n| matches!(n % 8, 1 | 3)).collect()
}

/// Odd lines, without one random line of every `group` consecutive odd lines. The omitted lines
/// detect odd nonlinearities; `group` below 2 omits none.
///
/// # Source
/// Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, on random
/// harmonic grids.
pub fn random_odd(last: usize, group: usize, seed: u64) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let lines = odd(last);
    if group < 2 {
        return lines;
    }
    let mut remaining = Vec::with_capacity(lines.len());
    for chunk in lines.chunks(group) {
        let out = rng.random_range(0..group);
        remaining.extend(chunk.iter().enumerate().filter(|(k, _)| *k != out).map(|(_, n)| *n));
    }
    remaining
}

/// Lines of a period between two frequencies in Hz, including the ends, without DC.
pub fn band(sampling: Sampling, low_hz: f64, high_hz: f64) -> Vec<usize> {
    let spacing = sampling.line_spacing_hz();
    // Rounding must not exclude a line at an end.
    let slack = 1e-9 * spacing;
    (1..(sampling.len() - 1) / 2 + 1)
        .filter(|n| {
            let f = *n as f64 * spacing;
            f >= low_hz - slack && f <= high_hz + slack
        })
        .collect()
}

/// Lines distributed in turn to several inputs, so that one experiment separates the inputs.
///
/// # Errors
/// [`SignalError::TooFew`] if there are no inputs, or fewer lines than inputs.
pub fn interleaved(lines: &[usize], inputs: usize) -> Result<Vec<Vec<usize>>, SignalError> {
    if inputs == 0 {
        return Err(SignalError::TooFew { what: "inputs of interleaved lines", least: 1, got: 0 });
    }
    if lines.len() < inputs {
        let got = lines.len();
        return Err(SignalError::TooFew { what: "lines, one per input", least: inputs, got });
    }
    let of = |k: usize| lines.iter().skip(k).step_by(inputs).copied().collect();
    Ok((0..inputs).map(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_by_hand() {
        assert_eq!(all(3), [1, 2, 3]);
        assert_eq!(odd(8), [1, 3, 5, 7]);
        assert_eq!(odd_odd(13), [1, 5, 9, 13]);
        assert_eq!(special_odd(20), [1, 3, 9, 11, 17, 19]);
        let s = Sampling::new(0.1, 20).unwrap(); // lines every 0.5 Hz
        assert_eq!(full(s), all(9));
        assert_eq!(full(Sampling::new(0.1, 21).unwrap()), all(10));
        assert_eq!(band(s, 1.0, 2.5), [2, 3, 4, 5]);
        assert_eq!(band(s, 0.0, f64::INFINITY), all(9));
        assert!(band(s, 1.1, 1.2).is_empty());
    }

    #[test]
    fn interleaved_lines_are_dealt_out_once() {
        let dealt = interleaved(&odd(13), 3).unwrap();
        assert_eq!(dealt, [vec![1, 7, 13], vec![3, 9], vec![5, 11]]);
        assert!(matches!(interleaved(&[1], 2), Err(SignalError::TooFew { least: 2, got: 1, .. })));
        assert!(interleaved(&[1], 0).is_err());
    }

    #[test]
    fn random_odd_leaves_one_of_each_group_out() {
        let kept = random_odd(79, 4, 3);
        assert_eq!(kept.len(), 30);
        for group in odd(79).chunks(4) {
            assert_eq!(group.iter().filter(|n| kept.contains(n)).count(), 3);
        }
        assert_ne!(kept, random_odd(79, 4, 4));
        assert_eq!(random_odd(9, 1, 3), odd(9));
    }
}
