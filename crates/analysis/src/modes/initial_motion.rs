//! Free motion of the modes at the beginning of a record.

use mechid_numerics::least_squares::{LeastSquares, Solution};
use mechid_signal::{Record, measures};
use nalgebra::{Complex, DMatrix};

use super::system::{MeasuredChannel, ModalSystem};
use crate::AnalysisError;
use crate::measurement::Block;

/// Number of samples whose equations are gathered at a time.
const SAMPLES_AT_ONCE: usize = 256;

/// Free motion of the modes r from the first sample on, Σ_r Re(a_r φ_r exp λ_r t), with amplitudes
/// a_r, shapes φ_r and poles λ_r.
pub(super) struct FreeMotion {
    /// Samples × outputs.
    pub motion: DMatrix<f64>,
    /// RMS of the error that the uncertainty of the amplitudes a_r causes, one for each output,
    /// over all samples except the first `settle`.
    pub standard_error: Vec<f64>,
}

impl FreeMotion {
    /// Fits the amplitudes of the free motion, and a constant for each channel, by least squares.
    /// The data are the first `settle` samples of the measured channels, minus the predicted
    /// response from rest.
    ///
    /// # Errors
    /// [`AnalysisError::Setting`] if these samples do not determine every amplitude.
    pub fn fit(
        system: &ModalSystem,
        block: &Block,
        columns: &[MeasuredChannel],
        from_rest: &Record,
        settle: usize,
    ) -> Result<Self, AnalysisError> {
        let unknowns = 2 * system.model.terms.len();
        let undetermined = || AnalysisError::Setting {
            setting: "settle",
            why: format!(
                "the first {settle} samples of the measured responses do not determine the motion of \
                 all modes"
            ),
        };
        if settle * columns.len() < unknowns + columns.len() {
            return Err(undetermined());
        }
        let mut equations = LeastSquares::new(unknowns + columns.len(), 1);
        for (at, (quantity, column, output)) in columns.iter().enumerate() {
            let kinds = block.responses();
            let Some((_, record)) = kinds.iter().find(|(kind, _)| kind == quantity) else {
                continue;
            };
            let measured = record.channel(*column);
            // Each channel is divided by its RMS value: all channels then have the same weight,
            // although their quantities and amplitudes differ.
            let scale = measures::rms(measured).max(f64::MIN_POSITIVE).recip();
            let predicted = from_rest.channel(*output);
            for first in (0..settle).step_by(SAMPLES_AT_ONCE) {
                let count = SAMPLES_AT_ONCE.min(settle - first);
                let mut rows = DMatrix::zeros(count, unknowns + columns.len());
                let mut targets = DMatrix::zeros(count, 1);
                for k in 0..count {
                    let basis =
                        basis(system, *output, (first + k) as f64 * block.force.sampling().dt());
                    for (unknown, value) in basis.into_iter().enumerate() {
                        rows[(k, unknown)] = scale * value;
                    }
                    rows[(k, unknowns + at)] = scale;
                    targets[(k, 0)] = scale * (measured[first + k] - predicted[first + k]);
                }
                equations.push_rows(rows.as_view(), targets.as_view())?;
            }
        }
        let solution = equations.solve()?;
        if solution.coefficients.iter().any(|value| !value.is_finite()) {
            return Err(undetermined());
        }
        Ok(Self::new(system, block, &solution, settle))
    }

    fn new(system: &ModalSystem, block: &Block, solution: &Solution, settle: usize) -> Self {
        let (len, outputs) = (block.force.len(), system.outputs.len());
        let unknowns = 2 * system.model.terms.len();
        let amplitudes = solution.coefficients.view((0, 0), (unknowns, 1));
        let variance = solution.residual_covariance[(0, 0)];
        let covariance = solution.unscaled_covariance.view((0, 0), (unknowns, unknowns)) * variance;
        let mut motion = DMatrix::zeros(len, outputs);
        let mut power = vec![0.0; outputs];
        for output in 0..outputs {
            for k in 0..len {
                let basis = basis(system, output, k as f64 * block.force.sampling().dt());
                let basis = nalgebra::RowDVector::from_vec(basis);
                motion[(k, output)] = (&basis * amplitudes)[(0, 0)];
                if k >= settle {
                    power[output] += (&basis * &covariance).dot(&basis);
                }
            }
        }
        let judged = (len - settle) as f64;
        let standard_error = power.into_iter().map(|sum| (sum / judged).sqrt()).collect();
        Self { motion, standard_error }
    }
}

/// Returns the real part and the negative imaginary part of φ exp λt at an output: two values for
/// each mode, mode by mode.
pub(crate) fn basis(system: &ModalSystem, output: usize, time: f64) -> Vec<f64> {
    let delay = system.model.delays.get(output).copied().unwrap_or(0.0);
    let part = |term: &mechid_modal::ModalTerm| {
        let [pole, shape] = [term.pole, term.shape[output]].map(|[re, im]| Complex::new(re, im));
        let value = shape * (pole * (time - delay)).exp();
        [value.re, -value.im]
    };
    system.model.terms.iter().flat_map(part).collect()
}
