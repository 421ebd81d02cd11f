//! Responses averaged over segments of records: correlation of their lines, and bias of the window.

use std::f64::consts::{PI, TAU};

use mechid_io::FrequencyResponses;
use mechid_modal::{IdentifiedMode, ModalEstimate, ModalSettings, identify_modes};
use mechid_spectra::LineData;
use mechid_spectra::frf::{Segments, smoothing_bias};
use nalgebra::{Complex, DMatrix};

use super::tables::Tables;
use crate::AnalysisError;
use crate::limits::{
    LEAST_SHARPENED_LINES, LINE_CORRELATION, MOST_SEGMENT_WORK, SHARPENING_ROUNDS,
    SHARPENING_SETTLED,
};

/// Maximum deviation of a frequency in a file from the nearest spectral line, in line spacings: it
/// allows for the rounding of the frequencies in the file.
const OF_LINE: f64 = 1e-3;

/// Segments of averaged responses of a table.
#[derive(Debug, Clone)]
pub(super) struct Averaged {
    /// Number of the spectral line of each row of the table.
    lines: Vec<usize>,
    /// Line spacing of a segment, in Hz.
    pub spacing_hz: f64,
    /// Minimum distance, in lines, between two lines whose errors count as independent.
    step: usize,
    /// Factor on the standard errors that are computed as if the selected lines were independent:
    /// lines at a distance of `step` lines still have a small correlation. 1 without correlation.
    pub inflation: f64,
    /// Weights of the smoothing by the window; empty without smoothing.
    smoothing: Vec<f64>,
}

impl Averaged {
    /// Returns the segments that a table states; `None` if the table states none, if its
    /// frequencies are not lines of these segments, or if the segments are so long that the weights
    /// of their window take too much time.
    pub fn new(table: &FrequencyResponses) -> Option<Self> {
        let stated = table.segments?;
        if stated.samples.saturating_mul(stated.samples.div_ceil(stated.hop)) > MOST_SEGMENT_WORK {
            return None;
        }
        let spacing_hz = stated.sample_rate_hz / stated.samples as f64;
        let lines: Vec<f64> = table.frequency_hz.iter().map(|hz| hz / spacing_hz).collect();
        if lines.iter().any(|line| (line - line.round()).abs() > OF_LINE || *line < 0.0) {
            return None;
        }
        let segments = match stated.window {
            None => Segments::Periods(stated.samples),
            Some(window) => Segments::Windowed { len: stated.samples, hop: stated.hop, window },
        };
        let correlation = segments.line_correlation(stated.count);
        let correlated = |apart: usize| correlation.get(apart).copied().unwrap_or(0.0);
        let step = (1..).find(|apart| correlated(*apart) < LINE_CORRELATION).unwrap_or(1);
        let remaining: f64 = (1..).map_while(|k| correlation.get(k * step)).sum();
        let lines = lines.into_iter().map(|line| line.round() as usize).collect();
        let inflation = (1.0 + 2.0 * remaining).sqrt();
        let smoothing = segments.smoothing();
        Some(Self { lines, spacing_hz, step, inflation, smoothing })
    }

    /// Returns whether the window of the segments smooths resonances.
    pub fn is_smoothed(&self) -> bool {
        !self.smoothing.is_empty()
    }

    /// Selects rows with mutually independent errors.
    pub fn independent(&self, rows: impl Iterator<Item = usize>) -> Vec<usize> {
        let mut next = 0;
        rows.filter(|row| {
            let is_taken = self.lines[*row] >= next;
            if is_taken {
                next = self.lines[*row] + self.step;
            }
            is_taken
        })
        .collect()
    }

    /// Returns the bias that averaging over the segments causes in the responses of `modes`, on the
    /// given rows.
    ///
    /// The residual terms are ignored, because they are not valid outside the band. They represent
    /// the modes outside the band; the responses of these modes are smooth within the band, so
    /// their bias is negligible.
    pub fn bias(
        &self,
        rows: &[usize],
        modes: &[IdentifiedMode],
    ) -> Vec<Option<DMatrix<Complex<f64>>>> {
        if !self.is_smoothed() {
            return Vec::new();
        }
        let lines: Vec<usize> = rows.iter().map(|row| self.lines[*row]).collect();
        let lines_wide = |mode: &IdentifiedMode| -mode.pole.re / (PI * self.spacing_hz);
        let wide: Vec<&IdentifiedMode> =
            modes.iter().filter(|mode| lines_wide(mode) >= LEAST_SHARPENED_LINES).collect();
        let response = |omega: f64| Some(modal_response(&wide, omega));
        smoothing_bias(&self.smoothing, &lines, TAU * self.spacing_hz, &response)
    }
}

