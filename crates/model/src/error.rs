//! What can be wrong with a model.

use crate::Matrix;

/// A model that cannot be made or evaluated; every variant carries the offending numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A matrix is not square or not of the size of the mass matrix.
    #[error("the {matrix} matrix is {rows}×{columns}, expected {dof}×{dof}")]
    Shape {
        /// Which matrix.
        matrix: Matrix,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
        /// Degrees of freedom expected.
        dof: usize,
    },
    /// A matrix entry is NaN or infinite.
    #[error("entry ({row}, {column}) of the {matrix} matrix is {value}, not a finite number")]
    NotFinite {
        /// Which matrix.
        matrix: Matrix,
        /// Row, counted from 1.
        row: usize,
        /// Column, counted from 1.
        column: usize,
        /// The value found.
        value: f64,
    },
    /// The mass matrix cannot be inverted.
    #[error("the mass matrix is singular (reciprocal condition about {reciprocal_condition:.1e})")]
    SingularMass {
        /// Smallest over largest singular value.
        reciprocal_condition: f64,
    },
    /// A system needs at least one degree of freedom.
    #[error("a system needs at least one degree of freedom")]
    NoDof,
    /// Displacement, velocity and acceleration do not belong together.
    #[error("displacement has {expected} channels, {quantity} has {got}")]
    Channels {
        /// `"velocity"` or `"acceleration"`.
        quantity: &'static str,
        /// Channels found.
        got: usize,
        /// Channels of the displacement.
        expected: usize,
    },
    /// A signal is not usable.
    #[error(transparent)]
    Signal(#[from] mechid_signal::SignalError),
}
