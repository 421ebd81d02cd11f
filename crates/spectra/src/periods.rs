//! Repeated periods of one experiment: their mean, their scatter, and independent halves.

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

/// Forces and motions at chosen lines, period by period, of a steady periodic experiment.
///
/// What repeats from period to period is the signal, what does not is noise: no
/// model is needed to tell one from the other.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*,
/// the chapters on nonparametric noise models and on periodic excitations.
#[derive(Debug, Clone)]
pub struct RepeatedPeriods {
    lines: Lines,
    measured: ResponseQuantity,
    dof: usize,
    /// Periods to come, by which they are split into halves.
    expected: usize,
    count: usize,
    /// Sums of all periods, and of the first and the second half of those expected: lines × 2n, first the
    /// motions as measured, then the forces.
    sum: DMatrix<Complex<f64>>,
    half_sums: [DMatrix<Complex<f64>>; 2],
    /// Per line Σ (z − z̄)(z − z̄)ᴴ over the periods so far, 2n×2n, or what is as large: from between the lines
    /// of periods taken as one.
    scatter: Vec<DMatrix<Complex<f64>>>,
    /// Periods whose scatter is still to come.
    together: BetweenLines,
    /// Their sum.
    together_sum: DMatrix<Complex<f64>>,
    /// Steps in which the values of each channel come, 2n; zero where they do not.
    steps: Vec<f64>,
}

impl RepeatedPeriods {
    /// Splits records of several whole periods; `lines` belong to one period, and the
    /// incomplete period at the end, if there is one, is left out.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if the records have not the same number of channels,
    /// [`SpectraError::Signal`] if they have not the same time axis, not the time step
    /// of the lines, or less than one period.
    pub fn new(
        lines: &Lines,
        force: &Record,
        motion: &Record,
        measured: ResponseQuantity,
    ) -> Result<Self, SpectraError> {
        let periods = force.len() / lines.sampling().len();
        let mut all = Self::expecting(lines, force.channels(), measured, periods);
        all.push(force, motion)?;
        Ok(all)
    }

    /// No periods yet of a machine of `dof` degrees of freedom; `periods` are to come, a few at a time:
    /// memory does not grow with their number.
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

    /// States the steps that the values of the channels come in, motions (in the unit measured) before forces (N),
    /// zero where they are not rounded: an error of step/√12, which is the same in all periods of a channel
    /// without other noise and so not part of their scatter.
    ///
    /// # Errors
    /// [`NumericsError::Size`] unless there is one step per channel.
    ///
    /// # Source
    /// Widrow & Kollár, *Quantization Noise* (2008), chapter on dither: beside noise of the standard deviation s steps q
    /// leave Σ q²/(2π²k²) exp(−4π²k²s²/q²) of the error alike from period to period.
    pub fn with_quantisation(mut self, steps: Vec<f64>) -> Result<Self, SpectraError> {
        check_size("quantisation steps", 2 * self.dof, steps.len())?;
        self.steps = steps;
        Ok(self)
    }

    /// Variance on the samples of each channel, 2n, of the rounding that is alike in all periods.
    fn rounding(&self) -> Vec<f64> {
        let (samples, count) = (self.lines.sampling().len() as f64, self.count as f64);
        let of_channel = |(channel, step): (usize, &f64)| {
            let powers = self.scatter.iter().map(|s| s[(channel, channel)].re);
            let of_noise =
                powers.sum::<f64>() / self.scatter.len().max(1) as f64 / (count - 1.0).max(1.0);
            let scatter = of_noise * samples / 4.0;
            if *step > 0.0 { step * step * alike(scatter / (step * step)) } else { 0.0 }
        };
        self.steps.iter().enumerate().map(of_channel).collect()
    }

    /// No periods yet of those that are taken as one next, where `remaining` are to come.
    fn together(lines: &Lines, dof: usize, remaining: usize) -> BetweenLines {
        let (period, channels) = (lines.sampling().len(), 2 * dof);
        BetweenLines::new(periods_as_one(remaining, period, channels), period, channels)
    }

