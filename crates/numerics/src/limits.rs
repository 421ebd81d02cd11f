//! Limits that decide something in this crate.

/// Predicted decrease, relative to the sum of squares, that ends a search at a minimum: parameters
/// are then within 10⁻⁶·√(residuals) standard errors of it.
pub(crate) const COST_TOLERANCE: f64 = 1e-12;

/// Length of a step, relative to the parameters and in scaled coordinates, that ends a search at a
/// minimum: for data without noise, the predicted decrease never does.
pub(crate) const STEP_TOLERANCE: f64 = 1e-12;

/// Initial damping of a step that does not descend, relative to a Gram matrix of unit diagonal.
pub(crate) const FIRST_DAMPING: f64 = 1e-8;

/// Minimum damping; a smaller one is replaced by zero.
pub(crate) const SMALLEST_DAMPING: f64 = 1e-13;

/// Maximum damping; above it rounding decides, so the search ends without descent.
pub(crate) const LARGEST_DAMPING: f64 = 1e12;

/// Maximum length of the correction of a step for curvature, relative to the step; if it is longer,
/// the step is damped instead (Transtrum & Sethna 2012).
pub(crate) const LARGEST_CORRECTION: f64 = 0.75;

/// Maximum relative singular value of an undetermined direction: a hundred times the rounding of a
/// matrix whose columns have unit length.
pub(crate) const RANK_TOLERANCE: f64 = 100.0 * f64::EPSILON;

/// Minimum part of an unknown in an undetermined direction for which the unknown counts as
/// undetermined.
pub(crate) const SHARE_TOLERANCE: f64 = 1e-6;

/// Minimum norm of a column whose squares are all normal numbers; the squares of a smaller one lose
/// digits.
pub(crate) const SMALLEST_NORM: f64 = 1e-140;

/// Maximum ratio, to the largest entry, of an entry that counts as 0 in a decomposition: its square
/// would underflow.
pub(crate) const NEGLIGIBLE: f64 = 1e-140;

/// Maximum number of iterations per row or column of a decomposition; two or three are usual.
pub(crate) const ITERATIONS: usize = 200;

/// Maximum 1-norm of a matrix whose exponential is computed: its 27th power, with which nalgebra
/// bounds the truncation error, must be finite.
pub(crate) const EXPONENTIAL_NORM: f64 = 1e11;

/// Number of QR sweeps without a deflation after which a subdiagonal entry below ε‖A‖ is set to
/// zero, too.
pub(crate) const PATIENCE: usize = 20;

/// Maximum number of QR sweeps without a deflation; more are not convergence.
pub(crate) const SWEEPS: usize = 100;
