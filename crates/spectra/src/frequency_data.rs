//! Forces and displacements at chosen frequencies: the input of all estimators for systems in which
//! every degree of freedom is measured.

mod derived_data;

use mechid_model::ResponseQuantity;
use mechid_numerics::{NumericsError, check_size};
use mechid_signal::{Record, Sampling, Spectrum};
use nalgebra::{Complex, DMatrix};

use crate::SpectraError;
use crate::limits::SCATTER_ROUNDING;
use crate::lines::{Lines, check_sampling};
use crate::noise::pulse::{PulseErrors, PulseNoise};
use crate::noise::spectrum::NoiseSpectrum;
use crate::noise::spectrum::variance_on_lines;
use crate::open_record::OpenRecord;

/// Complex amplitudes of forces and displacements, one row per frequency and experiment.
///
/// Measured velocities and accelerations are stored as displacements, X = V/(iω) = −A/ω²; the
/// measured quantity is stored too, because the noise is white in that quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct FrequencyData {
    omega: Vec<f64>,
    force: DMatrix<Complex<f64>>,
    displacement: DMatrix<Complex<f64>>,
    measured: ResponseQuantity,
    noise: Option<NoiseSpectrum>,
    /// Variances of the force noise, in N² (rows × n). They are used only if the noise of the
    /// displacements is not known.
    force_variance: DMatrix<f64>,
    /// Basis of the transients: displacements that correspond to the terms 1 and s³ in the measured
    /// quantity. Each open record has two columns, which are zero on the rows of other records.
    transient: DMatrix<Complex<f64>>,
    /// Time axis of each open record.
    open: Vec<Sampling>,
    /// Errors, in N, of forces that act only for a few samples.
    pulses: Vec<PulseErrors>,
}

impl FrequencyData {
    /// Reads the chosen lines of one record of force (N) and response, both over whole periods.
    ///
    /// Channel j of either record belongs to degree of freedom j; a degree of freedom without a
    /// force has a channel of zeros. For many records, [`FrequencyData::read`] uses one prepared
    /// transform.
    ///
    /// # Errors
    /// As [`Lines::new`] and [`FrequencyData::read`].
    pub fn from_records(
        force: &Record,
        motion: &Record,
        measured: ResponseQuantity,
        lines: impl IntoIterator<Item = usize>,
    ) -> Result<Self, SpectraError> {
        Self::read(&Lines::new(force.sampling(), lines)?, force, motion, measured)
    }

    /// Reads force (N) and response at prepared lines.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if the records have different numbers of channels,
    /// [`SpectraError::Signal`] if their time axes differ from the time axis of the lines.
    pub fn read(
        lines: &Lines,
        force: &Record,
        motion: &Record,
        measured: ResponseQuantity,
    ) -> Result<Self, SpectraError> {
        Self::from_amplitudes(lines.omega(), lines.read(force)?, lines.read(motion)?, measured)
    }

    /// Reads the chosen lines of two spectra over the same whole periods.
    ///
    /// # Errors
    /// [`NumericsError::Size`], [`SpectraError::LineOutOfRange`], [`SpectraError::NoExcitedLine`]
    /// or [`SpectraError::Signal`], as for records.
    pub fn from_spectra(
        force: &Spectrum,
        motion: &Spectrum,
        measured: ResponseQuantity,
        lines: impl IntoIterator<Item = usize>,
    ) -> Result<Self, SpectraError> {
        check_sampling(force.sampling(), motion.sampling())?;
        let lines = Lines::new(force.sampling(), lines)?;
        let rows = |s: &Spectrum| {
            DMatrix::from_fn(lines.as_slice().len(), s.channels(), |r, c| {
                s.line(lines.as_slice()[r], c)
            })
        };
        Self::from_amplitudes(lines.omega(), rows(force), rows(motion), measured)
    }

