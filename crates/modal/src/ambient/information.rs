//! Fisher information of Whittle's likelihood.

use nalgebra::{Complex, DMatrix, Matrix2};
use rayon::prelude::*;

use super::likelihood::{TASK, noise, positive_factor, spend_on_information};
use super::lines::PooledLines;
use super::parameters::{Layout, Parameters, Span};
use super::shape_basis::{Direction, ShapeBasis};
use super::spectrum::{Coefficients, Kernels};
use crate::dense::product;

/// Returns the Fisher information of the parameters; `None` where S is not positive definite.
///
/// # Source
/// Entry (a, b) is Σ tr S⁻¹ S_a S⁻¹ S_b over the lines, with the derivatives S_a of S; Zeira &
/// Nehorai (1990), IEEE Transactions on Acoustics, Speech, and Signal Processing 38, 1031–1036.
pub(super) fn information(
    parameters: &Parameters,
    lines: &[PooledLines],
    span: Span,
) -> Option<DMatrix<f64>> {
    spend_on_information(parameters, lines);
    let coefficients = Coefficients::new(parameters);
    let basis = ShapeBasis::new(parameters, &coefficients);
    let layout = &parameters.layout;
    let chunk = |chunk: &[PooledLines]| {
        let mut sum = DMatrix::zeros(layout.len(), layout.len());
        for line in chunk {
            let kernels = coefficients.kernels(line.omega, span);
            let variances = noise(parameters, &line.terms);
            let inverse = positive_factor(coefficients.spectrum(&kernels, &variances))?.inverse();
            LineInformation::new(layout, &basis, &kernels, &inverse, &variances, line)
                .add(&mut sum);
        }
        Some(sum)
    };
    let parts: Option<Vec<DMatrix<f64>>> = lines.par_chunks(TASK).map(chunk).collect();
    let mut sum = DMatrix::zeros(layout.len(), layout.len());
    for part in parts? {
        sum += part;
    }
    // A line adds to one of the entries (a, b) and (b, a).
    let mut total = &sum + sum.transpose();
    total.set_diagonal(&sum.diagonal());
    chain_correlations(parameters, &mut total);
    Some(total)
}

/// Replaces the information about the correlations Q_rs by that about the entries of the factor of
/// Q, by the chain rule from Q = C Cᵀ with rows of unit length.
fn chain_correlations(parameters: &Parameters, information: &mut DMatrix<f64>) {
    let (raw, factor) = (parameters.raw_factor(), parameters.factor());
    let pairs = &parameters.layout.pairs;
    let jacobian = DMatrix::from_fn(pairs.len(), pairs.len(), |pair, entry| {
        let ((r, s), (row, column)) = (pairs[pair], pairs[entry]);
        let partner = match row {
            _ if row == r => s,
            _ if row == s => r,
            _ => return 0.0,
        };
        let along = factor.row(row).dot(&factor.row(partner));
        (factor[(partner, column)] - along * factor[(row, column)]) / raw.row(row).norm()
    });
    let first = parameters.layout.correlation(0);
    let columns = information.columns(first, pairs.len()) * &jacobian;
    information.columns_mut(first, pairs.len()).copy_from(&columns);
    let rows = jacobian.transpose() * information.rows(first, pairs.len());
    information.rows_mut(first, pairs.len()).copy_from(&rows);
}

/// Information of one pooled line, with P = S⁻¹ and V, B of [`super::shape_basis`].
///
/// The derivatives with respect to shapes are S_a = e_i xᴴ + x e_iᵀ, where the vectors x are the
/// columns of X = V B: the columns of the real part and the imaginary part of a shape.
struct LineInformation<'a> {
    layout: &'a Layout,
    line: &'a PooledLines,
    variances: &'a [f64],
    /// P, real part and imaginary part.
    inverse: [DMatrix<f64>; 2],
    /// P X, real part and imaginary part.
    whitened: [DMatrix<f64>; 2],
    /// P V, outputs × 2 modes.
    basis: DMatrix<Complex<f64>>,
    /// Xᴴ P V and Xᴴ P X, 2 modes × 2 modes.
    cross: DMatrix<Complex<f64>>,
    shape_gram: DMatrix<Complex<f64>>,
    directions: Directions,
}

