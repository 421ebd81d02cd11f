//! Standard errors that are valid for a residual of any spectrum, even if the variance of the
//! residual changes with the response.

use nalgebra::{Complex, DMatrix, DVector};

use super::estimate::StandardErrors;
use super::grid::Grid;
use super::scatter::{Misfit, PeriodScatter};
use crate::limits::{COVARIANCE_MOST, TIME_CONSTANTS};

/// Covariance of all parameters, and its origin: periods, blocks, or a white residual.
pub(super) struct Uncertainty {
    pub(super) covariance: DMatrix<f64>,
    pub(super) standard_errors: StandardErrors,
    pub(super) freedom: usize,
    pub(super) misfit: Option<Misfit>,
    /// Bias of the parameters due to noise in their regressors, estimated from several periods;
    /// zero for a single period.
    pub(super) bias: DVector<f64>,
}

/// Effect of noise on an estimate, from the scatter of the periods.
pub(super) struct ByPeriods {
    pub(super) scatter: PeriodScatter,
    pub(super) misfit: Misfit,
    /// Bias of the parameters due to noise in the regressors.
    pub(super) bias: DVector<f64>,
}

impl Uncertainty {
    /// Computes the covariance from the scatter of the periods if the residual power does not
    /// exceed the noise power of the periods. Otherwise the covariance comes from the blocks of the
    /// residual; for a record too short for blocks, it is the covariance from the scatter times the
    /// ratio of the residual power to the noise power. Without `by_periods`, the covariance comes
    /// from the residual. The number of degrees of freedom is the smallest one of the first
    /// `wanted` parameters.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227, for standard errors scaled by the residual.
    pub(super) fn new(
        by_periods: Option<ByPeriods>,
        wanted: usize,
        by_residual: impl FnOnce() -> (DMatrix<f64>, StandardErrors, usize),
    ) -> Self {
        let Some(ByPeriods { scatter, misfit, bias }) = by_periods else {
            let (covariance, standard_errors, freedom) = by_residual();
            let bias = DVector::zeros(covariance.nrows());
            return Self { covariance, standard_errors, freedom, misfit: None, bias };
        };
        let by_residual = misfit.is_significant().then(by_residual);
        let (covariance, standard_errors, freedom) = match by_residual {
            Some(blocks) if blocks.1 != StandardErrors::White => blocks,
            is_beyond => {
                let (covariance, standard_errors, freedom) = scatter.finish(wanted);
                let factor = if is_beyond.is_some() { misfit.ratio } else { 1.0 };
                (covariance * factor, standard_errors, freedom)
            }
        };
        Self { covariance, standard_errors, freedom, misfit: Some(misfit), bias }
    }
}

/// Returns the number of blocks for an experiment of this duration (s) whose slowest free response
/// decays at `rate` (1/s).
pub(super) fn block_count(duration: f64, rate: f64) -> usize {
    match duration * rate / TIME_CONSTANTS {
        blocks if blocks.is_finite() => (blocks as usize).clamp(1, COVARIANCE_MOST),
        _ => 1,
    }
}

/// Scores (regressor times residual) and Gram matrices of the regressors, each summed over blocks
/// of time.
///
/// The formula s²(AᵀA)⁻¹ assumes a residual that is white and independent of the response. The
/// residual of a nonlinear model is neither white nor independent. Estimates that omit one block at
/// a time show the variance without this assumption.
///
/// # Source
/// Künsch (1989), Annals of Statistics 17, 1217–1241 (the jackknife by blocks of a series); Bell &
/// McCaffrey (2002), Survey Methodology 28, 169–181, for the correction of the plain sum of
/// squares; Newey & West (1987), Econometrica 55, 703–708, for the problem.
pub(super) struct BlockScores {
    blocks: Vec<(DVector<f64>, DMatrix<f64>)>,
    parameters: usize,
}

/// Regressors and residual of one equation or channel of one experiment, as time signals.
pub(super) struct InTime {
    /// Indices of the parameters, each with its regressor.
    pub(super) regressors: Vec<(usize, Vec<f64>)>,
    pub(super) residual: Vec<f64>,
}

impl BlockScores {
    pub(super) fn new(parameters: usize) -> Self {
        Self { blocks: Vec::new(), parameters }
    }

