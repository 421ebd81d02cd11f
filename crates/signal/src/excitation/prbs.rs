//! Maximum-length pseudo-random binary sequences.

use crate::error::{SignalError, fits_in_memory, not_negative};
use crate::record::Record;
use crate::sampling::Sampling;

/// Feedback taps of a shift register of maximum period, for orders 2 to 24; bit k − 1 is stage k.
///
/// A test runs the register through its whole period for every entry.
const TAPS: [u32; 23] = [
    stages(&[2, 1]),
    stages(&[3, 2]),
    stages(&[4, 3]),
    stages(&[5, 3]),
    stages(&[6, 5]),
    stages(&[7, 6]),
    stages(&[8, 6, 5, 4]),
    stages(&[9, 5]),
    stages(&[10, 7]),
    stages(&[11, 9]),
    stages(&[12, 6, 4, 1]),
    stages(&[13, 4, 3, 1]),
    stages(&[14, 5, 3, 1]),
    stages(&[15, 14]),
    stages(&[16, 15, 13, 4]),
    stages(&[17, 14]),
    stages(&[18, 11]),
    stages(&[19, 6, 2, 1]),
    stages(&[20, 17]),
    stages(&[21, 19]),
    stages(&[22, 21]),
    stages(&[23, 18]),
    stages(&[24, 23, 22, 17]),
];

const fn stages(stages: &[u32]) -> u32 {
    let (mut bits, mut k) = (0, 0);
    while k < stages.len() {
        bits |= 1 << (stages[k] - 1);
        k += 1;
    }
    bits
}

/// A two-level signal of period 2ⁿ − 1 chips, each held for some samples, with a circular
/// autocorrelation of A² at lag zero and −A²/(2ⁿ − 1) at all other lags of whole chips.
///
/// ```
/// use mechid_signal::excitation::Prbs;
///
/// let prbs = Prbs::new(3, 1.0, 1)?;
/// assert_eq!(prbs.chips(), [1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0]);
/// # Ok::<(), mechid_signal::SignalError>(())
/// ```
///
/// # Source
/// Golomb, *Shift Register Sequences*.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prbs {
    order: u32,
    amplitude: f64,
    hold: usize,
}

impl Prbs {
    /// A sequence of `order` stages (2 to 24) with levels ±`amplitude` (N); each chip lasts `hold`
    /// samples.
    ///
    /// # Errors
    /// [`SignalError::Range`] for the order, [`SignalError::Negative`] for the amplitude,
    /// [`SignalError::TooFew`] if `hold` is 0.
    pub fn new(order: u32, amplitude: f64, hold: usize) -> Result<Self, SignalError> {
        crate::error::within("order of the sequence", f64::from(order), 2.0, 24.0)?;
        not_negative("amplitude", amplitude)?;
        if hold == 0 {
            let what = "samples of a chip";
            return Err(SignalError::TooFew { what, least: 1, got: 0 });
        }
        Ok(Self { order, amplitude, hold })
    }

    /// Number of samples of one period, (2ⁿ − 1) · hold.
    pub fn period(&self) -> usize {
        ((1usize << self.order) - 1).saturating_mul(self.hold)
    }

    /// The levels of one period, in N, one per chip.
    pub fn chips(&self) -> Vec<f64> {
        self.first_chips(usize::MAX)
    }

    /// Returns the levels of one period, or of its first `most` chips.
    fn first_chips(&self, most: usize) -> Vec<f64> {
        let taps = TAPS[self.order as usize - 2];
        let mut register = (1u32 << self.order) - 1;
        (0..most.min((1usize << self.order) - 1))
            .map(|_| {
                let out = register >> (self.order - 1) & 1;
                let feedback = (register & taps).count_ones() & 1;
                register = (register << 1 | feedback) & ((1 << self.order) - 1);
                if out == 1 { self.amplitude } else { -self.amplitude }
            })
            .collect()
    }

    /// Samples the sequence from its beginning, repeated or cut to the length of the record.
    ///
    /// Only a record of [`period`](Self::period) samples, or a multiple, has the autocorrelation of
    /// the sequence.
    ///
    /// # Errors
    /// None for a valid sequence; the signature is the same for all excitations.
    pub fn sample(&self, sampling: Sampling) -> Result<Record, SignalError> {
        fits_in_memory(sampling.len(), 1)?;
        let chips = self.first_chips(sampling.len().div_ceil(self.hold));
        let level = |k: usize| chips[k / self.hold % chips.len()];
        Record::from_channel(sampling, (0..sampling.len()).map(level).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_runs_through_all_its_states() {
        for order in 2..=24 {
            let taps = TAPS[order as usize - 2];
            let mask = (1u32 << order) - 1;
            let (mut register, mut steps) = (mask, 0u32);
            loop {
                register = (register << 1 | (register & taps).count_ones() & 1) & mask;
                steps += 1;
                if register == mask || steps > mask {
                    break;
                }
            }
            assert_eq!(steps, mask, "order {order}");
        }
    }

    #[test]
    fn chips_are_held_and_repeated() {
        let prbs = Prbs::new(2, 5.0, 2).unwrap();
        assert_eq!(prbs.period(), 6);
        let r = prbs.sample(Sampling::new(0.1, 8).unwrap()).unwrap();
        assert_eq!(r.channel(0), [5.0, 5.0, 5.0, 5.0, -5.0, -5.0, 5.0, 5.0]);
    }

    #[test]
    fn impossible_sequences_are_refused() {
        assert!(matches!(Prbs::new(1, 1.0, 1), Err(SignalError::Range { value: 1.0, .. })));
        assert!(matches!(Prbs::new(25, 1.0, 1), Err(SignalError::Range { .. })));
        assert!(Prbs::new(5, -1.0, 1).is_err());
        assert!(Prbs::new(5, 1.0, 0).is_err());
    }
}
