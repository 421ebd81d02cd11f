//! Covariance of poles, participations and shapes due to all noise: noise of the sensors, and
//! unmeasured forces.
//!
//! In the fit, the weights of all outputs depend on frequency in the same way. The parameters of
//! the fit have the covariance G⁻¹ M G⁻¹, where G is the curvature and M is the variance of the
//! score under the estimated noise.
//!
//! # Source
//! White, Econometrica 50 (1982) 1, with the variance of the score from the noise model.

use std::ops::Range;

use nalgebra::{Complex, DMatrix, DVector, Matrix2, Vector2};
use rayon::prelude::*;

use crate::dense::transposed_product;
use crate::lines::{Block, Lines};
use crate::mode_parameters::ModeParameters;
use crate::model::Model;
use crate::noise::{Noise, noise_window};
use crate::normal::{
    NormalEquations, ShapeProducts, block_pairs, congruence_sum, parameter_scale, whitened_shapes,
};
use crate::projection::{BlockArrays, Projection};
use crate::scores::{BlockProducts, ProcessEffect, Scores};
use crate::search::Fit;

type C = Complex<f64>;

/// Covariances at a fit.
#[derive(Debug, Clone)]
pub(crate) struct Covariance {
    /// Covariance of the parameters of the search.
    pub(crate) parameters: DMatrix<f64>,
    /// Degrees of freedom of the noise estimate at each mode: the number of real and imaginary
    /// parts in the averaging window of a line, over all outputs, or fewer if an unmeasured force
    /// drives the mode.
    pub(crate) degrees_of_freedom: Vec<usize>,
    /// A⁺ C, the derivatives of the linear unknowns of the modes with respect to the parameters,
    /// `2m × parameters`.
    unknowns_by_parameter: DMatrix<f64>,
    /// Covariance of the linear unknowns of the modes due to the sensor noise of each output,
    /// `2m × 2m`, in whitened units.
    sensor: Vec<DMatrix<f64>>,
    /// Effect of the unmeasured force of each mode on the unknowns of its shape.
    process: Vec<ProcessEffect>,
    /// Inverse of the curvature.
    inverse: DMatrix<f64>,
    scale: Vec<f64>,
    pairs: Vec<(usize, Option<usize>)>,
    /// Shapes in whitened units.
    shapes: Vec<f64>,
}

impl Covariance {
    /// Returns the covariance of a fit under `noise`; `None` if the curvature of the fit is
    /// singular.
    pub(crate) fn new(fit: &Fit<'_>, noise: &Noise) -> Option<Self> {
        let (lines, model, projection) = (fit.lines, &fit.model, &fit.projection);
        let normal = NormalEquations::new(lines, model, projection);
        let pairs = model.pairs(lines.loads.len());
        let (size, modes) = (normal.size, model.modes());
        let scale = parameter_scale(&pairs, model);
        let shapes = whitened_shapes(projection, modes);
        let (unknowns_by_parameter, rows) = unknowns_by_parameter(lines, model, projection, &pairs);
        // The sensor noise replaces the weights of the fit here: the weights include the responses
        // to unmeasured forces, which are far above the sensor noise near a resonance.
        let mean = mean_sensor(fit, noise);
        let weights = mean.iter().zip(&fit.weights.spectrum_shape);
        let deviation: Vec<f64> = weights.map(|(mean, shape)| mean.sqrt() / shape).collect();
        let products = |(block, arrays): (&Block, &BlockArrays)| {
            let deviation = &deviation[block.rows.clone()];
            BlockProducts::new(
                lines,
                model,
                block,
                arrays,
                &pairs,
                &unknowns_by_parameter,
                &rows,
                deviation,
            )
        };
        let blocks: Vec<BlockProducts> =
            lines.blocks.par_iter().zip(&projection.blocks).map(products).collect();
        let outputs = lines.outputs.len();
        let (mut score_variance, sensor) =
            sensor_variance(fit, noise, &mean, &blocks, &pairs, &shapes, &scale);
        let scores = Scores { pairs: &pairs, shapes: &shapes, scale: &scale };
        let add = |mode| scores.add_process(fit, noise, mode, &blocks, &mut score_variance);
        let process: Vec<ProcessEffect> = (0..modes).map(add).collect();
        let inverse = symmetric_inverse(&normal.curvature, size)?;
        let score_variance = DMatrix::from_vec(size, size, score_variance);
        let parameters = &inverse * score_variance * &inverse;
        let columns = projection.triangle.size;
        let unknowns_by_parameter = DMatrix::from_fn(2 * modes, size, |row, column| {
            unknowns_by_parameter[column * columns + row]
        });
        let of_sensors = 2 * noise_window(lines) * outputs;
        let of_mode = |of_force: &f64| of_sensors.min((*of_force).max(1.0) as usize);
        let degrees_of_freedom = noise.process_freedom.iter().map(of_mode).collect();
        Some(Self {
            parameters,
            degrees_of_freedom,
            process,
            inverse,
            unknowns_by_parameter,
            sensor,
            scale,
            pairs,
            shapes,
        })
    }

