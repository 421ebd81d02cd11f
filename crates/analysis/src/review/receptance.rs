//! The receptance that records show, whatever was fitted.

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

/// Part of an open record that a segment takes; half overlapped, this makes fifteen segments. Of a
/// record too long to be held there are more of them, not longer ones.
const SEGMENTS: usize = 8;

/// A line is shown if the force explains at least this part of the power of every motion.
const EXPLAINED: f64 = 0.5;

/// A force counts as acting alone on a line if the others have less than this part of it.
const ALONE: f64 = 1e-3;

/// The same of others that have nothing to do with it: the noise of their load cells.
const ALONE_BESIDE_NOISE: f64 = 0.1;

/// Coherence from line to line from which a force is a part of another, and the fewest lines that
/// tell.
const PART_OF_IT: f64 = 0.5;
const FEWEST_LINES: usize = 8;

/// A measured receptance, and where it comes from.
pub struct Receptance {
    /// Receptance, line by line.
    pub data: FrequencyData,
    /// Origin of the receptance, in words.
    pub origin: String,
    /// Coherence of responses and forces, of records that are no periods.
    pub coherence: Option<ResponseCoherence>,
}

/// Rows of data on which one force acts alone, so that motion over force is the receptance.
pub struct ActingAlone<'a> {
    data: &'a FrequencyData,
    /// Part of force j, the column, that force k, the row, has at most where j acts alone.
    limits: DMatrix<f64>,
}

impl<'a> ActingAlone<'a> {
    /// Tells noise in the channel of an idle force from a part of the force that acts, by its
    /// coherence from line to line where one force acts.
    pub fn of(data: &'a FrequencyData) -> Self {
        let n = data.dof();
        let limits = DMatrix::from_fn(n, n, |k, j| {
            let driven = |row: &usize| {
                let amplitude = data.force()[(*row, j)].norm();
                let limit = ALONE_BESIDE_NOISE * amplitude;
                let others = (0..n).filter(|other| *other != j);
                amplitude > 0.0
                    && others.into_iter().all(|other| data.force()[(*row, other)].norm() <= limit)
            };
            // Each line counts alike, whatever drives it.
            let part = |row: usize| data.force()[(row, k)] / data.force()[(row, j)];
            let parts: Vec<Complex<f64>> = (0..data.len()).filter(driven).map(part).collect();
            let power: f64 = parts.iter().map(|part| part.norm_sqr()).sum();
            // A part of a force hardly turns from line to line, or always alike where it is late.
            let alike: Complex<f64> = parts.windows(2).map(|two| two[0].conj() * two[1]).sum();
            let (lines, coherence) = (parts.len(), alike.norm() / power);
            match lines >= FEWEST_LINES && coherence < PART_OF_IT {
                true => ALONE_BESIDE_NOISE,
                false => ALONE,
            }
        });
        Self { data, limits }
    }

    /// Returns `true` if on a row of the data no force acts but the one on degree of freedom `dof`,
    /// both counted from 0.
    pub fn on(&self, row: usize, dof: usize) -> bool {
        let amplitude = self.data.force()[(row, dof)].norm();
        let absent =
            |k: usize| self.data.force()[(row, k)].norm() <= self.limits[(k, dof)] * amplitude;
        amplitude > 0.0 && (0..self.data.dof()).all(|k| k == dof || absent(k))
    }
}

impl Receptance {
    /// Returns the data fitted in the frequency domain; otherwise those of whole periods, or
    /// averaged over segments of open records.
    ///
    /// # Errors
    /// If the records show none.
    pub fn of(identified: &Identified, parts: &[RecordReview<'_>]) -> Result<Self, AnalysisError> {
        let (data, origin) = measured(identified, parts)?;
        Ok(Self { data, origin, coherence: identified.coherence()? })
    }
}

/// Measured receptance and its origin in words.
fn measured(
    identified: &Identified,
    parts: &[RecordReview<'_>],
) -> Result<(FrequencyData, String), AnalysisError> {
    // One window without averages shows little of a random response.
    let fitted = identified.fitted();
    if let Some(data) = fitted.drawn.as_ref().filter(|_| identified.is_hammer_test()) {
        let origin = "measured on the lines of each hit, without what the ends of its window add";
        return Ok((data.clone(), origin.into()));
    }
    let of_responses = fitted.coherence.is_some();
    let of_lines = identified.drawn_spectra();
    if let Some(data) = of_lines.filter(|_| of_responses || fitted.drawn.is_none()) {
        let origin = match fitted.prediction {
            Prediction::Steady => "measured on the lines used",
            Prediction::Sampled { .. } => "averaged over segments, on the lines used",
        };
        return Ok((data.clone(), origin.into()));
    }
    let first = parts[0].held();
    // The beginning of a period is none.
    let held = first.periods > 1 || first.held_to().is_none();
    let period = match identified.fitted().prediction {
        Prediction::Steady | Prediction::Sampled { extent: Extent::WholePeriod, .. } => held,
        Prediction::Sampled { .. } => first.periods > 1,
    };
    let each = |part: &RecordReview<'_>| match period {
        true => of_periods(part),
        false => of_segments(part.recorded),
    };
    let mut data = each(&parts[0])?;
    for part in &parts[1..] {
        data = data.and(&each(part)?)?;
    }
    let origin = match period {
        true => "measured on the lines of whole periods that carry force".into(),
        false => format!(
            "by H1 from segments of {} samples, half overlapped and weighted by a Hann window, \
                 where the force explains at least half of the motion (a resonance narrower than \
                 the lines looks blunter than it is)",
            segment(first)
        ),
    };
    // A held or linear force is weaker than its samples there, and the motion with it.
    let origin =
        origin + "; towards half the sampling rate the force between the samples shows, too";
    Ok((data, origin))
}

fn of_periods(part: &RecordReview<'_>) -> Result<FrequencyData, AnalysisError> {
    let held = part.held();
    // Several periods tell their noise; of one that is longer than what is held there is the mean.
    let force = match held.force.len() < held.period {
        true => &part.whole.period(held).force,
        false => &held.force,
    };
    let chosen = choose_lines(force, held.period, &LineChoice::Driven)?;
    let lines = Lines::new(force.sampling().with_len(held.period)?, chosen)?;
    Ok(periods(part.recorded, &lines)?.mean()?)
}

fn segment(measured: &Block) -> usize {
    ((measured.period * measured.periods).min(IN_MEMORY_SAMPLES) / SEGMENTS).max(1)
}

fn of_segments(recorded: &Windowed) -> Result<FrequencyData, AnalysisError> {
    let held = &recorded.held;
    let len = segment(held);
    let segments = Segments::Windowed { len, hop: len.div_ceil(2), window: Window::Hann };
    let sampling = held.force.sampling().with_len(len)?;
    let all = Lines::new(sampling, lines::full(sampling))?;
    let responses = average(recorded, &all, segments)?.frf(FrfEstimator::H1)?;
    let explained =
        |row: &usize| responses.coherence().row(*row).iter().all(|part| *part >= EXPLAINED);
    let clear: Vec<usize> = (0..all.as_slice().len()).filter(explained).collect();
    if clear.is_empty() {
        return Err(AnalysisError::NoReceptance);
    }
    Ok(responses.at(&clear).data(&held.driven)?)
}
