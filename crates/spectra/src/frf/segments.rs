//! Segments of records for averaging.

use std::f64::consts::TAU;

use mechid_signal::Window;
use nalgebra::{Complex, DVectorView};

use crate::SpectraError;
use crate::limits::{FARTHEST_LINES, SEGMENT_INDEPENDENT, SMOOTHED_LINES, SMOOTHING_STEPS};

/// Segments of a record for averaging.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Segments {
    /// Whole periods of this many samples, for a periodic excitation in steady state; there is no
    /// window and no leakage.
    Periods(usize),
    /// Segments under a window, with their means removed, for a random excitation (Welch's method).
    Windowed {
        /// Number of samples in a segment.
        len: usize,
        /// Number of samples from the start of one segment to the start of the next, 1 to `len`.
        hop: usize,
        /// Window that weights the samples.
        window: Window,
    },
}

impl Segments {
    /// Creates segments of `len` samples that overlap by half, under Hann's window.
    pub fn hann(len: usize) -> Self {
        Segments::Windowed { len, hop: len.div_ceil(2), window: Window::Hann }
    }

    /// Returns the equivalent number of independent segments (a pure number). It is smaller than
    /// the number of segments if they overlap.
    ///
    /// # Errors
    /// [`SpectraError::Hop`].
    ///
    /// # Source
    /// Welch (1967), IEEE Trans. Audio Electroacoustics 15, 70–73.
    pub fn averages(self, pieces: usize) -> Result<f64, SpectraError> {
        Ok(self.averages_under(self.weights()?.as_deref(), pieces))
    }

    /// Returns the same number as [`Segments::averages`], for given samples of the window.
    pub(super) fn averages_under(self, weights: Option<&[f64]>, pieces: usize) -> f64 {
        let loss = weights.map(|weights| overlap_loss(weights, self.hop(), pieces));
        pieces as f64 / loss.unwrap_or(1.0)
    }

    /// Returns the number of samples in a segment.
    pub fn samples(self) -> usize {
        match self {
            Segments::Periods(len) | Segments::Windowed { len, .. } => len,
        }
    }

    /// Returns the correlation of the errors of a frequency response on two lines (pure numbers),
    /// for this many segments. The entries belong to distances of 0, 1 … lines, up to the largest
    /// distance with a noticeable correlation.
    ///
    /// The correlation has two causes: the window leaks noise and force in the same way from a line
    /// to its neighbours, and overlapping segments share samples. The correlation is Σ_j |ρ_j(d)|²
    /// over segments j hops apart, with ρ_j(d) = Σ w(k) w(k + j hop) exp(−2πi d k/len) for the
    /// window w, relative to the value at the distance d = 0.
    ///
    /// # Source
    /// Welch (1967), IEEE Transactions on Audio and Electroacoustics 15, 70–73 (segments that
    /// overlap).
    pub fn line_correlation(self, pieces: usize) -> Vec<f64> {
        let Segments::Windowed { len, hop, window } = self else { return vec![1.0] };
        let weights: Vec<f64> = (0..len).map(|k| window.weight(k, len)).collect();
        let common = |apart: usize, lines: usize| {
            let turn = |k: usize| Complex::cis(-TAU * ((lines * k) % len) as f64 / len as f64);
            let pairs = weights.iter().zip(&weights[apart * hop..]).enumerate();
            let shared: Complex<f64> = pairs.map(|(k, (a, b))| turn(k) * a * b).sum();
            let times =
                if apart == 0 { 1.0 } else { 2.0 * (1.0 - apart as f64 / pieces as f64).max(0.0) };
            times * shared.norm_sqr()
        };
        let overlapping = len.div_ceil(hop);
        let at = |lines: usize| (0..overlapping).map(|apart| common(apart, lines)).sum::<f64>();
        let at_zero = at(0);
        let mut correlation: Vec<f64> =
            (0..FARTHEST_LINES.min(len)).map(|lines| at(lines) / at_zero).collect();
        let tied = correlation.iter().rposition(|c| *c >= SEGMENT_INDEPENDENT).unwrap_or(0);
        correlation.truncate(tied + 1);
        correlation
    }

    /// Returns the weights with which averaging over segments smooths a frequency response under a
    /// random force: |W|² of the window (pure numbers), at distances from a line in steps of
    /// 1/`SMOOTHING_STEPS` lines. The weights are symmetric about the line. The list is empty
    /// without smoothing, that is for periods and for the rectangular window (which is for segments
    /// that begin and end at rest).
    ///
    /// # Source
    /// Bendat & Piersol, *Random Data*, 4th ed. (2010), section 8.5 (bias errors of spectral
    /// estimates): the impulse response h(τ) is multiplied by the autocorrelation of the window.
    pub fn smoothing(self) -> Vec<f64> {
        let Segments::Windowed { len, window, .. } = self else { return Vec::new() };
        if window == Window::Rectangular {
            return Vec::new();
        }
        let power = |step: usize| {
            let turn = TAU * step as f64 / (SMOOTHING_STEPS * len) as f64;
            let terms = (0..len).map(|k| Complex::cis(-turn * k as f64) * window.weight(k, len));
            terms.sum::<Complex<f64>>().norm_sqr()
        };
        let half: Vec<f64> = (0..=SMOOTHED_LINES * SMOOTHING_STEPS).map(power).collect();
        let total = half[0] + 2.0 * half[1..].iter().sum::<f64>();
        half.into_iter().map(|weight| weight / total).collect()
    }

    /// Returns the number of samples from the start of one segment to the start of the next.
    pub fn hop(self) -> usize {
        match self {
            Segments::Periods(len) => len,
            Segments::Windowed { hop, .. } => hop,
        }
    }

    /// Returns the window over the samples of a segment; `None` without a window.
    pub(super) fn weights(self) -> Result<Option<Vec<f64>>, SpectraError> {
        match self {
            Segments::Periods(_) => Ok(None),
            Segments::Windowed { len, hop, .. } if hop == 0 || hop > len => {
                Err(SpectraError::Hop { len, hop })
            }
            Segments::Windowed { len, window, .. } => {
                Ok(Some((0..len).map(|k| window.weight(k, len)).collect()))
            }
        }
    }
}

/// Writes a segment. If there is a window, the mean is removed and the samples are weighted;
/// otherwise the segment is unchanged.
pub(super) fn weigh(piece: &[f64], window: Option<&[f64]>, weighed: &mut [f64]) {
    let Some(window) = window else { return weighed.copy_from_slice(piece) };
    let mean = DVectorView::from_slice(piece, piece.len()).mean();
    for ((to, x), w) in weighed.iter_mut().zip(piece).zip(window) {
        *to = (x - mean) * w;
    }
}

/// Returns the variance of an average of overlapping windowed segments, relative to that of an
/// average of independent segments: 1 + 2 Σ (1 − j/count) ρ_j², where ρ_j is the correlation of two
/// segments j hops apart.
///
/// # Source
/// Welch (1967), IEEE Trans. Audio Electroacoustics 15, 70–73.
fn overlap_loss(window: &[f64], hop: usize, count: usize) -> f64 {
    let power: f64 = window.iter().map(|w| w * w).sum();
    let common = |apart: usize| {
        let shared = window.iter().zip(&window[apart * hop..]).map(|(a, b)| a * b).sum::<f64>();
        (1.0 - apart as f64 / count as f64) * (shared / power).powi(2)
    };
    let overlapping = (1..count).take_while(|apart| apart * hop < window.len());
    1.0 + 2.0 * overlapping.map(common).sum::<f64>()
}
