//! Mean, level and extremes of samples that arrive in blocks.

use crate::error::SignalError;
use crate::measures;
use crate::measures::power_of_two;

/// Count, mean, RMS value, standard deviation and extremes of a channel whose samples arrive in
/// blocks and need not be stored.
///
/// ```
/// use mechid_signal::RunningStatistics;
///
/// let mut whole = RunningStatistics::default();
/// whole.push(&[1.0, -3.0])?;
/// let mut rest = RunningStatistics::default();
/// rest.push(&[2.0, 4.0])?;
/// whole.merge(&rest)?;
/// assert_eq!((whole.count(), whole.mean()), (4, 1.0));
/// assert_eq!((whole.minimum(), whole.maximum(), whole.peak()), (-3.0, 4.0, 4.0));
/// assert_eq!(whole.rms(), 7.5_f64.sqrt());
/// assert_eq!(whole.standard_deviation(), 6.5_f64.sqrt());
/// # Ok::<(), mechid_signal::SignalError>(())
/// ```
///
/// # Source
/// Chan, Golub & LeVeque (1983), The American Statistician 37, 242–247 (sums of squares about the
/// mean, combined from parts).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunningStatistics {
    count: usize,
    sum: f64,
    /// Σ x² divided by the square of [`power_of_two`] of the peak. The division prevents overflow
    /// and underflow. If the peak changes, the conversion to the new scale is exact.
    squares: f64,
    /// Σ (x − mean)², divided by the same number as `squares`.
    centred_squares: f64,
    peak: f64,
    minimum: f64,
    maximum: f64,
}

impl Default for RunningStatistics {
    /// Returns the statistics of no samples.
    fn default() -> Self {
        Self {
            count: 0,
            // −0 is the neutral element of addition: −0 + x is x, including the sign of zero.
            sum: -0.0,
            squares: 0.0,
            centred_squares: 0.0,
            peak: 0.0,
            minimum: f64::INFINITY,
            maximum: f64::NEG_INFINITY,
        }
    }
}

impl RunningStatistics {
    /// Computes the statistics of these samples, in any unit.
    ///
    /// # Errors
    /// The error of [`push`](Self::push).
    pub fn from_samples(samples: &[f64]) -> Result<Self, SignalError> {
        let mut statistics = Self::default();
        statistics.push(samples)?;
        Ok(statistics)
    }

    /// Adds the next samples, in the unit of the earlier ones.
    ///
    /// Mean and RMS value are summed in the order of the samples, independently of the blocks.
    ///
    /// # Errors
    /// [`SignalError::NotFinite`] if a sample or the sum so far is not finite; the error has the
    /// number of the sample, counted from the first sample of all blocks.
    pub fn push(&mut self, samples: &[f64]) -> Result<(), SignalError> {
        if samples.is_empty() {
            return Ok(());
        }
        let mut sum = self.sum;
        for (sample, value) in (self.count..).zip(samples) {
            sum += value;
            if !sum.is_finite() {
                return Err(SignalError::NotFinite { sample, channel: 0, value: sum });
            }
        }
        let peak = self.peak.max(measures::peak(samples));
        let (unit, count) = (power_of_two(peak), samples.len());
        let before = self.squares_over(unit);
        self.squares = samples.iter().fold(before, |sum, x| sum + (x / unit).powi(2));
        let mean = samples.iter().sum::<f64>() / count as f64;
        let squares = samples.iter().map(|x| ((x - mean) / unit).powi(2)).sum();
        self.centred_squares = self.combined(squares, mean, count, unit);
        self.sum = sum;
        self.count += count;
        self.peak = peak;
        self.minimum = samples.iter().copied().fold(self.minimum, f64::min);
        self.maximum = samples.iter().copied().fold(self.maximum, f64::max);
        Ok(())
    }

