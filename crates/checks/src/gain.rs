//! Wrong gain between two degrees of freedom, detected in damping and stiffness.

use std::fmt::{self, Formatter};

use mechid_estimate::Estimate;
use mechid_model::Matrix;
use mechid_model::Parameter;

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::limits::{GAIN_AGREES, GAIN_NEAR, GAIN_SIGNIFICANT};
use super::{Subject, Verdict};

/// Damping and stiffness that are symmetric except for one factor between two degrees of freedom; a
/// wrong gain has this effect.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Gain {
    /// Degree of freedom whose responses (or forces) are too large by the factor.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub row: usize,
    /// The other degree of freedom, whose responses and forces are the reference.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub column: usize,
    /// Factor (pure number).
    pub ratio: f64,
    /// Standard error of the logarithm of the factor (pure number).
    pub standard_error: f64,
}

/// Finds a pair of degrees of freedom between which damping and stiffness are symmetric except for
/// the same factor; `None` if there is no such pair. If there are several pairs, the most
/// significant one is returned.
///
/// A response or a force that is measured g times too large multiplies a column or a row of both C
/// and K: symmetric matrices then have c_ij/c_ji = k_ij/k_ji = g, while a diagonal M stays
/// symmetric. Bearings and gyroscopic forces also make C and K non-symmetric, but with different
/// ratios. The factor must be significant in each of the two matrices.
///
/// # Source
/// Ours: each ratio has its error by the delta method.
pub fn gain_symmetry(estimate: &Estimate) -> Option<Finding> {
    let n = estimate.dof();
    let free = estimate.unknowns().free();
    let index = |matrix: Matrix, row: usize, column: usize| {
        let is_it = |p: &Parameter| (p.matrix(), p.row(), p.column()) == (matrix, row, column);
        free.iter().position(is_it)
    };
    let spread = estimate.spread();
    // Logarithm of the ratio of two entries, and its variance.
    let ratio = |matrix: Matrix, i: usize, j: usize| -> Option<[f64; 2]> {
        let entries = match matrix {
            Matrix::Mass => estimate.mass(),
            Matrix::Damping => estimate.damping(),
            Matrix::Stiffness => estimate.stiffness(),
        };
        let (above, below) = (entries[(i, j)], entries[(j, i)]);
        let (p, q) = (index(matrix, i, j)?, index(matrix, j, i)?);
        let variance = spread.variance_of(p) / above.powi(2)
            + spread.variance_of(q) / below.powi(2)
            - 2.0 * spread.between(p, q) / (above * below);
        let log = (above / below).ln();
        (log.is_finite() && variance > 0.0 && log * log > GAIN_SIGNIFICANT.powi(2) * variance)
            .then_some([log, variance])
    };
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    let gains = pairs.filter_map(|(i, j)| {
        let [log_c, variance_c] = ratio(Matrix::Damping, i, j)?;
        let [log_k, variance_k] = ratio(Matrix::Stiffness, i, j)?;
        let difference = (log_c - log_k).powi(2);
        let noise = GAIN_AGREES.powi(2) * (variance_c + variance_k);
        let weight = [variance_c.recip(), variance_k.recip()];
        let log = (weight[0] * log_c + weight[1] * log_k) / (weight[0] + weight[1]);
        let standard_error = (weight[0] + weight[1]).sqrt().recip();
        (difference < noise.max((GAIN_NEAR * log_k).powi(2))).then_some((i, j, log, standard_error))
    });
    let (i, j, log, standard_error) = gains.max_by(|a, b| {
        let shows = |(.., log, error): &(usize, usize, f64, f64)| (log / error).abs();
        shows(a).total_cmp(&shows(b))
    })?;
    let (row, column, log) = if log >= 0.0 { (i, j, log) } else { (j, i, -log) };
    Some(Finding::Gain(Gain { row, column, ratio: log.exp(), standard_error }))
}

impl Check for Gain {
    fn subject(&self) -> Subject {
        Subject::Symmetry
    }

    fn verdict(&self) -> Verdict {
        Verdict::Doubtful
    }

    fn value(&self) -> f64 {
        self.ratio
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let (i, j, ratio) = (self.row + 1, self.column + 1, three_digits(self.ratio));
        write!(
            f,
            "C and K are symmetric except for one factor: c{i}{j} over c{j}{i} and k{i}{j} over k{j}{i} are both \
             {ratio}, as if response {i} or force {i} were measured {ratio} times too large compared \
             with response {j} or force {j}: check their units and gains"
        )
    }
}