/// Returns the response of some modes at ω (rad/s), outputs × inputs.
fn modal_response(modes: &[&IdentifiedMode], omega: f64) -> DMatrix<Complex<f64>> {
    let s = Complex::new(0.0, omega);
    let size = |mode: &&IdentifiedMode| (mode.shape.len(), mode.participation.len());
    let (outputs, inputs) = modes.first().map_or((0, 0), size);
    DMatrix::from_fn(outputs, inputs, |output, input| {
        let of_mode = |mode: &&IdentifiedMode| {
            let residue = mode.residue(output, input);
            residue / (s - mode.pole) + residue.conj() / (s - mode.pole.conj())
        };
        modes.iter().map(of_mode).sum()
    })
}

/// Modes of tables, corrected for the bias of the window.
pub(super) struct Sharpened {
    /// Corrected lines.
    pub data: LineData,
    pub estimate: ModalEstimate,
    /// True if the correction converged.
    pub settled: bool,
}

impl Sharpened {
    /// Alternates between a fit of the modes and the correction of the responses for the window
    /// bias of these modes, until the modes no longer change. If a later fit fails, the last
    /// successful fit is the result, and the correction has not converged.
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), section 8.5 (bias by a window).
    pub fn new(
        tables: &Tables,
        band_hz: [f64; 2],
        settings: &ModalSettings,
    ) -> Result<Self, AnalysisError> {
        let data = tables.lines(band_hz, None)?;
        tables.check_memory(&data)?;
        let estimate = identify_modes(&data, settings)?;
        let mut fit = Self { data, estimate, settled: !tables.is_smoothed() };
        for _ in 0..SHARPENING_ROUNDS {
            if fit.settled {
                break;
            }
            let data = tables.lines(band_hz, Some(fit.estimate.modes()))?;
            let Ok(estimate) = identify_modes(&data, settings) else { break };
            let change = largest_change(fit.estimate.modes(), estimate.modes());
            let settled = change < SHARPENING_SETTLED;
            fit = Self { data, estimate, settled };
        }
        Ok(fit)
    }
}

/// Returns the largest change of a frequency or damping ratio in standard errors; infinite if the
/// numbers of modes differ.
fn largest_change(before: &[IdentifiedMode], after: &[IdentifiedMode]) -> f64 {
    if before.len() != after.len() {
        return f64::INFINITY;
    }
    let change = |(one, two): (&IdentifiedMode, &IdentifiedMode)| {
        let frequency = two.natural_frequency_hz.value - one.natural_frequency_hz.value;
        let damping = two.damping_ratio.value - one.damping_ratio.value;
        let frequency = frequency.abs() / two.natural_frequency_hz.standard_error;
        frequency.max(damping.abs() / two.damping_ratio.standard_error)
    };
    before.iter().zip(after).map(change).fold(0.0, f64::max)
}

/// Returns a mode without the decay rate (1/s) of an exponential window.
pub(super) fn without_decay(mode: &IdentifiedMode, added_decay: f64) -> IdentifiedMode {
    let mut mode = mode.clone();
    let (f, zeta) = (mode.natural_frequency_hz, mode.damping_ratio);
    let variance = [f.standard_error.powi(2), zeta.standard_error.powi(2)];
    let between = mode.frequency_damping_covariance;
    // The covariance is transformed from (f, ζ) to the pole σ + jω_d with the decay of the window,
    // and from the pole without this decay back to (f, ζ).
    mode.pole.re += added_decay;
    let slopes = frequency_and_damping_slopes(mode.pole) * pole_slopes(f.value, zeta.value);
    let covariance = nalgebra::Matrix2::new(variance[0], between, between, variance[1]);
    let covariance = slopes * covariance * slopes.transpose();
    let size = mode.pole.norm();
    mode.natural_frequency_hz.value = size / TAU;
    mode.natural_frequency_hz.standard_error = covariance[(0, 0)].max(0.0).sqrt();
    mode.damping_ratio.value = -mode.pole.re / size;
    mode.damping_ratio.standard_error = covariance[(1, 1)].max(0.0).sqrt();
    mode.frequency_damping_covariance = covariance[(0, 1)];
    mode
}

/// Returns the derivatives of natural frequency (Hz) and damping ratio (rows) with respect to the
/// real and imaginary part of the pole (columns).
fn frequency_and_damping_slopes(pole: Complex<f64>) -> nalgebra::Matrix2<f64> {
    let (re, im, size) = (pole.re, pole.im, pole.norm());
    let cubed = size.powi(3);
    nalgebra::Matrix2::new(re / size / TAU, im / size / TAU, -im * im / cubed, re * im / cubed)
}

/// Returns the derivatives of the real and imaginary part of a pole (rows) with respect to natural
/// frequency (Hz) and damping ratio (columns).
fn pole_slopes(natural_frequency_hz: f64, damping_ratio: f64) -> nalgebra::Matrix2<f64> {
    let omega = TAU * natural_frequency_hz;
    let root = (1.0 - damping_ratio * damping_ratio).sqrt();
    nalgebra::Matrix2::new(-TAU * damping_ratio, -omega, TAU * root, -omega * damping_ratio / root)
}
