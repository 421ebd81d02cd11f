//! Repeated periods of one experiment: their mean, their scatter, and two independent halves.

use std::f64::consts::PI;

use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_numerics::{NumericsError, check_size};
use mechid_signal::Record;
use nalgebra::{Complex, DMatrix, DVector};

use crate::SpectraError;
use crate::frequency_data::FrequencyData;
use crate::limits::{PERIODS_HALVINGS, PERIODS_REPEATS, PERIODS_TERMS};
use crate::lines::{Lines, check_sampling};
use crate::noise::between_lines::{BetweenLines, periods_as_one};
use crate::noise::pooling::Pooling;
use crate::noise::spectrum::NoiseSpectrum;

/// Forces and responses at chosen lines, period by period, in a periodic steady state.
///
/// The part that repeats in every period is the signal; the rest is noise. No model is needed to
/// separate signal and noise.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapters on
/// nonparametric noise models and on periodic excitations.
#[derive(Debug, Clone)]
pub struct RepeatedPeriods {
    lines: Lines,
    measured: ResponseQuantity,
    dof: usize,
    /// Expected number of periods, which determines the halves.
    expected: usize,
    count: usize,
    /// Sums of all periods, and of the first and the second half of the expected periods: lines ×
    /// 2n, first the responses in the measured quantity, then the forces.
    sum: DMatrix<Complex<f64>>,
    half_sums: [DMatrix<Complex<f64>>; 2],
    /// Sum Σ (z − z̄)(z − z̄)ᴴ over the periods so far, per line, 2n×2n. If several periods are
    /// taken as one record, an equivalent sum over the lines between the lines of a period replaces
    /// it.
    scatter: Vec<DMatrix<Complex<f64>>>,
    /// Periods that are not included in the scatter yet.
    together: BetweenLines,
    /// Sum of the periods in `together`.
    together_sum: DMatrix<Complex<f64>>,
    /// Quantisation step of each channel, 2n; zero without quantisation.
    steps: Vec<f64>,
}

impl RepeatedPeriods {
    /// Splits records of several whole periods into periods; `lines` are the lines of one period.
    /// An incomplete period at the end is ignored.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if the records have different numbers of channels,
    /// [`SpectraError::Signal`] if their time axes differ, if their time step differs from the time
    /// step of the lines, or if they are shorter than one period.
    pub fn new(
        lines: &Lines,
        force: &Record,
        motion: &Record,
        measured: ResponseQuantity,
    ) -> Result<Self, SpectraError> {
        let periods = force.len() / lines.sampling().len();
        let mut repeated = Self::expecting(lines, force.channels(), measured, periods);
        repeated.push(force, motion)?;
        Ok(repeated)
    }

    /// Creates an empty set of periods of a system with `dof` degrees of freedom, to which
    /// `periods` periods will be added a few at a time: the memory does not grow with the number of
    /// periods.
    pub fn expecting(
        lines: &Lines,
        dof: usize,
        measured: ResponseQuantity,
        periods: usize,
    ) -> Self {
        let zero = DMatrix::zeros(lines.as_slice().len(), 2 * dof);
        Self {
            lines: lines.clone(),
            measured,
            dof,
            expected: periods,
            count: 0,
            half_sums: [zero.clone(), zero.clone()],
            scatter: vec![DMatrix::zeros(2 * dof, 2 * dof); zero.nrows()],
            together: Self::together(lines, dof, periods),
            together_sum: zero.clone(),
            steps: vec![0.0; zero.ncols()],
            sum: zero,
        }
    }

    /// Sets the quantisation steps of the channels, responses (in the measured quantity) before
    /// forces (N), zero for channels without quantisation. If a channel has no other noise, its
    /// quantisation error of step/√12 is equal in all periods, and the scatter does not contain
    /// this error.
    ///
    /// # Errors
    /// [`NumericsError::Size`] unless there is one step per channel.
    ///
    /// # Source
    /// Widrow & Kollár, *Quantization Noise* (2008), chapter on dither: with steps q and noise of
    /// standard deviation s, the part Σ q²/(2π²k²) exp(−4π²k²s²/q²) of the variance is equal in all
    /// periods.
    pub fn with_quantisation(mut self, steps: Vec<f64>) -> Result<Self, SpectraError> {
        check_size("quantisation steps", 2 * self.dof, steps.len())?;
        self.steps = steps;
        Ok(self)
    }

