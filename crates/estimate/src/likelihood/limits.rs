//! Limits of the likelihood, with their reasons.

/// Order of the polynomial in s that the transient of an open record adds to every output. It
/// describes aliasing, which is smooth over the band. Together with the state loads, order 3
/// corresponds to the load polynomial of order 5 of a machine with all degrees of freedom measured.
pub(super) const TRANSIENT_ORDER: usize = 3;

/// Minimum relative length of the component of a transient column that is orthogonal to the other
/// columns; a column with less counts as linearly dependent, because rounding would decide its
/// coefficient.
pub(super) const TRANSIENT_RANK: f64 = 1e-12;

/// Minimum ratio of singular values of the scaled Jacobian for a determined combination of
/// parameters: the rounding of the responses, with a reserve.
pub(super) const RANK: f64 = 1e-9;

/// Minimum share of the squared effect of a delay that the parameters do not explain. Below it
/// rounding would decide the delay; above it the standard error of the delay does.
pub(super) const DETERMINED_DELAY: f64 = 1e-9;

/// Maximum relative standard error for a Wald interval. For a larger one the interval comes from
/// the profile of the likelihood, because the likelihood is not quadratic over such a distance.
pub(super) const WEAK: f64 = 0.3;

/// Relative noise assumed in the first steps of every search: they weight relative deviations of
/// the response, so that a resonance at a wrong frequency does not dominate all other lines.
pub(super) const FIRST_RELATIVE_NOISE: f64 = 0.3;

/// Rise of the sum of squares after the first steps over that of the search with the lowest
/// minimum, in units of the noise, above which a search ends. With the noise of
/// [`FIRST_RELATIVE_NOISE`], which is more than that of most measurements, the end of such a search
/// is less likely by a factor e²⁵.
pub(super) const HOPELESS_RISE: f64 = 50.0;

/// Numbers (real and imaginary parts of the lines) per unknown in the first steps of every search:
/// enough for their minimum to be near that of all lines, with which the search continues. With a
/// fifth of them the resonances of a long record can lie between the lines.
pub(super) const SEARCH_NUMBERS: usize = 100;

/// Damping of a step, relative to the unit diagonal of the Gram matrix, above which the curvature
/// of the residual is not worth an evaluation: weakly determined directions, along which the
/// residual is curved, hardly change.
pub(super) const SHORT_STEP: f64 = 1.0;

/// Maximum number of responses to state loads (of the sensors, and for each parameter, over all
/// lines) that stay in memory between a residual and its derivative: 64 MiB. With more, they are
/// computed again for each record.
pub(super) const KEPT_RESPONSES: usize = 1 << 22;

/// Maximum number of steps of a search.
pub(super) const STEPS: usize = 200;

/// Maximum number of steps away from the estimate until the profile of the likelihood has fallen
/// enough for the limit of an interval.
pub(super) const PROFILE_STEPS: usize = 24;

/// Smallest and largest factor from one distance to the next in the search for the limit of a
/// profile interval.
pub(super) const PROFILE_FACTORS: [f64; 2] = [1.5, 8.0];

/// Ratio of the next distance to the extrapolated distance of the limit of a profile interval: a
/// step slightly beyond the limit gives a value on either side of the limit.
pub(super) const PROFILE_MARGIN: f64 = 1.1;

/// Maximum number of steps between values on either side of the limit of a profile interval.
pub(super) const PROFILE_SECANTS: usize = 20;

/// Relative deviation from the required rise of the sum of squares that ends the search for the
/// limit of a profile interval. The limit then differs by a two-thousandth of its distance from the
/// estimate.
pub(super) const PROFILE_TOLERANCE: f64 = 1e-3;

/// Maximum relative difference of the sums of squares of two searches with the same minimum.
pub(super) const SAME_MINIMUM: f64 = 1e-6;

/// Maximum relative difference of a parameter after the first steps of two searches with the same
/// minimum; a parameter that the lines of these steps do not determine differs by more.
pub(super) const SAME_PARAMETER: f64 = 1e-3;

/// Maximum excess of the misfit of a correct model over its expectation, in standard deviations.
pub(super) const PLAUSIBLE: f64 = 6.0;

/// Relative change of the noise levels that ends the rounds of weighting.
pub(super) const NOISE_LEVEL_CHANGE: f64 = 1e-6;

/// Maximum number of rounds that alternate between the levels of white noise and the parameters.
pub(super) const NOISE_ROUNDS: usize = 30;

/// Number of rounds of weighting by a noise spectrum: the first is efficient, the others refine the
/// shape of the spectrum.
pub(super) const COLOURED_ROUNDS: usize = 3;

/// Minimum power of a residual relative to the noise of the round before; a line without residual
/// would have an unbounded weight.
pub(super) const LEAST_POWER: f64 = 1e-12;

/// Minimum share of its noise that a residual is assumed to keep after the fit (1 − leverage).
pub(super) const LEAST_KEPT: f64 = 0.1;

/// Maximum number of state loads of a machine with open records: the cost of a line grows with
/// their square.
pub(super) const MOST_STATES: usize = 150;

/// Maximum number of degrees of freedom of a machine with a state load on each of them. In a larger
/// machine the sensors respond to fewer independent loads, which are determined first.
pub(super) const EACH_STATE_DOFS: usize = 24;

/// Maximum number of lines on which the state loads are found: between two of them every mode still
/// contributes much more than [`STATE_RESPONSE`] to the response.
pub(super) const STATE_LINES: usize = 1000;

/// Minimum response of the sensors to a state load, relative to the response to the other state
/// loads: the noise of measurements is a hundred times larger.
pub(super) const STATE_RESPONSE: f64 = 1e-6;

/// Maximum number of known coefficients that are tried as unknowns where a machine does not explain
/// the data: each costs the derivatives of the response on all lines.
pub(super) const FREED_COEFFICIENTS: usize = 24;

/// Maximum number of lines times the cube of the degrees of freedom with unknown terms, if a known
/// coefficient is tried as an unknown: a step takes about a second.
pub(super) const FREED_WORK: f64 = 1e9;

/// Number of searches that must end at the lowest minimum if the known noise explains it; otherwise
/// the search uses all initial estimates.
pub(super) const CONFIRMED: usize = 2;

/// Number of searches that must end at the lowest minimum if the noise is unknown, because then no
/// misfit shows whether the minimum is the correct one.
pub(super) const CONFIRMED_WITHOUT_NOISE: usize = 4;

/// Number of degrees of freedom of a noise level that is known exactly: with more, Fisher's
/// distribution does not change.
pub(super) const KNOWN_FREEDOM: f64 = 1e6;

/// Maximum number of records of a fit that are compared with each other: the cost grows with the
/// square of their number.
pub(super) const COMPARED_RECORDS: usize = 16;

/// p-value of the misfit to known noise below which the misfit scales standard errors and
/// intervals. In one of a thousand fits this makes the intervals of a correct model wider than
/// necessary.
pub(super) const MISFIT_SIGNIFICANCE: f64 = 1e-3;

/// Maximum share of a gradient outside the determined combinations for a determined quantity; a
/// share up to this limit is rounding of the singular vectors.
pub(super) const UNDETERMINED_PART: f64 = 1e-5;

/// Maximum ratio of the sum of the terms of a combination to the sum of their absolute values if
/// the combination depends only on ratios of parameters.
pub(super) const COMMON_FACTOR: f64 = 1e-4;