    /// Creates data from complex amplitudes, frequencies × degrees of freedom, at `omega` (rad/s).
    ///
    /// # Errors
    /// [`NumericsError::Size`] if the shapes differ, [`SpectraError::NoExcitedLine`] if there is no
    /// row, [`NumericsError::NotFinite`] for a frequency that is not positive or an amplitude that
    /// is not finite.
    pub fn from_amplitudes(
        omega: Vec<f64>,
        force: DMatrix<Complex<f64>>,
        mut motion: DMatrix<Complex<f64>>,
        measured: ResponseQuantity,
    ) -> Result<Self, SpectraError> {
        check_shapes(&omega, &force, &motion)?;
        for (r, &w) in omega.iter().enumerate() {
            let to_displacement = measured.per_displacement(w).inv();
            motion.row_mut(r).apply(|x| *x *= to_displacement);
        }
        let transient = DMatrix::zeros(omega.len(), 0);
        let force_variance = DMatrix::zeros(omega.len(), force.ncols());
        Ok(Self {
            omega,
            force,
            displacement: motion,
            measured,
            noise: None,
            force_variance,
            transient,
            open: Vec::new(),
            pulses: Vec::new(),
        })
    }

    /// Creates data from frequency responses of the quantity `measured` per unit force. `response`
    /// has one matrix, responses × forces, for each frequency in `omega` (rad/s). Each force
    /// becomes one experiment with unit force at its degree of freedom (`force_dof`, one per
    /// column, counted from 0). `variance`, if it is known, is E|ΔH|² of every entry, in the square
    /// of its unit; errors of different entries are independent.
    /// # Errors
    /// [`NumericsError::Size`] if the shapes differ or a degree of freedom does not exist, and the
    /// errors of [`FrequencyData::from_amplitudes`] and [`NoiseSpectrum::new`].
    ///
    /// # Source
    /// Ewins, *Modal Testing*, 2nd ed. (2000), chapter 2 (frequency responses as amplitudes per
    /// unit force).
    pub fn from_responses(
        omega: &[f64],
        response: &[DMatrix<Complex<f64>>],
        variance: Option<&[DMatrix<f64>]>,
        measured: ResponseQuantity,
        force_dof: &[usize],
    ) -> Result<Self, SpectraError> {
        let size = check_size;
        let (lines, n) = (omega.len(), response.first().map_or(0, |h| h.nrows()));
        size("frequency response matrices", lines, response.len())?;
        size("variances of frequency responses", lines, variance.map_or(lines, <[_]>::len))?;
        let shapes = response.iter().map(|h| h.shape());
        for shape in shapes.chain(variance.iter().flat_map(|v| v.iter().map(|v| v.shape()))) {
            size("rows of a frequency response matrix", n, shape.0)?;
            size("columns of a frequency response matrix", force_dof.len(), shape.1)?;
        }
        if let Some(&got) = force_dof.iter().find(|dof| **dof >= n) {
            let what = "largest index of a forced degree of freedom";
            return Err(NumericsError::Size { what, expected: n.saturating_sub(1), got }.into());
        }
        let mut combined: Option<Self> = None;
        for (input, &dof) in force_dof.iter().enumerate() {
            let mut force = DMatrix::zeros(lines, n);
            force.column_mut(dof).fill(Complex::new(1.0, 0.0));
            let motion = DMatrix::from_fn(lines, n, |l, o| response[l][(o, input)]);
            let mut one = Self::from_amplitudes(omega.to_vec(), force, motion, measured)?;
            if let Some(variance) = variance {
                let covariance = variance.iter().zip(omega).map(|(variance, omega)| {
                    let scale = measured.per_displacement(*omega).norm_sqr();
                    let entries = variance.column(input).map(|v| Complex::from(v / scale));
                    DMatrix::from_diagonal(&entries.resize_vertically(2 * n, Complex::default()))
                });
                one = one.with_noise(NoiseSpectrum::new(omega.to_vec(), covariance.collect())?)?;
            }
            combined = Some(match combined {
                None => one,
                Some(before) => before.and(&one)?,
            });
        }
        combined.ok_or(SpectraError::NoExcitedLine)
    }

    /// Returns the same data with a known noise covariance.
    ///
    /// # Errors
    /// [`SpectraError::FrequencyMismatch`] or [`NumericsError::Size`] if the noise belongs to other
    /// frequencies or another number of degrees of freedom.
    pub fn with_noise(mut self, noise: NoiseSpectrum) -> Result<Self, SpectraError> {
        check_same_frequencies(&self.omega, noise.omega())?;
        if noise.dof() != self.dof() {
            let (got, expected) = (noise.dof(), self.dof());
            return Err(NumericsError::Size {
                what: "channels of the noise spectrum",
                got,
                expected,
            }
            .into());
        }
        self.noise = Some(noise);
        Ok(self)
    }

