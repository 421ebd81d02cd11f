//! Numerical limits of a maximum-likelihood fit, with their reasons.

/// Order of the polynomial in s that the transient of an open record adds to every output. The
/// polynomial describes aliasing, which is smooth over the band. Order 3, together with the state
/// loads, corresponds to a load polynomial of order 5 of a machine whose degrees of freedom are all
/// measured.
pub(super) const TRANSIENT_ORDER: usize = 3;

/// Minimum relative length of the component of a transient column that is orthogonal to the other
/// columns; a column with a shorter component counts as linearly dependent, because rounding would
/// determine its coefficient.
pub(super) const TRANSIENT_RANK: f64 = 1e-12;

/// Minimum ratio of a singular value of the scaled Jacobian to the largest one if the combination
/// of parameters is determined; the rounding of the responses is well below it.
pub(super) const RANK: f64 = 1e-9;

/// Minimum fraction of the squared effect of a delay that the parameters do not explain. Below it
/// the delay counts as undetermined, because rounding would determine its value.
pub(super) const DETERMINED_DELAY: f64 = 1e-9;

/// Maximum relative standard error for a Wald interval. If the standard error is larger, the
/// interval comes from the profile of the likelihood, because the likelihood is not quadratic so
/// far from the estimate.
pub(super) const WEAK: f64 = 0.3;

/// Noise, relative to the response, that the first steps of every search assume. These steps weight
/// relative deviations of the response, so that a resonance at a wrong frequency does not dominate
/// all other lines.
pub(super) const FIRST_RELATIVE_NOISE: f64 = 0.3;

/// Maximum excess, in units of the noise, of the sum of squares of a search over the sum of squares
/// of the search with the lowest minimum. Both sums are those after the first steps. A search above
/// the limit ends. With the noise of [`FIRST_RELATIVE_NOISE`], the result of such a search is less
/// likely by a factor e²⁵; most measurements have less noise.
pub(super) const MAX_EXCESS_COST: f64 = 50.0;

/// Number of measured values (real and imaginary parts) per unknown in the first steps of every
/// search. With this number the minimum is near the minimum for all lines; the search then
/// continues on all lines. With a fifth of this number the resonances of a long record can be
/// between the selected lines.
pub(super) const SEARCH_NUMBERS: usize = 100;

/// Damping of a step, relative to the unit diagonal of the Gram matrix, above which the curvature
/// of the residual is not evaluated: such a step hardly moves along the weakly determined
/// directions, in which the residual is curved.
pub(super) const SHORT_STEP: f64 = 1.0;

/// Maximum number of responses to state loads that stay in memory between a residual and its
/// derivative: 64 MiB. On each line, every state load has one response per sensor and one per
/// parameter. If there are more, the responses are computed again for each record.
pub(super) const KEPT_RESPONSES: usize = 1 << 22;

/// Maximum number of steps of a search.
pub(super) const STEPS: usize = 200;

/// Maximum number of steps away from the estimate in the search for a value beyond the limit of a
/// profile interval; if no step reaches such a value, the limit is infinite.
pub(super) const PROFILE_STEPS: usize = 24;

/// Smallest and largest factor from one distance to the next in the search for the limit of a
/// profile interval.
pub(super) const PROFILE_FACTORS: [f64; 2] = [1.5, 8.0];

/// Ratio of the next distance to the extrapolated distance of the limit of a profile interval. It
/// is slightly above 1, so that the next value is probably beyond the limit.
pub(super) const PROFILE_MARGIN: f64 = 1.1;

/// Maximum number of steps that narrow the range around the limit of a profile interval, after a
/// value on each side of the limit is known.
pub(super) const PROFILE_SECANTS: usize = 20;

/// Deviation from the required rise of the sum of squares, relative to this rise, that ends the
/// search for the limit of a profile interval. The error of the limit is then about a
/// two-thousandth of its distance from the estimate.
pub(super) const PROFILE_TOLERANCE: f64 = 1e-3;

/// Maximum relative difference of the sums of squares of two searches with the same minimum.
pub(super) const SAME_MINIMUM: f64 = 1e-6;

