//! Sums of harmonically related cosines.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};

use crate::error::{SignalError, fits_in_memory, has_channel, not_negative, positive};
use crate::phases::{Phases, gcd};
use crate::record::Record;
use crate::sampling::Sampling;
use crate::spectrum::Spectrum;

/// A periodic signal F(t) = Σ A_n cos(n ω0 t + φ_n), known exactly at any t.
///
/// The fundamental frequency ω0 (rad/s) is not stored: it is an argument or follows from the
/// sampling, so that one multisine can be used with any period. The amplitudes have the unit of the
/// signal.
///
/// ```
/// use mechid_signal::{Multisine, Phases, Sampling, lines};
///
/// // The excitation of the dissertation: every line strictly between DC and Nyquist.
/// let sampling = Sampling::new(0.01, 256)?;
/// let force = Multisine::flat(lines::full(sampling), 50.0, Phases::SchroederBinary)?;
/// let record = force.sample(sampling)?;
/// let exact = force.value(0.01 * 3.0, sampling.omega0());
/// assert!((record.channel(0)[3] - exact).abs() < 1e-10);
/// assert!(force.crest_factor()? < 2.2);
/// # Ok::<(), mechid_signal::SignalError>(())
/// ```
///
/// # Source
/// Dissertation eq. (4.3.2), with its amplitude and subscript restored.
#[derive(Debug, Clone, PartialEq)]
pub struct Multisine {
    lines: Vec<usize>,
    amplitudes: Vec<f64>,
    phases: Vec<f64>,
}

impl Multisine {
    /// Highest line supported, which limits the memory for a crest factor.
    pub const MAX_LINE: usize = 1 << 24;

    /// Number of samples per Nyquist interval for [`peak`](Self::peak) and
    /// [`crest_factor`](Self::crest_factor).
    pub const OVERSAMPLING: usize = 16;

    /// Creates a multisine from lines (ascending, from 1) and amplitudes (one per line).
    ///
    /// # Errors
    /// [`SignalError::NoLines`], [`SignalError::Line`] for DC or a line above
    /// [`MAX_LINE`](Self::MAX_LINE), [`SignalError::LineOrder`], [`SignalError::PerLine`] if the
    /// lists differ in length, [`SignalError::Negative`] for an amplitude below zero or not finite
    /// or for amplitudes too large to be added up, [`SignalError::Infinite`] for a given phase that
    /// is not finite.
    pub fn new(
        lines: Vec<usize>,
        amplitudes: Vec<f64>,
        phases: Phases,
    ) -> Result<Self, SignalError> {
        if lines.is_empty() {
            return Err(SignalError::NoLines);
        }
        let allowed = 1..=Self::MAX_LINE;
        if let Some(&line) = lines.iter().find(|n| !allowed.contains(n)) {
            return Err(SignalError::Line { line, highest: Self::MAX_LINE });
        }
        if let Some(w) = lines.windows(2).find(|w| w[1] <= w[0]) {
            return Err(SignalError::LineOrder { previous: w[0], line: w[1] });
        }
        let (count, got) = (lines.len(), amplitudes.len());
        if got != count {
            return Err(SignalError::PerLine { what: "amplitudes", lines: count, got });
        }
        check_amplitudes(&amplitudes)?;
        let phases = phases.values(&lines, &amplitudes)?;
        Ok(Self { lines, amplitudes, phases })
    }

    /// Creates a multisine with the same amplitude on every line.
    ///
    /// # Errors
    /// The errors of [`Multisine::new`].
    pub fn flat(
        lines: impl IntoIterator<Item = usize>,
        amplitude: f64,
        phases: Phases,
    ) -> Result<Self, SignalError> {
        let lines: Vec<usize> = lines.into_iter().collect();
        let amplitudes = vec![amplitude; lines.len()];
        Self::new(lines, amplitudes, phases)
    }