    /// Returns the same data with white noise of known standard deviation (N) on the samples of
    /// each force channel, for a record of this many samples. Use it if the data do not show the
    /// noise of the force: the spectrum of the response noise is then estimated from the residual,
    /// and the force is not assumed to be exact. Noise stated by [`FrequencyData::with_noise`] has
    /// priority.
    ///
    /// # Errors
    /// [`NumericsError::Size`] unless there is one deviation per degree of freedom,
    /// [`SpectraError::NoiseVariance`] if one is negative or not finite.
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapter on
    /// maximum likelihood in errors-in-variables.
    pub fn with_force_noise(
        mut self,
        deviation: &[f64],
        samples: usize,
    ) -> Result<Self, SpectraError> {
        check_size("noise levels of the force", self.dof(), deviation.len())?;
        for (channel, &value) in deviation.iter().enumerate() {
            if !(value >= 0.0 && value.is_finite()) {
                let column = self.dof() + channel;
                return Err(SpectraError::NoiseVariance { row: 0, column, value });
            }
            let variance = variance_on_lines(value, samples);
            self.force_variance.column_mut(channel).fill(variance);
        }
        Ok(self)
    }

    /// Returns the same data of one record with force noise only on the samples of some pulses,
    /// such as the pulses of hammer hits. This noise is common to all lines.
    ///
    /// # Errors
    /// As [`FrequencyData::with_force_noise`]; [`NumericsError::Size`] if there is no such channel
    /// or sample, or if the rows of a pulse are not all rows; [`SpectraError::Numerics`] if the
    /// decomposition of the noise fails.
    ///
    /// # Source
    /// As [`FrequencyData::with_force_noise`].
    pub fn with_pulse_noise(mut self, pulses: &[PulseNoise]) -> Result<Self, SpectraError> {
        let rows = self.len();
        self.force_variance.fill(0.0);
        for pulse in pulses {
            check_size("rows of a pulse", rows, pulse.rows.len())?;
            check_size("rows up to the last row of a pulse", rows, pulse.rows.end)?;
            let samples = pulse.sampling.len();
            for (what, expected, got) in [
                (
                    "index of a force channel with noise, which must be below the expected number",
                    self.dof(),
                    pulse.channel,
                ),
                (
                    "index of a sample with noise, which must be below the expected number",
                    samples,
                    pulse.samples.end.saturating_sub(1),
                ),
            ] {
                if got >= expected {
                    return Err(NumericsError::Size { what, expected, got }.into());
                }
            }
            let value = pulse.deviation;
            if !(value >= 0.0 && value.is_finite()) {
                let column = self.dof() + pulse.channel;
                return Err(SpectraError::NoiseVariance { row: 0, column, value });
            }
            let share = pulse.samples.len() as f64 / samples as f64;
            let variance = variance_on_lines(value, samples) * share;
            self.force_variance.column_mut(pulse.channel).add_scalar_mut(variance);
        }
        // The amplitude of a sinusoid is twice the mean over the samples.
        self.pulses = PulseErrors::all(pulses, &self.omega, |samples| 2.0 / samples as f64)?;
        Ok(self)
    }

    /// Returns the errors of forces that act only for a few samples, in N.
    pub fn pulse_errors(&self) -> &[PulseErrors] {
        &self.pulses
    }

    /// Returns the variances of the force noise, in N² (rows × n). They are used only if the noise
    /// of the displacements is not known.
    pub fn force_variance(&self) -> &DMatrix<f64> {
        &self.force_variance
    }

