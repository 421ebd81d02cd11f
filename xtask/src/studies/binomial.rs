//! Limits of the number of intervals that hold, and their power.

use statrs::distribution::{Binomial, DiscreteCDF};

/// Probability that the intervals hold, as they state.
pub const STATED: f64 = 0.95;
/// Loss of coverage that the short form is made to notice.
pub const LOSS: f64 = 0.02;
/// Probability of an alarm, and of calling intervals wide, where they hold as they state; for each
/// parameter.
pub const FALSE_ALARM: f64 = 0.001;

/// Limits of the number of independent intervals that hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Fewer that hold raise an alarm.
    pub fewest: u64,
    /// More that hold are intervals wider than they need be.
    pub most: u64,
}

fn binomial(probability: f64, experiments: u64) -> Result<Binomial, String> {
    Binomial::new(probability, experiments).map_err(|e| e.to_string())
}

impl Limits {
    /// Computes the limits. Right intervals exceed each with a probability of at most
    /// [`FALSE_ALARM`].
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
        // The smallest counts whose cumulative probabilities reach these.
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

    /// Twenty throws, by hand: P(X ≤ 14) = 0.00033 and P(X ≤ 15) = 0.0026 at 95 %.
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
