//! The covariance of measurement noise, frequency by frequency.

use mechid_model::ResponseQuantity;
use mechid_numerics::NumericsError;
use mechid_signal::Sampling;
use nalgebra::{Complex, DMatrix};

use crate::SpectraError;
use crate::noise::pooling::{NoiseModel, Pooled, Pooling, pooled};

/// Covariance of the measured displacement and force amplitudes, one matrix per row of data.
///
/// For every row the Hermitian 2n×2n matrix E[z zᴴ] with z = (ΔX₁ … ΔXₙ, ΔF₁ … ΔFₙ),
/// in m², m·N and N², of one-sided amplitudes scaled as in [`mechid_signal::spectrum`].
/// The noise is circular: real and imaginary part are independent and equally large.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseSpectrum {
    omega: Vec<f64>,
    covariance: Vec<DMatrix<Complex<f64>>>,
    degrees_of_freedom: f64,
    total_degrees_of_freedom: f64,
    models: Vec<NoiseModel>,
    /// Functions that each of the models was fitted with, if it is a smooth spectrum or white.
    parts: Vec<Option<SmoothPart>>,
}

/// Functions that the log powers of an experiment were fitted with.
#[derive(Debug, Clone, PartialEq)]
pub struct SmoothPart {
    /// Orthonormal columns, rows × terms.
    /// Dimensionless.
    pub basis: DMatrix<f64>,
    /// Complex deviations that each sample covariance was made of.
    /// A pure number.
    pub nu: f64,
}

impl NoiseSpectrum {
    /// A known covariance per row, at `omega` (rad/s).
    ///
    /// # Errors
    /// [`NumericsError::Size`] if there is not one matrix per frequency,
    /// [`NumericsError::Size`] if they are not square of one even size,
    /// [`SpectraError::NoiseVariance`] if a variance is negative or not finite.
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

    /// White noise of known standard deviation on the samples of every motion channel (in
    /// the unit measured) and force channel (N), as it stands on spectral lines of one
    /// period: E|X_n|² = 4 s²/N. For the mean of P periods divide both by √P.
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

    /// Makes the spectrum from sample covariances of the quantity measured, each of `degrees_of_freedom`; it may
    /// be smooth over the `relative` powers of the channels (rows × 2n) instead of being smooth itself.
    ///
    /// # Errors
    /// As [`NoiseSpectrum::new`].
    pub fn of_measured(
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

    /// The same noise and beside it white noise of these variances on the samples of each channel, 2n: motions in
    /// the square of the unit measured, forces in N².
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

    /// The same noise with the force taken as known exactly.
    pub fn with_exact_force(mut self) -> Self {
        let n = self.dof();
        for c in &mut self.covariance {
            c.rows_mut(n, n).fill(Complex::default());
            c.columns_mut(n, n).fill(Complex::default());
        }
        self
    }

    /// The same noise with these variances of the forces, rows × n, in N², independent of all others.
    pub fn with_force_variance(mut self, variance: &DMatrix<f64>) -> Self {
        let n = self.dof();
        for (c, variance) in self.covariance.iter_mut().zip(variance.row_iter()) {
            for (channel, variance) in variance.iter().enumerate() {
                c[(n + channel, n + channel)] = Complex::from(*variance);
            }
        }
        self
    }

    /// The noise of data whose force is `delay` seconds later.
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

    /// Degrees of freedom n of the system; the matrices are 2n×2n.
    pub fn dof(&self) -> usize {
        self.covariance[0].nrows() / 2
    }

    /// Angular frequency of every row, in rad/s.
    pub fn omega(&self) -> &[f64] {
        &self.omega
    }

    /// E[z zᴴ] of a row, 2n×2n: displacements (m) first, then forces (N).
    ///
    /// # Panics
    /// If there is no such row.
    pub fn covariance(&self, row: usize) -> &DMatrix<Complex<f64>> {
        &self.covariance[row]
    }

    /// Number of independent complex deviations that each covariance was averaged from;
    /// infinite for known noise.
    pub fn degrees_of_freedom(&self) -> f64 {
        self.degrees_of_freedom
    }

    /// Returns the number of independent complex deviations that all covariances together are made of;
    /// infinite for known noise.
    pub fn deviations(&self) -> f64 {
        self.total_degrees_of_freedom
    }

    /// Spectra that were made of samples, one of each experiment; none of known noise.
    pub fn models(&self) -> &[NoiseModel] {
        &self.models
    }

    /// Returns the functions that the log powers were fitted with, experiment by experiment; `None` unless each
    /// of them is smooth or white, and at least one is not white.
    pub fn smooth_parts(&self) -> Option<Vec<&SmoothPart>> {
        let parts: Option<Vec<&SmoothPart>> = self.parts.iter().map(Option::as_ref).collect();
        parts.filter(|parts| parts.iter().any(|part| part.basis.ncols() > 1))
    }

    /// Returns the number of covariances independent of one another; infinite or undefined for known
    /// noise.
    pub fn groups(&self) -> f64 {
        self.total_degrees_of_freedom / self.degrees_of_freedom
    }

    /// Returns whether any force is noisy.
    pub fn has_force(&self) -> bool {
        let n = self.dof();
        self.covariance.iter().any(|c| (n..2 * n).any(|i| c[(i, i)].re > 0.0))
    }

    /// Degrees of freedom of a variance averaged over all rows, for Student's t; known noise
    /// has as many as make it the normal distribution.
    pub fn total_degrees_of_freedom(&self) -> usize {
        // Real and imaginary deviations both count.
        (2.0 * self.total_degrees_of_freedom).min(1e6) as usize
    }

    /// E[Ŝ⁻¹] S of a sample covariance Ŝ of `channels` channels: ν/(ν − n).
    pub fn mean_inverse_ratio(&self, channels: usize) -> f64 {
        let nu = self.degrees_of_freedom;
        if nu.is_infinite() { 1.0 } else { nu / (nu - channels as f64) }
    }

    /// Rows of `self`, then those of `other`: the noise of two experiments.
    pub fn chain(&self, other: &Self) -> Self {
        Self {
            omega: [&self.omega[..], &other.omega].concat(),
            covariance: [&self.covariance[..], &other.covariance].concat(),
            // The more uncertain of the two decides how far the weights can be trusted.
            degrees_of_freedom: self.degrees_of_freedom.min(other.degrees_of_freedom),
            total_degrees_of_freedom: self.total_degrees_of_freedom
                + other.total_degrees_of_freedom,
            models: [&self.models[..], &other.models].concat(),
            parts: [&self.parts[..], &other.parts].concat(),
        }
    }
}

/// E|X_n|² = 4 s²/N of a line of N samples that have white noise of the standard deviation s.
pub fn variance_on_lines(deviation: f64, samples: usize) -> f64 {
    4.0 * deviation * deviation / samples as f64
}

/// Turns covariances of the quantity measured into covariances of displacement.
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
