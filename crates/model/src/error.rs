//! Errors of models.

use mechid_signal::message;

use crate::{Matrix, Parameter};

/// Error of a model that cannot be created or evaluated; every variant has the numbers that explain
/// it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A matrix is not square or not of the size of the mass matrix.
    #[error("the {matrix} matrix is {rows}×{columns}, expected {dof}×{dof}")]
    Shape {
        /// Matrix concerned.
        matrix: Matrix,
        /// Number of rows of the matrix.
        rows: usize,
        /// Number of columns of the matrix.
        columns: usize,
        /// Expected number of degrees of freedom.
        dof: usize,
    },
    /// A matrix entry is NaN or infinite.
    #[error(
        "entry ({row}, {column}) of the {matrix} matrix is {value}, not a finite number",
        value = message::number(*value)
    )]
    NotFinite {
        /// Matrix concerned.
        matrix: Matrix,
        /// Row, counted from 1.
        row: usize,
        /// Column, counted from 1.
        column: usize,
        /// The value, in the unit of the matrix.
        value: f64,
    },
    /// A matrix entry was given for a degree of freedom that the system does not have.
    #[error("entry ({row}, {column}) lies outside a {dof}×{dof} matrix")]
    EntryOutside {
        /// Row, counted from 1.
        row: usize,
        /// Column, counted from 1.
        column: usize,
        /// Degrees of freedom.
        dof: usize,
    },
    /// The mass matrix cannot be inverted.
    #[error("the mass matrix is singular (reciprocal condition about {reciprocal_condition:.1e})")]
    SingularMass {
        /// Ratio of the smallest to the largest singular value.
        reciprocal_condition: f64,
    },
    /// A system needs at least one degree of freedom.
    #[error("a system needs at least one degree of freedom")]
    NoDof,
    /// Displacement, velocity and acceleration have different sizes or instants.
    #[error("displacement has {}, {quantity} has {got}", message::count(*expected, "channel"))]
    Channels {
        /// `"velocity"` or `"acceleration"`.
        quantity: &'static str,
        /// Number of channels found.
        got: usize,
        /// Number of channels of the displacement.
        expected: usize,
    },
    /// A scalar parameter is out of range.
    #[error("the {name} must be {requirement}, got {value}", value = message::number(*value))]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Requirement that the value does not meet.
        requirement: &'static str,
        /// Value given, in the unit of the quantity.
        value: f64,
    },
    /// The displacement and velocity of a state differ in length, or a state does not fit a system.
    #[error("the state has {} for {}", message::count(*got, "entry"), message::count(*dof, "degree of freedom"))]
    StateLength {
        /// Number of entries found.
        got: usize,
        /// Expected number of degrees of freedom.
        dof: usize,
    },
    /// An initial displacement or velocity is NaN or infinite.
    #[error(
        "the initial {quantity} of degree of freedom {dof} is {value}, not a finite number",
        value = message::number(*value)
    )]
    StateNotFinite {
        /// `"displacement"` or `"velocity"`.
        quantity: &'static str,
        /// Degree of freedom, counted from 1.
        dof: usize,
        /// The value, in m or m/s.
        value: f64,
    },
    /// A force record does not have one channel per degree of freedom.
    #[error("the force has {} for {}", message::count(*got, "channel"), message::count(*dof, "degree of freedom"))]
    ForceChannels {
        /// Number of channels found.
        got: usize,
        /// Degrees of freedom.
        dof: usize,
    },
    /// The dynamic stiffness cannot be inverted: an undamped resonance.
    #[error(
        "the dynamic stiffness is singular at {omega} rad/s \
         (reciprocal condition about {reciprocal_condition:.1e}): an undamped resonance",
        omega = message::number(*omega)
    )]
    SingularDynamicStiffness {
        /// Angular frequency, in rad/s.
        omega: f64,
        /// 1 / ((‖K‖ + ω²‖M‖ + ω‖C‖) ‖D⁻¹‖) in the 1-norm; 0 if a pivot vanished.
        reciprocal_condition: f64,
    },
    /// The entries of M⁻¹K or M⁻¹C are too large for the computation of eigenvalues.
    #[error(
        "M⁻¹K or M⁻¹C has an entry of size {largest:.1e}, too large for the computation of eigenvalues"
    )]
    StateMatrixOverflow {
        /// Largest modulus of an entry, in 1/s² for M⁻¹K or 1/s for M⁻¹C.
        largest: f64,
    },
    /// The eigenvalue or singular value iteration did not converge.
    #[error("the modes of a system with {} did not converge", message::count(*dof, "degree of freedom"))]
    ModesNotConverged {
        /// Degrees of freedom.
        dof: usize,
    },
    /// A word is not one of the choices.
    #[error("there is no {what} `{name}`: choose one of {known}")]
    UnknownName {
        /// Kind of item that the word should name.
        what: &'static str,
        /// The word given.
        name: String,
        /// Accepted words, separated by commas.
        known: &'static str,
    },
    /// An index is outside M, C and K.
    #[error(
        "{matrix} has no entry ({row}, {column}): the system has {}",
        message::count(*dof, "degree of freedom")
    )]
    NoSuchEntry {
        /// Matrix concerned.
        matrix: Matrix,
        /// Row, counted from 1.
        row: usize,
        /// Column, counted from 1.
        column: usize,
        /// Degrees of freedom.
        dof: usize,
    },
    /// No entry of M, C or K has the name of the requested parameter.
    #[error(
        "a system of {} has no parameter `{name}`: its parameters are {}",
        message::count(*dof, "degree of freedom"),
        names(*dof)
    )]
    NoSuchParameter {
        /// The name given.
        name: String,
        /// Degrees of freedom.
        dof: usize,
    },
    /// A covariance does not have one row and column per parameter.
    #[error("the covariance is {rows}×{columns} for {}", message::count(*parameters, "parameter"))]
    CovarianceShape {
        /// Number of rows of the matrix.
        rows: usize,
        /// Number of columns of the matrix.
        columns: usize,
        /// Number of parameters to which the covariance belongs.
        parameters: usize,
    },
    /// A variance is negative, or a covariance is not finite.
    #[error(
        "{parameter} has the variance {variance}, or one of its covariances is not finite: \
         leave out the parameters that the data do not determine",
        variance = message::number(*variance)
    )]
    Covariance {
        /// Name of the parameter concerned.
        parameter: String,
        /// The variance given, in the squared unit of the parameter.
        variance: f64,
    },
    /// The same parameter was named twice.
    #[error("{parameter} is named twice")]
    RepeatedParameter {
        /// Name of the parameter concerned.
        parameter: String,
    },
    /// A text is not a nonlinear term, or the term does not fit the system.
    #[error("`{text}` is not a valid nonlinear term: {reason}")]
    Term {
        /// The text of the term.
        text: String,
        /// Reason why the text is refused.
        reason: String,
    },
    /// Two nonlinear terms have the same name.
    #[error("two nonlinear terms are called `{name}`")]
    RepeatedTerm {
        /// The name.
        name: String,
    },
    /// The number of coefficients differs from the number of nonlinear terms, or a coefficient is
    /// not finite.
    #[error(
        "{} for {}: give one finite coefficient for each term",
        message::count(*got, "coefficient"), message::count(*terms, "nonlinear term")
    )]
    Coefficients {
        /// Number of finite coefficients.
        got: usize,
        /// Number of terms.
        terms: usize,
    },
    /// The system does not have this mode.
    #[error("there is no mode {mode}: the system without damping has {}", message::count(*modes, "oscillating mode"))]
    NoSuchMode {
        /// Requested mode, counted from 1.
        mode: usize,
        /// Number of modes.
        modes: usize,
    },
    /// A signal cannot be used.
    #[error(transparent)]
    Signal(#[from] mechid_signal::SignalError),
    /// A decomposition fails.
    #[error(transparent)]
    Numerics(#[from] mechid_numerics::NumericsError),
}

/// Returns the name of the first and of the last entry of a system with `dof` degrees of freedom.
fn names(dof: usize) -> String {
    let last = dof.saturating_sub(1);
    let entry = |matrix, at| Parameter::new(matrix, at, at, dof).map(|entry| entry.to_string());
    match (dof, entry(Matrix::Mass, 0), entry(Matrix::Stiffness, last)) {
        (1, ..) => "m, c, k".into(),
        (_, Ok(first), Ok(last)) => format!("{first} … {last}"),
        _ => String::new(),
    }
}

/// Returns [`ModelError::Parameter`] unless `value` is finite and `holds` is true.
pub(crate) fn require(
    name: &'static str,
    value: f64,
    requirement: &'static str,
    holds: bool,
) -> Result<(), ModelError> {
    if holds && value.is_finite() {
        Ok(())
    } else {
        Err(ModelError::Parameter { name, requirement, value })
    }
}