/// Directions V_l W + Wᴴ V_lᵀ and their products with P; the matrices have two rows or columns for
/// each direction.
struct Directions {
    all: Vec<Direction>,
    /// For each direction b, the products β_sᴴ V_bᵀ P V of each of its blocks β_s, as blocks: one
    /// for each mode.
    gram: Vec<Vec<Vec<Matrix2<Complex<f64>>>>>,
    /// Blocks of W P V, directions × modes.
    with_basis: Blocks,
    /// P Wᴴ, outputs × 2 directions: real part and imaginary part.
    columns: [DMatrix<f64>; 2],
    /// W P X, 2 directions × 2 modes.
    with_shapes: DMatrix<Complex<f64>>,
}

impl<'a> LineInformation<'a> {
    fn new(
        layout: &'a Layout,
        shapes: &ShapeBasis<'_>,
        kernels: &Kernels,
        inverse: &DMatrix<Complex<f64>>,
        variances: &'a [f64],
        line: &'a PooledLines,
    ) -> Self {
        let matrix = shapes.matrix(kernels);
        let basis = product(inverse, &shapes.columns);
        let gram = product(&shapes.columns.transpose(), &basis);
        let whitened = product(&basis, &matrix);
        // B is Hermitian.
        let cross = product(&matrix, &gram);
        let shape_gram = product(&cross, &matrix);
        let directions = Directions::new(shapes.directions(kernels), &basis, &gram, &matrix);
        Self {
            layout,
            line,
            variances,
            inverse: parts(inverse),
            whitened: parts(&whitened),
            basis,
            cross,
            shape_gram,
            directions,
        }
    }

    /// Adds the information of this line; each pair of parameters is added once, in any order.
    fn add(&self, sum: &mut DMatrix<f64>) {
        self.add_shapes(sum);
        for (b, direction) in self.directions.all.iter().enumerate() {
            for (a, other) in self.directions.all[..=b].iter().enumerate() {
                let value = self.directions.trace(a, b);
                sum[(other.index, direction.index)] += self.line.count * value;
            }
            self.add_direction_and_shapes(b, sum);
            let value = |i: usize| self.directions.diagonal(b, i, &self.basis);
            self.add_noise(direction.index, sum, value);
        }
        self.add_shapes_and_noise(sum);
        for (i, variance) in self.variances.iter().enumerate() {
            for (d, term) in self.line.terms.iter().enumerate() {
                let index = self.layout.noise(d, i);
                let value = |j: usize| {
                    let [re, im] = [&self.inverse[0], &self.inverse[1]].map(|part| part[(j, i)]);
                    term * variance * (re * re + im * im)
                };
                self.add_noise(index, sum, value);
            }
        }
    }

    /// Adds tr (P S_a P S_b) = 2 Re [(P x)_j (P y)_i + P_ji xᴴ P y] for S_a = e_i xᴴ + x e_iᵀ and
    /// S_b = e_j yᴴ + y e_jᵀ.
    fn add_shapes(&self, sum: &mut DMatrix<f64>) {
        let ([re, im], [p_re, p_im]) = (&self.whitened, &self.inverse);
        let (p, columns) = re.shape();
        let weight = 2.0 * self.line.count;
        for b in 0..columns {
            for j in 0..p {
                let mut column = sum.column_mut(self.shape_index(b, j));
                let column = column.as_mut_slice();
                for a in 0..=b {
                    let first = self.shape_index(a, 0);
                    let rows = if a < b { p } else { j + 1 };
                    let turned = Complex::new(re[(j, a)], im[(j, a)]) * weight;
                    let inner = self.shape_gram[(a, b)] * weight;
                    // P is Hermitian: P_ji is the conjugate of P_ij, and the entries P_ij of column
                    // j are contiguous in memory.
                    let inverse = columns_of(p_re, p_im, j);
                    let vectors = columns_of(re, im, b).zip(inverse);
                    let entries = column[first..first + rows].iter_mut();
                    for (entry, ((re, im), (p_re, p_im))) in entries.zip(vectors) {
                        *entry +=
                            turned.re * re - turned.im * im + inner.re * p_re + inner.im * p_im;
                    }
                }
            }
        }
    }

