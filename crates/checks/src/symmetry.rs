//! Symmetry of the mass matrix.

use std::fmt::{self, Formatter};

use mechid_estimate::Estimate;
use mechid_model::Matrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::limits::ASYMMETRY;
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Tests the symmetry of the estimated mass matrix; `None` if no two entries can differ.
///
/// The kinetic energy ½ ẋᵀMẋ has a symmetric M, also with bearings, gyroscopic forces and controls,
/// which make C and K non-symmetric. An M that is not symmetric shows that forces and displacements
/// do not belong to the same points and directions.
///
/// The p-value is the probability that noise alone makes any pair m_ij, m_ji of a symmetric M
/// differ by at least as many standard errors as the most significant pair: the two-sided
/// probability of Student's t distribution, times the number of pairs.
///
/// # Source
/// Meirovitch, *Fundamentals of Vibrations* (2001), section 4.4 (the kinetic energy); the test is
/// ours.
pub fn mass_symmetry(estimate: &Estimate) -> Option<Finding> {
    let (n, unknowns) = (estimate.dof(), estimate.unknowns());
    let freedom = estimate.degrees_of_freedom();
    if unknowns.is_symmetric(Matrix::Mass) || freedom == 0 {
        return None;
    }
    let mut indices = vec![None; n * n];
    for (at, p) in unknowns.free().iter().enumerate().filter(|(_, p)| p.matrix() == Matrix::Mass) {
        indices[p.row() * n + p.column()] = Some(at);
    }
    let (mass, spread) = (estimate.mass(), estimate.spread());
    let student = StudentsT::new(0.0, 1.0, freedom as f64).expect("positive degrees of freedom");
    let mut pairs = 0;
    let mut worst: Option<(f64, Finding)> = None;
    for (i, j) in (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))) {
        let free = [indices[i * n + j], indices[j * n + i]];
        let variance = match free {
            [None, None] => continue,
            [Some(one), None] | [None, Some(one)] => spread.variance_of(one),
            [Some(p), Some(q)] => {
                spread.variance_of(p) + spread.variance_of(q) - 2.0 * spread.between(p, q)
            }
        };
        let difference = mass[(i, j)] - mass[(j, i)];
        let standard_error = variance.max(0.0).sqrt();
        if !(difference.is_finite() && standard_error.is_finite()) {
            continue;
        }
        pairs += 1;
        let scale = (mass[(i, i)] * mass[(j, j)]).abs().sqrt();
        let alone = match difference.abs() / standard_error {
            _ if difference.abs() <= ASYMMETRY * scale => 1.0,
            ratio if ratio.is_finite() => 2.0 * student.sf(ratio),
            _ => 0.0,
        };
        if worst.as_ref().is_none_or(|(least, _)| alone < *least) {
            let finding = Finding::MassSymmetry(MassSymmetry {
                row: i,
                column: j,
                above: mass[(i, j)],
                below: mass[(j, i)],
                standard_error,
                p_value: PValue::new(alone),
            });
            worst = Some((alone, finding));
        }
    }
    let (alone, mut finding) = worst?;
    if let Some(p_value) = finding.p_value_mut() {
        *p_value = PValue::new((alone * f64::from(pairs)).min(1.0));
    }
    Some(finding)
}

/// Difference of two mirrored entries of M; the mass matrix of a kinetic energy is symmetric.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct MassSymmetry {
    /// Degree of freedom: row of the entry `above` and column of the entry `below`.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub row: usize,
    /// Degree of freedom: column of the entry `above` and row of the entry `below`.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub column: usize,
    /// Entry (`row`, `column`) of M, in kg.
    pub above: f64,
    /// Entry (`column`, `row`) of M, in kg.
    pub below: f64,
    /// Standard error of `above` − `below`, in kg.
    pub standard_error: f64,
    /// Probability that noise alone makes any two mirrored entries differ at least as much as these
    /// two.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
}

impl Check for MassSymmetry {
    fn subject(&self) -> Subject {
        Subject::Symmetry
    }

    fn verdict(&self) -> Verdict {
        self.p_value.verdict()
    }

    fn value(&self) -> f64 {
        self.p_value.adjusted
    }

    fn p_value_mut(&mut self) -> Option<&mut PValue> {
        Some(&mut self.p_value)
    }

    fn sentence(&self, _: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { row, column, above, below, standard_error, p_value } = self;
        let (i, j) = (row + 1, column + 1);
        let errors = three_digits((above - below).abs() / standard_error);
        let [above, below] = [*above, *below].map(three_digits);
        if self.verdict() == Verdict::Good {
            return write!(
                f,
                "M is symmetric within the noise: m{i}{j} and m{j}{i} differ by {errors} \
                 standard errors ({p_value})"
            );
        }
        write!(
            f,
            "M is not symmetric, but the kinetic energy of a machine requires symmetry: m{i}{j} is {above} kg and \
             m{j}{i} {below} kg, {errors} standard errors apart ({p_value}). Possible causes: crosstalk between \
             forces or between responses, a wrong gain, a sensor that is not at the point or not in the direction \
             of its force"
        )
    }
}
