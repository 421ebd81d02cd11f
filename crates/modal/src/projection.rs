//! Least squares of the linear unknowns, for all outputs with one matrix.

use mechid_numerics::time_limit;
use rayon::prelude::*;

use crate::dense::{Triangle, add_product, triangularise};
use crate::limits::VECTOR_OPERATIONS;
use crate::lines::{Block, Lines};

/// Approximate standard deviation of the noise for the search. It is the product of a spectral
/// shape, which all outputs share, and a level of each output: E|n_i(ω)|² = (shape(ω) level_i)².
#[derive(Debug, Clone)]
pub(crate) struct Weights {
    pub(crate) spectrum_shape: Vec<f64>,
    pub(crate) level: Vec<f64>,
}

impl Weights {
    /// Returns √2/`spectrum_shape` on the lines of a block. If an output is divided by its level
    /// and multiplied by this factor, the real and imaginary parts of its noise have variance 1.
    pub(crate) fn block_weights(&self, block: &Block) -> Vec<f64> {
        let whiten = |shape: &f64| std::f64::consts::SQRT_2 / shape;
        self.spectrum_shape[block.rows.clone()].iter().map(whiten).collect()
    }
}

/// Columns of a linear model, block by block.
pub(crate) trait Design: Sync {
    /// Returns the number of columns of all blocks.
    fn columns(&self, lines: &Lines) -> usize;
    /// Returns the indices of the columns that are not zero on the lines of a block.
    fn block_columns(&self, lines: &Lines, block: &Block) -> Vec<usize>;
    /// Writes the whitened columns of a block; each has the real parts above the imaginary parts.
    fn fill(&self, lines: &Lines, block: &Block, weight: &[f64], columns: &mut [f64]);
}

impl Design for crate::model::Model {
    fn columns(&self, lines: &Lines) -> usize {
        self.columns(lines)
    }

    fn block_columns(&self, lines: &Lines, block: &Block) -> Vec<usize> {
        self.block_columns(lines, block)
    }

    fn fill(&self, lines: &Lines, block: &Block, weight: &[f64], columns: &mut [f64]) {
        self.fill(lines, block, weight, columns);
    }
}

/// Arrays of one block; their memory is reused in every step.
#[derive(Debug, Clone, Default)]
pub(crate) struct BlockArrays {
    pub(crate) weight: Vec<f64>,
    /// Whitened outputs, 2n rows each for n lines.
    pub(crate) outputs: Vec<f64>,
    /// Indices of the columns of the whole problem that act on the block.
    pub(crate) columns: Vec<usize>,
    /// Whitened columns of the design matrix, 2n rows each for n lines.
    pub(crate) design: Vec<f64>,
    /// Whitened residuals, 2n rows each for n lines.
    pub(crate) residual: Vec<f64>,
    /// Design and outputs, replaced by their triangular factor.
    stacked: Vec<f64>,
    /// Unknowns of the columns of the block.
    local: Vec<f64>,
}

/// Linear unknowns of all outputs for a given design, and the residuals of the outputs.
#[derive(Debug, Clone, Default)]
pub(crate) struct Projection {
    pub(crate) blocks: Vec<BlockArrays>,
    pub(crate) triangle: Triangle,
    /// Unknowns of each output, divided by the level of the output, one output after the other.
    pub(crate) unknowns: Vec<f64>,
    /// Sum of the squared whitened residuals.
    pub(crate) cost: f64,
    stacked: Vec<f64>,
}

impl Projection {
    /// Whitens the outputs.
    pub(crate) fn whiten(&mut self, lines: &Lines, weights: &Weights) {
        self.blocks.resize_with(lines.blocks.len(), BlockArrays::default);
        for (arrays, block) in self.blocks.iter_mut().zip(&lines.blocks) {
            let n = block.len();
            arrays.weight = weights.block_weights(block);
            arrays.outputs.resize(2 * n * lines.outputs.len(), 0.0);
            for (output, column) in arrays.outputs.chunks_exact_mut(2 * n).enumerate() {
                let (real, imaginary) = column.split_at_mut(n);
                let values = &lines.outputs[output][block.rows.clone()];
                for (line, value) in values.iter().enumerate() {
                    let whitened = value * (arrays.weight[line] / weights.level[output]);
                    (real[line], imaginary[line]) = (whitened.re, whitened.im);
                }
            }
        }
    }

