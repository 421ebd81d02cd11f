//! Errors of frequency responses: their correlation between lines, and between the entries (output,
//! input) of one line.

use std::collections::HashMap;

use mechid_model::SecondOrderSystem;
use nalgebra::{Complex, DMatrix};

use super::{ComplexMatrix, Frf, Segments};
use crate::limits::{COHERENCE_ROUNDING, SCATTER_DEVIATIONS, SCATTER_FEW, SMOOTHING_STEPS};

/// Covariances of the errors of averaged responses.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scatter {
    /// Covariance of the unexplained parts of the responses at each line, outputs × outputs.
    unexplained: Vec<ComplexMatrix>,
    /// S_FF⁻¹ at each line.
    inverse_force: Vec<ComplexMatrix>,
    /// Variances for weights, averaged over neighbouring lines.
    pub(super) pooled: Vec<DMatrix<f64>>,
    /// Number of independent complex deviations in each pooled variance.
    pub(super) freedom: f64,
    /// Weights of the smoothing by the window: see [`Segments::smoothing`].
    smoothing: Vec<f64>,
    /// Number of samples in a segment.
    samples: usize,
}

impl Scatter {
    /// Creates the covariances for `frf`, whose lines already have variances that are not pooled.
    pub(super) fn new(
        frf: &Frf,
        unexplained: Vec<ComplexMatrix>,
        inverse_force: Vec<ComplexMatrix>,
        segments: Segments,
    ) -> Self {
        let lines = unexplained.len();
        // Lines of whole periods are independent and may be far apart, so they are not pooled.
        let widest = match segments {
            Segments::Periods(_) => 0,
            Segments::Windowed { .. } => lines.saturating_sub(1) / 2,
        };
        Self::pooled(frf, unexplained, inverse_force, segments, widest)
    }

    /// Creates the covariances for responses of a table, in the same way as [`Scatter::new`]. If
    /// there are few averages over periods, the variances of neighbouring lines are pooled, too.
    pub(super) fn for_table(
        frf: &Frf,
        unexplained: Vec<ComplexMatrix>,
        inverse_force: Vec<ComplexMatrix>,
        segments: Segments,
    ) -> Self {
        let inputs = inverse_force.first().map_or(0, |inverse| inverse.nrows());
        let few = frf.averages - (inputs as f64) < SCATTER_FEW;
        match segments {
            Segments::Periods(_) if few => {
                let widest = unexplained.len().saturating_sub(1) / 2;
                Self::pooled(frf, unexplained, inverse_force, segments, widest)
            }
            _ => Self::new(frf, unexplained, inverse_force, segments),
        }
    }

    /// Averages the variances over at most `widest` lines on either side.
    fn pooled(
        frf: &Frf,
        unexplained: Vec<ComplexMatrix>,
        inverse_force: Vec<ComplexMatrix>,
        segments: Segments,
        widest: usize,
    ) -> Self {
        let inputs = inverse_force.first().map_or(0, |inverse| inverse.nrows());
        let per_line = frf.averages - inputs as f64;
        let lines = unexplained.len();
        let freedom = |half: usize| per_line * independent(2 * half + 1, &frf.line_correlation);
        let half = (0..=widest).find(|half| freedom(*half) >= SCATTER_DEVIATIONS).unwrap_or(widest);
        let pooled = (0..lines).map(|line| {
            let first = line.saturating_sub(half).min(lines - (2 * half + 1).min(lines));
            let around = first..(first + 2 * half + 1).min(lines);
            let mut variance = frf.variance[line].clone();
            for (output, mut row) in variance.row_iter_mut().enumerate() {
                let power = |at: usize| unexplained[at][(output, output)].re.max(0.0);
                let mean = around.clone().map(power).sum::<f64>() / around.len() as f64;
                // If a line has no unexplained power, its variance is only rounding and stays
                // unchanged.
                if half > 0 && power(line) > COHERENCE_ROUNDING * mean {
                    row *= mean / power(line);
                }
            }
            variance
        });
        let pooled = pooled.collect();
        let (freedom, smoothing) = (freedom(half), segments.smoothing());
        let samples = segments.samples();
        Self { unexplained, inverse_force, pooled, freedom, smoothing, samples }
    }

    /// Returns the same covariances at some of the lines.
    pub(super) fn at(&self, places: &[usize]) -> Self {
        let of = |all: &[ComplexMatrix]| places.iter().map(|at| all[*at].clone()).collect();
        Self {
            unexplained: of(&self.unexplained),
            inverse_force: of(&self.inverse_force),
            pooled: places.iter().map(|at| self.pooled[*at].clone()).collect(),
            freedom: self.freedom,
            smoothing: self.smoothing.clone(),
            samples: self.samples,
        }
    }

    /// Returns the covariance of the errors of two responses at a line, each given as (output,
    /// input), divided by the standard deviations that weight them.
    pub(super) fn covariance(
        &self,
        line: usize,
        averages: f64,
        [left, right]: [(usize, usize); 2],
    ) -> Complex<f64> {
        let deviation = |(output, input)| self.pooled[line][(output, input)].sqrt();
        self.unexplained[line][(left.0, right.0)] * self.inverse_force[line][(right.1, left.1)]
            / (averages * deviation(left) * deviation(right))
    }
}

