//! Gain between two degrees of freedom that damping and stiffness show.

use std::fmt::{self, Formatter};

use mechid_estimate::Estimate;
use mechid_model::Matrix;
use mechid_model::Parameter;

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::limits::{GAIN_AGREES, GAIN_NEAR, GAIN_SHOWS};
use super::{Subject, Verdict};

/// Damping and stiffness that are symmetric but for one factor between two degrees of freedom, as gains make them.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Gain {
    /// Degree of freedom whose responses (or forces) are so much larger.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub row: usize,
    /// The other degree of freedom.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub column: usize,
    /// The factor (pure number).
    pub ratio: f64,
    /// Standard error of its logarithm (pure number).
    pub standard_error: f64,
}

/// Tells of a pair of degrees of freedom between which damping and stiffness are symmetric but for one factor, the same
/// in both; `None` where there is none. Of several it is the one that is known best.
///
/// A response or a force that is read g times too large multiplies a column or a row of C and K alike, and makes
/// c_ij/c_ji = k_ij/k_ji = g of symmetric matrices, while a diagonal M stays symmetric. Bearings and gyroscopic forces,
/// which make C and K not symmetric, have another ratio in each. The factor has to show in both by itself.
///
/// # Source
/// Ours: each ratio has its error by the delta method.
pub fn gain_symmetry(estimate: &Estimate) -> Option<Finding> {
    let n = estimate.dof();
    let free = estimate.unknowns().free();
    let place = |matrix: Matrix, row: usize, column: usize| {
        let is_it = |p: &Parameter| (p.matrix(), p.row(), p.column()) == (matrix, row, column);
        free.iter().position(is_it)
    };
    let spread = estimate.spread();
    // Logarithm of the ratio of two entries, and its variance.
    let ratio = |matrix: Matrix, i: usize, j: usize| -> Option<[f64; 2]> {
        let all = match matrix {
            Matrix::Mass => estimate.mass(),
            Matrix::Damping => estimate.damping(),
            Matrix::Stiffness => estimate.stiffness(),
        };
        let (above, below) = (all[(i, j)], all[(j, i)]);
        let (p, q) = (place(matrix, i, j)?, place(matrix, j, i)?);
        let variance = spread.variance_of(p) / above.powi(2)
            + spread.variance_of(q) / below.powi(2)
            - 2.0 * spread.between(p, q) / (above * below);
        let log = (above / below).ln();
        (log.is_finite() && variance > 0.0 && log * log > GAIN_SHOWS.powi(2) * variance)
            .then_some([log, variance])
    };
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    let found = pairs.filter_map(|(i, j)| {
        let [of_c, variance_c] = ratio(Matrix::Damping, i, j)?;
        let [of_k, variance_k] = ratio(Matrix::Stiffness, i, j)?;
        let apart = (of_c - of_k).powi(2);
        let noise = GAIN_AGREES.powi(2) * (variance_c + variance_k);
        let weight = [variance_c.recip(), variance_k.recip()];
        let log = (weight[0] * of_c + weight[1] * of_k) / (weight[0] + weight[1]);
        let standard_error = (weight[0] + weight[1]).sqrt().recip();
        (apart < noise.max((GAIN_NEAR * of_k).powi(2))).then_some((i, j, log, standard_error))
    });
    let (i, j, log, standard_error) = found.max_by(|a, b| {
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
            "C and K are symmetric but for one factor: c{i}{j} over c{j}{i} and k{i}{j} over k{j}{i} are both \
             {ratio}, as where response {i} or force {i} is read {ratio} times too large beside number {j}: \
             look at their units and gains"
        )
    }
}
