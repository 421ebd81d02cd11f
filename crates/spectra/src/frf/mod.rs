//! Frequency response functions and coherence from measured forces and responses.

mod average;
mod cross_spectra;
mod interleaved;
mod scatter;
mod segments;

use mechid_model::ResponseQuantity;
use mechid_numerics::{NumericsError, check_size};
use mechid_signal::Record;
use nalgebra::{Complex, DMatrix};

pub use self::average::FrfAverage;
use self::cross_spectra::CrossSpectra;
pub use self::interleaved::{Crosstalk, InterleavedResponses};
use self::scatter::Scatter;
pub use self::scatter::smoothing_bias;
pub use self::segments::Segments;
use crate::SpectraError;
use crate::frequency_data::FrequencyData;
use crate::limits::COHERENCE_ROUNDING;
use crate::lines::Lines;

type ComplexMatrix = DMatrix<Complex<f64>>;

/// Estimator of a frequency response. The estimators differ in the signals that they assume to be
/// free of noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum FrfEstimator {
    /// S_XF S_FF⁻¹: unbiased if only the response is noisy; noise on the force makes the estimate
    /// too small.
    H1,
    /// S_XX S_FX⁻¹: unbiased if only the force is noisy; noise on the response makes the estimate
    /// too large. With several forces, the numbers of responses and forces must be equal.
    H2,
    /// Total least squares, with force and response scaled to equal power; for one force, the
    /// geometric mean of H1 and H2.
    Hv,
}

/// Response per unit force at chosen frequencies, with the coherence.
#[derive(Debug, Clone, PartialEq)]
pub struct Frf {
    omega: Vec<f64>,
    /// Number of the line of each frequency among the lines of a segment.
    lines: Vec<usize>,
    /// Correlation of the errors of two lines as a function of the distance of the lines: see
    /// [`Segments::line_correlation`].
    line_correlation: Vec<f64>,
    measured: ResponseQuantity,
    response: Vec<ComplexMatrix>,
    coherence: DMatrix<f64>,
    variance: Vec<DMatrix<f64>>,
    averages: f64,
    /// Covariances of the errors, in addition to the variances; `None` for responses from
    /// [`Frf::new`] and after the subtraction of crosstalk.
    scatter: Option<Scatter>,
}

impl Frf {
    /// Estimates frequency responses at some lines, from all segments of the records.
    ///
    /// Every force channel must contain a force; leave out the other channels.
    ///
    /// # Errors
    /// [`SpectraError::TooFewAverages`] unless there are more segments than forces,
    /// [`SpectraError::Hop`], [`SpectraError::DependentForces`] at a line where the forces are zero
    /// or proportional to one another in all segments, [`NumericsError::Size`] for H2 with several
    /// forces and another number of responses, and the errors of [`Lines::new`].
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapters 6, 7 and 9; Welch (1967).
    pub fn estimate(
        force: &Record,
        motion: &Record,
        measured: ResponseQuantity,
        segments: Segments,
        lines: impl IntoIterator<Item = usize>,
        estimator: FrfEstimator,
    ) -> Result<Self, SpectraError> {
        let lines = Lines::new(force.window(0, segments.samples())?.sampling(), lines)?;
        let mut average =
            FrfAverage::new(lines, [force.channels(), motion.channels()], measured, segments)?;
        average.push(force, motion)?;
        average.frf(estimator)
    }

    /// Creates responses that another program or instrument measured: a matrix responses × forces
    /// for each frequency, and the coherence of every response (frequencies × responses). Both come
    /// from this many independent averages.
    ///
    /// With several forces, the coherence is the multiple coherence; the forces are assumed to be
    /// uncorrelated and of equal size.
    ///
    /// # Errors
    /// [`NumericsError::Size`], [`SpectraError::Coherence`] outside (0, 1\],
    /// [`SpectraError::TooFewAverages`] unless there are more averages than forces.
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 9 (variance from the coherence).
    pub fn new(
        omega: Vec<f64>,
        response: Vec<ComplexMatrix>,
        coherence: DMatrix<f64>,
        averages: f64,
        measured: ResponseQuantity,
    ) -> Result<Self, SpectraError> {
        let size = check_size;
        size("frequency response matrices", omega.len(), response.len())?;
        size("rows of the coherence", omega.len(), coherence.nrows())?;
        let inputs = response.first().map_or(0, |h| h.ncols());
        for h in &response {
            size("rows of a frequency response matrix", coherence.ncols(), h.nrows())?;
            size("columns of a frequency response matrix", inputs, h.ncols())?;
        }
        if averages.is_nan() || averages <= inputs as f64 {
            let needed = inputs + 1;
            return Err(SpectraError::TooFewAverages { got: averages as usize, needed });
        }
        if let Some(&value) = coherence.iter().find(|c| !(**c > 0.0 && **c <= 1.0)) {
            return Err(SpectraError::Coherence { value });
        }
        let variance = response
            .iter()
            .zip(coherence.row_iter())
            .map(|(h, coherence)| {
                DMatrix::from_fn(h.nrows(), h.ncols(), |o, _| {
                    let power = h.row(o).norm_squared();
                    let unexplained = (1.0 / coherence[o] - 1.0).max(COHERENCE_ROUNDING);
                    power * unexplained / (averages - inputs as f64)
                })
            })
            .collect();
        let (lines, line_correlation) = ((0..omega.len()).collect(), vec![1.0]);
        Ok(Self {
            omega,
            lines,
            line_correlation,
            measured,
            response,
            coherence,
            variance,
            averages,
            scatter: None,
        })
    }