    /// Returns B_i = A⁺ ∂A/∂θ x_i for the two unknowns of one mode and for one output, in whitened
    /// units.
    fn response_of_unknowns(&self, mode: usize, output: usize) -> DMatrix<f64> {
        let outputs = self.sensor.len();
        let part = |row: usize| self.shapes[row * outputs + output];
        let mut response = DMatrix::zeros(2, self.scale.len());
        for (pair, &(r, _)) in self.pairs.iter().enumerate() {
            let (x, y) = (part(2 * r), part(2 * r + 1));
            for row in 0..2 {
                let u = self.unknowns_by_parameter[(2 * mode + row, 2 * pair)];
                let v = self.unknowns_by_parameter[(2 * mode + row, 2 * pair + 1)];
                response[(row, 2 * pair)] = (u * x + v * y) * self.scale[2 * pair];
                response[(row, 2 * pair + 1)] = (v * x - u * y) * self.scale[2 * pair + 1];
            }
        }
        response
    }

    /// Returns the covariance of real and imaginary part of a shape divided by its entry
    /// `reference`.
    ///
    /// An unmeasured force on the mode multiplies all entries of the shape by the same factor,
    /// which cancels in the quotient.
    pub(crate) fn normalised_entry_covariance(
        &self,
        mode: usize,
        output: usize,
        reference: usize,
        shape: &[C],
        levels: &[f64],
    ) -> DMatrix<f64> {
        if output == reference {
            return DMatrix::zeros(2, 2);
        }
        let quotient = shape[output] / shape[reference];
        let sensor_part = |output: usize| {
            self.sensor[output].view((2 * mode, 2 * mode), (2, 2)) * levels[output].powi(2)
        };
        let by_quotient = rotation(quotient);
        let by_reference = rotation(1.0 / shape[reference]);
        let difference = self.response_of_unknowns(mode, output) * levels[output]
            - &by_quotient * self.response_of_unknowns(mode, reference) * levels[reference];
        let sum = sensor_part(output)
            + &by_quotient * sensor_part(reference) * by_quotient.transpose()
            + &difference * &self.parameters * difference.transpose();
        &by_reference * sum * by_reference.transpose()
    }

    /// Returns pole, shape and participations of a mode with their joint covariance, which includes
    /// the errors of the delays of the outputs.
    pub(crate) fn mode_parameters(
        &self,
        fit: &Fit<'_>,
        mode: usize,
        shape: &[C],
    ) -> ModeParameters {
        let (outputs, inputs) = (shape.len(), fit.lines.inputs());
        let (values, mut covariance) = self.joint(fit, &[(mode, shape)]);
        for (output, delay) in fit.lines.delays.iter().enumerate() {
            // A delay that is too large by δ changes the entry φ by jωδφ.
            let change = shape[output] * C::new(0.0, fit.model.poles[mode].im);
            let by_delay = Vector2::new(change.re, change.im) * delay.standard_error;
            let at = ModeParameters::shape_index(output);
            let mut block = covariance.fixed_view_mut::<2, 2>(at, at);
            block += by_delay * by_delay.transpose();
        }
        let (gauge, degrees_of_freedom) = (fit.model.gauge[mode], self.degrees_of_freedom[mode]);
        ModeParameters { outputs, inputs, gauge, values, covariance, degrees_of_freedom }
    }

