//! Levels of noise: of white noise in addition to known noise, and of noise in proportion to a
//! response.

use crate::limits::{LEVEL_LEAST, LEVEL_ROUNDS, LEVEL_SETTLED};

/// Returns the most likely standard deviation s of white noise in residuals e, which are circular
/// Gaussian numbers of variances s² + g. Each residual is given as the pair (|e|², g) with the
/// known variance g; all pairs are in the same unit. The result is almost zero if g alone explains
/// the residuals.
///
/// # Source
/// Searle, Casella & McCulloch, *Variance Components* (1992), chapter 8 (Fisher scoring).
pub fn motion_level(residuals: impl Iterator<Item = (f64, f64)>) -> f64 {
    let residuals: Vec<(f64, f64)> = residuals.collect();
    let mean = residuals.iter().map(|(power, _)| power).sum::<f64>() / residuals.len() as f64;
    let least = LEVEL_LEAST * mean;
    let mut variance = mean;
    for _ in 0..LEVEL_ROUNDS {
        let (mut excess, mut weights) = (0.0, 0.0);
        for (power, known) in &residuals {
            let total = (variance + known).max(f64::MIN_POSITIVE);
            let weight = (total * total).recip();
            excess += weight * (power - known);
            weights += weight;
        }
        let next = (excess / weights).max(least);
        if !next.is_finite() || (next - variance).abs() <= LEVEL_SETTLED * variance {
            break;
        }
        // The decrease per step is limited: if the variance is too small, a few lines get all the
        // weight and the search oscillates.
        variance = next.max(0.1 * variance);
    }
    variance.sqrt().max(f64::MIN_POSITIVE)
}

/// Noise of a response: the sum of a white part and of a part in proportion to the response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResponseNoise {
    /// Variance of the white part, in the square of the unit of the response.
    pub white: f64,
    /// Ratio of the variance of the proportional part to the squared magnitude of the response.
    pub relative: f64,
}

impl ResponseNoise {
    /// Chooses the most likely noise of residuals, which are circular Gaussian numbers: white
    /// noise, noise in proportion to the response, or the sum of both. The sum is chosen only if
    /// Schwarz's criterion accepts its second unknown. Each entry is the pair of the squared
    /// magnitudes of a residual and of the response on its line.
    ///
    /// # Source
    /// Searle, Casella & McCulloch, *Variance Components* (1992), chapter 8 (Fisher scoring);
    /// Schwarz (1978), Annals of Statistics 6, 461–464.
    pub fn choose(residuals: &[(f64, f64)]) -> Self {
        Self::with_penalty(residuals, 0.5 * (residuals.len().max(1) as f64).ln())
    }

    /// Returns the most likely noise of residuals, from the pairs of [`ResponseNoise::choose`], one
    /// for each line, without a penalty for the second unknown.
    ///
    /// # Source
    /// As [`ResponseNoise::choose`].
    pub fn most_likely(residuals: &[(f64, f64)]) -> Self {
        Self::with_penalty(residuals, 0.0)
    }

    /// Returns the most likely noise; the logarithm of the likelihood of the sum of both parts is
    /// reduced by a penalty.
    fn with_penalty(residuals: &[(f64, f64)], penalty: f64) -> Self {
        let count = residuals.len().max(1) as f64;
        let white = residuals.iter().map(|(power, _)| power).sum::<f64>() / count;
        let white = Self { white: white.max(f64::MIN_POSITIVE), relative: 0.0 };
        let largest = residuals.iter().map(|(_, response)| *response).fold(0.0, f64::max);
        let ratios = residuals.iter().map(|(power, response)| power / response);
        let relative = Self { white: 0.0, relative: ratios.sum::<f64>() / count };
        let one = if largest > 0.0 && relative.cost(residuals) < white.cost(residuals) {
            relative
        } else {
            white
        };
        let both = Self { white: 0.5 * white.white, relative: 0.5 * white.white / largest };
        match both.scored(residuals) {
            Some(both) if both.cost(residuals) + penalty < one.cost(residuals) => both,
            _ => one,
        }
    }

    /// Returns the variance of the noise of a response with this squared magnitude.
    pub fn variance(&self, response: f64) -> f64 {
        self.white + self.relative * response
    }

    /// Returns minus the log-likelihood of residuals, up to a constant; infinite if the likelihood
    /// does not exist. There is one pair for each line, as for [`ResponseNoise::choose`].
    ///
    /// # Source
    /// As [`ResponseNoise::choose`].
    pub fn cost(&self, residuals: &[(f64, f64)]) -> f64 {
        let term = |(power, response): &(f64, f64)| {
            let variance = self.variance(*response);
            variance.ln() + power / variance
        };
        let cost: f64 = residuals.iter().map(term).sum();
        if cost.is_finite() { cost } else { f64::INFINITY }
    }

