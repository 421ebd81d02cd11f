//! Limits of this crate: the numbers that decide how long to iterate, when to stop and what counts
//! as rounding.

// Modes

/// Maximum relative difference of eigenvalues that count as one multiple eigenvalue: about √ε, the
/// rounding of a defective pair.
pub(crate) const MULTIPLE_EIGENVALUE: f64 = 1e-7;

/// Distance of the shift of inverse iteration from the eigenvalue, in units of its rounding. It
/// exceeds the coupling of equal eigenvalues by rounding, so that each start gives its own
/// direction.
pub(crate) const INVERSE_ITERATION_SHIFT: f64 = 100.0;

/// Number of steps of inverse iteration: the first reduces other modes to rounding, the second
/// below it.
pub(crate) const INVERSE_ITERATION_STEPS: usize = 2;

/// Smallest independent part of a shape, relative to others of the same eigenvalue, that makes it
/// a separate shape.
pub(crate) const INDEPENDENT_SHAPE: f64 = 1e-3;

/// Maximum number of degrees of freedom for which all singular values of M are computed; above it
/// the largest and the smallest are estimated by iteration.
pub(crate) const SINGULAR_VALUES_DOF: usize = 64;

// Backbone

/// Number of harmonics of the motion, in addition to its mean.
pub(crate) const HARMONICS: usize = 9;

/// Number of instants of a period: enough that the ninth power of nine harmonics, times one of
/// them, does not alias.
pub(crate) const INSTANTS: usize = 128;

/// Maximum number of Newton steps for one amplitude.
pub(crate) const BACKBONE_NEWTON_STEPS: usize = 30;

/// Newton step, relative to amplitude and frequency, that ends the iteration.
pub(crate) const BACKBONE_STEP: f64 = 1e-11;

/// Maximum number of attempts from one amplitude to the next; each failure halves the step.
pub(crate) const BACKBONE_ATTEMPTS: usize = 16;

/// Change of a parameter for a numerical derivative, in standard errors.
pub(crate) const PARAMETER_STEP: f64 = 0.1;

/// Maximum real part of an eigenvalue, relative to its modulus, for which it counts as undamped.
pub(crate) const UNDAMPED: f64 = 1e-6;

/// Maximum exponent of a power law; the backbone resolves its harmonics up to this exponent.
pub(crate) const HIGHEST_EXPONENT: u32 = 9;

// Machines of named elements

/// Maximum order of a matrix of an element: all entries are stored, 0.8 GB for this order.
#[cfg(feature = "serde")]
pub(crate) const MAX_MATRIX_ORDER: usize = 10_000;

/// Maximum number of names in a message; more would hide the wrong one.
pub(crate) const LISTED_NAMES: usize = 12;
