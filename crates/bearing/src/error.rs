//! Errors of bearings: impossible parameters, and equations without a solution.

use mechid_signal::message;

/// A bearing that cannot be described or solved; every variant carries the offending numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BearingError {
    /// A parameter is out of range.
    #[error("the {name} must be {requirement}, got {value}", value = message::number(*value))]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Range expected.
        requirement: &'static str,
        /// Value given, in the unit of the quantity.
        value: f64,
    },
    /// The journal touches the bore, without a film between them.
    #[error(
        "the journal touches the bore: its eccentricity is {eccentricity} times the clearance and must be below 1",
        eccentricity = message::number(*eccentricity)
    )]
    Contact {
        /// Eccentricity over the clearance, a ratio of at least 1.
        eccentricity: f64,
    },
    /// The equations of the film cannot be solved at this position of the journal.
    #[error(
        "the equations of the film have no solution (singular matrix) with the journal at ({}, {}) times the \
         clearance, along and across the load",
        message::number(position[0]),
        message::number(position[1])
    )]
    SingularFilm {
        /// Position of the journal along and across the load, divided by the clearance (a ratio
        /// each).
        position: [f64; 2],
    },
    /// The positions of the ends of the film did not converge within the maximum number of
    /// iterations.
    #[error(
        "the ends of the film did not converge in {iterations} iterations \
         (last change {change:.1e} rad) with the journal at ({}, {}) times the clearance, \
         along and across the load; a finer mesh may help",
        message::number(position[0]),
        message::number(position[1])
    )]
    FilmNotConverged {
        /// Iterations made.
        iterations: usize,
        /// Change of the position of an end of the film in the last iteration, in rad.
        change: f64,
        /// Position of the journal along and across the load, divided by the clearance (a ratio
        /// each).
        position: [f64; 2],
    },
    /// No equilibrium was found within the maximum number of iterations.
    #[error(
        "no equilibrium was found for the Sommerfeld number {sommerfeld} in {iterations} \
         iterations (last step {step:.1e} times the clearance); a finer mesh may help",
        sommerfeld = message::number(*sommerfeld)
    )]
    EquilibriumNotConverged {
        /// Sommerfeld number of the requested equilibrium, dimensionless.
        sommerfeld: f64,
        /// Iterations made.
        iterations: usize,
        /// Length of the last step of the journal over the clearance, a ratio.
        step: f64,
    },
    /// The covariance of the coefficients is not 8 × 8.
    #[error("the covariance of eight coefficients is {rows}×{columns}, expected 8×8")]
    CovarianceShape {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// The covariance of the coefficients has an entry that is not finite or a negative variance.
    #[error(
        "entry ({row}, {column}) of the covariance of the coefficients is {value}: \
         expected finite entries and variances of at least 0",
        value = message::number(*value)
    )]
    CovarianceEntry {
        /// Row, counted from 1.
        row: usize,
        /// Column, counted from 1.
        column: usize,
        /// Value found, in the squared unit of the coefficients.
        value: f64,
    },
}

/// Returns `value` if it is finite and satisfies `holds`, otherwise an error with its name.
pub(crate) fn require(
    name: &'static str,
    value: f64,
    requirement: &'static str,
    holds: bool,
) -> Result<(), BearingError> {
    if holds && value.is_finite() {
        Ok(())
    } else {
        Err(BearingError::Parameter { name, requirement, value })
    }
}
