//! Frequency response functions and coherence from measured forces and motions.

use mechid_signal::Record;
use nalgebra::{Complex, DMatrix, DVector};

use crate::EstimateError;
use crate::frequency_domain::{FrequencyData, Lines, Motion, NoiseSpectrum};

type ComplexMatrix = DMatrix<Complex<f64>>;

/// How a record is cut into pieces to average over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Segments {
    /// Whole periods of so many samples, for a periodic excitation in steady state: no
    /// window, no leakage.
    Periods(usize),
    /// Pieces of so many samples, half overlapping, their means removed, under a Hann
    /// window, for a random excitation (Welch's method).
    Hann(usize),
}

/// Which signal is believed where force and motion disagree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrfEstimator {
    /// S_XF S_FF⁻¹: right when only the motion is noisy; noise on the force makes it too small.
    H1,
    /// S_XX S_FX⁻¹: right when only the force is noisy; noise on the motion makes it too large.
    /// With several forces it needs as many motions.
    H2,
    /// Total least squares, force and motion scaled to equal power; with one force the
    /// geometric mean of H1 and H2.
    Hv,
}

/// Motion per unit force at chosen frequencies, with the coherence.
#[derive(Debug, Clone, PartialEq)]
pub struct Frf {
    omega: Vec<f64>,
    measured: Motion,
    response: Vec<ComplexMatrix>,
    coherence: DMatrix<f64>,
    variance: Vec<DMatrix<f64>>,
    averages: f64,
}

/// Averaged cross-spectra of one line.
struct CrossSpectra {
    force: ComplexMatrix,
    motion_force: ComplexMatrix,
    motion: ComplexMatrix,
}

/// Scaled force cross-spectra with eigenvalues further apart than this determine nothing.
const FORCE_TOLERANCE: f64 = 1e-10;

