//! Sign of the masses.

use std::fmt::{self, Formatter};

use mechid_estimate::Estimate;
use mechid_model::Matrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::digits::three_digits;
use super::finding::{Check, Finding, Names};
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Finds the most significant negative mass on the diagonal of M ([`Finding::NegativeMass`]);
/// `None` if there is none. The p-value is the probability that noise alone makes any of the
/// estimated masses at least as negative, in standard errors, if the true masses are zero: the
/// one-sided probability of Student's t distribution, times the number of masses.
///
/// A machine may have negative damping or stiffness, but no negative mass: a force or a response of
/// the wrong sign changes the sign of all matrices and leaves the modes unchanged.
///
/// # Source
/// Meirovitch, *Fundamentals of Vibrations* (2001), section 4.4 (the kinetic energy); the test is
/// ours.
pub fn negative_mass(estimate: &Estimate) -> Option<Finding> {
    let (freedom, spread) = (estimate.degrees_of_freedom(), estimate.spread());
    let student = StudentsT::new(0.0, 1.0, freedom.max(1) as f64).ok()?;
    let free = estimate.unknowns().free();
    let diagonal = free
        .iter()
        .enumerate()
        .filter(|(_, p)| p.matrix() == Matrix::Mass && p.row() == p.column());
    let masses: Vec<(usize, f64, f64)> = diagonal
        .map(|(at, p)| {
            (p.row(), estimate.mass()[(p.row(), p.row())], spread.variance_of(at).max(0.0).sqrt())
        })
        .collect();
    let (row, mass, standard_error) = *masses
        .iter()
        .filter(|(_, mass, _)| *mass < 0.0)
        .min_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))?;
    let alone = match -mass / standard_error {
        ratio if freedom == 0 || ratio.is_nan() => 1.0,
        ratio if ratio.is_finite() => student.sf(ratio),
        _ => 0.0,
    };
    let p_value = PValue::new((alone * masses.len() as f64).min(1.0));
    Some(Finding::NegativeMass(NegativeMass { row, mass, standard_error, p_value }))
}

/// Negative mass.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct NegativeMass {
    /// Degree of freedom.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub row: usize,
    /// Entry of the diagonal of M, in kg.
    pub mass: f64,
    /// Standard error of the mass, in kg.
    pub standard_error: f64,
    /// Probability that noise alone makes any of the estimated masses at least as negative as this
    /// one, in standard errors, if the true masses are zero.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
}

impl Check for NegativeMass {
    fn subject(&self) -> Subject {
        Subject::Mass
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
        let Self { row, mass, standard_error, p_value } = self;
        let (i, errors) = (row + 1, three_digits(mass.abs() / standard_error));
        let mass = three_digits(*mass);
        if self.verdict() == Verdict::Good {
            return write!(
                f,
                "m{i}{i} is {mass} kg, negative but within the noise: {errors} standard errors \
                 below zero ({p_value})"
            );
        }
        write!(
            f,
            "m{i}{i} is {mass} kg, {errors} standard errors below zero ({p_value}): no machine has a \
             negative mass. Possible causes: a force or a response of the wrong sign, channels in the \
             wrong order, a wrong quantity (acceleration read as displacement)"
        )
    }
}
