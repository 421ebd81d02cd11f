//! Measured receptance of the records, for any method of the fit.

use mechid_signal::Extent;
use mechid_signal::Window;
use mechid_signal::lines;
use mechid_spectra::frf::{FrfEstimator, Segments};
use mechid_spectra::{FrequencyData, Lines};
use nalgebra::{Complex, DMatrix};

use super::RecordReview;
use crate::AnalysisError;
use crate::frf::average;
use crate::identify::lines::{LineChoice, choose_lines};
use crate::identify::prediction::Prediction;
use crate::identify::spectra::periods;
use crate::identify::{Identified, ResponseCoherence};
use crate::measurement::{Block, IN_MEMORY_SAMPLES, Windowed};

/// Length of an open record divided by the length of a segment; with 50 % overlap this gives 15
/// segments. A record too long for memory has more segments: the length is computed from its part
/// in memory.
const SEGMENTS: usize = 8;

/// Minimum coherence of every response with the force; a spectral line below this coherence is not
/// shown.
const EXPLAINED: f64 = 0.5;

/// Maximum ratio of every other force to the largest force on a spectral line; up to this ratio,
/// the largest force counts as acting alone.
const ALONE: f64 = 1e-3;

/// Maximum ratio of every other force to the force that counts as acting alone, if the channels of
/// the other forces contain only the noise of their load cells.
const ALONE_WITH_NOISE: f64 = 0.1;

/// Minimum coherence, from line to line, of the ratio of two force channels that counts as
/// crosstalk; below this coherence, the smaller force is noise.
const CROSSTALK_COHERENCE: f64 = 0.5;
/// Minimum number of lines for a coherence from line to line.
const FEWEST_LINES: usize = 8;

/// A measured receptance and its origin.
pub struct Receptance {
    /// Receptance, line by line.
    pub data: FrequencyData,
    /// Origin of the receptance, in words.
    pub origin: String,
    /// Coherence of responses and forces, for open records.
    pub coherence: Option<ResponseCoherence>,
}

/// Rows of data with a single force, so that the ratio of motion to force is the receptance.
pub struct ActingAlone<'a> {
    data: &'a FrequencyData,
    /// Limit of the ratio of force k (row) to force j (column): force j counts as acting alone on a
    /// line if this ratio does not exceed the limit for any k.
    limits: DMatrix<f64>,
}

impl<'a> ActingAlone<'a> {
    /// Distinguishes noise in the channel of an unexcited force from crosstalk of the acting force,
    /// by the coherence from line to line.
    pub fn new(data: &'a FrequencyData) -> Self {
        let n = data.dof();
        let limits = DMatrix::from_fn(n, n, |k, j| {
            let driven = |row: &usize| {
                let amplitude = data.force()[(*row, j)].norm();
                let limit = ALONE_WITH_NOISE * amplitude;
                let other_forces = (0..n).filter(|other| *other != j);
                amplitude > 0.0
                    && other_forces
                        .into_iter()
                        .all(|other| data.force()[(*row, other)].norm() <= limit)
            };
            // The ratio gives every line the same weight.
            let part = |row: usize| data.force()[(row, k)] / data.force()[(row, j)];
            let parts: Vec<Complex<f64>> = (0..data.len()).filter(driven).map(part).collect();
            let power: f64 = parts.iter().map(|part| part.norm_sqr()).sum();
            // The phase of crosstalk is nearly constant from line to line, or linear with a delay.
            let products: Complex<f64> = parts.windows(2).map(|two| two[0].conj() * two[1]).sum();
            let (lines, coherence) = (parts.len(), products.norm() / power);
            let is_noise = lines >= FEWEST_LINES && coherence < CROSSTALK_COHERENCE;
            if is_noise { ALONE_WITH_NOISE } else { ALONE }
        });
        Self { data, limits }
    }

    /// Returns `true` if the force on degree of freedom `dof` acts alone on a row of the data, both
    /// counted from 0.
    pub fn on(&self, row: usize, dof: usize) -> bool {
        let amplitude = self.data.force()[(row, dof)].norm();
        let absent =
            |k: usize| self.data.force()[(row, k)].norm() <= self.limits[(k, dof)] * amplitude;
        amplitude > 0.0 && (0..self.data.dof()).all(|k| k == dof || absent(k))
    }
}

