//! Correlations over lags, and their p-values.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::SignalError;
use crate::measures::{peak, power_of_two};

/// Correlation coefficients at several lags, and the p-value of the hypothesis that they are noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlation {
    /// Coefficient at each lag, a pure number; the function that computes them states the lags.
    pub coefficients: Vec<f64>,
    /// Bound within which 95 % of the coefficients of noise lie; 1.96/√N for white noise.
    pub bound: f64,
    /// Sum of the squared coefficients, each divided by its variance for noise; dimensionless.
    pub statistic: f64,
    /// Probability that noise has a larger statistic. If it is below about 0.01, the residual is
    /// probably not noise, and the model is incomplete.
    pub p_value: f64,
}

impl Correlation {
    /// Number of coefficients beyond the 95 % bound.
    pub fn outside(&self) -> usize {
        self.coefficients.iter().filter(|c| c.abs() > self.bound).count()
    }
}

/// Autocorrelation of a residual (one value per sample, any unit) at the lags 1 … `lags`, tested
/// with the statistic of Ljung and Box.
///
/// # Errors
/// [`SignalError::TooShort`] unless `lags` is at least 1 and there are at least `lags + 2` samples.
///
/// # Source
/// Ljung & Box (1978), Biometrika 65, 297–303.
pub fn whiteness(residual: &[f64], lags: usize) -> Result<Correlation, SignalError> {
    whiteness_beyond(residual, 0, lags)
}

/// Autocorrelation of a residual (one value per sample, any unit) at the lags `span + 1` … `span +
/// lags`. At these lags, noise that is correlated over at most `span` lags has no correlation. For
/// example, the difference of two successive noisy samples has a span of 1.
///
/// The correlation within the span, estimated from the residual itself, increases the scatter of
/// the coefficients beyond it and correlates them; the statistic accounts for this.
///
/// # Errors
/// The errors of [`whiteness`]; the minimum number of samples is larger by `span`.
///
/// # Source
/// Bartlett (1946), Supplement to the JRSS 8, 27–41, for the scatter of the coefficients; Box
/// (1954), Annals of Mathematical Statistics 25, 290–302, for the distribution of their squares.
pub fn whiteness_beyond(
    residual: &[f64],
    span: usize,
    lags: usize,
) -> Result<Correlation, SignalError> {
    let e = centred(residual, lags, span)?;
    let correlation = autocorrelation(&e, span + lags);
    let count = e.len() as f64;
    let coefficients = correlation[span + 1..].to_vec();
    let covariance = correlated(&correlation[..=span], &correlation[..=span], lags);
    let weight = |lag: usize| count * (count + 2.0) / (count - lag as f64);
    let squares = (span + 1..).zip(&coefficients).map(|(lag, c)| c * c * weight(lag));
    // The squared coefficients at two lags are correlated, even for white noise, because they
    // contain the same samples.
    let shared = 2.0 * (lags * lags) as f64 / count * covariance[0] * covariance[0];
    Ok(Correlation::tested(squares.sum(), &covariance, shared, coefficients, count))
}

/// Correlation of a residual with an input (one value per sample, any units) at the lags −`lags` …
/// `lags`, in that order; at a positive lag the input comes first. At negative lags, the
/// correlation shows feedback from output to input.
///
/// The statistic assumes a white residual and allows for a coloured input, whose coefficients are
/// correlated.
///
/// # Errors
/// The errors of [`whiteness`], and [`SignalError::PairLength`] if the two differ in length.
///
/// # Source
/// Ljung, *System Identification: Theory for the User*, 2nd ed. (1999), section 16.6; Box (1954),
/// Annals of Mathematical Statistics 25, 290–302, for the distribution of the sum of squares.
pub fn cross_correlation(
    residual: &[f64],
    input: &[f64],
    lags: usize,
) -> Result<Correlation, SignalError> {
    cross_correlation_of_coloured(residual, input, lags, &[1.0])
}

/// Returns the correlation of an input with a residual that is itself autocorrelated: `colour` has
/// the autocorrelation coefficients of the residual at the lags 0, 1 …, up to the last significant
/// one. Residual and input have one value per sample, in any units; coefficients are pure numbers.
///
/// # Errors
/// The errors of [`cross_correlation`].
///
/// # Source
/// The source of [`cross_correlation`].
pub fn cross_correlation_of_coloured(
    residual: &[f64],
    input: &[f64],
    lags: usize,
    colour: &[f64],
) -> Result<Correlation, SignalError> {
    if residual.len() != input.len() {
        return Err(SignalError::PairLength { left: residual.len(), right: input.len() });
    }
    let (e, u) = (centred(residual, lags, 0)?, centred(input, lags, 0)?);
    let power = (products(&e, &e) * products(&u, &u)).sqrt();
    let before = (1..=lags).rev().map(|lag| products(&u[lag..], &e));
    let after = (0..=lags).map(|lag| products(&e[lag..], &u));
    let coefficients: Vec<f64> = before.chain(after).map(|c| ratio(c, power)).collect();
    let count = e.len() as f64;
    let input = autocorrelation(&u, (2 * lags + colour.len()).min(u.len() - 1));
    let covariance = correlated(colour, &input, coefficients.len());
    let weight = |at: usize| count * count / (count - at.abs_diff(lags) as f64);
    let squares = coefficients.iter().enumerate().map(|(at, c)| c * c * weight(at));
    // The input is fixed, not random, so the coefficients have a normal distribution.
    Ok(Correlation::tested(squares.sum(), &covariance, 0.0, coefficients, count))
}