    /// Creates responses that another program computed as averages over this many segments, in the
    /// same way as [`Frf::new`]. The arguments also contain the lines of a segment and, if known,
    /// the standard errors of real and imaginary part (responses × forces, in the unit of the
    /// responses). The forces are assumed to be uncorrelated with each other, and so are the
    /// unexplained parts of the responses.
    ///
    /// # Errors
    /// As [`Frf::new`], and [`SpectraError::Hop`].
    ///
    /// # Source
    /// Welch (1967); Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 9.
    pub fn from_segments(
        lines: &Lines,
        response: Vec<ComplexMatrix>,
        coherence: DMatrix<f64>,
        standard_error: Option<&[DMatrix<f64>]>,
        (segments, count): (Segments, usize),
        measured: ResponseQuantity,
    ) -> Result<Self, SpectraError> {
        let averages = segments.averages(count)?;
        let coherence = match standard_error {
            // The standard errors are given, so a coherence of zero is not an error.
            Some(_) => coherence.map(|c| c.max(f64::MIN_POSITIVE)),
            None => coherence,
        };
        let mut frf = Self::new(lines.omega(), response, coherence, averages, measured)?;
        let size = check_size;
        size("samples of a segment", segments.samples(), lines.sampling().len())?;
        frf.lines = lines.as_slice().to_vec();
        frf.line_correlation = segments.line_correlation(count);
        if let Some(errors) = standard_error {
            size("matrices of standard errors", frf.omega.len(), errors.len())?;
            for (variance, errors) in frf.variance.iter_mut().zip(errors) {
                size("rows of a matrix of standard errors", variance.nrows(), errors.nrows())?;
                size("columns of a matrix of standard errors", variance.ncols(), errors.ncols())?;
                *variance = errors.map(|error| 2.0 * error * error);
            }
        }
        let diagonal = |values: &mut dyn Iterator<Item = f64>| {
            let values: Vec<Complex<f64>> = values.map(Complex::from).collect();
            ComplexMatrix::from_diagonal(&values.into())
        };
        let residual_variance =
            |v: &DMatrix<f64>| diagonal(&mut v.column(0).iter().map(|v| v * averages));
        let of_force = |v: &DMatrix<f64>| {
            let power = v.column(0).norm_squared();
            let share = |input: usize| {
                if power > 0.0 { v.column(input).dot(&v.column(0)) / power } else { 1.0 }
            };
            diagonal(&mut (0..v.ncols()).map(share))
        };
        let unexplained = frf.variance.iter().map(residual_variance).collect();
        let inverse_force = frf.variance.iter().map(of_force).collect();
        frf.scatter = Some(Scatter::for_table(&frf, unexplained, inverse_force, segments));
        Ok(frf)
    }

    /// Adds a line; returns the covariance of the unexplained parts of the responses, and S_FF⁻¹.
    fn push_line(
        &mut self,
        line: usize,
        spectra: &CrossSpectra,
        estimator: FrfEstimator,
    ) -> Result<[ComplexMatrix; 2], SpectraError> {
        let frequency_hz = self.omega[line] / std::f64::consts::TAU;
        let inverse = spectra.inverse_force(frequency_hz)?;
        let h1 = &spectra.motion_force * &inverse;
        let explained = &h1 * spectra.motion_force.adjoint();
        let (outputs, inputs) = h1.shape();
        let mut variance = DMatrix::zeros(outputs, inputs);
        for o in 0..outputs {
            let total = spectra.motion[(o, o)].re;
            let share =
                if total > 0.0 { (explained[(o, o)].re / total).clamp(0.0, 1.0) } else { 0.0 };
            self.coherence[(line, o)] = share;
            for i in 0..inputs {
                let unexplained = (1.0 - share).max(COHERENCE_ROUNDING) * total;
                variance[(o, i)] =
                    unexplained * inverse[(i, i)].re / (self.averages - inputs as f64);
            }
        }
        let response = match estimator {
            FrfEstimator::H1 => h1.clone(),
            FrfEstimator::H2 => {
                spectra.h2().ok_or(SpectraError::IncoherentMotion { frequency_hz })?
            }
            FrfEstimator::Hv => spectra.hv()?,
        };
        // The variance of H1 is known; the variance of another estimate is that of H1 times the
        // squared ratio of the two estimates.
        for (v, (h, h1)) in variance.iter_mut().zip(response.iter().zip(h1.iter())) {
            if h1.norm_sqr() > 0.0 {
                *v *= h.norm_sqr() / h1.norm_sqr();
            }
        }
        self.response.push(response);
        self.variance.push(variance);
        let unexplained = (&spectra.motion - &explained)
            * Complex::from(self.averages / (self.averages - inputs as f64));
        Ok([unexplained, inverse])
    }

