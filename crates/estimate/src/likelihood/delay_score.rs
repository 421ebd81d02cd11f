//! Score test for a delay between the inputs and the outputs of a fit.
//!
//! # Source
//! Rao (1948), Proceedings of the Cambridge Philosophical Society 44, 50–57 (score test).

use mechid_numerics::linear_algebra::svd;
use nalgebra::{Complex, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::fit::Fit;
use super::limits::{DETERMINED_DELAY, RANK};
use super::residual::real_rows;
use super::response_model::{LineResponse, ResponseModel};
use super::search::Linearisation;

/// Delay of one output or of all outputs: among the tested delays, the one that explains the
/// largest part of the residual.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayScore {
    /// Index of the delayed output; `None` if all outputs have the same delay.
    pub output: Option<usize>,
    /// Delay of the output, in s, to first order.
    pub delay: f64,
    /// Standard error of the delay, in s.
    pub standard_error: f64,
    /// Probability that noise alone gives at least this ratio of delay to standard error for one of
    /// the tested delays.
    pub p_value: f64,
    /// First-order change of each parameter, in the unit of the parameter, if the delay is an
    /// unknown of the model.
    pub changes: Vec<f64>,
}

/// QR factors of the derivatives of residual and priors with respect to the parameters that are not
/// at a bound.
struct Factors {
    /// Indices of the parameters that are not at a bound.
    free: Vec<usize>,
    /// Orthonormal basis Q of the derivatives.
    basis: DMatrix<f64>,
    /// Triangular factor R.
    triangle: DMatrix<f64>,
}

/// Sums over all lines for a delay of each output.
struct Sums {
    /// DᵀD with the derivative D of the residual with respect to the delays, p × p.
    squares: DMatrix<f64>,
    /// Dᵀr, p entries.
    products: DVector<f64>,
    /// QᵀD.
    explained: DMatrix<f64>,
}

/// Returns the delay, of one output or of all outputs, that explains the largest part of the
/// residual in addition to the parameters; `None` if the data do not determine a delay. An output
/// whose `known` entry is `false` is not tested, because its delay is already a parameter.
pub(super) fn delay_score<M: ResponseModel>(
    fit: &Fit<'_, M>,
    linearised: &Linearisation,
    known: &[bool],
) -> Option<DelayScore> {
    let factors = Factors::new(linearised, &fit.minimum.at_bound);
    let sums = Sums::new(fit, &linearised.residual, &factors.basis)?;
    let p = known.len();
    let error_scale = fit.information.inflation.sqrt() * fit.error_scale();
    let score = |output: Option<usize>| {
        let direction = direction_of(output, p);
        let square = (&sums.squares * &direction).dot(&direction);
        let free = square - (&sums.explained * &direction).norm_squared();
        let product = sums.products.dot(&direction);
        (free > DETERMINED_DELAY * square)
            .then(|| (output, -product / free, error_scale / free.sqrt()))
    };
    let common = known.iter().all(|known| *known).then_some(None);
    let single = (0..p).filter(|output| p > 1 && known[*output]).map(Some);
    let scores: Vec<_> = common.into_iter().chain(single).filter_map(score).collect();
    let size = |score: &(_, f64, f64)| (score.1 / score.2).abs();
    let best = scores.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    let (output, delay, standard_error) = *best;
    let freedom = fit.degrees_of_freedom.clamp(1.0, 1e6);
    let of_one_test = 2.0 * StudentsT::new(0.0, 1.0, freedom).ok()?.sf(size(best));
    let p_value = (of_one_test * scores.len() as f64).min(1.0);
    let effect = &sums.explained * direction_of(output, p) * delay;
    let changes = factors.changes(&effect, fit.minimum.parameters.len())?;
    Some(DelayScore { output, delay, standard_error, p_value, changes })
}

/// Returns the unit delay of one output, or of all outputs, as a vector with one entry (1 or 0) for
/// each of the p outputs.
fn direction_of(output: Option<usize>, p: usize) -> DVector<f64> {
    DVector::from_fn(p, |at, _| f64::from(output.is_none_or(|one| one == at)))
}