impl Frf {
    /// Frequency responses at some lines of the segments, from all segments of the records.
    ///
    /// Every force channel must carry force; select the channels that do.
    ///
    /// # Errors
    /// [`EstimateError::TooFewAverages`] unless there are more segments than forces,
    /// [`EstimateError::DependentForces`] at a line where the forces are zero or
    /// proportional to one another in all segments, [`EstimateError::Size`] for H2 with
    /// several forces and another number of motions, and what [`Lines::new`] refuses.
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), chapters 6, 7 and 9; Welch (1967).
    pub fn estimate(
        force: &Record,
        motion: &Record,
        measured: Motion,
        segments: Segments,
        lines: impl IntoIterator<Item = usize>,
        estimator: FrfEstimator,
    ) -> Result<Self, EstimateError> {
        force.check_same_sampling(motion)?;
        let (inputs, outputs) = (force.channels(), motion.channels());
        if estimator == FrfEstimator::H2 && inputs > 1 && inputs != outputs {
            let what = "channels of the motion, for H2";
            return Err(EstimateError::Size { what, expected: inputs, got: outputs });
        }
        let len = match segments {
            Segments::Periods(len) | Segments::Hann(len) => len,
        };
        let lines = Lines::new(force.window(0, len)?.sampling(), lines)?;
        let (forces, averages) = amplitudes(&lines, force, segments);
        let (motions, _) = amplitudes(&lines, motion, segments);
        if forces.len() <= inputs {
            return Err(EstimateError::TooFewAverages { got: forces.len(), needed: inputs + 1 });
        }
        let omega = lines.omega();
        let mut frf = Self {
            response: Vec::with_capacity(omega.len()),
            coherence: DMatrix::zeros(omega.len(), outputs),
            variance: Vec::with_capacity(omega.len()),
            omega,
            measured,
            averages,
        };
        for line in 0..frf.omega.len() {
            frf.push_line(line, &CrossSpectra::new(line, &forces, &motions), estimator)?;
        }
        Ok(frf)
    }

    /// Measured elsewhere: per frequency a matrix motions × forces, and the coherence of every
    /// motion (frequencies × motions) from so many independent averages.
    ///
    /// With several forces the coherence is the multiple one, and the forces are taken as
    /// uncorrelated and equally large.
    ///
    /// # Errors
    /// [`EstimateError::Size`], [`EstimateError::Coherence`] outside (0, 1\],
    /// [`EstimateError::TooFewAverages`] unless there are more averages than forces.
    pub fn new(
        omega: Vec<f64>,
        response: Vec<ComplexMatrix>,
        coherence: DMatrix<f64>,
        averages: f64,
        measured: Motion,
    ) -> Result<Self, EstimateError> {
        let size = |what, expected, got| {
            if expected == got { Ok(()) } else { Err(EstimateError::Size { what, expected, got }) }
        };
        size("frequency response matrices", omega.len(), response.len())?;
        size("rows of the coherence", omega.len(), coherence.nrows())?;
        let inputs = response.first().map_or(0, |h| h.ncols());
        for h in &response {
            size("rows of a frequency response matrix", coherence.ncols(), h.nrows())?;
            size("columns of a frequency response matrix", inputs, h.ncols())?;
        }
        if averages.is_nan() || averages <= inputs as f64 {
            let needed = inputs + 1;
            return Err(EstimateError::TooFewAverages { got: averages as usize, needed });
        }
        if let Some(&value) = coherence.iter().find(|c| !(**c > 0.0 && **c <= 1.0)) {
            return Err(EstimateError::Coherence { value });
        }
        let variance = response
            .iter()
            .zip(coherence.row_iter())
            .map(|(h, coherence)| {
                DMatrix::from_fn(h.nrows(), h.ncols(), |o, _| {
                    let power = h.row(o).norm_squared();
                    power * (1.0 / coherence[o] - 1.0) / (averages - inputs as f64)
                })
            })
            .collect();
        Ok(Self { omega, measured, response, coherence, variance, averages })
    }

    fn push_line(
        &mut self,
        line: usize,
        spectra: &CrossSpectra,
        estimator: FrfEstimator,
    ) -> Result<(), EstimateError> {
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
                let unexplained = (1.0 - share) * total * inverse[(i, i)].re;
                variance[(o, i)] = unexplained / (self.averages - inputs as f64);
            }
        }
        self.response.push(match estimator {
            FrfEstimator::H1 => h1,
            FrfEstimator::H2 => {
                spectra.h2().ok_or(EstimateError::IncoherentMotion { frequency_hz })?
            }
            FrfEstimator::Hv => spectra.hv(),
        });
        self.variance.push(variance);
        Ok(())
    }

    /// As data for the estimators: every force channel in turn is an experiment with unit
    /// force at its degree of freedom (`force_dof`, one per channel, counted from 0), and
    /// the coherence gives the noise of the motion.
    ///
    /// # Errors
    /// [`EstimateError::Size`] if there is not one degree of freedom per force or one of
    /// them does not exist.
    pub fn data(&self, force_dof: &[usize]) -> Result<FrequencyData, EstimateError> {
        let (n, lines) = (self.coherence.ncols(), self.omega.len());
        let inputs = self.response.first().map_or(0, |h| h.ncols());
        if force_dof.len() != inputs {
            let (expected, got) = (inputs, force_dof.len());
            return Err(EstimateError::Size { what: "driven degrees of freedom", expected, got });
        }
        if let Some(&got) = force_dof.iter().find(|dof| **dof >= n) {
            let what = "driven degree of freedom, at most";
            return Err(EstimateError::Size { what, expected: n.saturating_sub(1), got });
        }
        let mut all: Option<FrequencyData> = None;
        for (input, &dof) in force_dof.iter().enumerate() {
            let mut force = DMatrix::zeros(lines, n);
            force.column_mut(dof).fill(Complex::new(1.0, 0.0));
            let motion = DMatrix::from_fn(lines, n, |l, o| self.response[l][(o, input)]);
            let covariance = (0..lines).map(|l| {
                let mut diagonal = DVector::zeros(2 * n);
                for o in 0..n {
                    let scale = self.measured.per_displacement(self.omega[l]).norm_sqr();
                    diagonal[o] = Complex::new(self.variance[l][(o, input)] / scale, 0.0);
                }
                DMatrix::from_diagonal(&diagonal)
            });
            let noise = NoiseSpectrum::new(self.omega.clone(), covariance.collect())?;
            let one =
                FrequencyData::from_amplitudes(self.omega.clone(), force, motion, self.measured)?
                    .with_noise(noise)?;
            all = Some(match all {
                None => one,
                Some(before) => before.and(&one)?,
            });
        }
        all.ok_or(EstimateError::NoExcitedLine)
    }

    /// Angular frequencies, in rad/s.
    pub fn omega(&self) -> &[f64] {
        &self.omega
    }

    /// The quantity measured: H is a receptance, a mobility or an accelerance.
    pub fn measured(&self) -> Motion {
        self.measured
    }

    /// H at one of the frequencies, motions × forces: m/N, m/(s·N) or m/(s²·N).
    ///
    /// # Panics
    /// If there is no such frequency.
    pub fn response(&self, at: usize) -> &ComplexMatrix {
        &self.response[at]
    }

    /// Share of the power of a motion that is linear in the forces, frequencies × motions
    /// (the multiple coherence γ², between 0 and 1).
    pub fn coherence(&self) -> &DMatrix<f64> {
        &self.coherence
    }

    /// Variance E|ΔH|² at one of the frequencies, motions × forces.
    ///
    /// # Panics
    /// If there is no such frequency.
    pub fn variance(&self, at: usize) -> &DMatrix<f64> {
        &self.variance[at]
    }

    /// How many independent segments the averages are worth.
    pub fn averages(&self) -> f64 {
        self.averages
    }
}

