//! Test whether the parts of the data agree about the parameters.

use mechid_model::Parameter;
use mechid_numerics::linear_algebra::hermitian_eigen;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::split::Cuts;
use super::{Part, PartsOfFit, Split};
use crate::frequency_domain::pulse_covariance::scatter;
use crate::frequency_responses::covariance_of_errors;
use crate::limits::PART_INFORMS;

/// Result of the test that the parts of the data agree about the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct PartsComparison {
    /// Number of parts.
    pub parts: usize,
    /// Mean square of the differences of the parts in units of their noise; 1 if they differ by
    /// noise alone.
    pub ratio: f64,
    /// Number of independent differences.
    pub degrees_of_freedom: usize,
    /// Probability that noise alone makes the parts differ as much.
    pub p_value: f64,
    /// Ratio of standard errors from the scatter of the parts to those from the noise: the larger
    /// of the ratio for the parameter with the largest disagreement and the ratio for all together.
    pub error_scale: f64,
    /// The largest difference of a part from the others in units of its standard error.
    pub largest: Option<Difference>,
}

/// Difference of a part of the data from the others about one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// The part.
    pub part: Part,
    /// The parameter.
    pub parameter: Parameter,
    /// Value from the part, in the unit of the parameter.
    pub by_part: f64,
    /// Value from the others, in the unit of the parameter.
    pub by_others: f64,
    /// Standard error of the difference, in the unit of the parameter.
    pub standard_error: f64,
}

/// Scores of the parts and their covariance in units of the noise.
struct Scores {
    /// Qᵀ D_p e, one below the other.
    scores: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Number of parameters.
    count: usize,
}

impl Scores {
    /// Returns the scores of a part.
    fn part_scores(&self, part: usize) -> DVector<f64> {
        self.scores.rows(part * self.count, self.count).into_owned()
    }

    /// Returns the covariance of the scores of a part.
    fn covariance_of(&self, part: usize) -> DMatrix<f64> {
        let at = part * self.count;
        self.covariance.view((at, at), (self.count, self.count)).into_owned()
    }
}

impl PartsOfFit<'_> {
    /// Compares the parameters that the parts of a split determine; `None` with fewer than two
    /// parts or too few residuals for an estimate of the noise.
    ///
    /// With scores s and their covariance V of rank d, sᵀV⁺s/d follows Fisher's F distribution with
    /// d degrees of freedom and the degrees of freedom of the noise level.
    ///
    /// # Source
    /// Chow (1960), Econometrica 28, 591–605, as a score test; Birge (1932), Physical Review 40,
    /// 207–227, for the factor; Liang & Zeger (1986), Biometrika 73, 13–22, for that of one
    /// parameter (scatter of the scores of parts).
    pub fn compare(&self, split: &Split) -> Option<PartsComparison> {
        let cuts = Cuts::new(self, split)?;
        let scores = self.scores(&cuts);
        let (squares, rank) = whitened_square(&scores.covariance, &scores.scores)?;
        let degrees = rank as f64;
        let (level, of_level) = match self.known {
            Some(known) => (self.inflation, known),
            None => {
                let free = self.linear.free() - degrees;
                let level = (self.linear.cost() - squares) / free;
                (level * self.inflation, free)
            }
        };
        if rank == 0 || of_level < 1.0 || level.is_nan() || level <= 0.0 {
            return None;
        }
        let ratio = squares / (degrees * level);
        let law = FisherSnedecor::new(degrees, of_level).ok()?;
        let of_one = self.largest_scatter(&scores, level).unwrap_or(0.0);
        Some(PartsComparison {
            parts: cuts.parts().count(),
            ratio,
            degrees_of_freedom: rank,
            p_value: law.sf(ratio),
            error_scale: ratio.sqrt().max(of_one),
            largest: self.largest_difference(&cuts, &scores, level),
        })
    }

    fn scores(&self, cuts: &Cuts) -> Scores {
        let count = self.linear.basis.ncols();
        let parts = cuts.columns(self.data, &self.linear.basis);
        let parts: Vec<DMatrix<f64>> =
            parts.into_iter().map(|part| self.linear.unexplained(part)).collect();
        let mut columns = DMatrix::zeros(self.linear.residual.len(), count * parts.len());
        for (at, part) in parts.iter().enumerate() {
            columns.columns_mut(at * count, count).copy_from(part);
        }
        let mut covariance = match self.responses {
            Some(records) => covariance_of_errors(records, self.data.dof(), &columns).0,
            None => columns.tr_mul(&columns),
        };
        if let Some(responses) = &self.linear.responses {
            covariance += scatter(self.data, responses, &columns);
        }
        Scores { scores: columns.tr_mul(&self.linear.residual), covariance, count }
    }

    /// Returns the largest ratio of a standard error from the scatter of the scores to its value from the
    /// noise.
    fn largest_scatter(&self, scores: &Scores, level: f64) -> Option<f64> {
        let parts = scores.scores.len() / scores.count;
        let of_row = |row: usize| {
            let root = self.linear.root.row(row).transpose();
            let square = |part: usize| root.dot(&scores.part_scores(part)).powi(2);
            let expected = |part: usize| root.dot(&(scores.covariance_of(part) * &root));
            let (squares, expected) = (
                (0..parts).map(square).sum::<f64>(),
                (0..parts).map(expected).sum::<f64>() * level,
            );
            (expected > 0.0).then(|| (squares / expected).sqrt())
        };
        (0..self.linear.root.nrows()).filter_map(of_row).max_by(f64::total_cmp)
    }

    /// Returns the difference of one part from the others that is largest in units of its standard
    /// error.
    fn largest_difference(&self, cuts: &Cuts, scores: &Scores, level: f64) -> Option<Difference> {
        let parts = cuts.columns(self.data, &self.linear.basis);
        let of_part = |(at, part): (usize, Part)| {
            let (inverse, _) = pseudo_inverse(&scores.covariance_of(at))?;
            let difference = &inverse * scores.part_scores(at);
            let of_others = -self.linear.basis.tr_mul(&(&parts[at] * &difference));
            let one = |row: usize| {
                let root = self.linear.root.row(row).transpose();
                let variance = level * root.dot(&(&inverse * &root));
                let by_others = self.values[row] + root.dot(&of_others);
                Difference {
                    part,
                    parameter: self.parameters[row],
                    by_part: by_others + root.dot(&difference),
                    by_others,
                    standard_error: variance.max(0.0).sqrt(),
                }
            };
            let differences = (0..self.linear.root.nrows()).map(one);
            differences.max_by(|a, b| a.in_errors().total_cmp(&b.in_errors()))
        };
        let differences = cuts.parts().enumerate().filter_map(of_part);
        differences.max_by(|a, b| a.in_errors().total_cmp(&b.in_errors()))
    }
}

impl Difference {
    /// Returns the difference in units of its standard error.
    pub fn in_errors(&self) -> f64 {
        let errors = (self.by_part - self.by_others).abs() / self.standard_error;
        if errors.is_finite() { errors } else { 0.0 }
    }
}

/// Returns the pseudo-inverse of a covariance, and its rank.
fn pseudo_inverse(covariance: &DMatrix<f64>) -> Option<(DMatrix<f64>, usize)> {
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
