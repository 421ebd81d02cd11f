//! Covariance of measurement noise, frequency by frequency.

use mechid_model::ResponseQuantity;
use mechid_numerics::NumericsError;
use mechid_signal::Sampling;
use nalgebra::{Complex, DMatrix};

use crate::SpectraError;
use crate::noise::pooling::{NoiseModel, Pooled, Pooling, pooled};
use crate::thinning::thinned_rows;

/// Covariance of the measured displacement and force amplitudes, one matrix per row of data.
///
/// Each row has the Hermitian 2n×2n matrix E[z zᴴ] with z = (ΔX₁ … ΔXₙ, ΔF₁ … ΔFₙ), in m², m·N and
/// N², for one-sided amplitudes scaled as in [`mechid_signal::spectrum`]. The noise is circular:
/// real and imaginary parts are independent and have equal variances.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseSpectrum {
    omega: Vec<f64>,
    covariance: Vec<DMatrix<Complex<f64>>>,
    degrees_of_freedom: f64,
    total_degrees_of_freedom: f64,
    models: Vec<NoiseModel>,
    /// Basis functions of the fit of each model; `None` unless the model is a smooth spectrum or
    /// white.
    parts: Vec<Option<SmoothPart>>,
}

/// Basis functions of the fit to the log powers of an experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothPart {
    /// Orthonormal columns, rows × terms, dimensionless.
    pub basis: DMatrix<f64>,
    /// Number of complex deviations of each sample covariance, a pure number.
    pub nu: f64,
}

impl NoiseSpectrum {
    /// Creates a spectrum from a known covariance per row, at `omega` (rad/s).
    ///
    /// # Errors
    /// [`NumericsError::Size`] if there is not one matrix per frequency, or if the matrices are not
    /// square and of the same even size, [`SpectraError::NoiseVariance`] if a variance is negative
    /// or not finite.
    pub fn new(
        omega: Vec<f64>,
        covariance: Vec<DMatrix<Complex<f64>>>,
    ) -> Result<Self, SpectraError> {
        if covariance.len() != omega.len() || omega.is_empty() {
            let (got, expected) = (covariance.len(), omega.len().max(1));
            return Err(NumericsError::Size { what: "noise covariances", got, expected }.into());
        }
        let size = covariance[0].nrows();
        let expected = 2 * size.div_ceil(2).max(1);
        for (row, c) in covariance.iter().enumerate() {
            if let Some(&got) = [c.nrows(), c.ncols()].iter().find(|s| **s != expected) {
                return Err(NumericsError::Size {
                    what: "rows or columns of a noise covariance",
                    got,
                    expected,
                }
                .into());
            }
            let bad = |v: &Complex<f64>| !(v.re >= 0.0 && v.re.is_finite());
            if let Some(column) = c.diagonal().iter().position(bad) {
                let value = c[(column, column)].re;
                return Err(SpectraError::NoiseVariance { row, column, value });
            }
        }
        let known = f64::INFINITY;
        Ok(Self {
            omega,
            covariance,
            degrees_of_freedom: known,
            total_degrees_of_freedom: known,
            models: Vec::new(),
            parts: Vec::new(),
        })
    }

    /// Returns the covariances of one of every `step` rows, the same rows as in
    /// [`FrequencyData::thinned`](crate::FrequencyData::thinned). The covariances count as known.
    /// `None` for a step of 0.
    pub fn thinned(&self, step: usize) -> Option<Self> {
        let rows = thinned_rows(self.omega.len(), step);
        let omega = rows.iter().map(|row| self.omega[*row]).collect();
        Self::new(omega, rows.iter().map(|row| self.covariance[*row].clone()).collect()).ok()
    }

    /// Creates white noise of known standard deviation on the samples of every response channel (in
    /// the measured unit) and force channel (N), on the spectral lines of one period: E|X_n|² = 4
    /// s²/N. For the mean of P periods, divide the standard deviations by √P.
    ///
    /// # Errors
    /// As [`NoiseSpectrum::new`].
    ///
    /// # Source
    /// Brillinger, *Time Series: Data Analysis and Theory* (1981), chapter 4 (the finite Fourier
    /// transform of white noise).
    pub fn white(
        sampling: Sampling,
        lines: &[usize],
        measured: ResponseQuantity,
        motion_deviation: &[f64],
        force_deviation: &[f64],
    ) -> Result<Self, SpectraError> {
        let diagonal: Vec<_> = motion_deviation
            .iter()
            .chain(force_deviation)
            .map(|s| Complex::from(variance_on_lines(*s, sampling.len())))
            .collect();
        let one = DMatrix::from_diagonal(&diagonal.into());
        let omega: Vec<f64> = lines.iter().map(|&n| n as f64 * sampling.omega0()).collect();
        let mut covariance = vec![one; lines.len()];
        to_displacement(&omega, &mut covariance, measured);
        Self::new(omega, covariance)
    }

