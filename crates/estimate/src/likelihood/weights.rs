//! Noise covariance that weights the residuals.

use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix, DVector};

use super::LikelihoodError;

/// Covariance of outputs and inputs, outputs first, at each line.
#[derive(Debug, Clone)]
pub(super) struct Weights {
    covariance: Vec<DMatrix<Complex<f64>>>,
    outputs: usize,
    inputs_are_exact: bool,
    /// Lower triangular factors of the covariance of the outputs, for exact inputs; empty if one
    /// factor does not exist.
    lower: Vec<DMatrix<Complex<f64>>>,
}

/// Factors of the covariance L Lᴴ of the error e of a line.
pub(super) struct WeightedLine {
    /// Lower triangular factor L.
    pub(super) lower: DMatrix<Complex<f64>>,
    /// Covariance S_uy − S_uu Gᴴ between the errors of the inputs and the error e of the line;
    /// empty for exact inputs.
    cross: DMatrix<Complex<f64>>,
}

impl Weights {
    pub(super) fn new(covariance: Vec<DMatrix<Complex<f64>>>, outputs: usize) -> Self {
        let exact = |matrix: &DMatrix<Complex<f64>>| {
            let inputs = matrix.columns(outputs, matrix.ncols() - outputs);
            inputs.iter().all(|z| *z == Complex::default())
        };
        let inputs_are_exact = covariance.iter().all(exact);
        let of_outputs = |matrix: &DMatrix<Complex<f64>>| {
            cholesky(matrix.view((0, 0), (outputs, outputs)).into_owned())
        };
        let lower: Option<Vec<_>> =
            covariance.iter().map(of_outputs).take_while(|_| inputs_are_exact).collect();
        Self { covariance, outputs, inputs_are_exact, lower: lower.unwrap_or_default() }
    }

    /// Creates weights from variances of the outputs, lines × p, and the stated covariance of the
    /// inputs.
    pub(super) fn from_variances(data: &LineData, variance: &DMatrix<f64>) -> Self {
        let (outputs, inputs) = (data.outputs().ncols(), data.inputs().ncols());
        let channels = outputs + inputs;
        let covariance = (0..data.len()).map(|row| {
            let mut matrix = DMatrix::zeros(channels, channels);
            if let Some(noise) = data.noise() {
                let of_inputs = noise.covariance()[row].view((outputs, outputs), (inputs, inputs));
                matrix.view_mut((outputs, outputs), (inputs, inputs)).copy_from(&of_inputs);
            }
            for output in 0..outputs {
                matrix[(output, output)] = Complex::from(variance[(row, output)]);
            }
            matrix
        });
        Self::new(covariance.collect(), outputs)
    }

    /// Returns the weights of the lines with the indices `rows`.
    pub(super) fn rows(&self, rows: &[usize]) -> Self {
        let covariance = rows.iter().map(|row| self.covariance[*row].clone());
        Self::new(covariance.collect(), self.outputs)
    }

    /// Adds noise that is proportional to the response: on each output, its amplitude is `share`
    /// times the amplitude of this output.
    pub(super) fn with_relative(&self, data: &LineData, share: f64) -> Self {
        let mut covariance = self.covariance.clone();
        for (row, matrix) in covariance.iter_mut().enumerate() {
            for output in 0..self.outputs {
                let power = data.outputs()[(row, output)].norm_sqr();
                matrix[(output, output)] += Complex::from(share * share * power);
            }
        }
        Self::new(covariance, self.outputs)
    }

    /// Variance of an output at a line.
    pub(super) fn variance(&self, row: usize, output: usize) -> f64 {
        self.covariance[row][(output, output)].re
    }

    /// Variance of an output due to the noise of the inputs.
    pub(super) fn variance_by_inputs(
        &self,
        row: usize,
        output: usize,
        receptance: &DMatrix<Complex<f64>>,
    ) -> f64 {
        let inputs = receptance.ncols();
        let of_inputs = self.covariance[row].view((self.outputs, self.outputs), (inputs, inputs));
        let gain = receptance.row(output);
        (gain * of_inputs * gain.adjoint())[(0, 0)].re
    }

    /// Computes the Cholesky factor of S_yy − S_yu Gᴴ − G S_uy + G S_uu Gᴴ plus the covariance of
    /// an uncertain model; `None` if the sum is singular.
    pub(super) fn line(
        &self,
        row: usize,
        receptance: &DMatrix<Complex<f64>>,
        of_model: Option<DMatrix<Complex<f64>>>,
    ) -> Option<WeightedLine> {
        if let (None, Some(lower)) = (&of_model, self.lower.get(row)) {
            return Some(WeightedLine { lower: lower.clone(), cross: DMatrix::zeros(0, 0) });
        }
        let (p, q) = receptance.shape();
        let covariance = &self.covariance[row];
        let block = |at: (usize, usize), size: (usize, usize)| covariance.view(at, size);
        let mut total = block((0, 0), (p, p)).into_owned();
        let mut cross = DMatrix::zeros(0, 0);
        if !self.inputs_are_exact {
            let adjoint = receptance.adjoint();
            cross = block((p, 0), (q, p)) - block((p, p), (q, q)) * &adjoint;
            total -= block((0, p), (p, q)) * &adjoint + receptance * &cross;
        }
        if let Some(of_model) = of_model {
            total += of_model;
        }
        Some(WeightedLine { lower: cholesky(total)?, cross })
    }

    /// Checks that the outputs have noise at every line if the inputs are exact.
    pub(super) fn check(&self, data: &LineData) -> Result<(), LikelihoodError> {
        if !self.inputs_are_exact {
            return Ok(());
        }
        let p = self.outputs;
        if self.lower.len() == self.covariance.len() {
            return Ok(());
        }
        for (covariance, omega) in self.covariance.iter().zip(data.omega()) {
            if cholesky(covariance.view((0, 0), (p, p)).into_owned()).is_none() {
                let frequency_hz = omega / std::f64::consts::TAU;
                return Err(LikelihoodError::SingularNoise { frequency_hz });
            }
        }
        Ok(())
    }
}

impl WeightedLine {
    /// Returns the most likely input û = u − Q (L Lᴴ)⁻¹ e, which follows from the noise of the
    /// inputs and the measured outputs; `white` is L⁻¹e.
    pub(super) fn likely_input(
        &self,
        input: DVector<Complex<f64>>,
        white: &DVector<Complex<f64>>,
    ) -> DVector<Complex<f64>> {
        if self.cross.is_empty() {
            return input;
        }
        let mut twice = white.clone();
        if !self.lower.ad_solve_lower_triangular_mut(&mut twice) {
            return input;
        }
        input - &self.cross * twice
    }
}

/// Returns L of a Hermitian positive definite matrix L Lᴴ, `None` for any other matrix.
fn cholesky(matrix: DMatrix<Complex<f64>>) -> Option<DMatrix<Complex<f64>>> {
    // nalgebra does not reject negative pivots but computes their complex roots.
    let lower = matrix.cholesky()?.unpack();
    let positive = |z: &Complex<f64>| z.re > 0.0 && z.im.abs() <= 1e-8 * z.re;
    lower.diagonal().iter().all(positive).then_some(lower)
}
