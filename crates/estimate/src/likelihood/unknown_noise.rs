//! Noise of the outputs, estimated from the residual in alternation with the parameters: first
//! levels, later spectra.

use mechid_numerics::time_limit;
use mechid_spectra::LineData;
use nalgebra::DMatrix;

use super::LikelihoodError;
use super::limits::{
    COLOURED_ROUNDS, LEAST_KEPT, LEAST_POWER, NOISE_LEVEL_CHANGE, NOISE_ROUNDS, STEPS,
};
use super::residual::{LineErrors, PriorRow, Residual};
use super::response_model::ResponseModel;
use super::search::{Bounds, Effort, Minimum, minimise};
use super::weights::Weights;
use mechid_spectra::noise::level::motion_level;
use mechid_spectra::noise::smooth;

/// Minimum with its weights.
pub(super) struct WeightedMinimum {
    pub(super) minimum: Minimum,
    pub(super) weights: Weights,
    /// True if every spectrum is white.
    pub(super) is_white: bool,
    /// Basis functions of the log powers of each record; empty for white noise.
    pub(super) bases: Vec<DMatrix<f64>>,
}

/// Data, model, priors and bounds, which are the same in all rounds.
pub(super) struct UnknownNoise<'a, M> {
    pub(super) model: &'a M,
    pub(super) data: &'a LineData,
    pub(super) priors: &'a [PriorRow],
    pub(super) bounds: &'a Bounds,
}

impl<'a, M: ResponseModel> UnknownNoise<'a, M> {
    fn residual<'b>(&'b self, weights: &'b Weights) -> Residual<'b, M> {
        Residual { model: self.model, data: self.data, weights, priors: self.priors }
    }

    /// Returns the weights of the first search: white noise with a tenth of the RMS value of each
    /// output.
    pub(super) fn first_weights(&self) -> Weights {
        let (lines, outputs) = self.data.outputs().shape();
        let power = |column: usize| {
            let sum: f64 = self.data.outputs().column(column).iter().map(|y| y.norm_sqr()).sum();
            (0.01 * sum / lines as f64).max(f64::MIN_POSITIVE)
        };
        let powers: Vec<f64> = (0..outputs).map(power).collect();
        let variance = DMatrix::from_fn(lines, outputs, |_, output| powers[output]);
        Weights::from_variances(self.data, &variance)
    }

    fn minimise(&self, weights: &Weights, from: &[f64]) -> Option<Minimum> {
        let residual = self.residual(weights);
        let is_result = |minimum: &Minimum| minimum.converged || time_limit::is_over();
        minimise(&residual, self.bounds, from, Effort::FINAL).filter(is_result)
    }

    /// Alternates between the most likely levels of white noise and the parameters. A level is
    /// corrected for the degrees of freedom of the fit.
    ///
    /// # Errors
    /// [`LikelihoodError::NotConverged`].
    pub(super) fn white(&self, from: &Minimum) -> Result<WeightedMinimum, LikelihoodError> {
        let mut weights = self.first_weights();
        let mut minimum = from.clone();
        let mut before: Vec<f64> = Vec::new();
        for _ in 0..NOISE_ROUNDS {
            let levels = self.levels(&weights, &minimum)?;
            let variance = DMatrix::from_fn(self.data.len(), levels.len(), |_, at| levels[at]);
            weights = Weights::from_variances(self.data, &variance);
            let failed = LikelihoodError::NotConverged { searches: 1, steps: STEPS };
            minimum = self.minimise(&weights, &minimum.parameters).ok_or(failed)?;
            let settled = levels
                .iter()
                .zip(&before)
                .all(|(now, before)| (now - before).abs() <= NOISE_LEVEL_CHANGE * now);
            if (settled && !before.is_empty()) || time_limit::is_over() {
                break;
            }
            before = levels;
        }
        Ok(WeightedMinimum { minimum, weights, is_white: true, bases: Vec::new() })
    }

    /// Returns the number of residuals (real and imaginary parts) divided by their degrees of
    /// freedom; `amplitudes` is the number of determined amplitudes of pulses.
    fn freedom_ratio(&self, minimum: &Minimum, amplitudes: f64, residual: &Residual<'_, M>) -> f64 {
        let free = minimum.at_bound.iter().filter(|at_bound| !**at_bound).count();
        let unknowns = (free + residual.transient_unknowns()).saturating_sub(self.priors.len());
        let spare = residual.len().saturating_sub(unknowns) as f64 - amplitudes;
        residual.len() as f64 / spare.max(1.0)
    }