    /// Returns the variance per sample of each channel, 2n, of the quantisation error that is equal
    /// in all periods.
    fn rounding(&self) -> Vec<f64> {
        let (samples, count) = (self.lines.sampling().len() as f64, self.count as f64);
        let of_channel = |(channel, step): (usize, &f64)| {
            let powers = self.scatter.iter().map(|s| s[(channel, channel)].re);
            let of_noise =
                powers.sum::<f64>() / self.scatter.len().max(1) as f64 / (count - 1.0).max(1.0);
            let scatter = of_noise * samples / 4.0;
            if *step > 0.0 { step * step * common_rounding(scatter / (step * step)) } else { 0.0 }
        };
        self.steps.iter().enumerate().map(of_channel).collect()
    }

    /// Creates the buffer for the next group of periods, whose spectrum is taken as that of one
    /// record. `remaining` is the number of periods that are still expected.
    fn together(lines: &Lines, dof: usize, remaining: usize) -> BetweenLines {
        let (period, channels) = (lines.sampling().len(), 2 * dof);
        BetweenLines::new(periods_as_one(remaining, period, channels), period, channels)
    }

    /// Adds the whole periods, at least one, of a part of the records of force (N) and response; an
    /// incomplete period at the end of the part is ignored.
    ///
    /// # Errors
    /// As [`RepeatedPeriods::new`]; after an error the set is unchanged.
    pub fn push(&mut self, force: &Record, motion: &Record) -> Result<(), SpectraError> {
        force.check_same_sampling(motion)?;
        let period = self.lines.sampling().len();
        // The function `window` returns an error if the record is shorter than a period.
        check_sampling(self.lines.sampling(), force.window(0, period)?.sampling())?;
        let dof = self.dof.max(1);
        for (what, got) in [
            ("channels of the force", force.channels()),
            ("channels of the motion", motion.channels()),
        ] {
            if got != dof {
                return Err(NumericsError::Size { what, got, expected: dof }.into());
            }
        }
        let lines = self.lines.clone();
        let mut reader = lines.reader();
        let mut both = DMatrix::zeros(self.sum.nrows(), 2 * dof);
        for start in (0..force.len() / period).map(|p| p * period) {
            let channels = [motion, force].into_iter().flat_map(|record| {
                (0..dof).map(move |channel| &record.channel(channel)[start..start + period])
            });
            for (mut column, samples) in both.column_iter_mut().zip(channels.clone()) {
                reader.read(|input| input.copy_from_slice(samples), column.iter_mut());
            }
            self.together.buffer(channels);
            self.add(&both);
        }
        Ok(())
    }

    fn add(&mut self, period: &DMatrix<Complex<f64>>) {
        let half = self.expected / 2;
        if self.count < half {
            self.half_sums[0] += period;
        }
        if self.count >= self.expected - half {
            self.half_sums[1] += period;
        }
        self.sum += period;
        self.together_sum += period;
        self.count += 1;
        if let Some(periods) = self.together.complete() {
            self.add_scatter(periods);
            let remaining = self.expected.saturating_sub(self.count);
            self.together = Self::together(&self.lines, self.dof, remaining);
            self.together_sum.fill(Complex::default());
        }
    }

    /// Adds the scatter of the last `periods` periods: the noise between the lines, and the
    /// deviation of the mean of these periods from the mean of all earlier periods.
    ///
    /// # Source
    /// Welford (1962), Technometrics 4, 419–420: the scatter about the mean in one pass.
    fn add_scatter(&mut self, periods: usize) {
        self.together.add_scatter(self.lines.as_slice(), &mut self.scatter);
        let (before, now) = ((self.count - periods) as f64, periods as f64);
        if before == 0.0 {
            return;
        }
        let weight = Complex::from(before * now / (before + now));
        let mut deviation = DVector::zeros(self.sum.ncols());
        for (line, scatter) in self.scatter.iter_mut().enumerate() {
            let both = self.together_sum.row(line).into_iter().zip(self.sum.row(line));
            for (apart, (last, all)) in deviation.iter_mut().zip(both) {
                *apart = last / now - (all - last) / before;
            }
            scatter.gerc(weight, &deviation, &deviation, Complex::from(1.0));
        }
    }

    /// Returns the number of whole periods.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the lines that are read from each period.
    pub fn lines(&self) -> &Lines {
        &self.lines
    }