    /// Adds the whole periods of a stretch of force (N) and motion, one period or more; an incomplete
    /// one at its end is left out.
    ///
    /// # Errors
    /// As [`RepeatedPeriods::new`]; then nothing is added.
    pub fn push(&mut self, force: &Record, motion: &Record) -> Result<(), SpectraError> {
        force.check_same_sampling(motion)?;
        let period = self.lines.sampling().len();
        // The window also refuses records shorter than a period.
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
            self.together.hold(channels);
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

    /// Adds the scatter of the last `periods`: what is between their lines, and how far their mean is from that
    /// of all before.
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

    /// Number of whole periods.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The lines that are read of each.
    pub fn lines(&self) -> &Lines {
        &self.lines
    }

    /// The mean over all periods, without a statement on its noise.
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

    /// The mean over all periods with the noise that their scatter shows.
    ///
    /// # Errors
    /// As [`RepeatedPeriods::mean`] and [`RepeatedPeriods::noise`].
    pub fn mean_with_noise(&self, pooling: Pooling) -> Result<FrequencyData, SpectraError> {
        self.mean()?.with_noise(self.noise(pooling)?)
    }

    /// The means over the first and the second half of the periods (the middle one of an
    /// odd number is left out): two measurements of the same signal with independent noise.
    ///
    /// # Errors
    /// [`SpectraError::TooFewAverages`] if there is only one period, or not yet all of those
    /// expected.
    pub fn halves(&self) -> Result<(FrequencyData, FrequencyData), SpectraError> {
        self.at_least(self.expected.max(2))?;
        let count = (self.expected / 2) as f64;
        let [first, second] = &self.half_sums;
        Ok((self.data(first.unscale(count))?, self.data(second.unscale(count))?))
    }

    /// Covariance of the mean over the periods, of displacement (m) and force (N), line by line or
    /// pooled over lines; [`NoiseSpectrum::models`] tells what was chosen.
    ///
    /// Three to 16 periods in a row, as far as memory allows, are taken as one record, between whose lines of a
    /// period there is noise only; for the rest their means scatter.
    /// A force that is the same in every period to rounding is taken as exact.
    ///
    /// # Errors
    /// [`SpectraError::TooFewAverages`] if there is only one period, or not yet all of those expected.
    ///
    /// # Source
    /// Pintelon & Schoukens, the chapters of above: noise on the lines that are not excited.
    /// McCullagh & Nelder, *Generalized Linear Models* (1989), chapter 8 (smooth spectra: variances with
    /// a logarithmic link); Schwarz (1978), Annals of Statistics 6, 461–464 (order and bands); Stone
    /// (1974), Journal of the Royal Statistical Society B 36, 111–147 (choice by prediction).
    pub fn noise(&self, pooling: Pooling) -> Result<NoiseSpectrum, SpectraError> {
        self.noise_relative_to(pooling, None)
    }

    /// The same where a smooth spectrum may also be that of the response of a `machine` to unmeasured forces.
    ///
    /// # Errors
    /// The errors of [`RepeatedPeriods::noise`]; [`NumericsError::Size`] for a machine of other degrees of freedom.
    ///
    /// # Source
    /// The sources of [`RepeatedPeriods::noise`].
    pub fn noise_beside(
        &self,
        pooling: Pooling,
        machine: &SecondOrderSystem,
    ) -> Result<NoiseSpectrum, SpectraError> {
        let (n, omega) = (self.dof, self.lines.omega());
        let (what, got) = ("degrees of freedom of the machine", machine.dof());
        if got != n {
            return Err(NumericsError::Size { what, got, expected: n }.into());
        }
        // At a pole on a line the noise has no level to compare with.
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
        // Of the mean: the scatter of one period, divided by their number once more.
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
        let noise = NoiseSpectrum::of_measured(
            &self.lines.omega(),
            self.scatter.iter().map(of_mean).collect(),
            self.measured,
            count - 1,
            pooling,
            relative,
        )?;
        let rounding = self.rounding();
        Ok(match rounding.iter().all(|variance| *variance == 0.0) {
            true => noise,
            false => noise.with_more(&rounding, self.measured, self.lines.sampling().len()),
        })
    }

    /// Returns whether the force is the same in every period, to rounding: a computed one, not measured.
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

/// Variance of rounding to steps of 1 that is alike in all periods, beside noise of which values in steps scatter so much
/// (variances, in squares of a step).
///
/// With a uniform place between two steps the error of rounding and noise together has the variance s² + 1/12, of
/// which the scatter has what is not alike.
fn alike(scatter: f64) -> f64 {
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
        match middle + 1.0 / 12.0 - beside(middle) < scatter {
            true => low = middle,
            false => high = middle,
        }
    }
    beside(high)
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Sampling, noise};

    use super::*;

    /// Judge: rounded samples themselves.
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
                // The mean has the scatter of a period over their number beside what is alike.
                together += ((mean - exact).powi(2) - own / PERIODS as f64) / SAMPLES as f64;
            }
            let found = alike(scatter);
            assert!((found - together).abs() < 0.004, "{deviation}: {found} {together}");
        }
    }
}