    /// Returns the same data, read from an open record with this time axis: its initial and final
    /// states differ, so that it is not a whole period.
    ///
    /// The effect of this difference on the lines, which is like that of a force, is the transient.
    /// For displacements it is M(iω Δx + Δv) + C Δx, divided by the duration, with the differences
    /// Δx and Δv between the two states. Sampling folds the components of the transient above half
    /// the sampling rate back into the band; the higher powers of s = iω describe these components:
    ///
    /// ```text
    /// (K + s C + s² M) X + (τ₀ + τ₁ s + … + τ₅ s⁵) Z = F
    /// ```
    ///
    /// with unknown real τ for every degree of freedom, the displacements X, the forces F, and Z =
    /// 1, 1/s or 1/s² if displacement, velocity or acceleration was measured. The
    /// maximum-likelihood estimator estimates the τ together with the system. The rows must be all
    /// lines of a band, because neighbouring lines distinguish the transient from the force; the
    /// band should end at about 0.4 of the sampling rate.
    ///
    /// # Source
    /// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, the chapters on
    /// arbitrary excitations (transient terms of a plant) and on continuous-time models of
    /// band-limited signals.
    #[must_use]
    pub fn as_open_record(mut self, sampling: Sampling) -> Self {
        self.open = vec![sampling];
        self.transient = DMatrix::from_fn(self.len(), 2, |row, column| {
            let omega = self.omega[row];
            let unit = self.measured.per_displacement(omega).inv();
            if column == 0 { unit } else { unit * Complex::new(0.0, omega).powu(3) }
        });
        self
    }

    /// Returns the basis of the transients: displacements, in m, that correspond to the terms 1 and
    /// s³ in the measured quantity. Each open record has two columns, which are zero on the rows of
    /// other records.
    pub fn transient(&self) -> &DMatrix<Complex<f64>> {
        &self.transient
    }

    /// Returns an open record, counted from 0; `None` if there is no such record.
    pub fn open_record(&self, record: usize) -> Option<OpenRecord> {
        let sampling = *self.open.get(record)?;
        let of_record = |row: &usize| self.transient[(*row, 2 * record)] != Complex::ZERO;
        let first = (0..self.len()).find(of_record)?;
        let last = (0..self.len()).rfind(of_record)?;
        Some(OpenRecord { sampling, rows: first..last + 1 })
    }

    /// Returns the rows of these data followed by the rows of `other`: several experiments on one
    /// system.
    ///
    /// The noise is kept if it is known for both.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if the numbers of degrees of freedom differ,
    /// [`SpectraError::MixedQuantities`] if the measured quantities differ.
    pub fn and(&self, other: &Self) -> Result<Self, SpectraError> {
        if self.dof() != other.dof() {
            let (got, expected) = (other.dof(), self.dof());
            return Err(NumericsError::Size {
                what: "channels of the second experiment",
                got,
                expected,
            }
            .into());
        }
        if self.measured != other.measured {
            return Err(SpectraError::MixedQuantities {
                left: self.measured,
                right: other.measured,
            });
        }
        Ok(Self {
            omega: [&self.omega[..], &other.omega].concat(),
            force: stacked(&self.force, &other.force),
            displacement: stacked(&self.displacement, &other.displacement),
            force_variance: stacked(&self.force_variance, &other.force_variance),
            measured: self.measured,
            noise: self.noise.as_ref().zip(other.noise.as_ref()).map(|(a, b)| a.chain(b)),
            transient: self.transient_of_both(other),
            open: [&self.open[..], &other.open].concat(),
            pulses: self.pulses_of_both(other),
        })
    }

    fn pulses_of_both(&self, other: &Self) -> Vec<PulseErrors> {
        let below = |pulse: &PulseErrors| {
            let rows = pulse.rows();
            pulse.with_rows(rows.start + self.len()..rows.end + self.len())
        };
        self.pulses.iter().cloned().chain(other.pulses.iter().map(below)).collect()
    }

    fn transient_of_both(&self, other: &Self) -> DMatrix<Complex<f64>> {
        let (rows, columns) =
            (self.len() + other.len(), self.transient.ncols() + other.transient.ncols());
        let mut both = DMatrix::zeros(rows, columns);
        both.view_mut((0, 0), self.transient.shape()).copy_from(&self.transient);
        both.view_mut(self.transient.shape(), other.transient.shape()).copy_from(&other.transient);
        both
    }

