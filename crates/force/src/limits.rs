//! Limits of this crate: the numbers that decide how long to search, when to stop, and whether a
//! measurement shows a force.

// Posterior points

/// Step for the curvature of the likelihood, whose parameters are logarithms.
pub(crate) const CURVATURE_STEP: f64 = 0.15;

/// Maximum posterior standard deviation of the logarithm of a parameter. A parameter that the
/// measurement does not determine has this value.
pub(crate) const UNDETERMINED_LOGARITHM: f64 = 1.5;

/// Standard deviation of the logarithm of a parameter; if all deviations are smaller, only the best
/// point is used. The effect of such a deviation on a standard error is at most a hundredth.
pub(crate) const NARROW_POSTERIOR: f64 = 0.02;

/// Maximum logarithm of the weight of a posterior point before normalisation; a larger weight is
/// reduced to this maximum. The weight is the likelihood at the point, divided by Laplace's
/// approximation of the likelihood.
pub(crate) const POINT_WEIGHT: f64 = 1.0;

// Kalman filter

/// Orders of the force model that are tried. The search for orders 1 and 2 starts from a grid; the
/// search for a higher order starts from the best point of the previous order.
pub(crate) const FORCE_ORDERS: [usize; 5] = [1, 2, 4, 8, 16];

/// Minimum gain in log-likelihood of the force model with an order above 4, relative to the best
/// lower order. If the gain is smaller, no higher order is tried.
pub(crate) const ORDER_GAIN: f64 = 1.0;

/// Maximum number of states of all forces; with more, long records take too long.
pub(crate) const FORCE_STATES: usize = 16;

/// Ratio of successive corner frequencies of the grid. At the lowest corner frequency of the grid,
/// the record has the length of half a period.
pub(crate) const CORNER_RATIO: f64 = 4.0;

/// Highest corner frequency, in radians per sample: the Nyquist frequency.
pub(crate) const HIGHEST_CORNER: f64 = std::f64::consts::PI;

/// Signal-to-noise ratios of the grid for the force model.
pub(crate) const GRID_RATIOS: [f64; 4] = [3.0, 30.0, 300.0, 3000.0];

/// Range of the signal-to-noise ratio: above it rounding hides the noise, below it the measurement
/// is only noise.
pub(crate) const RATIO_RANGE: std::ops::Range<f64> = 0.3..1e8;

/// Maximum relative change of any variance in one step for the covariance to count as converged.
/// Variances that converge by a factor of 1 − 10⁻⁴ per step are then within 10⁻⁸ of their limit.
pub(crate) const CONVERGED_COVARIANCE: f64 = 1e-12;

/// Maximum relative change of any variance in one step for the covariance to count as converged, if
/// only the likelihood is needed.
pub(crate) const CONVERGED_LIKELIHOOD: f64 = 1e-7;

/// Number of time constants 1/ω_c after which the initial state of a force model has decayed; for
/// order 16 by the factor e^(−0.1·512).
pub(crate) const DECAY_TIME: f64 = 512.0;

/// Largest norm of a rate matrix times a sub-step. Below this limit, each term of the series for
/// the noise of a sub-step is at most half the previous term.
pub(crate) const SUBSTEP: f64 = 0.25;

/// Number of terms of the series for the noise of a step; the next term would be smaller than
/// rounding.
pub(crate) const SERIES_TERMS: usize = 18;

/// Maximum number of frequencies at which the system is evaluated. Between these frequencies the
/// response changes little, except at a narrow resonance, where the force is known best.
pub(crate) const INFORMATION_FREQUENCIES: usize = 1024;

/// Number of periods in the record at the lowest frequency of an identified force, if the channels
/// do not show a constant force. Below this frequency, the unknown mean affects the force.
pub(crate) const SLOWEST_PERIODS: f64 = 2.0;

// Limits for the likelihood of the components.

/// Colours tried: white, random walk, integrated random walk.
pub(crate) const COLOURS: [i32; 3] = [0, 1, 2];

/// Minimum number of components that can carry a force; with fewer, only a white force is tried. If
/// a white force drives fewer components than this number, a coloured force needs the gain
/// [`COLOUR_GAIN`], because the amplitudes of few components may follow a slope by chance.
pub(crate) const COLOUR_COMPONENTS: f64 = 16.0;

/// Minimum gain in log-likelihood of a coloured force over a white force, if the white force drives
/// fewer than [`COLOUR_COMPONENTS`] components; a smaller gain may be chance.
pub(crate) const COLOUR_GAIN: f64 = 6.0;

/// Ratio of successive reaches (numbers of components that may carry a force) in the coarse search,
/// which starts with all components.
pub(crate) const REACH_RATIO: f64 = 0.8;

