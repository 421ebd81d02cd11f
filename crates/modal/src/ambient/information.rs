//! Fisher information of Whittle's likelihood.

use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::likelihood::{TASK, noise, positive_factor, spend};
use super::lines::PooledLines;
use super::parameters::{Parameters, Span};
use super::spectrum::{Coefficients, Direction, Kernels, directions};
use crate::dense::{product, transposed_product};

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
    spend(parameters, lines, parameters.layout.len());
    let coefficients = Coefficients::new(parameters);
    let directions = directions(parameters);
    let len = parameters.layout.len();
    let chunk = |chunk: &[PooledLines]| {
        let mut sum = DMatrix::zeros(len, len);
        for line in chunk {
            let kernels = coefficients.kernels(line.omega, span);
            let variances = noise(parameters, &line.terms);
            let inverse = positive_factor(coefficients.spectrum(&kernels, &variances))?.inverse();
            let task = LineInformation {
                parameters,
                coefficients: &coefficients,
                kernels: &kernels,
                inverse: &inverse,
                variances: &variances,
                line,
            };
            task.add(&directions, &mut sum);
        }
        Some(sum)
    };
    let parts: Option<Vec<DMatrix<f64>>> = lines.par_chunks(TASK).map(chunk).collect();
    let mut total = DMatrix::zeros(len, len);
    for part in parts? {
        total += part;
    }
    total.fill_lower_triangle_with_upper_triangle();
    Some(total)
}

/// Information of one pooled line.
struct LineInformation<'a> {
    parameters: &'a Parameters,
    coefficients: &'a Coefficients,
    kernels: &'a Kernels,
    inverse: &'a DMatrix<Complex<f64>>,
    variances: &'a [f64],
    line: &'a PooledLines,
}

impl LineInformation<'_> {
    /// Adds the information of this line to the upper triangle.
    fn add(&self, directions: &[Direction], sum: &mut DMatrix<f64>) {
        let x = self.coefficients.shape_directions(self.kernels);
        let whitened = product(self.inverse, &x);
        self.add_shapes(&x, &whitened, sum);
        self.add_directions(directions, &x, sum);
        self.add_noise_and_shapes(&whitened, sum);
        for i in 0..self.variances.len() {
            for (d, term) in self.line.terms.iter().enumerate() {
                let index = self.parameters.layout.noise(d, i);
                let scale = term * self.variances[i];
                self.add_noise(index, sum, |j| scale * self.inverse[(i, j)].norm_sqr());
            }
        }
    }

    /// Adds the entries between two directions, between directions and shapes (derivatives `x`),
    /// and between directions and noise.
    fn add_directions(
        &self,
        directions: &[Direction],
        x: &DMatrix<Complex<f64>>,
        sum: &mut DMatrix<f64>,
    ) {
        let p = self.inverse.nrows();
        // The matrices S_a of all directions are side by side.
        let mut derivatives = DMatrix::zeros(p, p * directions.len());
        for (a, direction) in directions.iter().enumerate() {
            let derivative = self.coefficients.derivative(self.kernels, direction);
            derivatives.columns_mut(a * p, p).copy_from(&derivative);
        }
        let mut turned = product(self.inverse, &derivatives);
        for a in 0..directions.len() {
            turned.columns_mut(a * p, p).adjoint_mut();
        }
        let sandwiched = product(self.inverse, &turned);
        // The matrices are Hermitian, so tr S_a (S⁻¹ S_b S⁻¹) is a sum of products of real parts
        // and of products of imaginary parts.
        let products = transposed_product(&parts(&derivatives), &parts(&sandwiched), 2 * p * p);
        let with_shapes = product(&x.adjoint(), &sandwiched);
        for (b, other) in directions.iter().enumerate() {
            for (a, direction) in directions[..=b].iter().enumerate() {
                self.put(sum, direction.index, other.index, products[b * directions.len() + a]);
            }
            for column in 0..x.ncols() {
                for i in 0..p {
                    let value = with_shapes[(column, b * p + i)].re;
                    self.put(sum, other.index, self.shape_index(column, i), 2.0 * value);
                }
            }
            self.add_noise(other.index, sum, |i| sandwiched[(i, b * p + i)].re);
        }
    }

    fn put(&self, sum: &mut DMatrix<f64>, a: usize, b: usize, value: f64) {
        sum[(a.min(b), a.max(b))] += self.line.count * value;
    }

    fn shape_index(&self, column: usize, output: usize) -> usize {
        let layout = &self.parameters.layout;
        layout.shape(column / 2) + (column % 2) * layout.outputs + output
    }

    /// Adds tr (P S_a P S_b) = 2 Re [(P x)_j (P y)_i + P_ji xᴴ P y] for S_a = e_i xᴴ + x e_iᵀ and
    /// S_b = e_j yᴴ + y e_jᵀ.
    fn add_shapes(
        &self,
        x: &DMatrix<Complex<f64>>,
        whitened: &DMatrix<Complex<f64>>,
        sum: &mut DMatrix<f64>,
    ) {
        let gram = x.ad_mul(whitened);
        let (p, columns) = x.shape();
        let weight = 2.0 * self.line.count;
        for b in 0..columns {
            for j in 0..p {
                let mut column = sum.column_mut(self.shape_index(b, j));
                let column = column.as_mut_slice();
                for a in 0..=b {
                    let first = self.shape_index(a, 0);
                    let rows = if a < b { p } else { j + 1 };
                    let (turned, inner) = (whitened[(j, a)], gram[(a, b)]);
                    let entries = column[first..first + rows].iter_mut();
                    // P is Hermitian: P_ji is the conjugate of P_ij, and the entries P_ij of column
                    // j are contiguous in memory.
                    let factors = whitened.column(b).into_iter().zip(self.inverse.column(j));
                    for (entry, (other, inverse)) in entries.zip(factors) {
                        let value = turned * other + inverse.conj() * inner;
                        *entry += weight * value.re;
                    }
                }
            }
        }
    }

    /// Adds the information between parameter `index` and the noise parameters; `value` returns the
    /// information with the noise variance of an output. A pair of noise parameters is added once.
    fn add_noise(&self, index: usize, sum: &mut DMatrix<f64>, value: impl Fn(usize) -> f64) {
        for (j, variance) in self.variances.iter().enumerate() {
            let value = value(j) * variance;
            for (d, term) in self.line.terms.iter().enumerate() {
                let noise_index = self.parameters.layout.noise(d, j);
                if noise_index >= index {
                    self.put(sum, index, noise_index, value * term);
                }
            }
        }
    }

    fn add_noise_and_shapes(&self, whitened: &DMatrix<Complex<f64>>, sum: &mut DMatrix<f64>) {
        for (column, values) in whitened.column_iter().enumerate() {
            for i in 0..values.len() {
                let index = self.shape_index(column, i);
                let at = |j: usize| 2.0 * (self.inverse[(i, j)] * values[j]).re;
                self.add_noise(index, sum, at);
            }
        }
    }
}

/// Returns the real and imaginary parts of the entries, one after the other.
fn parts(matrix: &DMatrix<Complex<f64>>) -> Vec<f64> {
    let mut parts = Vec::with_capacity(2 * matrix.len());
    matrix.iter().for_each(|z| parts.extend([z.re, z.im]));
    parts
}
