//! Sampled signals on one time axis.

use nalgebra::{DMatrix, DVectorView};

use crate::error::{SignalError, fits_in_memory};
use crate::sampling::Sampling;

/// Samples × channels on one uniform time axis; a channel is a contiguous column.
///
/// Every value is finite, so that a record needs no further checks. Values are in any unit: each
/// function that takes a record states the unit, and results of this crate have the same unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    sampling: Sampling,
    data: DMatrix<f64>,
}

impl Record {
    /// Creates a record from a matrix of `sampling.len()` rows and one column per channel.
    ///
    /// # Errors
    /// [`SignalError::Length`] if the rows do not match the sampling,
    /// [`SignalError::NotFinite`] at the first NaN or infinity.
    pub fn new(sampling: Sampling, data: DMatrix<f64>) -> Result<Self, SignalError> {
        if data.nrows() != sampling.len() {
            return Err(SignalError::Length {
                channel: 0,
                got: data.nrows(),
                expected: sampling.len(),
            });
        }
        if let Some(at) = first_unusable(data.as_slice()) {
            let (channel, sample) = (at / data.nrows(), at % data.nrows());
            let value = data[(sample, channel)];
            return Err(SignalError::NotFinite { sample, channel, value });
        }
        Ok(Self { sampling, data })
    }

    /// Creates a record of values that are known to be finite, without reading them once more;
    /// shape and unit as in [`Record::new`].
    ///
    /// # Errors
    /// [`SignalError::Length`] if the rows do not match the sampling.
    ///
    /// # Panics
    /// With debug assertions, if a value is not finite.
    pub fn from_finite(sampling: Sampling, data: DMatrix<f64>) -> Result<Self, SignalError> {
        debug_assert!(first_unusable(data.as_slice()).is_none(), "the values are finite");
        if data.nrows() != sampling.len() {
            return Err(SignalError::Length {
                channel: 0,
                got: data.nrows(),
                expected: sampling.len(),
            });
        }
        Ok(Self { sampling, data })
    }

    /// Creates a record of one channel.
    ///
    /// # Errors
    /// The errors of [`Record::new`].
    pub fn from_channel(sampling: Sampling, channel: Vec<f64>) -> Result<Self, SignalError> {
        let len = channel.len();
        Self::new(sampling, DMatrix::from_vec(len, 1, channel))
    }

    /// Creates a record from its channels, each as long as the sampling.
    ///
    /// # Errors
    /// The errors of [`Record::new`], with the channel of the wrong length.
    pub fn from_channels(
        sampling: Sampling,
        channels: &[impl AsRef<[f64]>],
    ) -> Result<Self, SignalError> {
        for (channel, data) in channels.iter().enumerate() {
            let got = data.as_ref().len();
            if got != sampling.len() {
                return Err(SignalError::Length { channel, got, expected: sampling.len() });
            }
        }
        let data: Vec<&[f64]> = channels.iter().map(AsRef::as_ref).collect();
        Self::new(sampling, DMatrix::from_vec(sampling.len(), channels.len(), data.concat()))
    }

    /// Creates a record of one channel from its value at each instant, in seconds.
    ///
    /// # Errors
    /// The errors of [`Record::new`], and [`SignalError::Memory`].
    pub fn from_fn(sampling: Sampling, value: impl FnMut(f64) -> f64) -> Result<Self, SignalError> {
        fits_in_memory(sampling.len(), 1)?;
        Self::from_channel(sampling, sampling.times().map(value).collect())
    }

    /// The time axis.
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// Number of samples.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.sampling.len()
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.data.ncols()
    }

    /// The samples of one channel, counted from 0.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn channel(&self, channel: usize) -> &[f64] {
        let n = self.len();
        &self.data.as_slice()[channel * n..(channel + 1) * n]
    }

    /// The samples of one channel as a vector view.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn column(&self, channel: usize) -> DVectorView<'_, f64> {
        self.data.column(channel)
    }

    /// All samples: `len()` rows, `channels()` columns.
    pub fn data(&self) -> &DMatrix<f64> {
        &self.data
    }

    /// Returns the samples without the time axis.
    pub fn into_data(self) -> DMatrix<f64> {
        self.data
    }

    /// Returns samples `start .. start + len`, with the first at t = 0.
    ///
    /// # Errors
    /// [`SignalError::Window`] unless they all exist, [`SignalError::Empty`] if `len` is 0.
    pub fn window(&self, start: usize, len: usize) -> Result<Self, SignalError> {
        let sampling = self.sampling.with_len(len)?;
        let end = start.saturating_add(len);
        if end > self.len() {
            return Err(SignalError::Window { start, end, len: self.len() });
        }
        Ok(Self { sampling, data: self.data.rows(start, len).into_owned() })
    }

    /// Returns the record with the mean of every channel subtracted.
    pub fn without_mean(&self) -> Self {
        let mut data = self.data.clone();
        for mut column in data.column_iter_mut() {
            let mean = column.mean();
            column.add_scalar_mut(-mean);
        }
        Self { sampling: self.sampling, data }
    }

    /// Returns the mean over consecutive periods of `period` samples; an incomplete last period is
    /// omitted.
    ///
    /// # Errors
    /// [`SignalError::Window`] if the record is shorter than one period,
    /// [`SignalError::Empty`] if `period` is 0.
    pub fn period_mean(&self, period: usize) -> Result<Self, SignalError> {
        let mut mean = self.window(0, period)?;
        let periods = self.len() / period;
        for p in 1..periods {
            mean.data += self.data.rows(p * period, period);
        }
        mean.data /= periods as f64;
        Ok(mean)
    }

    /// Returns the record repeated `periods` times.
    ///
    /// # Errors
    /// [`SignalError::Empty`] if `periods` is 0, [`SignalError::Memory`].
    pub fn repeated(&self, periods: usize) -> Result<Self, SignalError> {
        let sampling = self.sampling.with_len(self.len().saturating_mul(periods))?;
        fits_in_memory(sampling.len(), self.channels())?;
        let len = self.len();
        let data =
            DMatrix::from_fn(sampling.len(), self.channels(), |k, c| self.data[(k % len, c)]);
        Ok(Self { sampling, data })
    }

    /// Checks that `other` has the same time axis (steps may differ by rounding only).
    ///
    /// # Errors
    /// [`SignalError::SamplingMismatch`] if it has another one.
    pub fn check_same_sampling(&self, other: &Self) -> Result<(), SignalError> {
        let (left, right) = (self.sampling, other.sampling);
        let same_dt = (left.dt() - right.dt()).abs() <= 1e-9 * left.dt();
        if left.len() == right.len() && same_dt {
            return Ok(());
        }
        Err(SignalError::SamplingMismatch {
            left_len: left.len(),
            left_dt: left.dt(),
            right_len: right.len(),
            right_dt: right.dt(),
        })
    }
}

