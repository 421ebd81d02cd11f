//! Normal equations of poles and participations, with the linear unknowns projected out (Kaufman).
//!
//! All outputs share the matrix C, which has one pair of columns for each pair of parameters. The
//! derivatives of output i are this pair multiplied by T_i, the 2 × 2 matrix of the shape φ_i. The
//! matrix JᵀJ = Σ_i T_iᵀ (CᵀP⊥C) T_i, where P⊥ projects the linear unknowns out, therefore needs
//! one product CᵀC for any number of outputs.
//!
//! # Source
//! Kaufman, BIT 15 (1975) 49.

use mechid_numerics::time_limit;
use rayon::prelude::*;

use crate::dense::{add_product, gram, transposed_product};
use crate::limits::VECTOR_OPERATIONS;
use crate::lines::{Block, Lines};
use crate::model::Model;
use crate::projection::{BlockArrays, Projection};

/// Number of partial sums, each over neighbouring blocks. This number is fixed, so that results do
/// not depend on the number of processors.
const LANES: usize = 8;

/// Curvature G and gradient of half the cost with respect to the parameters of the search.
#[derive(Debug, Clone, Default)]
pub(crate) struct NormalEquations {
    /// Number of parameters.
    pub(crate) size: usize,
    /// Symmetric curvature, column-major.
    pub(crate) curvature: Vec<f64>,
    /// (∂A x)ᵀ r: the direction in which the cost falls.
    pub(crate) descent: Vec<f64>,
}

/// Partial sums over neighbouring blocks.
#[derive(Debug, Clone, Default)]
struct Lane {
    /// CᵀC, lower triangle.
    gram: Vec<f64>,
    /// AᵀC.
    cross: Vec<f64>,
    descent: Vec<f64>,
    derivatives: Vec<f64>,
    local_gram: Vec<f64>,
    turned: Vec<f64>,
}

/// Returns the shapes in whitened units: row 2r holds the real parts of mode r for all outputs, row
/// 2r + 1 the imaginary parts.
pub(crate) fn whitened_shapes(projection: &Projection, modes: usize) -> Vec<f64> {
    let columns = projection.triangle.size.max(1);
    let outputs = projection.unknowns.len() / columns;
    let mut shapes = vec![0.0; outputs * 2 * modes];
    for (output, unknowns) in projection.unknowns.chunks_exact(columns).enumerate() {
        for (row, value) in unknowns[..2 * modes].iter().enumerate() {
            shapes[row * outputs + output] = *value;
        }
    }
    shapes
}

/// Returns the pairs of parameters that affect a block, after their indices in the list of all
/// pairs. These parameters are all poles, and the participations of the loads of the block.
pub(crate) fn block_pairs(
    pairs: &[(usize, Option<usize>)],
    block: &Block,
) -> (Vec<usize>, Vec<(usize, Option<usize>)>) {
    let acts = |load: Option<usize>| load.is_none_or(|load| block.active.contains(&load));
    let active = pairs.iter().copied().enumerate().filter(|(_, (_, load))| acts(*load));
    active.unzip()
}

impl NormalEquations {
    /// Sums the normal equations at the unknowns of `projection`.
    pub(crate) fn new(lines: &Lines, model: &Model, projection: &Projection) -> Self {
        let pairs = model.pairs(lines.loads.len());
        let shapes = whitened_shapes(projection, model.modes());
        let rows: usize = lines.blocks.iter().map(Block::len).sum();
        let products = rows * pairs.len() * (pairs.len() + lines.outputs.len());
        time_limit::spend(VECTOR_OPERATIONS * products as f64);
        let work: Vec<(&Block, &BlockArrays)> =
            lines.blocks.iter().zip(&projection.blocks).collect();
        let width = work.len().div_ceil(LANES).max(1);
        let lanes: Vec<Lane> = work
            .par_chunks(width)
            .map(|chunk| {
                let mut lane = Lane::new(2 * pairs.len(), projection.triangle.size);
                for (block, arrays) in chunk {
                    lane.add(lines, model, &pairs, block, arrays, &shapes);
                }
                lane
            })
            .collect();
        let mut sum = Lane::new(2 * pairs.len(), projection.triangle.size);
        for lane in &lanes {
            let to = [&mut sum.gram, &mut sum.cross, &mut sum.descent];
            for (to, from) in to.into_iter().zip([&lane.gram, &lane.cross, &lane.descent]) {
                to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
            }
        }
        project(&mut sum, projection);
        let products = ShapeProducts::new(&shapes, model.modes());
        Self::assemble(&sum.gram, sum.descent, &pairs, model, &products)
    }