    /// Adds one experiment.
    pub(super) fn push(&mut self, blocks: usize, parts: &[InTime]) {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for block in 0..blocks {
            let mut score = DVector::zeros(self.parameters);
            let mut gram = DMatrix::zeros(self.parameters, self.parameters);
            for InTime { regressors, residual } in parts {
                let len = residual.len();
                let range = block * len / blocks..(block + 1) * len / blocks;
                for (row, regressor) in regressors {
                    let regressor = &regressor[range.clone()];
                    score[*row] += dot(regressor, &residual[range.clone()]);
                    for (column, right) in regressors {
                        if row <= column {
                            gram[(*row, *column)] += dot(regressor, &right[range.clone()]);
                        }
                    }
                }
            }
            gram.fill_lower_triangle_with_upper_triangle();
            self.blocks.push((score, gram));
        }
    }

    pub(super) fn count(&self) -> usize {
        self.blocks.len()
    }

    /// Returns the covariance (B − 1)/B Σ d dᵀ over B blocks. Here d = (AᵀA − A_bᵀA_b)⁻¹ s_b is the
    /// change of the estimate if block b is omitted. A are the regressors, A_b and s_b are the rows
    /// of A and the scores in this block, and `inverse` is (AᵀA)⁻¹. Also returns the smallest
    /// number of degrees of freedom of the first `wanted` parameters. `None` if a parameter depends
    /// on one block only.
    pub(super) fn covariance(
        &self,
        inverse: &DMatrix<f64>,
        wanted: usize,
    ) -> Option<(DMatrix<f64>, usize)> {
        let blocks = self.blocks.len() as f64;
        let mut sum = DMatrix::zeros(self.parameters, self.parameters);
        for (score, gram) in &self.blocks {
            // (G − G_b)⁻¹ = (I − G⁻¹G_b)⁻¹ G⁻¹.
            let remaining = DMatrix::identity(self.parameters, self.parameters) - inverse * gram;
            let change = remaining.lu().solve(&(inverse * score))?;
            if change.iter().any(|d| !d.is_finite()) {
                return None;
            }
            sum.ger(1.0, &change, &change, 1.0);
        }
        Some((sum * ((blocks - 1.0) / blocks), self.degrees_of_freedom(inverse, wanted)))
    }

    /// Returns the smallest number of Satterthwaite's degrees of freedom of the first `wanted`
    /// parameters. Parameter k has (Σ w)²/Σ w² − 1 degrees of freedom, where w = \[(AᵀA)⁻¹ A_bᵀA_b
    /// (AᵀA)⁻¹\]_kk is the contribution of block b to the variance of the parameter. Initial
    /// states, which follow these parameters, depend on the first block only and are ignored.
    fn degrees_of_freedom(&self, inverse: &DMatrix<f64>, wanted: usize) -> usize {
        let mut sums = DVector::<f64>::zeros(self.parameters);
        let mut squares = DVector::<f64>::zeros(self.parameters);
        for (_, gram) in &self.blocks {
            let variances = (inverse * gram * inverse).diagonal();
            squares += variances.component_mul(&variances);
            sums += variances;
        }
        let freedom = |(sum, square): (&f64, &f64)| sum * sum / square - 1.0;
        let freedoms = sums.iter().zip(squares.iter()).take(wanted).map(freedom);
        let least = freedoms.fold(f64::INFINITY, f64::min);
        // The result is at least one, and less than the number of blocks.
        (least as usize).clamp(1, self.blocks.len().max(2) - 1)
    }
}

/// Returns a weighted column of lines as a time signal. The sum of squares of the signal equals the
/// sum of squares of the real and imaginary parts of the lines.
pub(super) fn in_time(
    grid: &Grid,
    lines: usize,
    rows: &[usize],
    values: &[Complex<f64>],
) -> Vec<f64> {
    let mut spectrum = vec![Complex::ZERO; lines];
    for (row, value) in rows.iter().zip(values) {
        // The weight of the mean has a factor √2, which is not part of the signal.
        spectrum[*row] = if *row == 0 { value / std::f64::consts::SQRT_2 } else { *value };
    }
    let mut samples = grid.to_samples(spectrum.into_iter());
    let scale = (2.0 / samples.len() as f64).sqrt();
    samples.iter_mut().for_each(|x| *x *= scale);
    samples
}
