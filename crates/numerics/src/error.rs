//! Errors of numerical methods.

use nalgebra::DMatrixView;
use thiserror::Error;

/// Error of a numerical method; every variant carries the numbers that explain it.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NumericsError {
    /// A block of data has the wrong number of channels, lines or samples.
    #[error("{what}: expected {expected}, got {got}")]
    Size {
        /// Name of the items counted, such as `"channels of the force"`.
        what: &'static str,
        /// Number expected.
        expected: usize,
        /// Number given.
        got: usize,
    },
    /// A value among the data is NaN or infinite.
    #[error("row {row}, column {column} of the {what} is {value}, not a finite number")]
    NotFinite {
        /// Name of the data.
        what: &'static str,
        /// Row, counted from 0.
        row: usize,
        /// Column, counted from 0.
        column: usize,
        /// The value, in the unit of the data.
        value: f64,
    },
    /// The sum of squares of the data overflows.
    #[error("the squares of the data overflow: use units in which the values are below 1e150")]
    Overflow,
    /// The squares of the data underflow.
    #[error(
        "all values of the {what} {} are so small that their squares vanish (their root sum of \
         squares is about {norm:.0e}): use other units",
        column.saturating_add(1)
    )]
    Underflow {
        /// Name of the data.
        what: &'static str,
        /// Column, counted from 0.
        column: usize,
        /// Root sum of squares of the column, in its unit; 0 if all squares underflow.
        norm: f64,
    },
    /// Fewer equations than unknowns are given.
    #[error(
        "{} {} not determine {}: use a longer record or fewer unknowns",
        count(*rows, "equation"),
        if *rows == 1 { "does" } else { "do" },
        count(*unknowns, "unknown")
    )]
    TooFewRows {
        /// Equations (rows) given.
        rows: usize,
        /// Unknowns per right-hand side.
        unknowns: usize,
    },
    /// Every entry of M, C and K is known.
    #[error("every entry of M, C and K is known: at least one must be unknown")]
    NothingUnknown,
    /// A transition matrix from sample to sample has no real logarithm, so it does not belong to a
    /// system in continuous time.
    #[error(
        "the transition matrix from sample to sample has the eigenvalue {eigenvalue:.3e}, which is not \
         positive, so it does not belong to a system in continuous time: either a mode \
         oscillates near or above half the sampling rate (sample faster), or a mode decays within one \
         sample, or noise hides a mode"
    )]
    NoLogarithm {
        /// The eigenvalue of the matrix, a pure number, zero or negative.
        eigenvalue: f64,
    },
    /// The eigenvalues of a matrix could not be computed.
    #[error("the eigenvalues of a {size}×{size} matrix could not be computed")]
    Eigenvalues {
        /// Number of rows of the matrix.
        size: usize,
    },
    /// The eigenvalue or singular value iteration of a matrix did not converge.
    #[error("the eigenvalues or singular values of a {rows}×{columns} matrix did not converge")]
    NotConverged {
        /// Number of rows of the matrix.
        rows: usize,
        /// Number of columns of the matrix.
        columns: usize,
    },
    /// A matrix that must be square is not square.
    #[error("a {rows}×{columns} matrix was given where a square one is needed")]
    NotSquare {
        /// Number of rows of the matrix.
        rows: usize,
        /// Number of columns of the matrix.
        columns: usize,
    },
    /// An entry of a matrix to be decomposed is NaN or infinite.
    #[error(
        "entry ({}, {}) of a matrix to be decomposed is not a finite number",
        row.saturating_add(1), column.saturating_add(1)
    )]
    EntryNotFinite {
        /// Row, counted from 0.
        row: usize,
        /// Column, counted from 0.
        column: usize,
    },
    /// A matrix exponential overflows.
    #[error(
        "the exponential of a matrix of norm {norm:.1e} overflows: the time step is too long for \
         the system"
    )]
    ExponentialOverflow {
        /// Largest column sum of moduli, dimensionless.
        norm: f64,
    },
    /// A confidence level is outside (0, 1).
    #[error("a confidence level must be between 0 and 1, got {level}")]
    Level {
        /// The level that was given, a probability.
        level: f64,
    },
}

/// Returns an error unless `got` is equal to `expected`.
///
/// # Errors
/// [`NumericsError::Size`].
pub fn check_size(what: &'static str, expected: usize, got: usize) -> Result<(), NumericsError> {
    if expected == got { Ok(()) } else { Err(NumericsError::Size { what, expected, got }) }
}

/// Checks that all values of a matrix (rows × columns, any unit) are finite; the error names the
/// first value that is not.
///
/// # Errors
/// [`NumericsError::NotFinite`].
pub fn check_finite(what: &'static str, data: DMatrixView<'_, f64>) -> Result<(), NumericsError> {
    for (column, values) in data.column_iter().enumerate() {
        if let Some(row) = values.iter().position(|v| !v.is_finite()) {
            return Err(NumericsError::NotFinite { what, row, column, value: values[row] });
        }
    }
    Ok(())
}

/// Returns a number with its noun, in the plural unless it is 1.
fn count(number: usize, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}
