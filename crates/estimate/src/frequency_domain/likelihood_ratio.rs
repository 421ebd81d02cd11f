//! Likelihood-ratio test of a model with fewer parameters.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::OutputErrorFit;

/// Likelihood ratio of two nested models: the smaller one is the larger one with some parameters
/// fixed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct LikelihoodRatio {
    /// Twice the logarithm of the ratio, a pure number; its mean is about `restrictions` if the
    /// smaller model is correct.
    pub statistic: f64,
    /// Number of fixed parameters.
    pub restrictions: usize,
    /// Probability of a larger statistic if the smaller model is correct, from 0 to 1.
    pub p_value: f64,
}

/// Compares fits of two models to the same data: one pair (larger, smaller) for each of several
/// independent sets of data. `restrictions` (a pure number) is the number of fixed parameters of
/// all sets together. `None` if a noise level is not known before the fit.
///
/// With weights from repeated periods the statistic divided by `restrictions` follows Fisher's F.
///
/// # Source
/// Wilks (1938), Annals of Mathematical Statistics 9, 60–62; with sampled weights: Pintelon &
/// Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on the sample
/// maximum likelihood.
pub fn likelihood_ratio(
    fits: &[(&OutputErrorFit, &OutputErrorFit)],
    restrictions: usize,
) -> Option<LikelihoodRatio> {
    let differences =
        fits.iter().map(|(larger, smaller)| Some(smaller.deviance? - larger.deviance?));
    let statistic = differences.sum::<Option<f64>>()?.max(0.0);
    let known = fits.iter().map(|(larger, _)| larger.estimate.degrees_of_freedom()).sum::<usize>();
    let count = restrictions as f64;
    let distribution = FisherSnedecor::new(count, known as f64).ok()?;
    Some(LikelihoodRatio { statistic, restrictions, p_value: distribution.sf(statistic / count) })
}