impl Factors {
    fn new(linearised: &Linearisation, at_bound: &[bool]) -> Self {
        let free: Vec<usize> = (0..at_bound.len()).filter(|at| !at_bound[*at]).collect();
        let factors = linearised.jacobian.select_columns(&free).qr();
        Self { free, basis: factors.q(), triangle: factors.r() }
    }

    /// Returns the changes x of all parameters that minimise ‖R x + Qᵀd‖², with the effect Qᵀd of a
    /// delay.
    fn changes(&self, effect: &DVector<f64>, count: usize) -> Option<Vec<f64>> {
        let mut changes = vec![0.0; count];
        if self.free.is_empty() {
            return Some(changes);
        }
        let mut rows = self.triangle.clone();
        let lengths: Vec<f64> = rows.column_iter().map(|column| column.norm()).collect();
        for (mut column, length) in rows.column_iter_mut().zip(&lengths) {
            if *length > 0.0 {
                column.unscale_mut(*length);
            }
        }
        let decomposition = svd(rows).ok()?;
        let smallest = RANK * decomposition.singular_values.max();
        let scaled = decomposition.solve(&-effect, smallest).ok()?;
        for ((at, length), value) in self.free.iter().zip(&lengths).zip(scaled.iter()) {
            changes[*at] = if *length > 0.0 { value / length } else { 0.0 };
        }
        Some(changes)
    }
}

impl Sums {
    fn new<M: ResponseModel>(
        fit: &Fit<'_, M>,
        white: &DVector<f64>,
        basis: &DMatrix<f64>,
    ) -> Option<Self> {
        let (data, p) = (fit.data, fit.data.outputs().ncols());
        let mut sums = Self {
            squares: DMatrix::zeros(p, p),
            products: DVector::zeros(p),
            explained: DMatrix::zeros(basis.ncols(), p),
        };
        fit.residual().for_each_record(&fit.minimum.parameters, |record| {
            let bases = record.transient.as_ref().map(|(basis, _)| &basis.blocks);
            let rank = bases.and_then(|blocks| blocks.first()).map_or(0, DMatrix::ncols);
            let mut of_transient = DMatrix::zeros(rank, p);
            let effects = record.pulses.as_ref().map(|pulses| &pulses.effects);
            let amplitudes = effects.and_then(|blocks| blocks.first()).map_or(0, DMatrix::ncols);
            let mut of_pulses = DMatrix::zeros(amplitudes, p);
            for (index, block) in record.blocks.iter().enumerate() {
                for (at, (line, weighted)) in block.lines.iter().enumerate() {
                    let row = block.first + at;
                    let errors = block.white(at, p);
                    // The modelled outputs are the measured outputs minus their errors. They
                    // include the transient, and are the response to the most likely inputs.
                    let input = data.inputs().row(row).transpose();
                    let likely = weighted.likely_input(input.clone(), &errors);
                    let mut modelled = data.outputs().row(row).transpose();
                    modelled += line.receptance() * (likely - input) - &weighted.lower * errors;
                    let turn = Complex::new(0.0, data.omega()[row]);
                    let mut late = DMatrix::from_diagonal(&(modelled * turn));
                    weighted.lower.solve_lower_triangular_mut(&mut late).then_some(())?;
                    let derivative = real_rows(&late);
                    sums.squares += derivative.tr_mul(&derivative);
                    sums.products += derivative.tr_mul(&white.rows(2 * p * row, 2 * p));
                    sums.explained += basis.rows(2 * p * row, 2 * p).tr_mul(&derivative);
                    if let Some(blocks) = bases {
                        let rows = blocks[index].rows(2 * p * at, 2 * p);
                        of_transient += rows.tr_mul(&derivative);
                    }
                    if let Some(blocks) = effects {
                        let rows = blocks[index].rows(2 * p * at, 2 * p);
                        of_pulses += rows.tr_mul(&derivative);
                    }
                }
            }
            sums.squares -= of_transient.tr_mul(&of_transient);
            if let Some(pulses) = &record.pulses {
                sums.squares -= pulses.explained(&of_pulses);
            }
            Some(())
        })?;
        Some(sums)
    }
}