    /// Adds the statistics of later samples, in the unit of the earlier ones.
    ///
    /// # Errors
    /// [`SignalError::NotFinite`], with the number of earlier samples, if the sum of both is not
    /// finite.
    pub fn merge(&mut self, later: &Self) -> Result<(), SignalError> {
        if later.count == 0 {
            return Ok(());
        }
        let sum = self.sum + later.sum;
        if !sum.is_finite() {
            return Err(SignalError::NotFinite { sample: self.count, channel: 0, value: sum });
        }
        let peak = self.peak.max(later.peak);
        let unit = power_of_two(peak);
        self.squares = self.squares_over(unit) + later.squares_over(unit);
        let mean = later.sum / later.count as f64;
        let squares = later.centred_squares_over(unit);
        self.centred_squares = self.combined(squares, mean, later.count, unit);
        self.sum = sum;
        self.count += later.count;
        self.peak = peak;
        self.minimum = self.minimum.min(later.minimum);
        self.maximum = self.maximum.max(later.maximum);
        Ok(())
    }

    /// Number of samples.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Mean, in the unit of the samples; 0 without samples, or if the mean is only a rounding
    /// error.
    pub fn mean(&self) -> f64 {
        let mean = self.sum / self.count.max(1) as f64;
        if mean.abs() < 4.0 * f64::EPSILON * self.rms() { 0.0 } else { mean }
    }

    /// Root mean square, in the unit of the samples; 0 for no samples.
    pub fn rms(&self) -> f64 {
        if self.peak == 0.0 {
            return 0.0;
        }
        power_of_two(self.peak) * (self.squares / self.count as f64).sqrt()
    }

    /// Root mean square about the mean, in the unit of the samples; 0 for no samples.
    pub fn standard_deviation(&self) -> f64 {
        power_of_two(self.peak) * (self.centred_squares / self.count.max(1) as f64).sqrt()
    }

    /// Sum of the squares about the mean, in the squared unit of the samples.
    pub fn centred_sum_of_squares(&self) -> f64 {
        let unit = power_of_two(self.peak);
        self.centred_squares * unit * unit
    }

    /// Largest absolute value, in the unit of the samples; 0 for no samples.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Smallest sample, in the unit of the samples; ∞ for no samples.
    pub fn minimum(&self) -> f64 {
        self.minimum
    }

    /// Largest sample, in the unit of the samples; −∞ for no samples.
    pub fn maximum(&self) -> f64 {
        self.maximum
    }

    /// Peak over RMS value, a pure number; `None` if all samples are zero.
    pub fn crest_factor(&self) -> Option<f64> {
        (self.peak > 0.0).then(|| self.peak / self.rms())
    }

    /// Returns Σ (x − mean)² / unit² over the samples so far and `count` further samples. The
    /// further samples have this `mean`, and `squares` is their sum of squares about it, divided by
    /// unit².
    fn combined(&self, squares: f64, mean: f64, count: usize, unit: f64) -> f64 {
        if self.count == 0 {
            return squares;
        }
        let (before, count) = (self.count as f64, count as f64);
        let apart = (mean - self.sum / before) / unit;
        let between = apart * apart * before * count / (before + count);
        self.centred_squares_over(unit) + (squares + between)
    }

    fn squares_over(&self, new_unit: f64) -> f64 {
        self.squares * (power_of_two(self.peak) / new_unit).powi(2)
    }