    /// Adds tr (P S_a P S_b) = 2 Re [(xᴴ P V_l)(W P)_i + (xᴴ P Wᴴ)(V_lᵀ P)_i] for
    /// S_a = e_i xᴴ + x e_iᵀ and direction `at`, S_b.
    fn add_direction_and_shapes(&self, at: usize, sum: &mut DMatrix<f64>) {
        let p = self.basis.nrows();
        let direction = &self.directions.all[at];
        let first_left = 2 * direction.left;
        let mut column = sum.column_mut(direction.index);
        let column = column.as_mut_slice();
        let [re, im] = &self.directions.columns;
        let [left_re, left_im] = parts(&self.basis.columns(first_left, 2).into_owned());
        let weight = 2.0 * self.line.count;
        for shape in 0..self.cross.nrows() {
            let first = self.shape_index(shape, 0);
            let entries = &mut column[first..first + p];
            for k in 0..2 {
                let of_left = self.cross[(shape, first_left + k)] * weight;
                let of_right = self.directions.with_shapes[(2 * at + k, shape)].conj() * weight;
                // Rows of W P and of V_lᵀ P are conjugates of columns of P Wᴴ and of P V_l.
                let right = columns_of(re, im, 2 * at + k);
                let vectors = right.zip(columns_of(&left_re, &left_im, k));
                for (entry, ((re, im), (left_re, left_im))) in entries.iter_mut().zip(vectors) {
                    *entry += of_left.re * re + of_left.im * im;
                    *entry += of_right.re * left_re + of_right.im * left_im;
                }
            }
        }
    }

    fn shape_index(&self, column: usize, output: usize) -> usize {
        self.layout.shape(column / 2) + (column % 2) * self.layout.outputs + output
    }

    /// Adds the information between parameter `index` and the noise parameters; `value(j)` is the
    /// information between this parameter and the noise variance of output j. A pair of two noise
    /// parameters is added only once.
    fn add_noise(&self, index: usize, sum: &mut DMatrix<f64>, value: impl Fn(usize) -> f64) {
        for (j, variance) in self.variances.iter().enumerate() {
            let value = value(j) * variance;
            for (d, term) in self.line.terms.iter().enumerate() {
                let noise_index = self.layout.noise(d, j);
                if noise_index >= index {
                    sum[(noise_index, index)] += self.line.count * value * term;
                }
            }
        }
    }

    fn add_shapes_and_noise(&self, sum: &mut DMatrix<f64>) {
        let ([re, im], [p_re, p_im]) = (&self.whitened, &self.inverse);
        for column in 0..re.ncols() {
            for i in 0..re.nrows() {
                // P_ij is the conjugate of P_ji.
                let value = |j: usize| {
                    2.0 * (p_re[(j, i)] * re[(j, column)] + p_im[(j, i)] * im[(j, column)])
                };
                self.add_noise(self.shape_index(column, i), sum, value);
            }
        }
    }
}

impl Directions {
    fn new(
        all: Vec<Direction>,
        basis: &DMatrix<Complex<f64>>,
        gram: &DMatrix<Complex<f64>>,
        matrix: &DMatrix<Complex<f64>>,
    ) -> Self {
        // Wᴴ = V times these coefficients.
        let mut coefficients = DMatrix::zeros(gram.nrows(), 2 * all.len());
        for (at, direction) in all.iter().enumerate() {
            for (mode, block) in &direction.right {
                let mut view = coefficients.fixed_view_mut::<2, 2>(2 * mode, 2 * at);
                view.copy_from(&block.adjoint());
            }
        }
        let with_basis = product(&coefficients.adjoint(), gram);
        let blocks = Blocks::new(gram);
        let modes = 0..blocks.columns;
        let of_block = |left: usize, block: &Matrix2<Complex<f64>>| {
            let adjoint = block.adjoint();
            modes.clone().map(|mode| times(&adjoint, blocks.at(left, mode))).collect()
        };
        let of_direction = |direction: &Direction| {
            direction.right.iter().map(|(_, block)| of_block(direction.left, block)).collect()
        };
        Self {
            gram: all.iter().map(of_direction).collect(),
            all,
            columns: parts(&product(basis, &coefficients)),
            with_shapes: product(&with_basis, matrix),
            with_basis: Blocks::new(&with_basis),
        }
    }

