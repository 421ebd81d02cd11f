//! Scores of the search: projected derivatives of each block, and the effect of an unmeasured force
//! on these scores.

use nalgebra::{Complex, DMatrix};

use crate::dense::{add_product, gram, transposed_product};
use crate::limits::NEGLIGIBLE_PROCESS_POWER;
use crate::lines::{Block, Lines};
use crate::model::Model;
use crate::noise::{Noise, modal_gain};
use crate::normal::block_pairs;
use crate::projection::BlockArrays;
use crate::search::Fit;

type C = Complex<f64>;

/// Matrix products of one block, after the linear unknowns are projected out.
pub(crate) struct BlockProducts {
    /// Lower triangle of C̃ᵀRC̃ for all parameters, with the projected derivatives C̃ and the
    /// relative variances R.
    pub(crate) gram: Vec<f64>,
    /// A⁺R(A⁺)ᵀ with the relative variances R, for the rows of the pseudoinverse A⁺ that belong to
    /// modes.
    pub(crate) inverse: Vec<f64>,
    /// Rows of the pseudoinverse A⁺ that belong to modes; each is stored as a column of 2n entries.
    influence: Vec<f64>,
    /// Projected derivatives, 2n rows.
    derivatives: Vec<f64>,
}

/// Covariances of the two unknowns of the shape of a mode (real and imaginary part) due to the
/// unmeasured force on this mode, for a whitened shape of 1.
#[derive(Debug, Clone)]
pub(crate) struct ProcessEffect {
    /// Covariance of the two unknowns of the shape, 2 × 2.
    pub(crate) shape_covariance: DMatrix<f64>,
    /// Covariance between the two unknowns of the shape and the score (2 × parameters), for a shape
    /// whose phase is zero.
    pub(crate) cross: DMatrix<C>,
}

/// Returns the entries at `indices` of every column in `columns_of_all`. Each column has `columns`
/// entries, one for each linear unknown of the whole problem.
fn local_rows(columns_of_all: &[f64], columns: usize, indices: &[usize]) -> Vec<f64> {
    let chunks = columns_of_all.chunks_exact(columns.max(1));
    chunks.flat_map(|column| indices.iter().map(|index| column[*index])).collect()
}

/// Returns columns in which the real and the imaginary part of each line are multiplied by the
/// factor of the line.
fn scaled(columns: &[f64], factors: &[f64]) -> Vec<f64> {
    columns.iter().zip(factors.iter().cycle()).map(|(value, factor)| value * factor).collect()
}

impl BlockProducts {
    /// Computes the products of a block; `deviation` is the standard deviation of the sensor noise
    /// on each line relative to the weights.
    #[allow(clippy::too_many_arguments, reason = "all arguments belong to one fit")]
    pub(crate) fn new(
        lines: &Lines,
        model: &Model,
        block: &Block,
        arrays: &BlockArrays,
        pairs: &[(usize, Option<usize>)],
        followed: &[f64],
        inverse_rows: &[f64],
        deviation: &[f64],
    ) -> Self {
        let (rows, size) = (2 * block.len(), 2 * pairs.len());
        let columns = followed.len() / size.max(1);
        let (indices, local) = block_pairs(pairs, block);
        let mut block_derivatives = vec![0.0; rows * 2 * local.len()];
        model.fill_derivatives(lines, block, &arrays.weight, &local, &mut block_derivatives);
        let mut derivatives = vec![0.0; rows * size];
        for (index, pair) in indices.iter().zip(block_derivatives.chunks_exact(2 * rows)) {
            derivatives[2 * index * rows..(2 * index + 2) * rows].copy_from_slice(pair);
        }
        let inner = arrays.columns.len();
        let part = local_rows(followed, columns, &arrays.columns);
        add_product(&mut derivatives, &arrays.design, &part, rows, inner, -1.0);
        let mut product = vec![0.0; size * size];
        gram(&scaled(&derivatives, deviation), rows, &mut product);
        let block_inverse = local_rows(inverse_rows, columns, &arrays.columns);
        let mut influence = vec![0.0; rows * 2 * model.modes()];
        add_product(&mut influence, &arrays.design, &block_inverse, rows, inner, 1.0);
        let relative = scaled(&influence, deviation);
        let inverse = transposed_product(&relative, &relative, rows);
        Self { gram: product, inverse, influence, derivatives }
    }
}

/// Data that define the score of the search.
pub(crate) struct Scores<'a> {
    pub(crate) pairs: &'a [(usize, Option<usize>)],
    pub(crate) shapes: &'a [f64],
    pub(crate) scale: &'a [f64],
}