impl CrossSpectra {
    fn new(line: usize, forces: &[ComplexMatrix], motions: &[ComplexMatrix]) -> Self {
        let (inputs, outputs) = (forces[0].ncols(), motions[0].ncols());
        let mut spectra = Self {
            force: DMatrix::zeros(inputs, inputs),
            motion_force: DMatrix::zeros(outputs, inputs),
            motion: DMatrix::zeros(outputs, outputs),
        };
        for (force, motion) in forces.iter().zip(motions) {
            let (f, x) = (force.row(line).transpose(), motion.row(line).transpose());
            spectra.force += &f * f.adjoint();
            spectra.motion_force += &x * f.adjoint();
            spectra.motion += &x * x.adjoint();
        }
        let count = Complex::new(forces.len() as f64, 0.0);
        spectra.force /= count;
        spectra.motion_force /= count;
        spectra.motion /= count;
        spectra
    }

    /// S_FF⁻¹, refused where the forces do not act independently.
    fn inverse_force(&self, frequency_hz: f64) -> Result<ComplexMatrix, EstimateError> {
        let inputs = self.force.nrows();
        let size = self.force.diagonal().map(|s| s.re.sqrt());
        let scaled =
            DMatrix::from_fn(inputs, inputs, |i, j| self.force[(i, j)] / (size[i] * size[j]));
        let eigenvalues = if size.min() > 0.0 {
            scaled.clone().symmetric_eigenvalues()
        } else {
            DVector::from_element(1, 0.0)
        };
        let ratio = eigenvalues.min() / eigenvalues.max();
        if ratio.is_nan() || ratio < FORCE_TOLERANCE {
            let reciprocal_condition = if ratio.is_nan() { 0.0 } else { ratio.max(0.0) };
            return Err(EstimateError::DependentForces { frequency_hz, reciprocal_condition });
        }
        let mut inverse = DMatrix::identity(inputs, inputs);
        scaled.lu().solve_mut(&mut inverse);
        Ok(DMatrix::from_fn(inputs, inputs, |i, j| inverse[(i, j)] / (size[i] * size[j])))
    }