    /// Returns the parameters of some modes with given shapes, mode after mode, and their joint
    /// covariance.
    ///
    /// To first order the error of entry i of a shape is A⁺ times the noise of output i, minus B_i
    /// dθ. Here A⁺ is the pseudoinverse of the columns of the linear unknowns x_i of output i, B_i
    /// is A⁺ ∂A/∂θ x_i, and dθ is the error of the parameters of the search. An unmeasured force on
    /// a mode multiplies all entries of the shape of this mode by the same complex factor.
    pub(crate) fn joint(
        &self,
        fit: &Fit<'_>,
        modes: &[(usize, &[C])],
    ) -> (DVector<f64>, DMatrix<f64>) {
        let (outputs, inputs) = (self.sensor.len(), fit.lines.inputs());
        let size_of_mode = 2 + 2 * outputs + 2 * inputs;
        let size = modes.len() * size_of_mode;
        let mut values = DVector::zeros(size);
        let mut response = DMatrix::zeros(size, self.scale.len());
        let mut cross = DMatrix::zeros(size, self.scale.len());
        let mut scatter = DMatrix::zeros(size, size);
        for (index, &(mode, shape)) in modes.iter().enumerate() {
            let first = index * size_of_mode;
            let part = self.mode_response(fit, mode, shape);
            values.rows_mut(first, size_of_mode).copy_from(&part.values);
            response.rows_mut(first, size_of_mode).copy_from(&part.response);
            cross.rows_mut(first, size_of_mode).copy_from(&part.cross);
            let by_force =
                &part.common * &self.process[mode].shape_covariance * part.common.transpose();
            scatter.view_mut((first, first), (size_of_mode, size_of_mode)).copy_from(&by_force);
        }
        for output in 0..outputs {
            let variance = fit.weights.level[output].powi(2);
            for (a, &(mode, _)) in modes.iter().enumerate() {
                for (b, &(other, _)) in modes.iter().enumerate() {
                    let row = a * size_of_mode + ModeParameters::shape_index(output);
                    let column = b * size_of_mode + ModeParameters::shape_index(output);
                    let noise = self.sensor[output].view((2 * mode, 2 * other), (2, 2)) * variance;
                    let mut block = scatter.view_mut((row, column), (2, 2));
                    block += noise;
                }
            }
        }
        let cross_covariance = cross * &self.inverse * response.transpose();
        let covariance = &response * &self.parameters * response.transpose()
            + scatter
            + &cross_covariance
            + cross_covariance.transpose();
        (values, covariance)
    }

    /// Returns the parameters of one mode, and their derivatives with respect to the parameters of
    /// the search and to an unmeasured force on the mode.
    fn mode_response(&self, fit: &Fit<'_>, mode: usize, shape: &[C]) -> ModeResponse {
        let (model, levels) = (&fit.model, &fit.weights.level);
        let (outputs, inputs, loads) = (shape.len(), fit.lines.inputs(), fit.lines.loads.len());
        let (size, gauge) = (2 + 2 * outputs + 2 * inputs, model.gauge[mode]);
        let mut values = DVector::zeros(size);
        let mut response = DMatrix::zeros(size, self.scale.len());
        let mut common = DMatrix::zeros(size, 2);
        let mut cross = DMatrix::zeros(size, self.scale.len());
        let pole = model.poles[mode];
        (values[0], values[1]) = ((-pole.re).ln(), pole.im.ln());
        (response[(0, 2 * mode)], response[(1, 2 * mode + 1)]) = (1.0, 1.0);
        for (output, value) in shape.iter().enumerate() {
            let at = ModeParameters::shape_index(output);
            let level = levels[output];
            let direction = value / level;
            (values[at], values[at + 1]) = (value.re, value.im);
            let followed = self.response_of_unknowns(mode, output) * -level;
            response.rows_mut(at, 2).copy_from(&followed);
            common.rows_mut(at, 2).copy_from(&(rotation(direction) * level));
            let with_score = self.process[mode].cross.map(|value| (value * direction).re * level);
            cross.rows_mut(at, 2).copy_from(&with_score);
        }
        for input in 0..inputs {
            let at = 2 + 2 * outputs + 2 * input;
            let value = model.participation[mode][input];
            (values[at], values[at + 1]) = (value.re, value.im);
            if input != gauge {
                let pair = 2 * model.pair_of(mode, input, loads);
                (response[(at, pair)], response[(at + 1, pair + 1)]) = (1.0, 1.0);
            }
        }
        ModeResponse { values, response, common, cross }
    }

    /// Returns the covariance of ln(−Re λ) and ln Im λ of a mode.
    pub(crate) fn pole_covariance(&self, mode: usize) -> Matrix2<f64> {
        self.parameters.fixed_view::<2, 2>(2 * mode, 2 * mode).into_owned()
    }
}

