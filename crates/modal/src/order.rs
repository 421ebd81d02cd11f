//! Number of modes: candidates in the residual, and the gain in likelihood of each mode.

use mechid_numerics::time_limit;
use nalgebra::Complex;
use rayon::prelude::*;

use crate::limits::{
    HIDDEN_HALF_WIDTHS, HIDDEN_WIDTHS, LEAST_HIDDEN_SHARE, MAX_DAMPING, MAX_TRIES, MIN_SCAN_LINES,
    SCAN_HALF_WIDTHS,
};
use crate::lines::Lines;
use crate::residues::leading_row;
use crate::search::Fit;

type C = Complex<f64>;

/// Damping ratios of the grid of candidates.
const DAMPING_GRID: [f64; 6] = [5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 3e-2];
/// Step of the grid's frequencies, in half-widths.
const GRID_STEP: f64 = 0.5;
/// Minimum gain of a candidate in the scan, as a fraction of the required gain; candidates below it
/// are not tried.
const TRIAL_GAIN: f64 = 0.5;

/// Candidate for a further mode in the residual.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) pole: C,
    pub(crate) participation: Vec<C>,
    /// Decrease of −2 log L by this mode alone.
    pub(crate) gain: f64,
    /// Fraction of the power of the residual around the candidate that the candidate explains.
    pub(crate) explained: f64,
}

/// Returns the decrease of −2 log L that one more mode must achieve: the number of its parameters
/// times the logarithm of the number of observations (Schwarz, Annals of Statistics 6 (1978) 461).
pub(crate) fn required_gain(lines: &Lines) -> f64 {
    let parameters = 2 * (lines.outputs.len() + lines.loads.len() - 1) + 2;
    parameters as f64 * lines.schwarz()
}

/// Returns, for each mode, the increase of the cost if this mode is removed and all other poles and
/// participations stay as they are.
pub(crate) fn removal_losses(fit: &Fit<'_>) -> Vec<f64> {
    let (triangle, modes) = (&fit.projection.triangle, fit.model.modes());
    let columns = triangle.size;
    let mut rows = vec![0.0; columns * 2 * modes];
    (0..2 * modes).for_each(|k| rows[k * columns + k] = 1.0);
    triangle.solve_transposed(&mut rows);
    let product = |a: usize, b: usize| -> f64 {
        let (a, b) = (&rows[a * columns..(a + 1) * columns], &rows[b * columns..(b + 1) * columns]);
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    };
    let loss = |mode: usize| {
        let (i, j) = (2 * mode, 2 * mode + 1);
        let (a, b, c) = (product(i, i), product(i, j), product(j, j));
        let determinant = a * c - b * b;
        let output_loss = |unknowns: &[f64]| {
            let (x, y) = (unknowns[i], unknowns[j]);
            (c * x * x - 2.0 * b * x * y + a * y * y) / determinant
        };
        fit.projection.unknowns.chunks_exact(columns).map(output_loss).sum()
    };
    (0..modes).map(loss).collect()
}

/// Returns whether a pole is within the resonance of a mode of the fit and has about the same width
/// as the mode. The unmeasured force on the mode can hide only such a pole.
pub(crate) fn is_within_resonance(pole: C, modes: &[C]) -> bool {
    let width = |mode: &C| pole.re / mode.re;
    let inside = |mode: &&C| (pole.im - mode.im).abs() < HIDDEN_HALF_WIDTHS * -mode.re;
    modes
        .iter()
        .filter(inside)
        .any(|mode| (HIDDEN_WIDTHS.recip()..=HIDDEN_WIDTHS).contains(&width(mode)))
}

/// Returns the best candidate within the resonance of a mode of the fit. The response of the
/// candidate to the measured forces must explain most of the residual around the candidate.
///
/// If two close modes are fitted as one mode, the unmeasured force on this mode represents the
/// remaining response, and the weights hide the second mode. Such a residual depends on the
/// measured forces; noise and the response to unmeasured forces do not.
pub(crate) fn hidden(fit: &Fit<'_>, required: f64) -> Option<Candidate> {
    let mut candidates = candidates(fit, &|pole| is_within_resonance(pole, &fit.model.poles));
    candidates.retain(|one| one.gain > required && one.explained > LEAST_HIDDEN_SHARE);
    candidates.into_iter().next()
}