/// Position of the first NaN or infinity.
///
/// The search has no branch within a block of values, so that the check of a finite record runs at
/// memory speed.
fn first_unusable(values: &[f64]) -> Option<usize> {
    const BLOCK: usize = 1024;
    let usable = |v: &f64| v.is_finite();
    let sound = |block: &[f64]| block.iter().fold(true, |sound, v| sound & usable(v));
    let block = values.chunks(BLOCK).position(|block| !sound(block))?;
    let at = values[block * BLOCK..].iter().position(|v| !usable(v))?;
    Some(block * BLOCK + at)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_channels() -> Record {
        let s = Sampling::new(0.1, 4).unwrap();
        Record::from_channels(s, &[[1.0, 2.0, 3.0, 6.0], [0.0, 1.0, 0.0, -1.0]]).unwrap()
    }

    #[test]
    fn channels_are_contiguous_columns() {
        let r = two_channels();
        assert_eq!((r.len(), r.channels()), (4, 2));
        assert_eq!(r.channel(1), [0.0, 1.0, 0.0, -1.0]);
    }

    #[test]
    fn windows_means_and_periods() {
        let r = two_channels();
        assert_eq!(r.window(1, 2).unwrap().channel(0), [2.0, 3.0]);
        assert_eq!(r.window(3, 2), Err(SignalError::Window { start: 3, end: 5, len: 4 }));
        assert_eq!(r.without_mean().channel(0), [-2.0, -1.0, 0.0, 3.0]);
        assert_eq!(r.period_mean(2).unwrap().channel(0), [2.0, 4.0]);
        assert_eq!(r.period_mean(3).unwrap().channel(0), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn repetition_and_its_mean() {
        let r = two_channels();
        let thrice = r.repeated(3).unwrap();
        assert_eq!((thrice.len(), thrice.channel(1)[9]), (12, 1.0));
        assert_eq!(thrice.period_mean(4).unwrap(), r);
        assert_eq!(r.repeated(0), Err(SignalError::Empty));
        let ramp = Record::from_fn(r.sampling(), |t| 10.0 * t).unwrap();
        assert_eq!(ramp.channel(0)[2], 2.0);
    }

    #[test]
    fn bad_data_are_refused_with_their_place() {
        let s = Sampling::new(0.1, 2).unwrap();
        let e = Record::from_channels(s, &[vec![1.0, 2.0], vec![1.0]]).unwrap_err();
        assert_eq!(e, SignalError::Length { channel: 1, got: 1, expected: 2 });
        let e = Record::from_channels(s, &[[1.0, 2.0], [0.0, f64::INFINITY]]).unwrap_err();
        assert_eq!(e, SignalError::NotFinite { sample: 1, channel: 1, value: f64::INFINITY });
        // A record of 3,000 samples has −∞ at sample 2500 and NaN at sample 2999; the error must
        // name the first of these samples.
        let mut long = DMatrix::zeros(3000, 2);
        (long[(2500, 1)], long[(2999, 1)]) = (f64::NEG_INFINITY, f64::NAN);
        let e = Record::new(Sampling::new(0.1, 3000).unwrap(), long).unwrap_err();
        let value = f64::NEG_INFINITY;
        assert_eq!(e, SignalError::NotFinite { sample: 2500, channel: 1, value });
    }

    #[test]
    fn what_does_not_fit_in_memory_is_refused() {
        for periods in [usize::MAX, 1 << 60, 1 << 50] {
            let refused = two_channels().repeated(periods);
            let samples = periods.saturating_mul(4);
            assert_eq!(refused, Err(SignalError::Memory { samples, channels: 2 }));
        }
        let endless = Sampling::new(1.0, usize::MAX).unwrap();
        assert!(matches!(Record::from_fn(endless, |t| t), Err(SignalError::Memory { .. })));
    }

    #[test]
    fn time_axes_are_compared() {
        let r = two_channels();
        let other = r.window(0, 3).unwrap();
        assert!(r.check_same_sampling(&r).is_ok());
        assert!(r.check_same_sampling(&other).is_err());
    }
}