    /// Estimates the spectrum from sample covariances of the measured quantity, each with
    /// `degrees_of_freedom`. Instead of the spectrum, the ratio of the spectrum to the `relative`
    /// powers of the channels (rows × 2n) may be smooth.
    ///
    /// # Errors
    /// As [`NoiseSpectrum::new`].
    pub fn from_measured(
        omega: &[f64],
        covariance: Vec<DMatrix<Complex<f64>>>,
        measured: ResponseQuantity,
        degrees_of_freedom: usize,
        pooling: Pooling,
        relative: Option<&DMatrix<f64>>,
    ) -> Result<Self, SpectraError> {
        let Pooled { mut covariance, model, freedom, basis } =
            pooled(omega, covariance, degrees_of_freedom as f64, pooling, relative);
        to_displacement(omega, &mut covariance, measured);
        let known = Self::new(omega.to_vec(), covariance)?;
        Ok(Self {
            degrees_of_freedom: freedom,
            total_degrees_of_freedom: (degrees_of_freedom * omega.len()) as f64,
            models: vec![model],
            parts: vec![basis.map(|basis| SmoothPart { basis, nu: degrees_of_freedom as f64 })],
            ..known
        })
    }

    /// Returns the noise plus white noise on the samples of each channel. There are 2n variances of
    /// the samples: responses in the square of the measured unit, forces in N².
    ///
    /// # Source
    /// As [`NoiseSpectrum::white`].
    pub fn with_more(
        mut self,
        variance: &[f64],
        measured: ResponseQuantity,
        samples: usize,
    ) -> Self {
        let n = self.dof();
        for (c, omega) in self.covariance.iter_mut().zip(&self.omega) {
            let per_displacement = measured.per_displacement(*omega).norm_sqr();
            for (channel, variance) in variance.iter().enumerate() {
                let unit = if channel < n { per_displacement } else { 1.0 };
                let on_lines = variance_on_lines(variance.sqrt(), samples);
                c[(channel, channel)] += Complex::from(on_lines / unit);
            }
        }
        self
    }

    /// Returns the same noise with an exactly known force.
    pub fn with_exact_force(mut self) -> Self {
        let n = self.dof();
        for c in &mut self.covariance {
            c.rows_mut(n, n).fill(Complex::default());
            c.columns_mut(n, n).fill(Complex::default());
        }
        self
    }

    /// Returns the same noise with these variances of the forces, rows × n, in N², independent of
    /// all other noise.
    pub fn with_force_variance(mut self, variance: &DMatrix<f64>) -> Self {
        let n = self.dof();
        for (c, variance) in self.covariance.iter_mut().zip(variance.row_iter()) {
            for (channel, variance) in variance.iter().enumerate() {
                c[(n + channel, n + channel)] = Complex::from(*variance);
            }
        }
        self
    }

    /// Returns the noise of data whose force is delayed by `delay` seconds.
    ///
    /// # Source
    /// The shift theorem of Fourier transforms.
    pub fn with_later_force(&self, delay: f64) -> Self {
        let mut later = self.clone();
        for (c, omega) in later.covariance.iter_mut().zip(&self.omega) {
            let (n, turn) = (c.nrows() / 2, Complex::cis(-omega * delay));
            c.rows_mut(n, n).apply(|v| *v *= turn);
            c.columns_mut(n, n).apply(|v| *v *= turn.conj());
        }
        later
    }

    /// Returns the number of degrees of freedom n of the system; the matrices are 2n×2n.
    pub fn dof(&self) -> usize {
        self.covariance[0].nrows() / 2
    }

    /// Returns the angular frequency of every row, in rad/s.
    pub fn omega(&self) -> &[f64] {
        &self.omega
    }

