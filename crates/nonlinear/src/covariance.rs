//! Standard errors that hold for a residual of any colour, and for one that comes and goes with the
//! response.

use nalgebra::{Complex, DMatrix, DVector};

use super::estimate::StandardErrors;
use super::grid::Grid;
use super::scatter::{Misfit, PeriodScatter};
use crate::limits::{COVARIANCE_MOST, TIME_CONSTANTS};

/// Covariance of all parameters, and what it rests on.
pub(super) struct Uncertainty {
    pub(super) covariance: DMatrix<f64>,
    pub(super) standard_errors: StandardErrors,
    pub(super) freedom: usize,
    pub(super) misfit: Option<Misfit>,
    /// Bias of the parameters by noise in their regressors, as the periods show it; zero where they do not.
    pub(super) bias: DVector<f64>,
}

/// What the periods show of the noise in an estimate.
pub(super) struct ByPeriods {
    pub(super) scatter: PeriodScatter,
    pub(super) misfit: Misfit,
    /// Bias of the parameters by noise in their regressors.
    pub(super) bias: DVector<f64>,
}

impl Uncertainty {
    /// That of the scatter of the periods as long as the residual is no more than their noise, otherwise that of the
    /// residual or, where that could be taken as white only, of the scatter in proportion to the misfit; the degrees of
    /// freedom are those of the first `wanted` parameters.
    ///
    /// # Source
    /// Birge (1932), Physical Review 40, 207–227, for errors in proportion to a misfit.
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

/// Blocks for an experiment of this duration (s), whose slowest free response decays at `rate` (1/s).
pub(super) fn block_count(duration: f64, rate: f64) -> usize {
    match duration * rate / TIME_CONSTANTS {
        blocks if blocks.is_finite() => (blocks as usize).clamp(1, COVARIANCE_MOST),
        _ => 1,
    }
}

/// Scores (regressor times residual) and Gram matrices of the regressors, summed over blocks of time.
///
/// The white formula s²(AᵀA)⁻¹ takes the residual as independent of its neighbours and of the
/// response. What a model of a nonlinear system leaves is neither. Leaving out one block after the
/// other shows how much the estimate depends on each, whatever the reason.
///
/// # Source
/// Künsch (1989), Annals of Statistics 17, 1217–1241 (the jackknife by blocks of a series); Bell &
/// McCaffrey (2002), Survey Methodology 28, 169–181, for what it corrects of the plain sum of
/// squares; Newey & West (1987), Econometrica 55, 703–708, for the problem.
pub(super) struct BlockScores {
    blocks: Vec<(DVector<f64>, DMatrix<f64>)>,
    parameters: usize,
}

/// One equation or channel of one experiment, sample by sample.
pub(super) struct InTime {
    /// Places of parameters and their regressors.
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
                for (row, left) in regressors {
                    let left = &left[range.clone()];
                    score[*row] += dot(left, &residual[range.clone()]);
                    for (column, right) in regressors {
                        if row <= column {
                            gram[(*row, *column)] += dot(left, &right[range.clone()]);
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

    /// (B − 1)/B Σ d dᵀ over B blocks, d = (AᵀA − A_bᵀA_b)⁻¹ s_b being the change of the estimate
    /// without block b, and `inverse` = (AᵀA)⁻¹; with the degrees of freedom of that of the first
    /// `wanted` parameters that has least. `None` if a parameter rests on one block alone.
    pub(super) fn covariance(
        &self,
        inverse: &DMatrix<f64>,
        wanted: usize,
    ) -> Option<(DMatrix<f64>, usize)> {
        let blocks = self.blocks.len() as f64;
        let mut sum = DMatrix::zeros(self.parameters, self.parameters);
        for (score, gram) in &self.blocks {
            // (G − G_b)⁻¹ = (I − G⁻¹G_b)⁻¹ G⁻¹.
            let rest = DMatrix::identity(self.parameters, self.parameters) - inverse * gram;
            let change = rest.lu().solve(&(inverse * score))?;
            if change.iter().any(|d| !d.is_finite()) {
                return None;
            }
            sum.ger(1.0, &change, &change, 1.0);
        }
        Some((sum * ((blocks - 1.0) / blocks), self.degrees_of_freedom(inverse, wanted)))
    }

    /// Satterthwaite's degrees of freedom of a variance to which the blocks contribute as unequally as
    /// they carry information, (Σ w)²/Σ w² − 1 with w = \[(AᵀA)⁻¹ A_bᵀA_b (AᵀA)⁻¹\]_kk; of that of the
    /// first `wanted` parameters k that has least. An initial state, which stands behind them, rests on
    /// the first block alone and says nothing of the others.
    fn degrees_of_freedom(&self, inverse: &DMatrix<f64>, wanted: usize) -> usize {
        let mut sums = DVector::<f64>::zeros(self.parameters);
        let mut squares = DVector::<f64>::zeros(self.parameters);
        for (_, gram) in &self.blocks {
            let variances = (inverse * gram * inverse).diagonal();
            squares += variances.component_mul(&variances);
            sums += variances;
        }
        let of = |(sum, square): (&f64, &f64)| sum * sum / square - 1.0;
        let each = sums.iter().zip(squares.iter()).take(wanted).map(of);
        let least = each.fold(f64::INFINITY, f64::min);
        // Never more than blocks, never less than one.
        (least as usize).clamp(1, self.blocks.len().max(2) - 1)
    }
}

/// A weighted column of lines as a signal whose square sum is that of its real and imaginary parts.
pub(super) fn in_time(
    grid: &Grid,
    lines: usize,
    rows: &[usize],
    values: &[Complex<f64>],
) -> Vec<f64> {
    let mut all = vec![Complex::ZERO; lines];
    for (row, value) in rows.iter().zip(values) {
        // The mean carries the factor √2 of its row.
        all[*row] = if *row == 0 { value / std::f64::consts::SQRT_2 } else { *value };
    }
    let mut samples = grid.to_samples(all.into_iter());
    let scale = (2.0 / samples.len() as f64).sqrt();
    samples.iter_mut().for_each(|x| *x *= scale);
    samples
}
