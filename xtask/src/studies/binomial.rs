//! Limits of the number of intervals that contain the true value, and the power of these limits.

use statrs::distribution::{Binomial, DiscreteCDF};

/// Stated probability that an interval contains the true value.
pub const STATED: f64 = 0.95;
/// Loss of coverage that the short form can detect.
pub const LOSS: f64 = 0.02;
/// Probability, for each parameter, of a false alarm and of a false report of wide intervals, if
/// the coverage is the stated one.
pub const FALSE_ALARM: f64 = 0.001;

/// Limits of the number of independent intervals that contain the true value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Smallest number of intervals containing the true value that raises no alarm.
    pub fewest: u64,
    /// Largest number of intervals that may contain the true value; with more, the intervals are
    /// reported as too wide.
    pub most: u64,
}

fn binomial(probability: f64, experiments: u64) -> Result<Binomial, String> {
    Binomial::new(probability, experiments).map_err(|e| e.to_string())
}

impl Limits {
    /// Computes the limits. If the coverage is the stated one, the number of intervals that contain
    /// the true value is below `fewest` with a probability of at most [`FALSE_ALARM`], and above
    /// `most` with a probability of at most [`FALSE_ALARM`].
    ///
    /// # Errors
    /// A message if there are no experiments.
    ///
    /// # Source
    /// Clopper & Pearson, Biometrika 26 (1934), 404–413: tails of the binomial distribution.
    pub fn new(experiments: u64) -> Result<Self, String> {
        if experiments == 0 {
            return Err("no experiments".into());
        }
        let right = binomial(STATED, experiments)?;
        // The limits are the smallest counts whose cumulative probabilities reach these two values.
        let [fewest, most] = [FALSE_ALARM, 1.0 - FALSE_ALARM].map(|p| right.inverse_cdf(p));
        Ok(Self { fewest, most })
    }
}

/// Probability of an alarm from one parameter whose coverage has fallen by `loss`.
///
/// # Errors
/// A message if there are no experiments.
pub fn power(experiments: u64, loss: f64) -> Result<f64, String> {
    let Limits { fewest, .. } = Limits::new(experiments)?;
    let wrong = binomial(STATED - loss, experiments)?;
    Ok(if fewest == 0 { 0.0 } else { wrong.cdf(fewest - 1) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares the limits and the power for twenty experiments with probabilities that were
    /// calculated by hand. For a coverage of 95 %, P(X ≤ 14) = 0.00033 and P(X ≤ 15) = 0.0026, so
    /// 15 is the smallest number without an alarm.
    #[test]
    fn limits_and_power_of_twenty_experiments() {
        let limits = Limits::new(20).unwrap();
        assert_eq!(limits, Limits { fewest: 15, most: 20 });
        // P(X ≤ 14) for 20 throws at 93 %: Σ C(20, k) 0.93^k 0.07^(20−k).
        let mut probability = 0.0;
        for k in 0..=14i32 {
            let ways: f64 = (0..k).map(|i| f64::from(20 - i) / f64::from(i + 1)).product();
            probability += ways * 0.93f64.powi(k) * 0.07f64.powi(20 - k);
        }
        assert!((power(20, LOSS).unwrap() - probability).abs() < 1e-12);
        assert!(Limits::new(0).is_err());
    }
}
