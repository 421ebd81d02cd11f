//! Level of white noise in addition to known noise.

use crate::limits::{LEVEL_LEAST, LEVEL_ROUNDS, LEVEL_SETTLED};

/// Returns the most likely standard deviation s of white noise in residuals e, which are circular
/// Gaussian numbers of variances s² + g. Each residual is a pair (|e|², g) with its known variance
/// g, all in one unit. The result is almost zero if g alone explains the residuals.
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
        // The decrease per step is limited, because after too small a variance a few lines get all
        // the weight and the search oscillates.
        variance = next.max(0.1 * variance);
    }
    variance.sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Sampling, noise};

    use super::motion_level;

    /// Powers of lines with the variances s² + g.
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

    /// A resonance a hundred times as high as the noise does not hide its level, because some 350
    /// lines beside it give the root to 2.7 %, and the mean of 40 experiments to a sixth of that.
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
}