/// Returns the equivalent number of independent lines among neighbouring lines with this
/// correlation of their powers.
fn independent(lines: usize, correlation: &[f64]) -> f64 {
    let count = lines as f64;
    let pairs = correlation.iter().enumerate().skip(1).take(lines.saturating_sub(1));
    let common: f64 = pairs.map(|(apart, c)| c * (1.0 - apart as f64 / count)).sum();
    count / (1.0 + 2.0 * common)
}

/// Returns the bias that averaging over segments with these weights ([`Segments::smoothing`])
/// causes in a frequency response: the window smooths the response and reduces a resonance. The
/// response is given as a function of ω (rad/s). The lines are given by their numbers: line k is at
/// k · `spacing` (rad/s). `None` on a line without a finite response.
/// # Source
/// Bendat & Piersol, *Random Data*, 4th ed. (2010), section 8.5 (bias errors of spectral
/// estimates).
pub fn smoothing_bias(
    smoothing: &[f64],
    lines: &[usize],
    spacing: f64,
    response: &dyn Fn(f64) -> Option<ComplexMatrix>,
) -> Vec<Option<ComplexMatrix>> {
    let step = spacing / SMOOTHING_STEPS as f64;
    let finite = |place: i64| {
        response(place as f64 * step).filter(|h| h.iter().all(|z: &Complex<f64>| z.is_finite()))
    };
    // The responses are needed at several frequencies around each line. Neighbouring lines need
    // mostly the same frequencies, so computed responses are stored.
    let mut known: HashMap<i64, Option<ComplexMatrix>> = HashMap::new();
    let bias_at = |line: &usize| {
        let centre = (line * SMOOTHING_STEPS) as i64;
        let exact = known.entry(centre).or_insert_with(|| finite(centre)).clone()?;
        let mut smooth = &exact * Complex::from(smoothing[0]);
        for (apart, weight) in smoothing.iter().enumerate().skip(1) {
            for side in [centre - apart as i64, centre + apart as i64] {
                // A system with rigid-body modes has no static response.
                let there = known.entry(side).or_insert_with(|| finite(side));
                smooth += there.as_ref().unwrap_or(&exact) * Complex::from(*weight);
            }
        }
        Some(smooth - exact)
    };
    lines.iter().map(bias_at).collect()
}

impl Frf {
    /// Returns whether the window of the segments smooths the responses.
    pub fn is_smoothed(&self) -> bool {
        self.scatter.as_ref().is_some_and(|scatter| scatter.smoothing.len() > 1)
    }

    /// Returns the responses minus the bias from the window of the segments, which smooths a
    /// response and reduces a resonance; the bias is computed from the responses of `system` to
    /// forces at the degrees of freedom `force_dof`.
    #[must_use]
    pub fn sharpened(&self, system: &SecondOrderSystem, force_dof: &[usize]) -> Self {
        let Some(scatter) = self.scatter.as_ref().filter(|_| self.is_smoothed()) else {
            return self.clone();
        };
        let response = |omega: f64| {
            let receptance = system.receptance(omega).ok()?;
            Some(receptance.select_columns(force_dof) * self.measured.per_displacement(omega))
        };
        let bias = smoothing_bias(&scatter.smoothing, &self.lines, self.line_spacing(), &response);
        let mut sharp = self.clone();
        for (response, bias) in sharp.response.iter_mut().zip(bias) {
            if let Some(bias) = bias {
                *response -= bias;
            }
        }
        sharp
    }

    /// Returns the line spacing, in rad/s, and the number of samples in a segment, if the window
    /// smooths the responses.
    pub fn resolution(&self) -> Option<[f64; 2]> {
        let scatter = self.scatter.as_ref().filter(|_| self.is_smoothed())?;
        Some([self.line_spacing(), scatter.samples as f64])
    }

    /// Returns whether the covariance of the errors of two responses at a line is known.
    pub fn has_error_covariance(&self) -> bool {
        self.scatter.is_some()
    }

    /// Returns the covariance of the errors of two responses at a line, each given as (output,
    /// input), divided by the standard deviations that weight them; `None` for responses from
    /// [`Frf::new`] and after the subtraction of crosstalk.
    pub fn error_covariance(&self, line: usize, pair: [(usize, usize); 2]) -> Option<Complex<f64>> {
        Some(self.scatter.as_ref()?.covariance(line, self.averages, pair))
    }

    /// Returns the lines whose errors are correlated with the errors of a given line, including
    /// this line, and the correlations.
    pub fn correlated_lines(&self, line: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let reach = self.line_correlation.len() - 1;
        let around = line.saturating_sub(reach)..(line + reach + 1).min(self.lines.len());
        around.filter_map(move |other| {
            let apart = self.lines[other].abs_diff(self.lines[line]);
            Some((other, *self.line_correlation.get(apart)?))
        })
    }

    /// Returns the line spacing of a segment, in rad/s.
    fn line_spacing(&self) -> f64 {
        self.omega[0] / self.lines[0].max(1) as f64
    }
}