    /// Creates the multisine with exactly the lines of a measured period between DC and Nyquist.
    ///
    /// # Errors
    /// The errors of [`Multisine::new`], also for a period of one or two samples, which has no such
    /// lines; [`SignalError::NoSuchChannel`].
    pub fn from_spectrum(spectrum: &Spectrum, channel: usize) -> Result<Self, SignalError> {
        has_channel(channel, spectrum.channels())?;
        let lines = crate::lines::full(spectrum.sampling());
        let (amplitudes, phases) =
            lines.iter().map(|n| spectrum.line(*n, channel).to_polar()).unzip();
        Self::new(lines, amplitudes, Phases::Given(phases))
    }

    /// Lines of the multisine, in ascending order.
    pub fn lines(&self) -> &[usize] {
        &self.lines
    }

    /// The amplitude of each line, in the unit of the signal, N for a force.
    pub fn amplitudes(&self) -> &[f64] {
        &self.amplitudes
    }

    /// The phase of each line, in rad.
    pub fn phases(&self) -> &[f64] {
        &self.phases
    }

    /// Returns the multisine with the same lines and amplitudes and with other phases.
    ///
    /// # Errors
    /// [`SignalError::PerLine`] or [`SignalError::Infinite`] for bad [`Phases::Given`].
    pub fn with_phases(mut self, phases: Phases) -> Result<Self, SignalError> {
        self.phases = phases.values(&self.lines, &self.amplitudes)?;
        Ok(self)
    }

    /// Returns the multisine scaled to an RMS value; the shape of the signal is unchanged.
    ///
    /// # Errors
    /// [`SignalError::Negative`] for an impossible `rms`, [`SignalError::Silent`] if all
    /// amplitudes are zero.
    pub fn with_rms(self, rms: f64) -> Result<Self, SignalError> {
        not_negative("RMS value", rms)?;
        let now = self.rms();
        self.scaled(rms, now)
    }

    /// Returns the multisine scaled to a largest absolute value ([`peak`](Self::peak)); the shape
    /// of the signal is unchanged.
    ///
    /// # Errors
    /// [`SignalError::Negative`] for an impossible `peak`, [`SignalError::Silent`] if all
    /// amplitudes are zero.
    pub fn with_peak(self, peak: f64) -> Result<Self, SignalError> {
        not_negative("peak value", peak)?;
        let now = self.peak();
        self.scaled(peak, now)
    }

    fn scaled(mut self, wanted: f64, now: f64) -> Result<Self, SignalError> {
        positive("present level", now).map_err(|_| SignalError::Silent { channel: 0 })?;
        self.amplitudes.iter_mut().for_each(|a| *a = *a / now * wanted);
        check_amplitudes(&self.amplitudes)?;
        Ok(self)
    }

    /// Returns the exact value at `t` seconds for a fundamental of `omega0` rad/s.
    pub fn value(&self, t: f64, omega0: f64) -> f64 {
        // Whole periods are subtracted first: n·ω0·t would lose digits at large t.
        let turn = (omega0 * t / TAU).fract() * TAU;
        let terms = self.lines.iter().zip(&self.amplitudes).zip(&self.phases);
        terms.map(|((&n, a), phase)| a * (n as f64 * turn + phase).cos()).sum()
    }

    /// Samples one period, with lines at multiples of `sampling.omega0()`.
    ///
    /// # Errors
    /// [`SignalError::Nyquist`] if the last line is at or above half the sampling rate,
    /// [`SignalError::Memory`], [`SignalError::NotFinite`] for amplitudes that overflow.
    pub fn sample(&self, sampling: Sampling) -> Result<Record, SignalError> {
        self.spectrum(sampling)?.to_record()
    }