    /// Returns the sum of a white and a proportional part with the most likely variances; `None` if
    /// one of the variances is not positive.
    fn scored(mut self, residuals: &[(f64, f64)]) -> Option<Self> {
        for _ in 0..LEVEL_ROUNDS {
            // The sums are the entries of the weighted normal equations for s² and r². The powers
            // have the expected values s² + r² |x|².
            let [mut ss, mut sr, mut rr, mut sp, mut rp] = [0.0; 5];
            for (power, response) in residuals {
                let weight = self.variance(*response).powi(-2);
                ss += weight;
                sr += weight * response;
                rr += weight * response * response;
                sp += weight * power;
                rp += weight * response * power;
            }
            let determinant = ss * rr - sr * sr;
            let white = (rr * sp - sr * rp) / determinant;
            let relative = (ss * rp - sr * sp) / determinant;
            if !(white.is_finite() && relative.is_finite()) {
                return None;
            }
            let before = self;
            // The decrease per step is limited: if the variances are too small, a few lines get all
            // the weight and the search oscillates.
            self = Self {
                white: white.max(0.1 * before.white),
                relative: relative.max(0.1 * before.relative),
            };
            let settled = |now: f64, before: f64| (now - before).abs() <= LEVEL_SETTLED * before;
            if settled(self.white, before.white) && settled(self.relative, before.relative) {
                return (white > 0.0 && relative > 0.0).then_some(self);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Sampling, noise};

    use super::{ResponseNoise, motion_level};

    /// Returns the pair (|e|², g) of each line: e is a simulated residual with the variance s² + g,
    /// where s is `level` and g is the entry of `known`.
    fn powers(level: f64, known: &[f64], seed: u64) -> Vec<(f64, f64)> {
        let sampling = Sampling::new(1.0, known.len()).unwrap();
        let drawn = noise::white(sampling, 2, 0.5_f64.sqrt(), seed).unwrap();
        let power = |(row, g): (usize, &f64)| {
            ((level * level + g) * drawn.data().row(row).norm_squared(), *g)
        };
        known.iter().enumerate().map(power).collect()
    }

    #[test]
    fn without_known_noise_the_level_is_the_root_of_the_mean_power() {
        let residuals = powers(3.0, &[0.0; 400], 1);
        let mean = residuals.iter().map(|(power, _)| power).sum::<f64>() / 400.0;
        let level = motion_level(residuals.into_iter());
        assert!((level - mean.sqrt()).abs() < 1e-6 * level, "{level}");
    }

    /// The level of white noise must be found, although the resonance of the known noise is a
    /// hundred times as high as this level. About 350 lines outside the resonance determine the
    /// level with a standard error of 2.7 %; the mean of 40 experiments has a sixth of this error.
    #[test]
    fn the_level_is_found_beside_a_resonance() {
        let known: Vec<f64> =
            (0..400).map(|l| 1e4 / (1.0 + (4.0 * (f64::from(l) - 200.0)).powi(2))).collect();
        let levels: Vec<f64> =
            (0..40).map(|seed| motion_level(powers(1.0, &known, seed).into_iter())).collect();
        let mean = levels.iter().sum::<f64>() / 40.0;
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
    }

    #[test]
    fn known_noise_that_explains_all_leaves_next_to_nothing() {
        let known: Vec<f64> = (0..100).map(|l| 1.0 + f64::from(l)).collect();
        let residuals: Vec<(f64, f64)> = known.iter().map(|g| (0.5 * g, *g)).collect();
        let level = motion_level(residuals.into_iter());
        assert!((0.0..1e-4).contains(&level), "{level}");
    }

    /// In nearly all of 200 sets of 300 lines near a resonance, the right form is chosen, and the
    /// mean levels are right.
    #[test]
    fn noise_in_proportion_to_a_response_is_recognised() {
        let response: Vec<f64> =
            (0..300).map(|l| 1e4 / (1.0 + (0.1 * (f64::from(l) - 150.0)).powi(2))).collect();
        for (white, relative) in [(1.0, 0.0), (0.0, 0.01), (2.0, 0.01)] {
            let (mut right, mut sums) = (0, [0.0; 2]);
            for seed in 0..200 {
                let known: Vec<f64> = response.iter().map(|x| white + relative * x).collect();
                let residuals: Vec<(f64, f64)> = powers(0.0, &known, seed)
                    .into_iter()
                    .zip(&response)
                    .map(|((power, _), x)| (power, *x))
                    .collect();
                let got = ResponseNoise::choose(&residuals);
                sums = [sums[0] + got.white / 200.0, sums[1] + got.relative / 200.0];
                right += u32::from(
                    (got.white > 0.0, got.relative > 0.0) == (white > 0.0, relative > 0.0),
                );
            }
            // In 1.7 % of large sets, Schwarz's criterion adds a part that does not exist.
            assert!(right >= 188, "{white} {relative}: {right}");
            assert!((sums[0] - white).abs() < 0.05 * white + 0.02, "{sums:?}");
            assert!((sums[1] - relative).abs() < 0.05 * relative + 1e-5, "{sums:?}");
        }
    }
}
