//! Test that the parts of the data agree about the parameters.

use mechid_numerics::linear_algebra::hermitian_eigen;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::split::Cuts;
use super::{Part, PartsOfFit, Split};
use crate::frequency_responses::covariance_of_errors;
use crate::limits::PART_INFORMS;

/// Result of the test that the parts of the data agree about the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct PartsComparison {
    /// Number of parts.
    pub parts: usize,
    /// Mean square of the differences between the parts, in units of their noise; 1 if the parts
    /// differ by noise alone.
    pub ratio: f64,
    /// Number of independent differences.
    pub degrees_of_freedom: usize,
    /// Probability that noise alone makes the parts differ by at least as much.
    pub p_value: f64,
    /// Ratio of standard errors from the scatter of the parts to those from the noise. It is the
    /// larger of two values: the largest ratio of a single parameter, and the ratio of all
    /// parameters together.
    pub error_scale: f64,
    /// Largest difference of a part from the other parts, compared in units of the standard error
    /// of the difference.
    pub largest: Option<Difference>,
}

/// Difference between a part of the data and the other parts in one parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The part.
    pub part: Part,
    /// Name of the parameter.
    pub parameter: String,
    /// Value of the parameter from this part of the data, in the unit of the parameter.
    pub by_part: f64,
    /// Value of the parameter from the other parts of the data, in the unit of the parameter.
    pub by_others: f64,
    /// Standard error of the difference, in the unit of the parameter.
    pub standard_error: f64,
}

/// Scores of the parts of a linearised fit, and their covariance in units of the noise.
pub(crate) struct Scores<'a> {
    /// Change of every parameter per unit change of the coefficient of each column of Q, parameters
    /// × columns.
    pub(crate) root: &'a DMatrix<f64>,
    /// Values of the parameters, each in its unit.
    pub(crate) values: &'a DVector<f64>,
    /// Change of the coefficients of Q if the residual changes by D_p Q, one matrix for each part
    /// p; D_p selects the rows of the part.
    pub(crate) effects: Vec<DMatrix<f64>>,
    /// Scores Qᵀ D_p e of the parts, one below the other, with the residual e.
    pub(crate) scores: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
}

/// Variance of the residual in units of the noise.
pub(crate) enum Level {
    /// Noise that is stated: the residual has the variance `inflation`, which is the effect of
    /// weights estimated from the data. `degrees_of_freedom` are those of the noise level.
    Known { inflation: f64, degrees_of_freedom: f64 },
    /// Variance of the residual, `inflation · cost / free`, with the sum of squares `cost` and the
    /// degrees of freedom `free`; `inflation` is the effect of weights estimated from the data.
    Residual { inflation: f64, cost: f64, free: f64 },
}

impl Level {
    /// Returns the variance and its degrees of freedom. If the variance comes from the residual,
    /// the sum `squares` that a statistic of this `rank` explains is subtracted first. `None` if no
    /// residual remains.
    fn without(&self, squares: f64, rank: usize) -> Option<(f64, f64)> {
        let (level, of_level) = match *self {
            Self::Known { inflation, degrees_of_freedom } => (inflation, degrees_of_freedom),
            Self::Residual { inflation, cost, free } => {
                let free = free - rank as f64;
                (inflation * (cost - squares) / free, free)
            }
        };
        (rank > 0 && of_level >= 1.0 && level > 0.0).then_some((level, of_level))
    }
}

/// Difference between one part and the other parts in one parameter, in the unit of the parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PartDifference {
    part: usize,
    parameter: usize,
    by_part: f64,
    by_others: f64,
    standard_error: f64,
}

impl Scores<'_> {
    /// Returns the scores of a part.
    fn scores_of(&self, part: usize) -> DVector<f64> {
        self.scores.rows(part * self.root.ncols(), self.root.ncols()).into_owned()
    }

    /// Returns the covariance of the scores of a part.
    fn covariance_of(&self, part: usize) -> DMatrix<f64> {
        let count = self.root.ncols();
        self.covariance.view((part * count, part * count), (count, count)).into_owned()
    }

    /// Compares the scores of some `parts` with their covariance; `parameters` are the names of the
    /// parameters. `None` if there are too few residuals for an estimate of the noise.
    pub(crate) fn compare(
        &self,
        level: &Level,
        parts: &[Part],
        parameters: &[String],
    ) -> Option<PartsComparison> {
        let (squares, rank) = whitened_square(&self.covariance, &self.scores)?;
        let degrees = rank as f64;
        let (level, of_level) = level.without(squares, rank)?;
        let ratio = squares / (degrees * level);
        let law = FisherSnedecor::new(degrees, of_level).ok()?;
        let of_one = self.largest_scatter(level).unwrap_or(0.0);
        let largest = self.largest_difference(level).map(|largest| Difference {
            part: parts[largest.part],
            parameter: parameters[largest.parameter].clone(),
            by_part: largest.by_part,
            by_others: largest.by_others,
            standard_error: largest.standard_error,
        });
        Some(PartsComparison {
            parts: parts.len(),
            ratio,
            degrees_of_freedom: rank,
            p_value: law.sf(ratio),
            error_scale: ratio.sqrt().max(of_one),
            largest,
        })
    }

    /// Returns the largest ratio, over all parameters, of the standard error from the scatter of
    /// the scores to the standard error from the noise.
    fn largest_scatter(&self, level: f64) -> Option<f64> {
        let of_row = |row: usize| {
            let root = self.root.row(row).transpose();
            let square = |part: usize| root.dot(&self.scores_of(part)).powi(2);
            let expected = |part: usize| root.dot(&(self.covariance_of(part) * &root));
            let parts = self.effects.len();
            let (squares, expected) = (
                (0..parts).map(square).sum::<f64>(),
                (0..parts).map(expected).sum::<f64>() * level,
            );
            (expected > 0.0).then(|| (squares / expected).sqrt())
        };
        (0..self.root.nrows()).filter_map(of_row).max_by(f64::total_cmp)
    }

    /// Returns the largest difference of one part from the other parts, compared in units of the
    /// standard error of the difference.
    fn largest_difference(&self, level: f64) -> Option<PartDifference> {
        let of_part = |part: usize| {
            let (inverse, _) = pseudo_inverse(&self.covariance_of(part))?;
            let difference = &inverse * self.scores_of(part);
            let of_others = -(&self.effects[part] * &difference);
            let one = |row: usize| {
                let root = self.root.row(row).transpose();
                let variance = level * root.dot(&(&inverse * &root));
                let by_others = self.values[row] + root.dot(&of_others);
                PartDifference {
                    part,
                    parameter: row,
                    by_part: by_others + root.dot(&difference),
                    by_others,
                    standard_error: variance.max(0.0).sqrt(),
                }
            };
            let of_parameters = (0..self.root.nrows()).map(one);
            of_parameters.max_by(|a, b| a.in_errors().total_cmp(&b.in_errors()))
        };
        let of_parts = (0..self.effects.len()).filter_map(of_part);
        of_parts.max_by(|a, b| a.in_errors().total_cmp(&b.in_errors()))
    }
}

