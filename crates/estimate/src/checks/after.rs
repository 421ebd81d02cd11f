//! Whether residuals are noise: white, and unrelated to the input.

use mechid_signal::Record;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Check, Subject, Verdict};
use crate::EstimateError;

/// A residual smaller than this share of what was fitted is rounding.
const ROUNDING: f64 = 1e-9;

/// Noise has a larger statistic in one record of a hundred.
const SIGNIFICANT: f64 = 0.01;

/// Correlations at a number of lags, and how likely pure noise has as much of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlation {
    /// Coefficient at each lag, a pure number; see the function that made it for which lags.
    pub coefficients: Vec<f64>,
    /// 95 % of the coefficients of white noise are smaller than this: 1.96/√N.
    pub bound: f64,
    /// Sum of squared coefficients, dimensionless, scaled to follow a χ² distribution for white
    /// noise.
    pub statistic: f64,
    /// The share of white-noise records with a larger statistic. Below 0.01 or so the residual is
    /// hardly noise: the model misses something.
    pub p_value: f64,
}

impl Correlation {
    /// How many coefficients exceed the 95 % bound.
    pub fn outside(&self) -> usize {
        self.coefficients.iter().filter(|c| c.abs() > self.bound).count()
    }
}

/// Autocorrelation of a residual (one value per sample, any unit) at the lags 1 … `lags`, judged by
/// the statistic of Ljung and Box.
///
/// # Errors
/// [`EstimateError::TooShort`] unless there are more than `lags + 1` samples and lags.
///
/// # Source
/// Ljung & Box (1978), Biometrika 65, 297–303.
pub fn whiteness(residual: &[f64], lags: usize) -> Result<Correlation, EstimateError> {
    let e = centred(residual, lags)?;
    let power: f64 = e.iter().map(|v| v * v).sum();
    let count = e.len() as f64;
    let coefficient = |lag: usize| ratio(products(&e[lag..], &e), power);
    let coefficients: Vec<f64> = (1..=lags).map(coefficient).collect();
    let weighted = coefficients.iter().enumerate().map(|(at, c)| c * c / (count - (at + 1) as f64));
    let statistic = count * (count + 2.0) * weighted.sum::<f64>();
    Ok(judged(coefficients, statistic, count))
}

/// Correlation of a residual with an input (one value per sample, any units) at the lags −`lags` …
/// `lags`, in that order; at a positive lag the input comes first. With negative lags it shows
/// feedback from output to input.
///
/// The statistic takes the residual as white.
///
/// # Errors
/// As [`whiteness`], and [`EstimateError::Size`] if the two differ in length.
///
/// # Source
/// Ljung, *System Identification: Theory for the User*, 2nd ed. (1999), section 16.6.
pub fn cross_correlation(
    residual: &[f64],
    input: &[f64],
    lags: usize,
) -> Result<Correlation, EstimateError> {
    crate::least_squares::size("samples of the input", residual.len(), input.len())?;
    let (e, u) = (centred(residual, lags)?, centred(input, lags)?);
    let power = (products(&e, &e) * products(&u, &u)).sqrt();
    let before = (1..=lags).rev().map(|lag| products(&u[lag..], &e));
    let after = (0..=lags).map(|lag| products(&e[lag..], &u));
    let coefficients: Vec<f64> = before.chain(after).map(|c| ratio(c, power)).collect();
    let count = e.len() as f64;
    let statistic = count * coefficients.iter().map(|c| c * c).sum::<f64>();
    Ok(judged(coefficients, statistic, count))
}

/// Whether every channel of a residual is white and has nothing in common with the forces that act,
/// in words; `fitted` is what the residual is left over from, on the same time axis.
///
/// A residual of rounding is good whatever its colour.
///
/// # Errors
/// As [`whiteness`], and [`EstimateError::Signal`] or [`EstimateError::Size`] if the records do not
/// belong together.
///
/// # Source
/// Those of [`whiteness`] and [`cross_correlation`].
pub fn after_fit(
    residual: &Record,
    fitted: &Record,
    force: &Record,
    lags: usize,
) -> Result<Vec<Check>, EstimateError> {
    residual.check_same_sampling(fitted)?;
    residual.check_same_sampling(force)?;
    crate::least_squares::size("channels of the residual", fitted.channels(), residual.channels())?;
    let mut checks = Vec::new();
    for channel in 0..residual.channels() {
        let (e, number) = (residual.channel(channel), channel + 1);
        let size = fitted.column(channel).norm();
        let rounding = residual.column(channel).norm() <= ROUNDING * size;
        let white = whiteness(e, lags)?;
        checks.push(white.check(Subject::Whiteness, rounding, &format!("residual {number}")));
        let acts =
            |input: &usize| force.channel(*input).iter().any(|f| *f != force.data()[(0, *input)]);
        for input in (0..force.channels()).filter(acts) {
            let cross = cross_correlation(e, force.channel(input), lags)?;
            let name = format!("residual {number} with force {}", input + 1);
            checks.push(cross.check(Subject::CrossCorrelation, rounding, &name));
        }
    }
    Ok(checks)
}

impl Correlation {
    fn check(&self, subject: Subject, rounding: bool, name: &str) -> Check {
        if rounding {
            let text = format!("{name}: rounding, whatever its correlations");
            return Check { subject, verdict: Verdict::Good, value: self.p_value, text };
        }
        let (outside, count) = (self.outside(), self.coefficients.len());
        let (verdict, meaning) = match (subject, self.p_value < SIGNIFICANT) {
            (Subject::Whiteness, true) => (
                Verdict::Doubtful,
                "not white: the noise is coloured, or the model misses something",
            ),
            (_, true) => {
                (Verdict::Doubtful, "the model leaves some of the force's doing unexplained")
            }
            (Subject::Whiteness, false) => (Verdict::Good, "white, as noise is"),
            (_, false) => (Verdict::Good, "nothing in common"),
        };
        // A distribution function does not resolve the rest.
        let p = match self.p_value {
            p if p < 1e-15 => "p < 1e-15".to_owned(),
            p if p < 1e-3 => format!("p = {p:.1e}"),
            p => format!("p = {p:.3}"),
        };
        let text = format!(
            "{name}: {outside} of {count} correlations beyond the 95 % bound of {:.3}, {p}; {meaning}",
            self.bound
        );
        Check { subject, verdict, value: self.p_value, text }
    }
}

fn judged(coefficients: Vec<f64>, statistic: f64, count: f64) -> Correlation {
    let distribution = ChiSquared::new(coefficients.len() as f64).expect("at least one lag");
    let p_value = 1.0 - distribution.cdf(statistic);
    Correlation { coefficients, bound: 1.96 / count.sqrt(), statistic, p_value }
}

fn centred(values: &[f64], lags: usize) -> Result<Vec<f64>, EstimateError> {
    let needed = lags.max(1) + 2;
    if lags == 0 || values.len() < needed {
        return Err(EstimateError::TooShort { samples: values.len(), needed });
    }
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    Ok(values.iter().map(|v| v - mean).collect())
}

fn products(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn ratio(value: f64, power: f64) -> f64 {
    if power > 0.0 { value / power } else { 0.0 }
}