impl Correlation {
    /// Tests a sum of squared coefficients. The covariance of two coefficients depends only on
    /// their distance in lags: `covariance` has its values at the distances 0, 1 …, multiplied by
    /// the number of samples. The variance of the sum exceeds the variance for normal variables by
    /// 2 · `shared`.
    fn tested(
        sum: f64,
        covariance: &[f64],
        shared: f64,
        coefficients: Vec<f64>,
        count: f64,
    ) -> Self {
        // The variance of the coefficients is almost zero if the spectra of input and residual do
        // not overlap; the limit avoids a division by zero.
        let variance = covariance[0].max(f64::EPSILON);
        let p_value = probability_above(sum, coefficients.len(), covariance, shared);
        let bound = 1.96 * (variance / count).sqrt();
        Self { coefficients, bound, statistic: sum / variance, p_value }
    }
}

/// Returns the probability that the sum of squares of `terms` normal variables of mean zero exceeds
/// `sum`. The covariance of two variables depends only on their distance: `covariance` has its
/// values at the distances 0, 1 …, and it is zero at larger distances. The variance of the sum
/// exceeds the variance for normal variables by 2 · `shared`.
///
/// The sum has approximately the distribution of g χ²(h) with the same mean and variance.
fn probability_above(sum: f64, terms: usize, covariance: &[f64], shared: f64) -> f64 {
    let squares = covariance.iter().enumerate().take(terms).map(|(distance, c)| {
        let pairs = if distance == 0 { terms } else { 2 * (terms - distance) };
        pairs as f64 * c * c
    });
    probability_above_of(sum, terms as f64 * covariance[0], squares.sum::<f64>() + shared)
}

/// Returns the probability that a sum of squares of normal variables of mean zero is above `sum`.
/// Their covariance matrix has the trace `mean`, and the square of this matrix has the trace
/// `square`.
///
/// # Source
/// Box (1954), Annals of Mathematical Statistics 25, 290–302.
pub fn probability_above_of(sum: f64, mean: f64, square: f64) -> f64 {
    let unit = square.sqrt();
    let ratio = mean / unit;
    match ChiSquared::new(ratio * ratio) {
        Ok(distribution) if sum.is_finite() => distribution.sf(sum / unit * ratio),
        // Without variance, the sum of squares is 0, which is never above a positive value.
        _ => f64::from(!(sum > 0.0 && mean <= 0.0)),
    }
}

/// Returns Σ_k a(k) b(k + j) over all k, positive and negative, at j = 0, 1 … `lags − 1`, for two
/// autocorrelations a and b. Each is a list of pure numbers at the lags 0, 1 …, and zero at later
/// lags.
///
/// # Source
/// Bartlett (1946), Supplement to the JRSS 8, 27–41.
pub fn correlated(a: &[f64], b: &[f64], lags: usize) -> Vec<f64> {
    let last = a.len() as isize - 1;
    let at = |of: &[f64], lag: isize| of.get(lag.unsigned_abs()).copied().unwrap_or(0.0);
    (0..lags as isize).map(|j| (-last..=last).map(|k| at(a, k) * at(b, k + j)).sum()).collect()
}

/// Returns the autocorrelation coefficients, pure numbers, at the lags 0 … `lags` of values with
/// mean zero. There is one value per sample.
pub fn autocorrelation(centred: &[f64], lags: usize) -> Vec<f64> {
    let power = products(centred, centred);
    let at =
        |lag: usize| if lag == 0 { 1.0 } else { ratio(products(&centred[lag..], centred), power) };
    (0..=lags).map(at).collect()
}

/// Returns values minus their mean, in units of a power of two near their peak. One value per
/// sample.
///
/// # Errors
/// [`SignalError::TooShort`] unless `lags` is at least 1 and there are at least `lags + span + 2`
/// values, [`SignalError::NotFinite`].
///
/// # Source
/// Ours.
pub fn centred(values: &[f64], lags: usize, span: usize) -> Result<Vec<f64>, SignalError> {
    let needed = lags.max(1).saturating_add(span).saturating_add(2);
    if lags == 0 || values.len() < needed {
        return Err(SignalError::TooShort { samples: values.len(), needed });
    }
    if let Some(sample) = values.iter().position(|value| !value.is_finite()) {
        return Err(SignalError::NotFinite { sample, channel: 0, value: values[sample] });
    }
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    // Division by a power of two changes no coefficient and keeps fourth powers finite.
    let unit = power_of_two(peak(values));
    Ok(values.iter().map(|v| (v - mean) / unit).collect())
}

fn products(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn ratio(value: f64, power: f64) -> f64 {
    if power > 0.0 { value / power } else { 0.0 }
}