impl PartDifference {
    /// Returns the difference in units of its standard error.
    fn in_errors(&self) -> f64 {
        let errors = (self.by_part - self.by_others).abs() / self.standard_error;
        if errors.is_finite() { errors } else { 0.0 }
    }
}

impl PartsOfFit<'_> {
    /// Compares the parameters that the parts of a split determine; `None` if there are fewer than
    /// two parts, or too few residuals for an estimate of the noise.
    ///
    /// For scores s with a covariance V of rank d, sᵀV⁺s/d divided by the noise level follows
    /// Fisher's distribution. Its degrees of freedom are d and those of the noise level.
    ///
    /// # Source
    /// Chow (1960), Econometrica 28, 591–605, as a score test; Birge (1932), Physical Review 40,
    /// 207–227, for the factor; Liang & Zeger (1986), Biometrika 73, 13–22, for the factor of one
    /// parameter (scatter of the scores of parts).
    pub fn compare(&self, split: &Split) -> Option<PartsComparison> {
        let cuts = Cuts::new(self, split)?;
        let parts: Vec<Part> = cuts.parts().collect();
        let parameters: Vec<String> = self.parameters.iter().map(ToString::to_string).collect();
        self.scores(&cuts).compare(&self.noise_level(), &parts, &parameters)
    }

    /// Returns the source of the variance of the residual: the stated noise or the residual.
    fn noise_level(&self) -> Level {
        match self.known {
            Some(known) => Level::Known { inflation: self.inflation, degrees_of_freedom: known },
            None => {
                let (cost, free) = (self.linear.cost(), self.linear.free());
                Level::Residual { inflation: self.inflation, cost, free }
            }
        }
    }

    /// Returns the variance of the residual and its degrees of freedom, as [`Level::without`].
    pub(super) fn level(&self, squares: f64, rank: usize) -> Option<(f64, f64)> {
        self.noise_level().without(squares, rank)
    }

    fn scores(&self, cuts: &Cuts) -> Scores<'_> {
        let count = self.linear.basis.ncols();
        let parts = cuts.columns(self.data, &self.linear.basis);
        let mut columns = DMatrix::zeros(self.linear.residual.len(), count * parts.len());
        for (at, part) in parts.iter().enumerate() {
            let unexplained = self.linear.unexplained(part.clone());
            columns.columns_mut(at * count, count).copy_from(&unexplained);
        }
        let covariance = match self.responses {
            Some(records) => covariance_of_errors(records, self.data.dof(), &columns).0,
            None => self.linear.covariance_of_products(&columns),
        };
        Scores {
            root: &self.linear.root,
            values: &self.values,
            effects: parts.iter().map(|part| self.linear.effect_of(part)).collect(),
            scores: columns.tr_mul(&self.linear.residual),
            covariance,
        }
    }
}

/// Returns the pseudo-inverse of a covariance, and its rank.
pub(super) fn pseudo_inverse(covariance: &DMatrix<f64>) -> Option<(DMatrix<f64>, usize)> {
    let eigen = hermitian_eigen(covariance.clone()).ok()?;
    let least = PART_INFORMS * eigen.eigenvalues.max();
    let inverse = eigen.eigenvalues.map(|l| if l > least { l.recip() } else { 0.0 });
    let rank = inverse.iter().filter(|l| **l > 0.0).count();
    let vectors = &eigen.eigenvectors;
    Some((vectors * DMatrix::from_diagonal(&inverse) * vectors.transpose(), rank))
}

/// Returns sᵀV⁺s and the rank of V.
fn whitened_square(covariance: &DMatrix<f64>, scores: &DVector<f64>) -> Option<(f64, usize)> {
    let (inverse, rank) = pseudo_inverse(covariance)?;
    Some((scores.dot(&(inverse * scores)), rank))
}