    /// Returns E[z zᴴ] of a row, 2n×2n: displacements (m) first, then forces (N).
    ///
    /// # Panics
    /// If there is no such row.
    pub fn covariance(&self, row: usize) -> &DMatrix<Complex<f64>> {
        &self.covariance[row]
    }

    /// Returns the number of independent complex deviations of each covariance; infinite for known
    /// noise.
    pub fn degrees_of_freedom(&self) -> f64 {
        self.degrees_of_freedom
    }

    /// Returns the total number of independent complex deviations of all covariances; infinite for
    /// known noise.
    pub fn deviations(&self) -> f64 {
        self.total_degrees_of_freedom
    }

    /// Returns the same noise with `model` as the form of its spectrum.
    #[must_use]
    pub fn with_model(self, model: NoiseModel) -> Self {
        Self { models: vec![model], ..self }
    }

    /// Returns the forms of the estimated spectra, one for each experiment; empty for known noise.
    pub fn models(&self) -> &[NoiseModel] {
        &self.models
    }

    /// Returns the basis functions of the fit to the log powers, experiment by experiment. `None`
    /// if a spectrum is neither smooth nor white, or if all spectra are white.
    pub fn smooth_parts(&self) -> Option<Vec<&SmoothPart>> {
        let parts: Option<Vec<&SmoothPart>> = self.parts.iter().map(Option::as_ref).collect();
        parts.filter(|parts| parts.iter().any(|part| part.basis.ncols() > 1))
    }

    /// Returns the number of independent covariances; infinite or undefined for known noise.
    pub fn groups(&self) -> f64 {
        self.total_degrees_of_freedom / self.degrees_of_freedom
    }

    /// Returns whether any force is noisy.
    pub fn has_force(&self) -> bool {
        let n = self.dof();
        self.covariance.iter().any(|c| (n..2 * n).any(|i| c[(i, i)].re > 0.0))
    }

    /// Returns the degrees of freedom of a variance averaged over all rows, for Student's t. For
    /// known noise the number is large, so that Student's t is nearly a normal distribution.
    pub fn total_degrees_of_freedom(&self) -> usize {
        // The real and the imaginary part of a deviation each count.
        (2.0 * self.total_degrees_of_freedom).min(1e6) as usize
    }

    /// Returns ν/(ν − n), the ratio of the mean of Ŝ⁻¹ to S⁻¹. Ŝ is a sample covariance of n =
    /// `channels` channels from ν complex deviations, and S is the true covariance.
    pub fn mean_inverse_ratio(&self, channels: usize) -> f64 {
        let nu = self.degrees_of_freedom;
        if nu.is_infinite() { 1.0 } else { nu / (nu - channels as f64) }
    }

    /// Returns the noise with every entry of the covariances multiplied by `factor`, a pure number:
    /// for example the noise of a mean of fewer periods.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.covariance.iter_mut().for_each(|c| c.scale_mut(factor));
        self
    }

    /// Returns the rows of `self` followed by the rows of `other`: the noise of two experiments.
    pub fn chain(&self, other: &Self) -> Self {
        Self {
            omega: [&self.omega[..], &other.omega].concat(),
            covariance: [&self.covariance[..], &other.covariance].concat(),
            // The less certain covariance limits the accuracy of the weights.
            degrees_of_freedom: self.degrees_of_freedom.min(other.degrees_of_freedom),
            total_degrees_of_freedom: self.total_degrees_of_freedom
                + other.total_degrees_of_freedom,
            models: [&self.models[..], &other.models].concat(),
            parts: [&self.parts[..], &other.parts].concat(),
        }
    }
}

/// Returns E|X_n|² = 4 s²/N of a line from N samples with white noise of standard deviation s.
pub fn variance_on_lines(deviation: f64, samples: usize) -> f64 {
    4.0 * deviation * deviation / samples as f64
}

/// Converts covariances of the measured quantity to covariances of displacement.
fn to_displacement(
    omega: &[f64],
    covariance: &mut [DMatrix<Complex<f64>>],
    measured: ResponseQuantity,
) {
    if measured == ResponseQuantity::Displacement {
        return;
    }
    for (c, &w) in covariance.iter_mut().zip(omega) {
        let n = c.nrows() / 2;
        let factor = measured.per_displacement(w).inv();
        c.rows_mut(0, n).apply(|v| *v *= factor);
        c.columns_mut(0, n).apply(|v| *v *= factor.conj());
    }
}
