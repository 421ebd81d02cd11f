//! Errors of an identification.

use mechid_model::Matrix;
use mechid_signal::message;

/// Maximum number of parameters that an error names.
pub const NAMED_PARAMETERS: usize = 12;

/// Maximum number of undetermined combinations that an error names.
pub const NAMED_DIRECTIONS: usize = 3;

/// An identification that cannot be done; every variant carries the offending numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// The size of a known matrix differs from that of the problem.
    #[error("the known {matrix} matrix is {rows}×{columns}, expected {dof}×{dof}")]
    Shape {
        /// Name of the matrix.
        matrix: Matrix,
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
        /// Expected number of degrees of freedom.
        dof: usize,
    },
    /// A known value is NaN or infinite.
    #[error("the known value of {parameter} is {value}, which is not a finite number")]
    FixedValue {
        /// Name of the parameter.
        parameter: String,
        /// The value given, in the unit of the parameter.
        value: f64,
    },
    /// A problem needs at least one degree of freedom.
    #[error("an identification needs at least one degree of freedom")]
    NoDof,
    /// No unknown parameter has the given name.
    #[error("no unknown parameter is called \"{name}\"; the unknowns are {known}")]
    NoSuchParameter {
        /// Name that was given.
        name: String,
        /// Names of the unknown parameters.
        known: String,
    },
    /// An equation of motion has neither a force nor a known entry: it determines only ratios of
    /// its entries.
    #[error(
        "no force acts on degree of freedom {dof} and none of its parameters ({parameters}) is known: its equation \
         of motion determines only the ratios of these parameters; give one of the masses, or apply a force there"
    )]
    OnlyRatios {
        /// Degree of freedom, counted from 1.
        dof: usize,
        /// Names of the parameters in the equation of motion of `dof`.
        parameters: String,
    },
    /// The two entries of a symmetric pair are known, but they differ.
    #[error(
        "{lower} is given as {} and {upper} as {}: a symmetric matrix needs equal values",
        message::number(*lower_value), message::number(*upper_value)
    )]
    Asymmetric {
        /// Name of the entry below the diagonal.
        lower: String,
        /// Value of the entry below the diagonal, in its SI unit.
        lower_value: f64,
        /// Name of the entry above the diagonal.
        upper: String,
        /// Value of the entry above the diagonal, in its SI unit.
        upper_value: f64,
    },
    /// An entry of the damping matrix is given although proportional damping determines it.
    #[error(
        "{parameter} cannot be given: with proportional damping every entry follows from mass and stiffness"
    )]
    RelatedDamping {
        /// Name of the entry.
        parameter: String,
    },
    /// Entries of M, C and K are related, which the estimator does not support.
    #[error(
        "{estimator} estimates every entry of M, C and K separately: symmetric matrices and proportional damping need least squares on the equation of motion or maximum likelihood"
    )]
    Related {
        /// The estimator.
        estimator: &'static str,
    },
    /// The data do not determine some parameters, and all parameters are needed.
    #[error("the data do not determine {parameters}: {directions}")]
    Undetermined {
        /// Names of the parameters concerned.
        parameters: String,
        /// The combinations of parameters that the data do not determine.
        directions: String,
    },
    /// A parameter or its standard error overflows.
    #[error(
        "{parameter} or its standard error exceeds the range of double precision: a known value or the force \
         is far too large, or the response far too small"
    )]
    Unbounded {
        /// Name of the parameter.
        parameter: String,
    },
    /// Records that are to be fitted together have different steps.
    #[error("the records have different time steps: {expected} s and {got} s")]
    Step {
        /// Step of the first record, in seconds.
        expected: f64,
        /// Step of the other record, in seconds.
        got: f64,
    },
    /// A sliding polynomial cannot be fitted, or has no derivative of the requested order.
    #[error(
        "a polynomial of order {order} through {} is not possible: the window must have more samples \
         than the order, and the order must be at least that of the derivative", message::count(*samples, "sample")
    )]
    Window {
        /// Samples of the window.
        samples: usize,
        /// Order of the polynomial.
        order: usize,
    },
    /// A sliding polynomial over too many samples, or of too high an order.
    #[error(
        "a sliding polynomial of order {order} with {half_width} samples on either side is not possible: \
         the order can be at most {}, the number of samples on either side at most {}",
        crate::derivatives::SavitzkyGolay::MOST_ORDER,
        crate::derivatives::SavitzkyGolay::MOST_HALF_WIDTH
    )]
    WindowTooLarge {
        /// Samples to either side of the centre.
        half_width: usize,
        /// Order of the polynomial.
        order: usize,
    },
    /// The identified system has no steady state with the period of the force.
    #[error(
        "the identified machine has no steady state of period {period} s: it is undamped or unstable"
    )]
    NoSteadyState {
        /// The period, in seconds.
        period: f64,
    },
    /// A mode is too fast for a step of one sample.
    #[error(
        "the fastest mode has {rate:.3e} rad/s, too fast for a sampling interval of {dt:.3e} s: leave \
         out degrees of freedom without a mass, or sample faster"
    )]
    TooStiff {
        /// Modulus of the eigenvalue of the mode, in rad/s.
        rate: f64,
        /// Sampling interval, in s.
        dt: f64,
    },
    /// A computed response diverges.
    #[error(
        "the response of the nonlinear system grows without limit within {}: a spring or damper has a \
         negative force coefficient at this amplitude",
        message::count(*len, "sample")
    )]
    Diverged {
        /// Number of samples of the record.
        len: usize,
    },
    /// The noise covariance of a line cannot be inverted.
    #[error(
        "the noise covariance at {frequency_hz} Hz is singular: a displacement has no noise, or the periods are \
         too few (there must be more periods than degrees of freedom); pool the covariance over more lines"
    )]
    SingularNoise {
        /// Frequency, in Hz.
        frequency_hz: f64,
    },
    /// No search for the best fit (by maximum likelihood, by output error, or for proportional
    /// damping) converged.
    #[error(
        "the search for the best fit failed: {} reached no minimum within {steps} \
         steps. This does not show that the model is wrong; more lines, more periods, a known mass or fewer \
         unknowns make the search easier",
        if *searches == 1 { "one search".to_owned() } else { format!("{searches} searches") }
    )]
    NotConverged {
        /// Number of searches, each with another initial estimate.
        searches: usize,
        /// Maximum number of steps of the first search.
        steps: usize,
    },
    /// Spectral lines are unusable.
    #[error(transparent)]
    Spectra(#[from] mechid_spectra::SpectraError),
    /// A numerical method fails.
    #[error(transparent)]
    Numerics(#[from] mechid_numerics::NumericsError),
    /// The identified matrices do not make a system.
    #[error(transparent)]
    Model(#[from] mechid_model::ModelError),
    /// A record cannot be used.
    #[error(transparent)]
    Signal(#[from] mechid_signal::SignalError),
}