    /// Returns data for the estimators: each force channel is one experiment with unit force at its
    /// degree of freedom (`force_dof`, one per channel, counted from 0). The noise of the response
    /// comes from the coherence; if there are few averages, it is averaged over neighbouring lines.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if there is not one degree of freedom per force, or if a degree of
    /// freedom does not exist.
    pub fn data(&self, force_dof: &[usize]) -> Result<FrequencyData, SpectraError> {
        let inputs = self.response.first().map_or(0, |h| h.ncols());
        if force_dof.len() != inputs {
            let (expected, got) = (inputs, force_dof.len());
            return Err(
                NumericsError::Size { what: "driven degrees of freedom", expected, got }.into()
            );
        }
        let variance = match &self.scatter {
            Some(scatter) => &scatter.pooled,
            None => &self.variance,
        };
        FrequencyData::from_responses(
            &self.omega,
            &self.response,
            Some(variance),
            self.measured,
            force_dof,
        )
    }

    /// Returns the same responses at some of the frequencies only, by their indices, counted from
    /// 0.
    ///
    /// # Panics
    /// If there is no such frequency.
    pub fn at(&self, places: &[usize]) -> Self {
        Self {
            omega: places.iter().map(|at| self.omega[*at]).collect(),
            lines: places.iter().map(|at| self.lines[*at]).collect(),
            line_correlation: self.line_correlation.clone(),
            measured: self.measured,
            response: places.iter().map(|at| self.response[*at].clone()).collect(),
            coherence: self.coherence.select_rows(places),
            variance: places.iter().map(|at| self.variance[*at].clone()).collect(),
            averages: self.averages,
            scatter: self.scatter.as_ref().map(|scatter| scatter.at(places)),
        }
    }

    /// Returns the number of independent complex deviations in each variance that weights an
    /// estimate.
    pub fn deviations(&self) -> f64 {
        let inputs = self.response.first().map_or(0, |h| h.ncols());
        let per_line = self.averages - inputs as f64;
        self.scatter.as_ref().map_or(per_line, |scatter| scatter.freedom)
    }

    /// Returns the information of the responses about a system, a pure number. It is a sum over
    /// lines and responses, times a number of averages. The terms of the sum are γ²/(1 − γ²), the
    /// ratio of explained to unexplained power, corrected for the bias of a sample coherence. The
    /// number of averages is reduced by the number of forces and by one for the weights. Longer
    /// segments have more lines and less leakage, but fewer averages.
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapter 9 (variance of a response by its
    /// coherence).
    pub fn information(&self) -> f64 {
        let inputs = self.response.first().map_or(0, |h| h.ncols()) as f64;
        let spare = self.averages - inputs;
        let of_one = |coherence: &f64| {
            let unexplained = (1.0 - coherence).max(COHERENCE_ROUNDING) * self.averages / spare;
            (1.0 / unexplained - 1.0).max(0.0)
        };
        (spare - 1.0).max(0.0) * self.coherence.iter().map(of_one).sum::<f64>()
    }

    /// Returns the angular frequencies, in rad/s.
    pub fn omega(&self) -> &[f64] {
        &self.omega
    }

    /// Returns the line number of each frequency; for responses from [`Frf::new`], its index.
    pub fn lines(&self) -> &[usize] {
        &self.lines
    }

    /// Returns the correlation of the noise on two lines that are 0, 1, 2 … lines apart.
    pub fn line_correlation(&self) -> &[f64] {
        &self.line_correlation
    }

    /// Returns the measured quantity: H is a receptance, a mobility or an accelerance.
    pub fn measured(&self) -> ResponseQuantity {
        self.measured
    }

    /// Returns H at one of the frequencies, responses × forces: m/N, m/(s·N) or m/(s²·N).
    ///
    /// # Panics
    /// If there is no such frequency.
    pub fn response(&self, at: usize) -> &ComplexMatrix {
        &self.response[at]
    }

    /// Returns the multiple coherence γ², frequencies × responses: the fraction, from 0 to 1, of
    /// the power of a response that depends linearly on the forces.
    pub fn coherence(&self) -> &DMatrix<f64> {
        &self.coherence
    }

    /// Returns the variance E|ΔH|² at one of the frequencies, responses × forces, in the square of
    /// the unit of H.
    ///
    /// # Panics
    /// If there is no such frequency.
    pub fn variance(&self, at: usize) -> &DMatrix<f64> {
        &self.variance[at]
    }

    /// Returns the equivalent number of independent segments.
    pub fn averages(&self) -> f64 {
        self.averages
    }
}