/// Parameters of one mode, with the derivatives and covariances that describe their errors.
struct ModeResponse {
    values: DVector<f64>,
    /// Derivatives with respect to the parameters of the search.
    response: DMatrix<f64>,
    /// Derivatives with respect to the complex factor that an unmeasured force applies to the
    /// shape.
    common: DMatrix<f64>,
    /// Covariance of this complex factor with the score.
    cross: DMatrix<f64>,
}

/// Returns the real 2 × 2 matrix whose product with (real part, imaginary part) is the
/// multiplication by a complex number.
fn rotation(z: C) -> DMatrix<f64> {
    DMatrix::from_row_slice(2, 2, &[z.re, -z.im, z.im, z.re])
}

/// Returns A⁺C, the derivatives of all linear unknowns (the columns of A) with respect to the
/// parameters, and the rows of (AᵀA)⁻¹ that belong to modes. These rows are stored as columns.
fn unknowns_by_parameter(
    lines: &Lines,
    model: &Model,
    projection: &Projection,
    pairs: &[(usize, Option<usize>)],
) -> (Vec<f64>, Vec<f64>) {
    let (columns, size) = (projection.triangle.size, 2 * pairs.len());
    let parts: Vec<Vec<f64>> = lines
        .blocks
        .par_iter()
        .zip(&projection.blocks)
        .map(|(block, arrays)| {
            let rows = 2 * block.len();
            let (indices, local) = block_pairs(pairs, block);
            let mut derivatives = vec![0.0; rows * 2 * local.len()];
            model.fill_derivatives(lines, block, &arrays.weight, &local, &mut derivatives);
            let cross = transposed_product(&arrays.design, &derivatives, rows);
            let mut part = vec![0.0; columns * size];
            for (k, from) in cross.chunks_exact(arrays.columns.len().max(1)).enumerate() {
                let index = 2 * indices[k / 2] + k % 2;
                for (column, value) in arrays.columns.iter().zip(from) {
                    part[index * columns + column] = *value;
                }
            }
            part
        })
        .collect();
    let mut sum = vec![0.0; columns * size];
    for part in &parts {
        sum.iter_mut().zip(part).for_each(|(to, part)| *to += part);
    }
    let mut rows = vec![0.0; columns * 2 * model.modes()];
    (0..2 * model.modes()).for_each(|k| rows[k * columns + k] = 1.0);
    for right in [&mut sum, &mut rows] {
        projection.triangle.solve_transposed(right);
        projection.triangle.solve(right);
    }
    (sum, rows)
}

/// Returns the variance that the sensor noise causes in the score and in the unknowns of each
/// output.
fn sensor_variance(
    fit: &Fit<'_>,
    noise: &Noise,
    mean: &[f64],
    blocks: &[BlockProducts],
    pairs: &[(usize, Option<usize>)],
    shapes: &[f64],
    scale: &[f64],
) -> (Vec<f64>, Vec<DMatrix<f64>>) {
    let (modes, size) = (fit.model.modes(), 2 * pairs.len());
    let outputs = fit.lines.outputs.len();
    let mut score_variance = vec![0.0; size * size];
    let mut unknowns = vec![DMatrix::zeros(2 * modes, 2 * modes); outputs];
    for (block, products) in fit.lines.blocks.iter().zip(blocks) {
        let ratios = noise_ratios(fit, noise, mean, block);
        let weighted: Vec<f64> =
            shapes.iter().enumerate().map(|(k, x)| x * ratios[k % outputs].sqrt()).collect();
        let turned =
            congruence_sum(&products.gram, pairs, &ShapeProducts::new(&weighted, modes), scale);
        score_variance.iter_mut().zip(&turned).for_each(|(to, part)| *to += part);
        for (unknowns, ratio) in unknowns.iter_mut().zip(&ratios) {
            unknowns.iter_mut().zip(&products.inverse).for_each(|(to, part)| *to += ratio * part);
        }
    }
    (score_variance, unknowns)
}

/// Returns, for every line, the variance of the sensor noise divided by the squared level of the
/// output in the weights; this ratio is averaged over the outputs.
fn mean_sensor(fit: &Fit<'_>, noise: &Noise) -> Vec<f64> {
    let levels = &fit.weights.level;
    let mut mean = vec![0.0; fit.lines.len()];
    for (sensor, level) in noise.sensor.iter().zip(levels) {
        let scale = 1.0 / (level * level * levels.len() as f64);
        mean.iter_mut().zip(sensor).for_each(|(mean, variance)| *mean += scale * variance);
    }
    mean
}