/// Maximum number of EM rounds; a few dozen are typical.
pub(crate) const EM_ROUNDS: usize = 300;

/// Change of the log-likelihood in one EM round; below it the iteration ends.
pub(crate) const EM_CHANGE: f64 = 1e-3;

/// Maximum difference to the largest log-likelihood; a reach or colour with a larger difference has
/// a negligible weight.
pub(crate) const NEGLIGIBLE_LIKELIHOOD: f64 = 6.0;

/// Prior weight of a white force that reaches all components, relative to the sum of the prior
/// weights of all possible reaches.
pub(crate) const ENDLESS_PRIOR: f64 = 0.25;

/// Maximum number of neighbouring reaches, on each side of the best reach, that are averaged with
/// it. A reach is the number of the strongest components that may carry a force.
pub(crate) const NEIGHBOURING_REACHES: usize = 16;

/// Minimum share of components with a force for the force to count as a band; below it the force
/// consists of single lines. The components without a force then determine where the lines are, and
/// neighbouring reaches are not averaged.
pub(crate) const BAND_SHARE: f64 = 0.5;

/// Minimum number of components with a force for the force to count as a band; below it the force
/// consists of single lines, even if [`BAND_SHARE`] is exceeded.
pub(crate) const BAND_COMPONENTS: f64 = 6.0;

// Regularisation

/// Number of values of λ per decade.
pub(crate) const LAMBDAS_PER_DECADE: usize = 25;

/// Number of decades of λ below the largest singular value.
pub(crate) const LAMBDA_DECADES: usize = 8;

/// Largest ratio of the residual variance to the noise variance at which the corner of the L-curve
/// is searched for.
pub(crate) const CORNER_NOISE_RATIO: f64 = 2.0;

/// Smallest relative change of residual and force for which a step of λ counts as effective.
pub(crate) const LAMBDA_EFFECT: f64 = 1e-3;

/// Minimum ratio of remaining data (data − unknowns) to all data for a threshold of truncation. If
/// the ratio is smaller, the threshold does not count: a few data that are small by chance would
/// look like a perfect fit.
pub(crate) const TRUNCATION_RESIDUAL: f64 = 0.1;

/// Minimum ratio of remaining data (data − unknowns) to all data for a λ of Tikhonov's filter. If
/// the ratio is smaller, the λ does not count: the residual of data without noise would be only
/// rounding, and rounding would determine λ.
pub(crate) const TIKHONOV_RESIDUAL: f64 = 1e-4;

/// Largest relative difference of costs that count as equal.
pub(crate) const EQUAL_COSTS: f64 = 1e-6;

/// Maximum number of Newton steps to the half width of an interval; the iteration converges in far
/// fewer steps.
pub(crate) const HALF_WIDTH_STEPS: usize = 50;

/// Change of a half width, in standard deviations, that ends the search.
pub(crate) const HALF_WIDTH_CHANGE: f64 = 1e-12;

// Transmission and uncertainty

/// Minimum reciprocal condition number of a line or a time step; below it a force counts as not
/// transmitted. A force from a response with 16 digits would then have fewer than four digits.
pub(crate) const NOT_TRANSMITTED: f64 = 1e-12;

/// Largest growth of the free response over the record, as a natural logarithm: a factor of 10⁶.
/// With more growth, the responses to late impulses have too few digits: above 10⁸ the identified
/// force is entirely wrong.
pub(crate) const FREE_GROWTH: f64 = 14.0;

/// Tolerance for rounding at the ends of a band, in line spacings.
pub(crate) const BAND_TOLERANCE: f64 = 1e-9;

/// Change of an entry for a numerical derivative, in standard errors.
pub(crate) const PARAMETER_STEP: f64 = 0.1;

// Whiteness of innovations

/// Number of lags of the whiteness test of the innovations.
pub(crate) const INNOVATION_LAGS: usize = 25;

/// Number of innovations at the beginning of a record that are not tested: they still depend on the
/// unknown initial state.
pub(crate) const INNOVATIONS_SETTLED: usize = 50;

// Limits for forces that act for a part of a record.

/// Number of parts into which a record is divided in the search for quiet parts.
pub(crate) const INTERMITTENT_BLOCKS: usize = 16;

/// Minimum number of consecutive quiet parts that determine the noise: a quarter of the record.
pub(crate) const QUIET_BLOCKS: usize = 4;

/// Minimum probability that the parts of a record with a stationary force differ this much by
/// chance; below it the force counts as not stationary.
pub(crate) const INTERMITTENT_LEVEL: f64 = 0.01;

/// Number of samples, from the first on, that decide whether a record begins at rest. More samples
/// take more time, and do not determine the first state better once its free response has decayed.
pub(crate) const REST_SAMPLES: usize = 1024;