    /// Returns tr (P S_a P S_b) = 2 Re tr [(W_a P V_b)(W_b P V_a) + (W_a P W_bᴴ)(V_bᵀ P V_a)] for
    /// two directions.
    fn trace(&self, a: usize, b: usize) -> f64 {
        let (left_a, left_b) = (self.all[a].left, self.all[b].left);
        let second =
            self.all[b].right.iter().zip(&self.gram[b]).map(|((mode, _), blocks)| {
                real_trace(self.with_basis.at(a, *mode), &blocks[left_a])
            });
        let first = real_trace(self.with_basis.at(a, left_b), self.with_basis.at(b, left_a));
        2.0 * (first + second.sum::<f64>())
    }

    /// Returns entry (i, i) of P S_b P for direction `at`.
    fn diagonal(&self, at: usize, i: usize, basis: &DMatrix<Complex<f64>>) -> f64 {
        let first_left = 2 * self.all[at].left;
        let [re, im] = &self.columns;
        let terms = (0..2).map(|k| {
            let z = basis[(i, first_left + k)];
            z.re * re[(i, 2 * at + k)] + z.im * im[(i, 2 * at + k)]
        });
        2.0 * terms.sum::<f64>()
    }
}

/// Matrix as blocks of 2 × 2.
struct Blocks {
    blocks: Vec<Matrix2<Complex<f64>>>,
    columns: usize,
}

impl Blocks {
    fn new(matrix: &DMatrix<Complex<f64>>) -> Self {
        let columns = matrix.ncols() / 2;
        let block = |at: usize| {
            matrix.fixed_view::<2, 2>(2 * (at / columns), 2 * (at % columns)).into_owned()
        };
        Self { blocks: (0..columns * matrix.nrows() / 2).map(block).collect(), columns }
    }

    fn at(&self, row: usize, column: usize) -> &Matrix2<Complex<f64>> {
        &self.blocks[row * self.columns + column]
    }
}

/// Returns the product of two small matrices; the general product of nalgebra costs several times
/// as much.
fn times(a: &Matrix2<Complex<f64>>, b: &Matrix2<Complex<f64>>) -> Matrix2<Complex<f64>> {
    Matrix2::new(
        a.m11 * b.m11 + a.m12 * b.m21,
        a.m11 * b.m12 + a.m12 * b.m22,
        a.m21 * b.m11 + a.m22 * b.m21,
        a.m21 * b.m12 + a.m22 * b.m22,
    )
}

/// Returns Re tr (A B).
fn real_trace(a: &Matrix2<Complex<f64>>, b: &Matrix2<Complex<f64>>) -> f64 {
    let real = |a: &Complex<f64>, b: &Complex<f64>| a.re * b.re - a.im * b.im;
    real(&a.m11, &b.m11) + real(&a.m12, &b.m21) + real(&a.m21, &b.m12) + real(&a.m22, &b.m22)
}

/// Returns the entries of a column of the real parts and of the imaginary parts.
fn columns_of<'a>(
    re: &'a DMatrix<f64>,
    im: &'a DMatrix<f64>,
    column: usize,
) -> impl Iterator<Item = (&'a f64, &'a f64)> {
    let range = column * re.nrows()..(column + 1) * re.nrows();
    re.as_slice()[range.clone()].iter().zip(&im.as_slice()[range])
}

fn parts(matrix: &DMatrix<Complex<f64>>) -> [DMatrix<f64>; 2] {
    [matrix.map(|z| z.re), matrix.map(|z| z.im)]
}