    /// Estimates the variance of the noise of each output.
    fn levels(&self, weights: &Weights, minimum: &Minimum) -> Result<Vec<f64>, LikelihoodError> {
        let residual = self.residual(weights);
        let failed = LikelihoodError::NoResponse { at: "a minimum of the search" };
        let LineErrors { errors, receptances, determined_amplitudes } =
            residual.errors(&minimum.parameters).ok_or(failed)?;
        let factor = self.freedom_ratio(minimum, determined_amplitudes, &residual);
        let level = |output: usize| {
            let of_line = |row: usize| {
                let by_inputs = weights.variance_by_inputs(row, output, &receptances[row]);
                (factor * errors[(row, output)].norm_sqr(), by_inputs)
            };
            motion_level((0..self.data.len()).map(of_line)).powi(2)
        };
        let levels: Vec<f64> = (0..errors.ncols()).map(level).collect();
        // An output without residual would have an unbounded weight.
        let size = |output: usize| {
            let column = self.data.outputs().column(output);
            column.iter().map(|y| y.norm_sqr()).sum::<f64>() / column.len() as f64
        };
        let floor = |(output, level): (usize, f64)| level.max(1e-30 * size(output));
        Ok(levels.into_iter().enumerate().map(floor).collect())
    }

    /// Alternates between smooth noise spectra from the residual, one for each output and record,
    /// and the parameters; `None` if all spectra are white.
    ///
    /// # Errors
    /// [`LikelihoodError::NoResponse`].
    pub(super) fn smooth(
        &self,
        white: &WeightedMinimum,
    ) -> Result<Option<WeightedMinimum>, LikelihoodError> {
        let mut last: Option<WeightedMinimum> = None;
        for _ in 0..COLOURED_ROUNDS {
            if time_limit::is_over() {
                break;
            }
            let before = last.as_ref().unwrap_or(white);
            let (variance, bases) = self.spectra(before)?;
            if bases.iter().all(|basis| basis.ncols() <= 1) {
                return Ok(None);
            }
            let weights = Weights::from_variances(self.data, &variance);
            let Some(minimum) = self.minimise(&weights, &before.minimum.parameters) else { break };
            last = Some(WeightedMinimum { minimum, weights, is_white: false, bases });
        }
        Ok(last)
    }

    /// Returns the variances, lines × p, and the basis functions of their logarithms for every
    /// record.
    fn spectra(
        &self,
        before: &WeightedMinimum,
    ) -> Result<(DMatrix<f64>, Vec<DMatrix<f64>>), LikelihoodError> {
        let residual = self.residual(&before.weights);
        let failed = || LikelihoodError::NoResponse { at: "a minimum of the search" };
        let LineErrors { errors, receptances, .. } =
            residual.errors(&before.minimum.parameters).ok_or_else(failed)?;
        let residual_share = self.residual_share(before).ok_or_else(failed)?;
        let power = DMatrix::from_fn(errors.nrows(), errors.ncols(), |row, output| {
            let level = before.weights.variance(row, output);
            let by_inputs = before.weights.variance_by_inputs(row, output, &receptances[row]);
            let share = level / (level + by_inputs);
            let power = (share * errors[(row, output)].norm_sqr()).max(LEAST_POWER * level);
            power / residual_share[(row, output)]
        });
        let mut variance = power.clone();
        let mut bases = Vec::new();
        for (rows, _) in self.data.records() {
            let mut order: Vec<usize> = rows.clone().collect();
            order.sort_by(|a, b| self.data.omega()[*a].total_cmp(&self.data.omega()[*b]));
            let omega: Vec<f64> = order.iter().map(|row| self.data.omega()[*row]).collect();
            let smooth = smooth::choose(&omega, &power.select_rows(&order), 1.0);
            for (at, row) in order.iter().enumerate() {
                let values = smooth.log_power.row(at).map(f64::exp);
                variance.row_mut(*row).copy_from(&values);
            }
            let mut basis = smooth.basis.clone();
            for (at, row) in order.iter().enumerate() {
                basis.row_mut(row - rows.start).copy_from(&smooth.basis.row(at));
            }
            bases.push(basis);
        }
        Ok((variance, bases))
    }

    /// Returns the share of the noise that remains in the residual after the fit (1 − leverage of
    /// the parameters and of the errors of pulses), lines × p.
    fn residual_share(&self, before: &WeightedMinimum) -> Option<DMatrix<f64>> {
        let residual = self.residual(&before.weights);
        let linearisation = residual.linearise(&before.minimum.parameters)?;
        let free: Vec<usize> =
            (0..before.minimum.at_bound.len()).filter(|at| !before.minimum.at_bound[*at]).collect();
        let mut jacobian = linearisation.jacobian.select_columns(&free);
        for mut column in jacobian.column_iter_mut() {
            let length = column.norm();
            if length > 0.0 {
                column.unscale_mut(length);
            }
        }
        let q = jacobian.qr().q();
        let of_pulses = residual.explained_by_pulses(&before.minimum.parameters)?;
        let outputs = self.data.outputs().ncols();
        Some(DMatrix::from_fn(self.data.len(), outputs, |row, output| {
            let at = 2 * (outputs * row + output);
            let explained =
                |row: usize| q.row(row).norm_squared() + of_pulses.row(row).norm_squared();
            let leverage = 0.5 * (explained(at) + explained(at + 1));
            (1.0 - leverage).max(LEAST_KEPT)
        }))
    }
}