impl Scores<'_> {
    /// Adds to `score_variance` the variance of the score due to the unmeasured force on one mode,
    /// and returns the effect of this force on the shape of the mode.
    pub(crate) fn add_process(
        &self,
        fit: &Fit<'_>,
        noise: &Noise,
        mode: usize,
        blocks: &[BlockProducts],
        score_variance: &mut [f64],
    ) -> ProcessEffect {
        let (lines, size) = (fit.lines, 2 * self.pairs.len());
        let (along, direction) = self.along(mode, lines.outputs.len());
        let mut effect = ProcessEffect {
            shape_covariance: DMatrix::zeros(2, 2),
            cross: DMatrix::zeros(2, size),
        };
        if noise.process[mode] <= 0.0 {
            return effect;
        }
        for (block, products) in lines.blocks.iter().zip(blocks) {
            let n = block.len();
            let gain = |line: usize| {
                let row = block.rows.start + line;
                let gain = modal_gain(fit.model.poles[mode], lines.omega[row]);
                gain * (noise.process[mode].sqrt() / fit.weights.spectrum_shape[row])
            };
            let share = |line: &usize| gain(*line).norm_sqr() * direction;
            let active: Vec<usize> =
                (0..n).filter(|line| share(line) > NEGLIGIBLE_PROCESS_POWER).collect();
            let rows = 2 * active.len();
            if rows == 0 {
                continue;
            }
            let mut scores = vec![0.0; rows * size];
            for (pair, (p, q)) in along.iter().enumerate() {
                let derivatives = &products.derivatives[4 * pair * n..(4 * pair + 4) * n];
                let (first, second) =
                    scores[2 * pair * rows..(2 * pair + 2) * rows].split_at_mut(rows);
                for (k, &line) in active.iter().enumerate() {
                    let u = C::new(derivatives[line], -derivatives[n + line]);
                    let v = C::new(derivatives[2 * n + line], -derivatives[3 * n + line]);
                    let a = (u * p + v * q) * gain(line) * self.scale[2 * pair];
                    let b = (v * p - u * q) * gain(line) * self.scale[2 * pair + 1];
                    (first[2 * k], first[2 * k + 1]) = (a.re, a.im);
                    (second[2 * k], second[2 * k + 1]) = (b.re, b.im);
                }
            }
            let part = transposed_product(&scores, &scores, rows);
            score_variance.iter_mut().zip(&part).for_each(|(to, part)| *to += part);
            let influence = &products.influence[4 * mode * n..(4 * mode + 4) * n];
            let unknown = |row: usize, line: usize| {
                let derivatives = &influence[2 * row * n..(2 * row + 2) * n];
                C::new(derivatives[line], -derivatives[n + line]) * gain(line)
            };
            for (k, &line) in active.iter().enumerate() {
                effect.add_line([unknown(0, line), unknown(1, line)], &scores, rows, k);
            }
        }
        effect
    }

    /// Returns Σ_i x_si α_i and Σ_i y_si α_i of every pair of parameters, and Σ |α_i|²: α is the
    /// whitened shape of the driven mode, x_s and y_s are the real and imaginary parts of the
    /// whitened shape of the pair's mode s.
    fn along(&self, mode: usize, outputs: usize) -> (Vec<(C, C)>, f64) {
        let column = |row: usize| &self.shapes[row * outputs..(row + 1) * outputs];
        let product = |a: usize, b: usize| -> f64 {
            column(a).iter().zip(column(b)).map(|(a, b)| a * b).sum()
        };
        let (x, y) = (2 * mode, 2 * mode + 1);
        let shape_product = |row: usize| C::new(product(row, x), product(row, y));
        let along = self
            .pairs
            .iter()
            .map(|&(s, _)| (shape_product(2 * s), shape_product(2 * s + 1)))
            .collect();
        (along, product(x, x) + product(y, y))
    }
}

impl ProcessEffect {
    /// Adds one line; `unknowns` and `scores` are the responses of the two unknowns and of the
    /// scores to a unit force.
    fn add_line(&mut self, unknowns: [C; 2], scores: &[f64], rows: usize, line: usize) {
        for (a, value) in unknowns.iter().enumerate() {
            for (b, other) in unknowns.iter().enumerate() {
                self.shape_covariance[(a, b)] += (value * other.conj()).re;
            }
            for (parameter, score) in scores.chunks_exact(rows).enumerate() {
                let score = C::new(score[2 * line], -score[2 * line + 1]);
                self.cross[(a, parameter)] += value * score;
            }
        }
    }
}