    fn h2(&self) -> Option<ComplexMatrix> {
        if self.force.nrows() == 1 {
            let h = DMatrix::from_fn(self.motion.nrows(), 1, |o, _| {
                self.motion[(o, o)] / self.motion_force[(o, 0)].conj()
            });
            return h.iter().all(|z| z.is_finite()).then_some(h);
        }
        // H S_FX = S_XX, transposed for a solution from the left.
        let solution = self.motion_force.map(|z| z.conj()).lu().solve(&self.motion.transpose());
        solution.map(|h| h.transpose()).filter(|h| h.iter().all(|z| z.is_finite()))
    }

    /// Per motion, the eigenvector of least power of the cross-spectra of forces and motion.
    fn hv(&self) -> ComplexMatrix {
        let (outputs, inputs) = self.motion_force.shape();
        let mut h = DMatrix::zeros(outputs, inputs);
        for o in 0..outputs {
            let power = self.motion[(o, o)].re;
            if power == 0.0 {
                continue;
            }
            let size = |i: usize| if i < inputs { self.force[(i, i)].re } else { power }.sqrt();
            let all = DMatrix::from_fn(inputs + 1, inputs + 1, |i, j| {
                let s = match (i < inputs, j < inputs) {
                    (true, true) => self.force[(i, j)],
                    (false, true) => self.motion_force[(o, j)],
                    (true, false) => self.motion_force[(o, i)].conj(),
                    (false, false) => self.motion[(o, o)],
                };
                s / (size(i) * size(j))
            });
            let eigen = all.symmetric_eigen();
            let least = eigen.eigenvectors.column(eigen.eigenvalues.imin());
            for i in 0..inputs {
                // aᴴ z = 0 for the scaled z = (forces, motion).
                h[(o, i)] = -(least[i] / least[inputs]).conj() * size(inputs) / size(i);
            }
        }
        h
    }
}

/// Amplitudes of every segment (lines × channels), and how many independent ones they are worth.
fn amplitudes(lines: &Lines, record: &Record, segments: Segments) -> (Vec<ComplexMatrix>, f64) {
    let len = lines.sampling().len();
    match segments {
        Segments::Periods(_) => {
            let count = record.len() / len;
            ((0..count).map(|p| lines.read_window(record, p * len)).collect(), count as f64)
        }
        Segments::Hann(_) => {
            let window: Vec<f64> = (0..len).map(|k| hann(k, len)).collect();
            let hop = len.div_ceil(2);
            let count = (record.len() - len) / hop + 1;
            let pieces = (0..count).map(|p| windowed(lines, record, p * hop, &window)).collect();
            (pieces, count as f64 / overlap_loss(&window, hop, count))
        }
    }
}

fn windowed(lines: &Lines, record: &Record, start: usize, window: &[f64]) -> ComplexMatrix {
    let mut piece = record.data().rows(start, window.len()).into_owned();
    for mut column in piece.column_iter_mut() {
        let mean = column.mean();
        column.iter_mut().zip(window).for_each(|(x, w)| *x = (*x - mean) * w);
    }
    let piece = Record::new(lines.sampling(), piece).expect("finite, of the window's length");
    lines.read_window(&piece, 0)
}

fn hann(k: usize, len: usize) -> f64 {
    0.5 - 0.5 * (std::f64::consts::TAU * k as f64 / len as f64).cos()
}

/// Variance of an average of overlapping windowed segments over that of independent ones.
///
/// # Source
/// Welch (1967), IEEE Trans. Audio Electroacoustics 15, 70–73.
fn overlap_loss(window: &[f64], hop: usize, count: usize) -> f64 {
    let power: f64 = window.iter().map(|w| w * w).sum();
    let shared: f64 = window.iter().zip(&window[hop.min(window.len())..]).map(|(a, b)| a * b).sum();
    1.0 + 2.0 * (shared / power).powi(2) * (count - 1) as f64 / count as f64
}