    /// Multiplies CᵀP⊥C by the shapes, and scales the product to the parameters.
    fn assemble(
        projected: &[f64],
        mut descent: Vec<f64>,
        pairs: &[(usize, Option<usize>)],
        model: &Model,
        products: &ShapeProducts,
    ) -> Self {
        let scale = parameter_scale(pairs, model);
        let curvature = congruence_sum(projected, pairs, products, &scale);
        descent.iter_mut().zip(&scale).for_each(|(value, scale)| *value *= scale);
        Self { size: 2 * pairs.len(), curvature, descent }
    }
}

/// Returns the derivatives of Re λ and Im λ (or of L) with respect to the parameters.
pub(crate) fn parameter_scale(pairs: &[(usize, Option<usize>)], model: &Model) -> Vec<f64> {
    let scale = |&(mode, load): &(usize, Option<usize>)| match load {
        None => [model.poles[mode].re, model.poles[mode].im],
        Some(_) => [1.0; 2],
    };
    pairs.iter().flat_map(scale).collect()
}

/// Products of the shapes of two modes, summed over the outputs: real part times real part (xx),
/// real part times imaginary part (xy), and so on.
pub(crate) struct ShapeProducts {
    modes: usize,
    sums: Vec<f64>,
}

impl ShapeProducts {
    /// Sums over all outputs.
    pub(crate) fn new(shapes: &[f64], modes: usize) -> Self {
        let outputs = shapes.len() / (2 * modes).max(1);
        Self { modes, sums: transposed_product(shapes, shapes, outputs.max(1)) }
    }

    /// Returns the sums xx, xy, yx and yy of two modes; the first letter is a part of the shape of
    /// mode `r` (x real, y imaginary), the second letter a part of the shape of mode `s`.
    fn pair(&self, r: usize, s: usize) -> [f64; 4] {
        let entry = |row: usize, column: usize| self.sums[column * 2 * self.modes + row];
        let (x, y, u, v) = (2 * r, 2 * r + 1, 2 * s, 2 * s + 1);
        [entry(x, u), entry(x, v), entry(y, u), entry(y, v)]
    }
}

/// Returns Σ_i T_iᵀ G T_i as a full symmetric matrix; each entry is multiplied by the scales of its
/// row and its column. `lower` is the lower triangle of G.
pub(crate) fn congruence_sum(
    lower: &[f64],
    pairs: &[(usize, Option<usize>)],
    products: &ShapeProducts,
    scale: &[f64],
) -> Vec<f64> {
    let size = 2 * pairs.len();
    let mut result = vec![0.0; size * size];
    let entry = |row: usize, column: usize| {
        let (row, column) = if row >= column { (row, column) } else { (column, row) };
        lower[column * size + row]
    };
    for (b, &(s, _)) in pairs.iter().enumerate() {
        for (a, &(r, _)) in pairs.iter().enumerate().skip(b) {
            let [xx, xy, yx, yy] = products.pair(r, s);
            let (i, j) = (2 * a, 2 * b);
            let (c00, c01) = (entry(i, j), entry(i, j + 1));
            let (c10, c11) = (entry(i + 1, j), entry(i + 1, j + 1));
            let turned = [
                [
                    c00 * xx + c01 * xy + c10 * yx + c11 * yy,
                    c01 * xx - c00 * xy + c11 * yx - c10 * yy,
                ],
                [
                    c10 * xx + c11 * xy - c00 * yx - c01 * yy,
                    c11 * xx - c10 * xy - c01 * yx + c00 * yy,
                ],
            ];
            for (p, row) in turned.iter().enumerate() {
                for (q, value) in row.iter().enumerate() {
                    let value = value * scale[i + p] * scale[j + q];
                    result[(j + q) * size + i + p] = value;
                    result[(i + p) * size + j + q] = value;
                }
            }
        }
    }
    result
}