    /// Solves for the linear unknowns and returns the cost.
    ///
    /// Each block is reduced to a triangular factor, and these factors are combined into one
    /// factor; Q is never computed.
    pub(crate) fn solve(&mut self, lines: &Lines, design: &impl Design) -> f64 {
        let (columns, outputs) = (design.columns(lines), lines.outputs.len());
        let rows: usize = lines.blocks.iter().map(Block::len).sum();
        time_limit::spend(VECTOR_OPERATIONS * (rows * columns * (columns + 2 * outputs)) as f64);
        self.blocks.par_iter_mut().zip(&lines.blocks).for_each(|(arrays, block)| {
            arrays.reduce(lines, block, design);
        });
        self.join(columns, outputs);
        let unknowns = &self.unknowns;
        let costs: Vec<f64> = self
            .blocks
            .par_iter_mut()
            .zip(&lines.blocks)
            .map(|(arrays, block)| arrays.update_residual(unknowns, columns, 2 * block.len()))
            .collect();
        self.cost = costs.iter().sum();
        self.cost
    }

    /// Joins the triangular factors of the blocks and solves for the linear unknowns.
    fn join(&mut self, columns: usize, outputs: usize) {
        let height = |arrays: &BlockArrays| {
            let rows = 2 * arrays.weight.len();
            arrays.columns.len().min(rows)
        };
        let rows = self.blocks.iter().map(height).sum::<usize>().max(columns);
        let width = columns + outputs;
        self.stacked.clear();
        self.stacked.resize(rows * width, 0.0);
        let mut top = 0;
        for arrays in &self.blocks {
            let (block_rows, count) = (2 * arrays.weight.len(), height(arrays));
            let indices = arrays.columns.iter().copied().chain(columns..width);
            for (local, index) in indices.enumerate() {
                let upper =
                    if local < arrays.columns.len() { (local + 1).min(count) } else { count };
                let from = &arrays.stacked[local * block_rows..local * block_rows + upper];
                self.stacked[index * rows + top..index * rows + top + upper].copy_from_slice(from);
            }
            top += count;
        }
        triangularise(&mut self.stacked, rows, columns);
        self.triangle = Triangle::new(&self.stacked, rows, columns);
        self.unknowns.resize(columns * outputs, 0.0);
        for (output, to) in self.unknowns.chunks_exact_mut(columns.max(1)).enumerate() {
            let start = (columns + output) * rows;
            to.copy_from_slice(&self.stacked[start..start + columns]);
        }
        self.triangle.solve(&mut self.unknowns);
    }

    /// Returns the unknowns of one output in units of the output.
    pub(crate) fn unknowns_of(&self, output: usize, weights: &Weights) -> Vec<f64> {
        let columns = self.triangle.size;
        let unknowns = &self.unknowns[output * columns..(output + 1) * columns];
        unknowns.iter().map(|value| value * weights.level[output]).collect()
    }
}

impl BlockArrays {
    fn reduce(&mut self, lines: &Lines, block: &Block, design: &impl Design) {
        let rows = 2 * block.len();
        self.columns = design.block_columns(lines, block);
        self.design.resize(rows * self.columns.len(), 0.0);
        design.fill(lines, block, &self.weight, &mut self.design);
        self.stacked.clear();
        self.stacked.extend_from_slice(&self.design);
        self.stacked.extend_from_slice(&self.outputs);
        triangularise(&mut self.stacked, rows, self.columns.len());
    }

    fn update_residual(&mut self, unknowns: &[f64], columns: usize, rows: usize) -> f64 {
        self.local.clear();
        for output_unknowns in unknowns.chunks_exact(columns.max(1)) {
            self.local.extend(self.columns.iter().map(|column| output_unknowns[*column]));
        }
        self.residual.clone_from(&self.outputs);
        let inner = self.columns.len();
        add_product(&mut self.residual, &self.design, &self.local, rows, inner, -1.0);
        self.residual.iter().map(|r| r * r).sum()
    }
}