    /// Returns the complex amplitudes A_n exp(i φ_n) as the spectrum of one period.
    ///
    /// # Errors
    /// The errors of [`Multisine::sample`].
    pub fn spectrum(&self, sampling: Sampling) -> Result<Spectrum, SignalError> {
        let line = self.lines[self.lines.len() - 1];
        if 2 * line >= sampling.len() {
            return Err(SignalError::Nyquist { line, len: sampling.len() });
        }
        fits_in_memory(sampling.len(), 1)?;
        let mut values = DMatrix::zeros(sampling.lines(), 1);
        for ((n, a), phase) in self.lines.iter().zip(&self.amplitudes).zip(&self.phases) {
            values[(*n, 0)] = Complex::from_polar(*a, *phase);
        }
        Spectrum::from_lines(sampling, values)
    }

    /// Root mean square over a period, √(Σ A_n² / 2).
    pub fn rms(&self) -> f64 {
        // The amplitudes are divided by the largest one, because squares of very large or very
        // small amplitudes overflow or underflow.
        let largest = self.amplitudes.iter().fold(0.0_f64, |m, a| m.max(*a));
        if largest == 0.0 {
            return 0.0;
        }
        let squares = self.amplitudes.iter().map(|a| (a / largest).powi(2));
        largest * (0.5 * squares.sum::<f64>()).sqrt()
    }

    /// Largest absolute value over a period, from samples at least
    /// [`OVERSAMPLING`](Self::OVERSAMPLING) times as dense as the Nyquist rate, and from a parabola
    /// through three samples at each maximum.
    pub fn peak(&self) -> f64 {
        let x = self.fine_period();
        let n = x.len();
        let highest = |k: usize| parabola_top(x[(k + n - 1) % n], x[k], x[(k + 1) % n]);
        (0..n).map(highest).fold(0.0, f64::max)
    }

    /// Ratio of peak to RMS, a pure number: 1 for a square wave, √2 for a sine.
    ///
    /// # Errors
    /// [`SignalError::Silent`] if all amplitudes are zero.
    pub fn crest_factor(&self) -> Result<f64, SignalError> {
        let rms = self.rms();
        positive("RMS value", rms).map_err(|_| SignalError::Silent { channel: 0 })?;
        Ok(self.peak() / rms)
    }

    /// Samples one period on a fine grid.
    fn fine_period(&self) -> Vec<f64> {
        // Lines 10, 20, 30 have the waveform of lines 1, 2, 3, so that the shortest period is
        // enough.
        let common = self.lines.iter().fold(0, |d, n| gcd(d, *n));
        let lines: Vec<usize> = self.lines.iter().map(|n| n / common).collect();
        let last = lines[lines.len() - 1];
        let len = (2 * (last + 1) * Self::OVERSAMPLING).next_power_of_two();
        let reduced =
            Self { lines, amplitudes: self.amplitudes.clone(), phases: self.phases.clone() };
        let sampling = Sampling::new(1.0, len).expect("a positive step and length");
        let spectrum = reduced.spectrum(sampling).expect("far below Nyquist");
        spectrum.samples().as_slice().to_vec()
    }
}

/// Checks that amplitudes and their sums are finite and not negative.
fn check_amplitudes(amplitudes: &[f64]) -> Result<(), SignalError> {
    for a in amplitudes {
        not_negative("amplitude", *a)?;
    }
    // The factor of 2 ensures that the sums within a transform do not overflow, either.
    not_negative("sum of all amplitudes", 2.0 * amplitudes.iter().sum::<f64>())?;
    Ok(())
}

/// Returns the largest |value| near the middle of three equidistant samples: the vertex of the
/// parabola through them if the middle sample is the largest, otherwise the middle sample.
fn parabola_top(before: f64, middle: f64, after: f64) -> f64 {
    // The values are multiplied by the sign of the middle value, so that the vertex is a maximum.
    // Products of two values are avoided, because they could overflow.
    let [b, m, a] = [before, middle, after].map(|v| v * middle.signum());
    let bend = b - 2.0 * m + a;
    if m < b || m < a || bend >= 0.0 {
        return m;
    }
    m - (a - b) * ((a - b) / (8.0 * bend))
}