    /// Returns the mean over all periods, without a noise spectrum. The only noise stated in the
    /// data is the force noise due to quantisation ([`RepeatedPeriods::with_quantisation`]).
    ///
    /// # Errors
    /// As [`FrequencyData::from_amplitudes`], and [`SpectraError::TooFewAverages`] if there is no
    /// period.
    pub fn mean(&self) -> Result<FrequencyData, SpectraError> {
        self.at_least(1)?;
        let deviations: Vec<f64> = self.rounding()[self.dof..].iter().map(|v| v.sqrt()).collect();
        let mean = self.data(self.sum.unscale(self.count as f64))?;
        mean.with_force_noise(&deviations, self.lines.sampling().len())
    }

    /// Returns the mean over all periods with the noise that follows from their scatter.
    ///
    /// # Errors
    /// As [`RepeatedPeriods::mean`] and [`RepeatedPeriods::noise`].
    pub fn mean_with_noise(&self, pooling: Pooling) -> Result<FrequencyData, SpectraError> {
        self.mean()?.with_noise(self.noise(pooling)?)
    }

    /// Returns the means over the first and the second half of the periods (without the middle
    /// period of an odd number): two measurements of the same signal with independent noise.
    ///
    /// # Errors
    /// [`SpectraError::TooFewAverages`] if there is only one period, or fewer than expected.
    pub fn halves(&self) -> Result<(FrequencyData, FrequencyData), SpectraError> {
        self.at_least(self.expected.max(2))?;
        let count = (self.expected / 2) as f64;
        let [first, second] = &self.half_sums;
        Ok((self.data(first.unscale(count))?, self.data(second.unscale(count))?))
    }

    /// Returns the covariance of the mean over the periods, of displacement (m) and force (N), line
    /// by line or pooled over lines; [`NoiseSpectrum::models`] describes the choice.
    ///
    /// The spectra of 3 to 16 consecutive periods, as far as memory allows, are taken as the
    /// spectrum of one record; between the lines of a period this spectrum contains only noise. The
    /// scatter between the means of such groups is added. A force that is equal in every period up
    /// to rounding is taken as exact.
    ///
    /// # Errors
    /// [`SpectraError::TooFewAverages`] if there is only one period, or fewer than expected.
    ///
    /// # Source
    /// Pintelon & Schoukens, as for the type: noise on the lines that are not excited. McCullagh &
    /// Nelder, *Generalized Linear Models* (1989), chapter 8 (smooth spectra: variances with a
    /// logarithmic link); Schwarz (1978), Annals of Statistics 6, 461–464 (order and bands); Stone
    /// (1974), Journal of the Royal Statistical Society B 36, 111–147 (choice by prediction).
    pub fn noise(&self, pooling: Pooling) -> Result<NoiseSpectrum, SpectraError> {
        self.noise_relative_to(pooling, None)
    }

    /// Returns the covariance as [`RepeatedPeriods::noise`] does; here a smooth spectrum may also
    /// be the response of the system `machine` to unmeasured forces.
    ///
    /// # Errors
    /// As [`RepeatedPeriods::noise`]; [`NumericsError::Size`] for a system with another number of
    /// degrees of freedom.
    ///
    /// # Source
    /// As [`RepeatedPeriods::noise`].
    pub fn noise_with_system(
        &self,
        pooling: Pooling,
        machine: &SecondOrderSystem,
    ) -> Result<NoiseSpectrum, SpectraError> {
        let (n, omega) = (self.dof, self.lines.omega());
        let (what, got) = ("degrees of freedom of the machine", machine.dof());
        if got != n {
            return Err(NumericsError::Size { what, got, expected: n }.into());
        }
        // The receptance is infinite if a pole is on a line, and then gives no noise level.
        let Ok(receptances) = machine.receptances(&omega) else { return self.noise(pooling) };
        let of_forces = DMatrix::from_fn(omega.len(), 2 * n, |row, channel| {
            if channel >= n {
                return 1.0;
            }
            let gain: f64 = receptances[row].row(channel).iter().map(|g| g.norm_sqr()).sum();
            gain * self.measured.per_displacement(omega[row]).norm_sqr()
        });
        self.noise_relative_to(pooling, Some(&of_forces))
    }

