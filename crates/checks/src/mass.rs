//! Sign of the masses.

use mechid_estimate::Estimate;
use mechid_model::Matrix;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::finding::{Finding, PValue};

/// Tells of a mass on the diagonal of M that is negative ([`Finding::NegativeMass`]), the one that noise explains
/// least; `None` if there is none. The p-value is the probability that one of so many masses of zero is estimated as
/// far below it: one-sided, Student's t times the number of masses.
///
/// No machine has one, whatever it makes of damping and stiffness: a force or a response of the wrong sign turns the sign
/// of all matrices, and leaves the modes as they are.
///
/// # Source
/// Meirovitch, *Fundamentals of Vibrations* (2001), section 4.4 (the kinetic energy); the test is ours.
pub fn negative_mass(estimate: &Estimate) -> Option<Finding> {
    let (freedom, spread) = (estimate.degrees_of_freedom(), estimate.spread());
    let student = StudentsT::new(0.0, 1.0, freedom.max(1) as f64).ok()?;
    let free = estimate.unknowns().free();
    let own = free
        .iter()
        .enumerate()
        .filter(|(_, p)| p.matrix() == Matrix::Mass && p.row() == p.column());
    let masses: Vec<(usize, f64, f64)> = own
        .map(|(at, p)| {
            (p.row(), estimate.mass()[(p.row(), p.row())], spread.of(at).max(0.0).sqrt())
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
    let p_value = PValue::of((alone * masses.len() as f64).min(1.0));
    Some(Finding::NegativeMass { row, mass, standard_error, p_value })
}