    /// Returns the number of degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.force.ncols()
    }

    /// Returns the number of rows: the number of frequencies, summed over the experiments.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.omega.len()
    }

    /// Returns the angular frequency of every row, in rad/s.
    pub fn omega(&self) -> &[f64] {
        &self.omega
    }

    /// Returns the force amplitudes, rows × n, in N.
    pub fn force(&self) -> &DMatrix<Complex<f64>> {
        &self.force
    }

    /// Returns the displacement amplitudes, rows × n, in m.
    pub fn displacement(&self) -> &DMatrix<Complex<f64>> {
        &self.displacement
    }

    /// Returns the measured quantity of the response.
    pub fn measured(&self) -> ResponseQuantity {
        self.measured
    }

    /// Returns the covariances of the noise of displacement (m) and force (N) for every row.
    pub fn noise(&self) -> Option<&NoiseSpectrum> {
        self.noise.as_ref()
    }

    /// Returns the covariances of the noise as [`FrequencyData::noise`] does; `None` also if the
    /// noise is only rounding. Noise is rounding if it is below 10⁻¹⁰ of the displacement and of
    /// the force (RMS over lines and channels).
    pub fn noise_above_rounding(&self) -> Option<&NoiseSpectrum> {
        let noise = self.noise()?;
        let (n, mut scatter) = (self.dof(), [0.0; 2]);
        for row in 0..self.len() {
            let variance = noise.covariance(row).diagonal().map(|variance| variance.re);
            scatter[0] += variance.rows(0, n).sum();
            scatter[1] += variance.rows(n, n).sum();
        }
        let sizes = [self.displacement.norm_squared(), self.force.norm_squared()];
        let rounding = SCATTER_ROUNDING * SCATTER_ROUNDING;
        scatter.iter().zip(sizes).any(|(scatter, size)| *scatter > rounding * size).then_some(noise)
    }
}

/// Returns the rows of the matrix `upper` followed by the rows of `lower`.
fn stacked<T: nalgebra::Scalar>(upper: &DMatrix<T>, lower: &DMatrix<T>) -> DMatrix<T> {
    let rows = upper.nrows();
    DMatrix::from_fn(rows + lower.nrows(), upper.ncols(), |row, column| {
        let from = if row < rows { &upper[(row, column)] } else { &lower[(row - rows, column)] };
        from.clone()
    })
}

/// Returns an error unless two sets of frequencies (rad/s, one per line) are equal up to rounding.
///
/// # Errors
/// [`NumericsError::Size`], [`SpectraError::FrequencyMismatch`].
///
/// # Source
/// Ours.
pub fn check_same_frequencies(left: &[f64], right: &[f64]) -> Result<(), SpectraError> {
    if left.len() != right.len() {
        let (got, expected) = (right.len(), left.len());
        return Err(NumericsError::Size { what: "frequencies", got, expected }.into());
    }
    for (row, (&left, &right)) in left.iter().zip(right).enumerate() {
        if (left - right).abs() > 1e-9 * left.abs() {
            return Err(SpectraError::FrequencyMismatch { row, left, right });
        }
    }
    Ok(())
}

fn check_shapes(
    omega: &[f64],
    force: &DMatrix<Complex<f64>>,
    motion: &DMatrix<Complex<f64>>,
) -> Result<(), SpectraError> {
    if force.ncols() != motion.ncols() || motion.ncols() == 0 {
        let (got, expected) = (motion.ncols(), force.ncols().max(1));
        return Err(NumericsError::Size { what: "channels of the motion", got, expected }.into());
    }
    for rows in [force.nrows(), motion.nrows()] {
        if rows != omega.len() {
            return Err(NumericsError::Size {
                what: "rows of amplitudes",
                got: rows,
                expected: omega.len(),
            }
            .into());
        }
    }
    if omega.is_empty() {
        return Err(SpectraError::NoExcitedLine);
    }
    if let Some(&value) = omega.iter().find(|w| !(**w > 0.0 && w.is_finite())) {
        return Err(SpectraError::Frequency { value });
    }
    for (what, amplitudes) in [("force amplitudes", force), ("motion amplitudes", motion)] {
        if let Some(at) = amplitudes.iter().position(|z| !z.is_finite()) {
            let (row, column) = (at % omega.len(), at / omega.len());
            return Err(NumericsError::NotFinite {
                what,
                row,
                column,
                value: amplitudes[at].norm(),
            }
            .into());
        }
    }
    Ok(())
}