/// Returns, for each output, the ratio of its sensor noise variance to the mean over all outputs,
/// averaged over a block.
fn noise_ratios(fit: &Fit<'_>, noise: &Noise, mean: &[f64], block: &Block) -> Vec<f64> {
    let ratio = |(sensor, level): (&Vec<f64>, &f64)| {
        let rows: Range<usize> = block.rows.clone();
        let sum: f64 = rows.map(|row| sensor[row] / mean[row]).sum();
        sum / (block.len() as f64 * level * level)
    };
    noise.sensor.iter().zip(&fit.weights.level).map(ratio).collect()
}

/// Returns the factors that scale a symmetric matrix to a unit diagonal, and the scaled matrix. A
/// factor is not finite if the entry on the diagonal is zero or negative.
fn with_unit_diagonal(matrix: &[f64], size: usize) -> (Vec<f64>, DMatrix<f64>) {
    let scale: Vec<f64> = (0..size).map(|k| 1.0 / matrix[k * size + k].sqrt()).collect();
    let scaled = DMatrix::from_fn(size, size, |a, b| matrix[b * size + a] * scale[a] * scale[b]);
    (scale, scaled)
}

/// Returns the inverse of a symmetric positive definite matrix. The matrix is scaled to a unit
/// diagonal before it is inverted.
fn symmetric_inverse(matrix: &[f64], size: usize) -> Option<DMatrix<f64>> {
    let (scale, scaled) = with_unit_diagonal(matrix, size);
    if scale.iter().any(|value| !value.is_finite()) {
        return None;
    }
    let factor = scaled.cholesky()?;
    let inverse = factor.solve(&DMatrix::identity(size, size));
    Some(DMatrix::from_fn(size, size, |a, b| inverse[(a, b)] * scale[a] * scale[b]))
}

/// Returns the mode that the data determine least: in scaled parameters, the likelihood changes
/// least along one direction, and this mode has the largest component in that direction.
///
/// # Source
/// Belsley, Kuh & Welsch, *Regression Diagnostics* (1980), section 3.2 (decomposition of the
/// variance by the directions of a scaled matrix).
pub(crate) fn least_determined_mode(fit: &Fit<'_>) -> Option<usize> {
    let normal = NormalEquations::new(fit.lines, &fit.model, &fit.projection);
    let pairs = fit.model.pairs(fit.lines.loads.len());
    least_determined(&normal.curvature, &pairs)
}

/// Returns the least determined mode, given the curvature (column-major) and the mode of each pair
/// of parameters.
fn least_determined(curvature: &[f64], pairs: &[(usize, Option<usize>)]) -> Option<usize> {
    let (scale, scaled) = with_unit_diagonal(curvature, 2 * pairs.len());
    if let Some(index) = scale.iter().position(|value| !value.is_finite()) {
        return Some(pairs[index / 2].0);
    }
    let eigen = crate::decomposition::hermitian_eigen(scaled)?;
    let direction = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let part = |mode: &usize| -> f64 {
        let of_mode = pairs.iter().enumerate().filter(|(_, (other, _))| other == mode);
        of_mode.map(|(pair, _)| direction.rows(2 * pair, 2).norm_squared()).sum()
    };
    pairs.iter().map(|(mode, _)| *mode).max_by(|a, b| part(a).total_cmp(&part(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three modes have one pole and one participation each. The function returns the second mode
    /// if the curvature is almost singular in a direction of this mode, and the third mode if a
    /// parameter of the third mode has no effect.
    #[test]
    fn the_mode_of_a_singular_direction_is_named() {
        let pairs = [(0, None), (1, None), (2, None), (0, Some(1)), (1, Some(1)), (2, Some(1))];
        let size = 2 * pairs.len();
        let mut curvature = DMatrix::<f64>::identity(size, size);
        // The parameters have different sizes, and two parameters of the second mode have the same
        // effect.
        curvature[(2, 8)] = 1.0 - 1e-15;
        curvature[(8, 2)] = 1.0 - 1e-15;
        let sizes = DVector::from_fn(size, |k, _| 10f64.powi(k as i32 % 5 - 2));
        let curvature = DMatrix::from_diagonal(&sizes) * curvature * DMatrix::from_diagonal(&sizes);
        assert_eq!(least_determined(curvature.as_slice(), &pairs), Some(1));
        let mut without_effect = curvature;
        without_effect.fill_row(5, 0.0);
        without_effect.fill_column(5, 0.0);
        assert_eq!(least_determined(without_effect.as_slice(), &pairs), Some(2));
    }
}