/// Returns the candidates of the residual, the best first.
pub(crate) fn scan(fit: &Fit<'_>) -> Vec<Candidate> {
    candidates(fit, &|_| true)
}

/// Returns the candidates at the poles (rad/s) of the grid for which `is_tried` is true, the best
/// first.
fn candidates(fit: &Fit<'_>, is_tried: &dyn Fn(C) -> bool) -> Vec<Candidate> {
    let lines = fit.lines;
    let (low, high) = lines.band();
    let spacing = (high - low) / lines.blocks[0].len().max(2) as f64;
    let spacing = line_spacing(lines).unwrap_or(spacing);
    let mut grid = Vec::new();
    for damping in DAMPING_GRID {
        let mut omega = low;
        while omega < high {
            if is_tried(C::new(-damping * omega, omega)) {
                grid.push((omega, damping));
            }
            omega += (GRID_STEP * damping * omega).max(0.75 * spacing);
        }
    }
    let residuals = Residual::new(fit);
    let mut candidates: Vec<Candidate> = grid
        .par_iter()
        .filter_map(|&(omega, damping)| residuals.candidate(lines, omega, damping, spacing))
        .collect();
    candidates.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    candidates
}

/// Returns the distance between the first two lines.
fn line_spacing(lines: &Lines) -> Option<f64> {
    let [first, second] = lines.omega.get(..2)? else { return None };
    Some((second - first).abs()).filter(|spacing| *spacing > 0.0)
}

/// Whitened residuals as complex rows.
struct Residual {
    /// Residual of every output on every line: `[line · outputs + output]`.
    values: Vec<C>,
    /// Weight of every line.
    weight: Vec<f64>,
}

impl Residual {
    fn new(fit: &Fit<'_>) -> Self {
        let (lines, outputs) = (fit.lines, fit.lines.outputs.len());
        let mut values = vec![C::default(); lines.len() * outputs];
        let mut weight = Vec::with_capacity(lines.len());
        for (block, arrays) in lines.blocks.iter().zip(&fit.projection.blocks) {
            let n = block.len();
            weight.extend_from_slice(&arrays.weight);
            for (output, column) in arrays.residual.chunks_exact(2 * n).enumerate() {
                for line in 0..n {
                    let index = (block.rows.start + line) * outputs + output;
                    values[index] = C::new(column[line], column[n + line]);
                }
            }
        }
        Self { values, weight }
    }

    /// Fits one more mode, at a given pole, to the residual near this pole.
    fn candidate(
        &self,
        lines: &Lines,
        omega: f64,
        damping: f64,
        spacing: f64,
    ) -> Option<Candidate> {
        let pole = C::new(-damping * omega, omega * (1.0 - damping * damping).sqrt());
        let half_range = (SCAN_HALF_WIDTHS * damping * omega).max(MIN_SCAN_LINES as f64 * spacing);
        let (loads, outputs) = (lines.loads.len(), lines.outputs.len());
        let mut square = vec![C::default(); loads * loads];
        let mut cross = vec![C::default(); loads * outputs];
        let mut column = vec![C::default(); loads];
        let mut power = 0.0;
        for block in &lines.blocks {
            let omega_block = &lines.omega[block.rows.clone()];
            let first = omega_block.partition_point(|w| *w < omega - half_range);
            let last = omega_block.partition_point(|w| *w <= omega + half_range);
            for row in block.rows.start + first..block.rows.start + last.max(first) {
                let gain = self.weight[row] / (C::new(0.0, lines.omega[row]) - pole);
                for &load in &block.active {
                    column[load] = lines.load(load, row) * gain;
                }
                let residual = &self.values[row * outputs..(row + 1) * outputs];
                power += residual.iter().map(|z| z.norm_sqr()).sum::<f64>();
                for &a in &block.active {
                    let conjugate = column[a].conj();
                    for &b in &block.active {
                        square[a * loads + b] += conjugate * column[b];
                    }
                    let to = &mut cross[a * outputs..(a + 1) * outputs];
                    to.iter_mut().zip(residual).for_each(|(to, r)| *to += conjugate * r);
                }
            }
        }
        rank_one(&mut square, &mut cross, loads, outputs).map(|(participation, gain)| Candidate {
            pole,
            participation,
            gain,
            explained: gain / power.max(f64::MIN_POSITIVE),
        })
    }
}

