//! Limits that decide something in this crate, each with what happens on either side.

/// Promised decrease, relative to the sum of squares, below which a search ends at a minimum: parameters are then
/// within 10⁻⁶·√(residuals) standard errors of it.
pub(crate) const COST_TOLERANCE: f64 = 1e-12;

/// Length of a step relative to the parameters, both in scaled coordinates, below which a search ends at a minimum
/// too: data without noise have no other end.
pub(crate) const STEP_TOLERANCE: f64 = 1e-12;

/// First damping of a step that does not descend, against a Gram matrix of unit diagonal.
pub(crate) const FIRST_DAMPING: f64 = 1e-8;

/// Smallest damping; a smaller one is none.
pub(crate) const SMALLEST_DAMPING: f64 = 1e-13;

/// Largest damping; where a larger one would be needed rounding decides, and there is no descent.
pub(crate) const LARGEST_DAMPING: f64 = 1e12;

/// Largest length of the correction of a step for curvature, relative to the step; with a longer one the step is
/// damped instead (Transtrum & Sethna 2012).
pub(crate) const LARGEST_CORRECTION: f64 = 0.75;

/// Relative singular value below which a direction counts as not determined by the data: a hundred times the
/// rounding of a matrix whose columns have unit length.
pub(crate) const RANK_TOLERANCE: f64 = 100.0 * f64::EPSILON;

/// Share of an unknown in an undetermined direction from which it counts as undetermined.
pub(crate) const SHARE_TOLERANCE: f64 = 1e-6;

/// Smallest norm of a column whose squares are all normal numbers; the squares of a smaller one have lost digits.
pub(crate) const SMALLEST_NORM: f64 = 1e-140;

/// Entries below this part of the largest count as 0 in a decomposition: their squares would underflow.
pub(crate) const NEGLIGIBLE: f64 = 1e-140;

/// Maximum number of iterations per row or column of a decomposition; two or three are usual.
pub(crate) const ITERATIONS: usize = 200;

/// Largest 1-norm of a matrix whose exponential is computed: its 27th power, with which nalgebra bounds the
/// truncation error, must be finite.
pub(crate) const EXPONENTIAL_NORM: f64 = 1e11;

/// Number of QR sweeps without a deflation after which a subdiagonal entry below ε‖A‖ is dropped too.
pub(crate) const PATIENCE: usize = 20;

/// Maximum number of QR sweeps without a deflation; then the iteration is given up.
pub(crate) const SWEEPS: usize = 100;
