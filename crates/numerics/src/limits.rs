//! Numerical limits of this crate: when searches and iterations end, and what counts as zero.

/// Predicted decrease, relative to the sum of squares, that ends a search at a minimum. The
/// parameters are then within 10⁻⁶·√(number of residuals) standard errors of the minimum.
pub(crate) const COST_TOLERANCE: f64 = 1e-12;

/// Length of a step, relative to the parameters and in scaled coordinates, that ends a search at a
/// minimum. It is needed for data without noise: with such data the predicted decrease does not end
/// the search.
pub(crate) const STEP_TOLERANCE: f64 = 1e-12;

/// Initial damping after a step that does not reduce the sum of squares, relative to a Gram matrix
/// with a unit diagonal.
pub(crate) const FIRST_DAMPING: f64 = 1e-8;

/// Minimum damping; a smaller one is replaced by zero.
pub(crate) const SMALLEST_DAMPING: f64 = 1e-13;

/// Maximum damping; above it, rounding determines whether a step reduces the sum of squares, so the
/// search ends.
pub(crate) const LARGEST_DAMPING: f64 = 1e12;

/// Maximum length of the curvature correction of a step, relative to the step; if the correction is
/// longer, the step is damped instead (Transtrum & Sethna 2012).
pub(crate) const LARGEST_CORRECTION: f64 = 0.75;

/// Maximum relative singular value of an undetermined direction: a hundred times the rounding of a
/// matrix whose columns have unit length.
pub(crate) const RANK_TOLERANCE: f64 = 100.0 * f64::EPSILON;

/// Minimum component of an unknown in an undetermined direction for which the unknown counts as
/// undetermined.
pub(crate) const SHARE_TOLERANCE: f64 = 1e-6;

/// Minimum norm of a column whose squares are all normal numbers; the squares of a smaller column
/// lose digits.
pub(crate) const SMALLEST_NORM: f64 = 1e-140;

/// Largest magnitude of an entry that counts as 0 in a decomposition, relative to the largest
/// entry; the squares of much smaller entries underflow.
pub(crate) const NEGLIGIBLE: f64 = 1e-140;

/// Maximum number of iterations per row or column of a decomposition; two or three are usual.
pub(crate) const ITERATIONS: usize = 200;

/// Maximum 1-norm of a matrix whose exponential is computed: its 27th power, with which nalgebra
/// bounds the truncation error, must be finite.
pub(crate) const EXPONENTIAL_NORM: f64 = 1e11;

/// Number of QR sweeps without a deflation; after this number, a subdiagonal entry below ε‖A‖ is
/// also set to zero.
pub(crate) const PATIENCE: usize = 20;

/// Maximum number of QR sweeps without a deflation; if more are needed, the iteration does not
/// converge.
pub(crate) const SWEEPS: usize = 100;

/// Number of rows per block in products of tall matrices: a block of a hundred columns then fits in
/// the cache of a core.
pub(crate) const PRODUCT_ROWS: usize = 1024;

/// Maximum number of degrees of freedom for which products of pairs of regressors are computed as
/// dot products; with more, a product of matrices is faster.
pub(crate) const NARROW_PRODUCT: usize = 2;

/// Number of rows of a tall matrix that are multiplied by their weights at a time: these rows stay
/// in the fastest cache of a core.
pub(crate) const WEIGHTED_ROWS: usize = 256;