/// Subtracts from CᵀC the part that the linear unknowns explain.
fn project(sum: &mut Lane, projection: &Projection) {
    let (columns, size) = (projection.triangle.size, sum.descent.len());
    projection.triangle.solve_transposed(&mut sum.cross);
    if columns > 0 && size > 0 {
        let mut explained = vec![0.0; size * size];
        gram(&sum.cross, columns, &mut explained);
        sum.gram.iter_mut().zip(&explained).for_each(|(to, part)| *to -= part);
    }
}

impl Lane {
    fn new(parameters: usize, columns: usize) -> Self {
        Self {
            gram: vec![0.0; parameters * parameters],
            cross: vec![0.0; columns * parameters],
            descent: vec![0.0; parameters],
            ..Self::default()
        }
    }

    fn add(
        &mut self,
        lines: &Lines,
        model: &Model,
        pairs: &[(usize, Option<usize>)],
        block: &Block,
        arrays: &BlockArrays,
        shapes: &[f64],
    ) {
        let rows = 2 * block.len();
        let (indices, local) = block_pairs(pairs, block);
        self.derivatives.resize(2 * local.len() * rows, 0.0);
        model.fill_derivatives(lines, block, &arrays.weight, &local, &mut self.derivatives);
        self.add_products(&indices, arrays, rows);
        let outputs = lines.outputs.len();
        self.turned.clear();
        self.turned.resize(rows * 2 * model.modes(), 0.0);
        add_product(&mut self.turned, &arrays.residual, shapes, rows, outputs, 1.0);
        for ((index, (mode, _)), pair) in
            indices.iter().zip(&local).zip(self.derivatives.chunks_exact(2 * rows))
        {
            let (u, v) = pair.split_at(rows);
            let turned = &self.turned[2 * mode * rows..(2 * mode + 2) * rows];
            let (x, y) = turned.split_at(rows);
            self.descent[2 * index] += dot(u, x) + dot(v, y);
            self.descent[2 * index + 1] += dot(v, x) - dot(u, y);
        }
    }