impl Receptance {
    /// Returns the data of a fit in the frequency domain. For other fits, returns the spectra of
    /// whole periods, or averages over segments of open records.
    ///
    /// # Errors
    /// [`AnalysisError`] if the records do not show a receptance.
    pub fn new(identified: &Identified, parts: &[RecordReview<'_>]) -> Result<Self, AnalysisError> {
        let (data, origin) = measured(identified, parts)?;
        Ok(Self { data, origin, coherence: identified.coherence()? })
    }
}

/// Returns the measured receptance and its origin in words.
fn measured(
    identified: &Identified,
    parts: &[RecordReview<'_>],
) -> Result<(FrequencyData, String), AnalysisError> {
    // A random response needs averages: one window is not enough.
    let fitted = identified.fitted();
    if let Some(data) = fitted.drawn.as_ref().filter(|_| identified.is_hammer_test()) {
        let origin =
            "measured on the lines of each hit; the transient of its window was subtracted";
        return Ok((data.clone(), origin.into()));
    }
    let of_responses = fitted.coherence.is_some();
    let of_lines = identified.drawn_spectra();
    if let Some(data) = of_lines.filter(|_| of_responses || fitted.drawn.is_none()) {
        let origin = match fitted.prediction {
            Prediction::Steady => "measured on the lines of the fit",
            Prediction::Sampled { .. } => "averaged over segments, on the lines of the fit",
        };
        return Ok((data.clone(), origin.into()));
    }
    let first = parts[0].held();
    // A period that is not completely in memory cannot be transformed.
    let is_complete = first.periods > 1 || first.held_to().is_none();
    let is_periodic = match identified.fitted().prediction {
        Prediction::Steady | Prediction::Sampled { extent: Extent::WholePeriod, .. } => is_complete,
        Prediction::Sampled { .. } => first.periods > 1,
    };
    let spectra = |part: &RecordReview<'_>| {
        if is_periodic { period_spectra(part) } else { segment_spectra(part.recorded) }
    };
    let mut data = spectra(&parts[0])?;
    for part in &parts[1..] {
        data = data.and(&spectra(part)?)?;
    }
    let origin = if is_periodic {
        "measured on the excited lines of whole periods".into()
    } else {
        format!(
            "by H1 from segments of {} samples (Hann window, 50 % overlap), on the lines where the force \
                 explains at least half of the response (a resonance narrower than the line spacing \
                 appears too wide)",
            segment(first)
        )
    };
    // Near half the sampling rate, the spectrum of a force that is held or linear between its
    // samples is smaller than the samples show, and so is the response.
    let origin = origin
        + "; near half the sampling rate, the response also depends on the force between the samples";
    Ok((data, origin))
}

fn period_spectra(part: &RecordReview<'_>) -> Result<FrequencyData, AnalysisError> {
    let buffered = part.held();
    // The scatter of several periods gives their noise. If a period does not fit in memory, only
    // the mean of the periods is available.
    let force = if buffered.force.len() < buffered.period {
        &part.whole.period(buffered).force
    } else {
        &buffered.force
    };
    let chosen = choose_lines(force, buffered.period, &LineChoice::Driven)?;
    let lines = Lines::new(force.sampling().with_len(buffered.period)?, chosen)?;
    Ok(periods(part.recorded, &lines)?.mean()?)
}

fn segment(measured: &Block) -> usize {
    ((measured.period * measured.periods).min(IN_MEMORY_SAMPLES) / SEGMENTS).max(1)
}

fn segment_spectra(recorded: &Windowed) -> Result<FrequencyData, AnalysisError> {
    let buffered = &recorded.held;
    let len = segment(buffered);
    let segments = Segments::Windowed { len, hop: len.div_ceil(2), window: Window::Hann };
    let sampling = buffered.force.sampling().with_len(len)?;
    let lines = Lines::new(sampling, lines::full(sampling))?;
    let responses = average(recorded, &lines, segments)?.frf(FrfEstimator::H1)?;
    let explained =
        |row: &usize| responses.coherence().row(*row).iter().all(|part| *part >= EXPLAINED);
    let clear: Vec<usize> = (0..lines.as_slice().len()).filter(explained).collect();
    if clear.is_empty() {
        return Err(AnalysisError::NoReceptance);
    }
    Ok(responses.at(&clear).data(&buffered.driven)?)
}
