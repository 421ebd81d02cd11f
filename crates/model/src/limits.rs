//! Limits of this crate: the numbers that decide how long to iterate, when to stop and what counts
//! as rounding.

// Modes

/// Maximum relative difference of eigenvalues that count as one multiple eigenvalue: about √ε, the
/// distance that rounding causes within a defective pair.
pub(crate) const MULTIPLE_EIGENVALUE: f64 = 1e-7;

/// Distance between the shift of inverse iteration and the eigenvalue, in units of the rounding of
/// the eigenvalue. The distance is larger than the coupling that rounding causes between equal
/// eigenvalues, so that each start vector gives a different direction.
pub(crate) const INVERSE_ITERATION_SHIFT: f64 = 100.0;

/// Number of steps of inverse iteration: the first step reduces the other modes to the size of
/// rounding, the second step to less.
pub(crate) const INVERSE_ITERATION_STEPS: usize = 2;

/// Smallest independent part of a shape: the part that is not a combination of the other shapes of
/// the same eigenvalue, relative to the whole shape. If the part is smaller, there is no further
/// independent shape.
pub(crate) const INDEPENDENT_SHAPE: f64 = 1e-3;

/// Maximum number of degrees of freedom for which all singular values of M are computed; above it
/// the largest and the smallest are estimated by iteration.
pub(crate) const SINGULAR_VALUES_DOF: usize = 64;

// Backbone

/// Number of harmonics of a motion on the backbone, in addition to its mean.
pub(crate) const HARMONICS: usize = 9;

/// Number of instants per period: enough to avoid aliasing of the ninth power of a sum of nine
/// harmonics, multiplied by one of these harmonics.
pub(crate) const INSTANTS: usize = 128;

/// Maximum number of Newton steps for one amplitude of a backbone.
pub(crate) const BACKBONE_NEWTON_STEPS: usize = 30;

/// Maximum Newton step, relative to amplitude and frequency, at which the iteration for a point of
/// a backbone ends.
pub(crate) const BACKBONE_STEP: f64 = 1e-11;

/// Maximum number of attempts from one amplitude of a backbone to the next; each failure halves the
/// step.
pub(crate) const BACKBONE_ATTEMPTS: usize = 16;

/// Change of a parameter for a numerical derivative, in standard errors.
pub(crate) const PARAMETER_STEP: f64 = 0.1;

/// Maximum real part of an eigenvalue, relative to its modulus, for which the mode counts as
/// undamped.
pub(crate) const UNDAMPED: f64 = 1e-6;

/// Maximum exponent of a power law. A backbone has the same number of harmonics: the ninth power of
/// a cosine has harmonics up to the ninth.
pub(crate) const HIGHEST_EXPONENT: u32 = 9;

// The following limits are for machines that consist of named elements.

/// Maximum order of a matrix of an element: all entries are stored, 0.8 GB for this order.
#[cfg(feature = "serde")]
pub(crate) const MAX_MATRIX_ORDER: usize = 10_000;

/// Maximum number of names in a message; a longer list would hide the wrong name.
pub(crate) const LISTED_NAMES: usize = 12;
