//! The decay that an exponential window adds to frequency responses, and its removal.

use std::f64::consts::TAU;

use mechid_estimate::Unknowns;
use mechid_io::FrequencyResponses;
use mechid_model::{Matrix, Parameter, ResponseQuantity};
use nalgebra::Complex;

use crate::AnalysisError;

/// Returns the decay rate that the exponential windows of all tables add, in 1/s; `None` without a
/// window.
///
/// # Errors
/// [`AnalysisError::Setting`] if the decays of the tables differ.
pub(crate) fn common_rate(tables: &[FrequencyResponses]) -> Result<Option<f64>, AnalysisError> {
    let Some(first) = tables.first() else { return Ok(None) };
    match tables.iter().find(|table| table.added_decay != first.added_decay) {
        None => Ok(first.added_decay),
        Some(other) => {
            let why = format!(
                "the windows of {} and {} add different decay rates: identify from each table separately",
                first.file, other.file
            );
            Err(AnalysisError::Setting { setting: "exponential_percent", why })
        }
    }
}

/// Returns a table whose velocities and accelerations are iω and (iω)² times the displacement, as
/// the estimators assume. With an exponential window, the measured velocities and accelerations are
/// iω + σ and (iω + σ)² times the displacement.
pub(crate) fn as_derivatives(
    table: &FrequencyResponses,
    quantity: ResponseQuantity,
    rate: f64,
) -> FrequencyResponses {
    let mut table = table.clone();
    for (at, hz) in table.frequency_hz.iter().enumerate() {
        let ratio = Complex::new(0.0, TAU * hz) / Complex::new(rate, TAU * hz);
        let factor = match quantity {
            ResponseQuantity::Displacement => return table,
            ResponseQuantity::Velocity => ratio,
            ResponseQuantity::Acceleration => ratio * ratio,
        };
        for function in &mut table.functions {
            function.values[at] *= factor;
            if let Some(errors) = &mut function.standard_error {
                errors[at] *= factor.norm();
            }
        }
    }
    table
}

/// Returns the known entries of the system that includes the decay σ of the window: M, C + 2σM and
/// K + σC + σ²M.
///
/// # Errors
/// [`AnalysisError::Setting`] if the window mixes a known entry with an unknown entry.
pub(super) fn unknowns(unknowns: &Unknowns, rate: f64) -> Result<Unknowns, AnalysisError> {
    let mut windowed = unknowns.clone();
    for p in Parameter::all(unknowns.dof()).filter(|p| p.matrix() == Matrix::Mass) {
        let (row, column) = (p.row(), p.column());
        let [mass, damping, stiffness] =
            Matrix::ALL.map(|matrix| unknowns.fixed(matrix, row, column));
        let mixed = |known: Matrix, free: Matrix| {
            let name = |matrix| {
                Ok::<_, AnalysisError>(Parameter::new(matrix, row, column, unknowns.dof())?)
            };
            let (known, free) = (name(known)?, name(free)?);
            let why = format!(
                "the exponential window of the table couples the known {known} with the unknown {free}: leave \
                 {known} unknown, or state {free} as well"
            );
            Err(AnalysisError::Setting { setting: "structure", why })
        };
        match (damping, mass) {
            (Some(_), None) => return mixed(Matrix::Damping, Matrix::Mass),
            // The entries of a proportional damping follow from the entries of M and K, and are not
            // fixed here.
            (Some(damping), Some(mass)) if !unknowns.has_proportional_damping() => {
                let value = damping + 2.0 * rate * mass;
                windowed = windowed.fix(Matrix::Damping, row, column, value)?;
            }
            _ => {}
        }
        match (stiffness, damping, mass) {
            (Some(_), None, _) => return mixed(Matrix::Stiffness, Matrix::Damping),
            (Some(_), _, None) => return mixed(Matrix::Stiffness, Matrix::Mass),
            (Some(stiffness), Some(damping), Some(mass)) => {
                let value = stiffness + rate * damping + rate * rate * mass;
                windowed = windowed.fix(Matrix::Stiffness, row, column, value)?;
            }
            _ => {}
        }
    }
    Ok(windowed)
}
