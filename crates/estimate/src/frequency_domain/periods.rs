//! Repeated periods of one experiment: their mean, their scatter, and independent halves.

use mechid_signal::Record;
use nalgebra::{Complex, DMatrix};

use super::{FrequencyData, Lines, Motion, NoiseSpectrum, Pooling};
use crate::EstimateError;

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
    omega: Vec<f64>,
    measured: Motion,
    dof: usize,
    /// Per period: lines × 2n, first the motions as measured, then the forces.
    amplitudes: Vec<DMatrix<Complex<f64>>>,
}

impl RepeatedPeriods {
    /// Splits records of several whole periods; `lines` belong to one period, and the
    /// incomplete period at the end, if there is one, is left out.
    ///
    /// # Errors
    /// [`EstimateError::Size`] if the records have not the same number of channels,
    /// [`EstimateError::Signal`] if they have not the same time axis, not the time step
    /// of the lines, or less than one period.
    pub fn new(
        lines: &Lines,
        force: &Record,
        motion: &Record,
        measured: Motion,
    ) -> Result<Self, EstimateError> {
        force.check_same_sampling(motion)?;
        let period = lines.sampling().len();
        // The window also refuses records shorter than a period.
        super::lines::check_sampling(lines.sampling(), force.window(0, period)?.sampling())?;
        let dof = force.channels();
        if motion.channels() != dof || dof == 0 {
            let (got, expected) = (motion.channels(), dof.max(1));
            return Err(EstimateError::Size { what: "channels of the motion", got, expected });
        }
        let amplitudes = (0..force.len() / period)
            .map(|p| {
                let mut both = DMatrix::zeros(lines.as_slice().len(), 2 * dof);
                both.columns_mut(0, dof).copy_from(&lines.read_window(motion, p * period));
                both.columns_mut(dof, dof).copy_from(&lines.read_window(force, p * period));
                both
            })
            .collect();
        Ok(Self { omega: lines.omega(), measured, dof, amplitudes })
    }

    /// Number of whole periods.
    pub fn count(&self) -> usize {
        self.amplitudes.len()
    }

    /// The mean over all periods, without a statement on its noise.
    ///
    /// # Errors
    /// As [`FrequencyData::from_amplitudes`].
    pub fn mean(&self) -> Result<FrequencyData, EstimateError> {
        self.mean_of(0..self.count())
    }

    /// The mean over all periods with the noise that their scatter shows.
    ///
    /// # Errors
    /// As [`RepeatedPeriods::mean`] and [`RepeatedPeriods::noise`].
    pub fn mean_with_noise(&self, pooling: Pooling) -> Result<FrequencyData, EstimateError> {
        self.mean()?.with_noise(self.noise(pooling)?)
    }

    /// The means over the first and the second half of the periods (the middle one of an
    /// odd number is left out): two measurements of the same signal with independent noise.
    ///
    /// # Errors
    /// [`EstimateError::TooFewAverages`] if there is only one period.
    pub fn halves(&self) -> Result<(FrequencyData, FrequencyData), EstimateError> {
        let count = self.count();
        if count < 2 {
            return Err(EstimateError::TooFewAverages { got: count, needed: 2 });
        }
        let half = count / 2;
        Ok((self.mean_of(0..half)?, self.mean_of(count - half..count)?))
    }

    /// Covariance of the mean over the periods, of displacement (m) and force (N), line by line or
    /// pooled over lines.
    ///
    /// A force that is the same in every period to rounding is taken as exact.
    ///
    /// # Errors
    /// [`EstimateError::TooFewAverages`] if there is only one period.
    pub fn noise(&self, pooling: Pooling) -> Result<NoiseSpectrum, EstimateError> {
        let count = self.count();
        if count < 2 {
            return Err(EstimateError::TooFewAverages { got: count, needed: 2 });
        }
        let mean = self.mean_amplitudes(0..count);
        // Of the mean: the scatter of one period, divided by their number once more.
        let scale = Complex::from(1.0 / ((count - 1) * count) as f64);
        let covariance = (0..self.omega.len()).map(|line| self.scatter(line, &mean) * scale);
        let noise = NoiseSpectrum::of_measured(
            &self.omega,
            covariance.collect(),
            self.measured,
            count - 1,
            pooling,
        )?;
        Ok(if self.force_repeats(&mean) { noise.with_exact_force() } else { noise })
    }

    /// Σ (z − z̄)(z − z̄)ᴴ over the periods, 2n×2n.
    fn scatter(&self, line: usize, mean: &DMatrix<Complex<f64>>) -> DMatrix<Complex<f64>> {
        let size = 2 * self.dof;
        let mut sum = DMatrix::zeros(size, size);
        for period in &self.amplitudes {
            let deviation = |c: usize| period[(line, c)] - mean[(line, c)];
            for j in 0..size {
                for i in 0..size {
                    sum[(i, j)] += deviation(i) * deviation(j).conj();
                }
            }
        }
        sum
    }

    /// Whether the force is the same in every period, to rounding: a computed one, not measured.
    fn force_repeats(&self, mean: &DMatrix<Complex<f64>>) -> bool {
        let force = mean.columns(self.dof, self.dof);
        let rounding = 1e-12 * force.norm();
        self.amplitudes.iter().all(|p| (p.columns(self.dof, self.dof) - force).norm() <= rounding)
    }

    fn mean_of(&self, periods: std::ops::Range<usize>) -> Result<FrequencyData, EstimateError> {
        let mean = self.mean_amplitudes(periods);
        let n = self.dof;
        let (motion, force) = (mean.columns(0, n).into_owned(), mean.columns(n, n).into_owned());
        FrequencyData::from_amplitudes(self.omega.clone(), force, motion, self.measured)
    }

    fn mean_amplitudes(&self, periods: std::ops::Range<usize>) -> DMatrix<Complex<f64>> {
        let count = periods.len() as f64;
        let mut mean = DMatrix::zeros(self.omega.len(), 2 * self.dof);
        for period in &self.amplitudes[periods] {
            mean += period;
        }
        mean.unscale(count)
    }
}