/// Maximum relative difference of a parameter after the first steps of two searches that would end
/// at the same minimum. A parameter that the lines of these steps do not determine differs by more;
/// then both searches continue.
pub(super) const SAME_PARAMETER: f64 = 1e-3;

/// Maximum excess of the misfit of a correct model over its expected value, in standard deviations
/// of the misfit.
pub(super) const PLAUSIBLE: f64 = 6.0;

/// Relative change of the noise levels that ends the rounds of weighting.
pub(super) const NOISE_LEVEL_CHANGE: f64 = 1e-6;

/// Maximum number of rounds that alternate between the levels of white noise and the parameters.
pub(super) const NOISE_ROUNDS: usize = 30;

/// Number of rounds of weighting by a noise spectrum: the first one gives an efficient estimate,
/// the others refine the shape of the spectrum.
pub(super) const COLOURED_ROUNDS: usize = 3;

/// Minimum power of a residual relative to the noise of the round before; a line without residual
/// would have an unbounded weight.
pub(super) const LEAST_POWER: f64 = 1e-12;

/// Minimum assumed fraction of the noise that remains in a residual after the fit (1 − leverage).
pub(super) const LEAST_KEPT: f64 = 0.1;

/// Maximum number of state loads of a machine with open records: the cost of a line grows with
/// their square.
pub(super) const MOST_STATES: usize = 150;

/// Maximum number of degrees of freedom of a machine in which each degree of freedom has a state
/// load. In a larger machine the sensors respond to fewer independent loads; these loads are
/// determined first.
pub(super) const EACH_STATE_DOFS: usize = 24;

/// Maximum number of lines on which the state loads are determined. Between two of these lines
/// every mode still contributes much more than [`STATE_RESPONSE`] to the response.
pub(super) const STATE_LINES: usize = 1000;

/// Minimum response of the sensors to a state load (the load that has the effect of the initial and
/// final state of a record), relative to the response to the other state loads. The noise of
/// measurements is at least a hundred times this limit.
pub(super) const STATE_RESPONSE: f64 = 1e-6;

/// Maximum number of known coefficients that are tried as unknowns if a machine does not explain
/// the data. Each of them needs the derivatives of the response on all lines.
pub(super) const FREED_COEFFICIENTS: usize = 24;

/// Maximum product of the number of lines and the cube of the number of degrees of freedom with
/// unknown terms, in a fit that tries a known coefficient as an unknown; a larger fit is not made.
/// At the limit a step takes about a second.
pub(super) const FREED_WORK: f64 = 1e9;

/// Number of searches that must end at the lowest minimum if the known noise explains the residual
/// of this minimum; otherwise the search uses all initial estimates.
pub(super) const CONFIRMED: usize = 2;

/// Number of searches that must end at the lowest minimum if the noise is unknown. In this case the
/// misfit cannot show whether the minimum is the correct one.
pub(super) const CONFIRMED_WITHOUT_NOISE: usize = 4;

/// Number of degrees of freedom that represents an exactly known noise level: with a larger number,
/// Fisher's distribution hardly changes.
pub(super) const KNOWN_FREEDOM: f64 = 1e6;

/// Maximum number of records of a fit that are compared with each other. The cost of the comparison
/// grows with the square of the number of records.
pub(super) const COMPARED_RECORDS: usize = 16;

/// p-value of the misfit to known noise below which the misfit scales standard errors and
/// intervals. One of a thousand fits of a correct model has a smaller p-value; the intervals of
/// this fit are wider than necessary.
pub(super) const MISFIT_SIGNIFICANCE: f64 = 1e-3;

/// Maximum fraction of the gradient of a determined quantity that is outside the determined
/// combinations; a fraction up to this limit is rounding of the singular vectors.
pub(super) const UNDETERMINED_PART: f64 = 1e-5;

/// Largest magnitude of the sum of the terms of a combination, relative to the sum of the
/// magnitudes of the terms, at which the combination counts as a function of only the ratios of the
/// parameters.
pub(super) const COMMON_FACTOR: f64 = 1e-4;