    fn noise_relative_to(
        &self,
        pooling: Pooling,
        relative: Option<&DMatrix<f64>>,
    ) -> Result<NoiseSpectrum, SpectraError> {
        self.at_least(self.expected.max(2))?;
        let count = self.count;
        // The covariance of the mean is the covariance of one period divided by the number of
        // periods.
        let scale = Complex::from(1.0 / ((count - 1) * count) as f64);
        let (n, repeats) = (self.dof, self.force_repeats());
        let of_mean = |scatter: &DMatrix<Complex<f64>>| {
            let mut covariance = scatter * scale;
            if repeats {
                covariance.rows_mut(n, n).fill(Complex::default());
                covariance.columns_mut(n, n).fill(Complex::default());
            }
            covariance
        };
        let noise = NoiseSpectrum::from_measured(
            &self.lines.omega(),
            self.scatter.iter().map(of_mean).collect(),
            self.measured,
            count - 1,
            pooling,
            relative,
        )?;
        let rounding = self.rounding();
        Ok(if rounding.iter().all(|variance| *variance == 0.0) {
            noise
        } else {
            noise.with_more(&rounding, self.measured, self.lines.sampling().len())
        })
    }

    /// Returns whether the force is equal in every period up to rounding, because it was computed
    /// and not measured.
    fn force_repeats(&self) -> bool {
        let (n, count) = (self.dof, self.count as f64);
        let scatter = self.scatter.iter().map(|s| (n..2 * n).map(|i| s[(i, i)].re).sum::<f64>());
        let rms = (scatter.sum::<f64>() / count).sqrt();
        rms <= PERIODS_REPEATS * self.sum.columns(n, n).norm() / count
    }

    fn at_least(&self, needed: usize) -> Result<(), SpectraError> {
        match self.count {
            got if got < needed => Err(SpectraError::TooFewAverages { got, needed }),
            _ => Ok(()),
        }
    }

    fn data(&self, mean: DMatrix<Complex<f64>>) -> Result<FrequencyData, SpectraError> {
        let n = self.dof;
        let (motion, force) = (mean.columns(0, n).into_owned(), mean.columns(n, n).into_owned());
        FrequencyData::from_amplitudes(self.lines.omega(), force, motion, self.measured)
    }
}

/// Returns the part of the variance of the rounding error that is equal in all periods. The
/// argument is the `scatter` of the quantised values between periods. Both are variances, in units
/// of the squared step.
///
/// If the position between two steps is uniformly distributed, rounding and noise of variance s²
/// together have the variance s² + 1/12. The scatter is this variance minus the part that is equal
/// in all periods.
fn common_rounding(scatter: f64) -> f64 {
    let beside = |variance: f64| -> f64 {
        let term = |k: i32| {
            let k2 = f64::from(k * k);
            (-4.0 * PI * PI * k2 * variance).exp() / (2.0 * PI * PI * k2)
        };
        (1..=PERIODS_TERMS).map(term).sum()
    };
    let (mut low, mut high) = (0.0, scatter.max(0.0));
    for _ in 0..PERIODS_HALVINGS {
        let middle = 0.5 * (low + high);
        if middle + 1.0 / 12.0 - beside(middle) < scatter { low = middle } else { high = middle }
    }
    beside(high)
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Sampling, noise};

    use super::*;

    /// The variance of the rounding error that is equal in all periods is computed from the scatter
    /// alone, and agrees with the error of simulated rounded samples.
    #[test]
    fn rounding_alike_is_found_from_the_scatter() {
        const SAMPLES: usize = 4000;
        const PERIODS: usize = 50;
        let drawn = noise::white(Sampling::new(1.0, SAMPLES).unwrap(), PERIODS, 1.0, 3).unwrap();
        for deviation in [0.0, 0.01, 0.03, 0.1, 0.2, 0.3, 0.5] {
            let (mut scatter, mut together) = (0.0, 0.0);
            for k in 0..SAMPLES {
                let exact = 100.0 * (0.618_034 * k as f64).fract();
                let rounded =
                    |period: usize| (exact + deviation * drawn.channel(period)[k]).round();
                let all: Vec<f64> = (0..PERIODS).map(rounded).collect();
                let mean = all.iter().sum::<f64>() / PERIODS as f64;
                let own =
                    all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (PERIODS - 1) as f64;
                scatter += own / SAMPLES as f64;
                // The variance of the mean is the scatter of a period divided by the number of
                // periods, plus the part that is equal in all periods.
                together += ((mean - exact).powi(2) - own / PERIODS as f64) / SAMPLES as f64;
            }
            let found = common_rounding(scatter);
            assert!((found - together).abs() < 0.004, "{deviation}: {found} {together}");
        }
    }
}