    fn centred_squares_over(&self, new_unit: f64) -> f64 {
        self.centred_squares * (power_of_two(self.peak) / new_unit).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns samples of a fast oscillation about an offset, multiplied by `scale`.
    fn samples(count: usize, offset: f64, scale: f64) -> Vec<f64> {
        (0..count).map(|k| scale * (offset + (0.7 * k as f64).sin())).collect()
    }

    /// Returns the mean and the standard deviation from two passes over all samples, as the
    /// reference.
    fn two_pass(samples: &[f64]) -> (f64, f64) {
        let count = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / count;
        let squares: f64 = samples.iter().map(|x| (x - mean) * (x - mean)).sum();
        (mean, (squares / count).sqrt())
    }

    #[test]
    fn blocks_change_nothing_in_mean_level_and_extremes() {
        let all = samples(1000, 0.3, 2.0);
        let whole = RunningStatistics::from_samples(&all).unwrap();
        assert_eq!(whole.rms(), measures::rms(&all));
        assert_eq!(whole.peak(), measures::peak(&all));
        for block in [1, 7, 999] {
            let mut parts = RunningStatistics::default();
            all.chunks(block).for_each(|part| parts.push(part).unwrap());
            assert_eq!(parts.mean(), whole.mean());
            assert_eq!((parts.minimum(), parts.maximum()), (whole.minimum(), whole.maximum()));
            // The peak rises from block to block; the scale of the sum of squares, a power of two,
            // follows it without rounding.
            assert_eq!(parts.rms(), whole.rms());
            let (mean, deviation) = two_pass(&all);
            assert!((parts.mean() / mean - 1.0).abs() < 1e-14);
            assert!((parts.standard_deviation() / deviation - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn a_large_offset_does_not_cost_the_deviation_its_digits() {
        let all = samples(5000, 1e9, 1.0);
        let mut merged = RunningStatistics::default();
        for part in all.chunks(64) {
            merged.merge(&RunningStatistics::from_samples(part).unwrap()).unwrap();
        }
        let (_, deviation) = two_pass(&all);
        // The rounding of samples of this size is 1e-7 of the standard deviation.
        assert!((merged.standard_deviation() / deviation - 1.0).abs() < 1e-7);
        assert!((merged.standard_deviation() - 0.5_f64.sqrt()).abs() < 1e-3);
    }

    #[test]
    fn parts_in_any_order_make_the_whole() {
        let (first, second) = (samples(300, 4.0, 1.0), samples(500, -2.0, 1e-3));
        let all = [first.clone(), second.clone()].concat();
        let whole = RunningStatistics::from_samples(&all).unwrap();
        for parts in [[&first, &second], [&second, &first]] {
            let mut merged = RunningStatistics::default();
            merged.merge(&RunningStatistics::from_samples(parts[0]).unwrap()).unwrap();
            merged.merge(&RunningStatistics::from_samples(parts[1]).unwrap()).unwrap();
            for (a, b) in [
                (merged.mean(), whole.mean()),
                (merged.rms(), whole.rms()),
                (merged.standard_deviation(), whole.standard_deviation()),
                (merged.centred_sum_of_squares(), whole.centred_sum_of_squares()),
            ] {
                assert!((a / b - 1.0).abs() < 1e-13, "{a} {b}");
            }
            assert_eq!((merged.peak(), merged.count()), (whole.peak(), 800));
        }
    }

    #[test]
    fn very_large_and_very_small_samples_keep_their_levels() {
        for scale in [1e-300, 1e-200, 1e200, 1e300] {
            let all = samples(100, 0.5, 1.0);
            let (mean, deviation) = two_pass(&all);
            let scaled = RunningStatistics::from_samples(&samples(100, 0.5, scale)).unwrap();
            assert!((scaled.mean() / scale / mean - 1.0).abs() < 1e-13);
            assert!((scaled.rms() / scale / measures::rms(&all) - 1.0).abs() < 1e-13);
            assert!((scaled.standard_deviation() / scale / deviation - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn nothing_zeros_and_rounding_have_no_mean() {
        let none = RunningStatistics::default();
        assert_eq!((none.count(), none.mean(), none.rms()), (0, 0.0, 0.0));
        assert_eq!((none.standard_deviation(), none.crest_factor()), (0.0, None));
        let zeros = RunningStatistics::from_samples(&[0.0; 5]).unwrap();
        assert_eq!((zeros.mean(), zeros.standard_deviation()), (0.0, 0.0));
        let rounding = RunningStatistics::from_samples(&[1.0, -1.0, 1.0, -1.0 + 1e-16]).unwrap();
        assert_eq!(rounding.mean(), 0.0);
        assert_eq!(
            RunningStatistics::from_samples(&[2.0, -2.0]).unwrap().crest_factor(),
            Some(1.0)
        );
    }

    #[test]
    fn what_is_not_finite_is_named_and_adds_nothing() {
        let mut statistics = RunningStatistics::from_samples(&[1.0, 2.0]).unwrap();
        let before = statistics;
        let refused = statistics.push(&[3.0, f64::INFINITY]);
        let value = f64::INFINITY;
        assert_eq!(refused, Err(SignalError::NotFinite { sample: 3, channel: 0, value }));
        assert_eq!(statistics, before);
        let large = RunningStatistics::from_samples(&[f64::MAX]).unwrap();
        assert!(RunningStatistics::from_samples(&[f64::MAX]).unwrap().merge(&large).is_err());
    }
}