    /// Adds the products CᵀC and AᵀC of a block to the sums over blocks, at the indices of its
    /// parameters and columns; C has the derivatives, and A is the design matrix.
    fn add_products(&mut self, indices: &[usize], arrays: &BlockArrays, rows: usize) {
        let (count, size) = (2 * indices.len(), self.descent.len());
        self.local_gram.resize(count * count, 0.0);
        gram(&self.derivatives, rows, &mut self.local_gram);
        let at = |local: usize| 2 * indices[local / 2] + local % 2;
        for column in 0..count {
            let to = &mut self.gram[at(column) * size..(at(column) + 1) * size];
            for row in column..count {
                to[at(row)] += self.local_gram[column * count + row];
            }
        }
        let cross = transposed_product(&arrays.design, &self.derivatives, rows);
        let (inner, columns) = (arrays.columns.len(), self.cross.len() / size.max(1));
        for (local, from) in cross.chunks_exact(inner.max(1)).enumerate() {
            let to = &mut self.cross[at(local) * columns..(at(local) + 1) * columns];
            for (column, value) in arrays.columns.iter().zip(from) {
                to[*column] += value;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use mechid_spectra::{LineData, Transient};
    use nalgebra::{Complex, DMatrix};

    use super::*;
    use crate::model::ResidualPowers;
    use crate::projection::Weights;
    use crate::search::Fit;

    /// Returns two records of two inputs and three outputs: one open record, and one record whose
    /// second input is zero.
    fn lines() -> Lines {
        let value = |k: usize| ((k * k + 3 * k) as f64 * 0.7).sin();
        let data = |shift: usize, silent: bool, transient| {
            let omega: Vec<f64> = (0..40).map(|k| 8.0 + 0.1 * k as f64).collect();
            let at = |line: usize, column: usize| {
                let k = shift + line * 7 + column * 131;
                Complex::new(value(k), value(k + 1))
            };
            let inputs = DMatrix::from_fn(40, 2, |line, column| {
                if silent && column == 1 { Complex::default() } else { at(line, column) }
            });
            let outputs = DMatrix::from_fn(40, 3, |line, column| at(line, column + 5));
            LineData::new(omega, inputs, outputs, transient).unwrap()
        };
        let open = data(3, false, Transient::Open { sample_interval: 0.05 });
        Lines::new(&open.followed_by(&data(900, true, Transient::None)).unwrap())
    }

    fn fit(lines: &Lines) -> Fit<'_> {
        let one = Complex::new(1.0, 0.0);
        let model = Model {
            poles: vec![Complex::new(-0.3, 9.1), Complex::new(-0.2, 10.6)],
            participation: vec![
                vec![one, Complex::new(0.4, -0.2), Complex::new(2.0, 1.0)],
                vec![Complex::new(-0.7, 0.3), one, Complex::new(-1.0, 3.0)],
            ],
            gauge: vec![0, 1],
            powers: ResidualPowers { forces: vec![-2, 0, 2], transients: vec![0, 1] },
            reference: 12.0,
        };
        let spectrum_shape = lines.omega.iter().map(|omega| 0.5 + 0.02 * omega).collect();
        Fit::new(lines, model, Weights { spectrum_shape, level: vec![1.0, 0.7, 1.3] })
    }

    /// Reference: central differences of the projected cost, which do not use any of the formulas
    /// above.
    #[test]
    fn descent_is_the_derivative_of_half_the_cost() {
        let lines = lines();
        let fit = fit(&lines);
        let normal = NormalEquations::new(&lines, &fit.model, &fit.projection);
        for index in 0..normal.size {
            let cost = |by: f64| {
                let mut other = fit.clone();
                let (mode, load) = other.model.pairs(3)[index / 2];
                match (load, index % 2) {
                    (None, 0) => other.model.poles[mode].re *= by.exp(),
                    (None, _) => other.model.poles[mode].im *= by.exp(),
                    (Some(load), 0) => other.model.participation[mode][load].re += by,
                    (Some(load), _) => other.model.participation[mode][load].im += by,
                }
                other.refresh();
                other.cost()
            };
            let step = 1e-5;
            let slope = (cost(step) - cost(-step)) / (4.0 * step);
            let scale = normal.curvature[index * normal.size + index].sqrt();
            let error = (slope + normal.descent[index]).abs() / scale;
            assert!(error < 1e-6, "parameter {index}: {slope} and {}", normal.descent[index]);
        }
    }

    /// Reference: the cost of a direct least-squares solution with the whole matrix.
    #[test]
    fn projection_is_the_least_squares_solution() {
        let lines = lines();
        let fit = fit(&lines);
        let columns = fit.model.columns(&lines);
        let rows: usize = lines.blocks.iter().map(|block| 2 * block.len()).sum();
        let mut whole = DMatrix::<f64>::zeros(rows, columns);
        let mut outputs = DMatrix::<f64>::zeros(rows, 3);
        let mut top = 0;
        for arrays in &fit.projection.blocks {
            let unknowns = 2 * arrays.weight.len();
            for (local, place) in arrays.columns.iter().enumerate() {
                let from = &arrays.design[local * unknowns..(local + 1) * unknowns];
                whole.view_mut((top, *place), (unknowns, 1)).copy_from_slice(from);
            }
            outputs.view_mut((top, 0), (unknowns, 3)).copy_from_slice(&arrays.outputs);
            top += unknowns;
        }
        let solution = (whole.transpose() * &whole).lu().solve(&(whole.transpose() * &outputs));
        let rest = &outputs - whole * solution.unwrap();
        assert!((rest.norm_squared() / fit.cost() - 1.0).abs() < 1e-9);
    }
}