/// Solves a least-squares problem for a coefficient matrix of rank one, and returns the
/// participations in this matrix and its gain. The products of the problem are `square` (loads ×
/// loads) and `cross` (loads × outputs).
fn rank_one(
    square: &mut [C],
    cross: &mut [C],
    loads: usize,
    outputs: usize,
) -> Option<(Vec<C>, f64)> {
    let trace: f64 = (0..loads).map(|k| square[k * loads + k].re).sum();
    if !(trace > 0.0 && trace.is_finite()) {
        return None;
    }
    // This loop replaces `square` by its Cholesky factor F (square = F Fᴴ), and `cross` by F⁻¹
    // cross.
    for k in 0..loads {
        for j in 0..k {
            let sum: C = (0..j).map(|i| square[k * loads + i] * square[j * loads + i].conj()).sum();
            square[k * loads + j] = (square[k * loads + j] - sum) / square[j * loads + j];
        }
        let sum: f64 = (0..k).map(|i| square[k * loads + i].norm_sqr()).sum();
        let pivot = square[k * loads + k].re - sum;
        square[k * loads + k] = C::from(pivot.max(1e-12 * trace).sqrt());
        for j in 0..k {
            let factor = square[k * loads + j];
            for output in 0..outputs {
                let part = factor * cross[j * outputs + output];
                cross[k * outputs + output] -= part;
            }
        }
        let pivot = square[k * loads + k];
        cross[k * outputs..(k + 1) * outputs].iter_mut().for_each(|value| *value /= pivot);
    }
    // Each row is one column of F⁻¹ cross, with one entry for each load.
    let rows: Vec<Vec<C>> = (0..outputs)
        .map(|output| (0..loads).map(|load| cross[load * outputs + output]).collect())
        .collect();
    let mut direction = leading_row(&rows);
    let power: f64 = direction.iter().map(|z| z.norm_sqr()).sum();
    let along = |row: &Vec<C>| {
        let product: C = row.iter().zip(&direction).map(|(r, d)| r * d.conj()).sum();
        product.norm_sqr()
    };
    let gain = rows.iter().map(along).sum::<f64>() / power;
    for k in (0..loads).rev() {
        let sum: C = (k + 1..loads).map(|i| square[i * loads + k].conj() * direction[i]).sum();
        direction[k] = (direction[k] - sum) / square[k * loads + k];
    }
    gain.is_finite().then_some((direction, gain))
}

/// Adds the best candidate whose gain after a search is at least `required`; otherwise, and after
/// the end of a time limit, returns the candidates that were tried, with their gains.
pub(crate) fn add_best(fit: &mut Fit<'_>, required: f64) -> Result<(), Vec<Candidate>> {
    let mut tried: Vec<Candidate> = Vec::new();
    for candidate in scan(fit) {
        let is_last = tried.len() >= MAX_TRIES || candidate.gain < TRIAL_GAIN * required;
        if is_last || time_limit::is_over() {
            break;
        }
        let is_near = |other: &Candidate| {
            let width = (-candidate.pole.re).max(-other.pole.re);
            (candidate.pole.im - other.pole.im).abs() < 2.0 * width
        };
        if tried.iter().any(is_near) {
            continue;
        }
        let mut trial = fit.clone();
        trial.model.push(&candidate);
        trial.refresh();
        trial.search_roughly();
        let gain = fit.cost() - trial.cost();
        let pole = trial.model.poles[fit.model.modes()];
        let possible = -pole.re / pole.norm() < MAX_DAMPING && fit.lines.reaches(pole);
        log::debug!(
            "candidate {:.3} Hz: gain {:.0} in the scan, {gain:.0} after {} steps; required {required:.0}",
            pole.im / std::f64::consts::TAU,
            candidate.gain,
            trial.steps - fit.steps,
        );
        if gain > required && possible {
            *fit = trial;
            return Ok(());
        }
        tried.push(Candidate { pole, gain, ..candidate });
    }
    Err(tried)
}
