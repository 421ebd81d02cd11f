//! Limits of the identification of ambient records.

/// Number of operations, for a limit of the work, for each line in addition to its products.
pub(super) const LINE_OPERATIONS: f64 = 500.0;

/// Number of operations, for a limit of the work, for each line and mode: complex exponentials and
/// divisions.
pub(super) const MODE_OPERATIONS: f64 = 300.0;

/// Number of operations, for a limit of the work, for each multiplication in a product of complex
/// matrices.
pub(super) const PRODUCT_OPERATIONS: f64 = 10.0;

/// Number of operations, for a limit of the work, for each line and each entry of the Fisher
/// information.
pub(super) const ENTRY_OPERATIONS: f64 = 2.0;

/// Smallest ζωT for an interval: with fewer decay times in the record the distribution of the
/// estimates is far from normal, and intervals contain the true value less often than their level
/// states.
pub const MIN_DECAY_TIMES: f64 = 15.0;

/// Highest frequency of the default band, as a share of half the sampling rate: above it the
/// response is distorted by filter and aliasing.
pub(super) const DEFAULT_BAND_TOP: f64 = 0.8;

/// Lowest line of the default band: below it drift dominates.
pub(super) const DEFAULT_FIRST_LINE: f64 = 4.0;

/// Default maximum number of modes.
pub(super) const DEFAULT_MAX_MODES: usize = 12;

/// Smallest number of lines in the band per unknown of one mode; fewer lines do not determine the
/// mode.
pub(super) const MIN_LINES_PER_UNKNOWN: usize = 3;

/// Minimum ratio of the RMS value of a channel to the RMS value of the strongest channel; a channel
/// below it counts as dead. The limit is far below the resolution of a twelve-bit converter.
pub(super) const DEAD_CHANNEL: f64 = 1e-7;

/// Number of additional orders of the subspace models: the orders go up to twice the requested
/// number of modes plus this number.
pub(super) const EXTRA_ORDERS: usize = 16;

/// Smallest number of block rows of the Hankel matrix of covariances.
pub(super) const MIN_BLOCK_ROWS: usize = 20;

/// Sampling rate for the subspace method, as a multiple of the upper end of the band.
pub(super) const RESAMPLING: f64 = 2.5;

/// Largest damping ratio of a pole that may be a mode.
pub(super) const MAX_DAMPING: f64 = 0.2;

/// Minimum fraction of the model orders in which a pole must appear to become an initial mode.
pub(super) const MIN_SHARE: f64 = 0.3;

/// Width of pooled lines, as a share of the distance to the nearest pole: with this width the mean
/// spectrum differs from the spectrum at the centre by at most 0.25 %.
pub(super) const POOLING: f64 = 0.1;

/// Maximum difference between the mean spectrum of pooled lines and the spectrum at their centre,
/// relative to that spectrum in each direction of the outputs; a group with a larger difference is
/// divided.
pub(super) const MAX_POOLING_CHANGE: f64 = 0.01;

/// Width of pooled lines for the comparison of initial estimates and for the information of a step,
/// as a share of the distance to the nearest pole.
pub(super) const COARSE_POOLING: f64 = 0.3;

/// Number of Chebyshev polynomials that describe the logarithm of the noise variance of a sensor
/// over the band while the modes are chosen.
pub(super) const NOISE_TERMS: usize = 3;

/// Number of polynomials of the noise that are tried at a time: an even and an odd one.
pub(super) const NOISE_TERMS_ADDED: usize = 2;

/// Maximum number of polynomials of the noise; Akaike's criterion chooses the number.
pub(super) const MOST_NOISE_TERMS: usize = 15;

/// Gain in log-likelihood of a step below which a search ends: a step with a smaller gain moves the
/// parameters by less than a twentieth of their standard errors.
pub(super) const MIN_GAIN: f64 = 1e-3;

/// Largest step of the logarithm of a damping ratio or of another unknown of unit scale.
pub(super) const LARGEST_STEP: f64 = 0.7;

/// Minimum eigenvalue of the information (scaled to a unit diagonal): combinations of parameters
/// below it are undetermined.
pub(super) const DETERMINED_SHARE: f64 = 1e-8;

/// Maximum bias of ln ω or ln ζ that is subtracted, in standard errors. A larger bias is not
/// subtracted, because the first-order formula is then unreliable.
pub(super) const MAX_BIAS: f64 = 1.0;

/// Maximum number of alternations between a fit of the parameters and a prediction of the
/// transient.
pub(super) const TRANSIENT_ROUNDS: usize = 6;

/// Maximum number of candidates without success: the search for further modes ends when this number
/// of candidates were refused, or added a pole that is not a mode.
pub(super) const REFUSALS: usize = 2;

/// Minimum ratio of the damping of a mode to its standard error; below it the damping is
/// undetermined.
pub(super) const DAMPING_SIGNIFICANCE: f64 = 2.0;

/// Probability of a false harmonic in a record.
pub(super) const HARMONIC_LEVEL: f64 = 1e-3;

/// Number of sine tapers in the test for harmonics; the resolution, in lines, is half of this
/// number.
pub(super) const TAPERS: usize = 7;

/// Number of lines excluded on either side of a harmonic: the subtraction of the sinusoid is not
/// exact on these lines.
pub(super) const EXCLUDED_LINES: f64 = 2.0;

/// Minimum share of a channel's power that another channel does not explain; below it the two
/// channels count as copies.
pub(super) const COPIED_CHANNEL: f64 = 1e-10;

/// Minimum ratio of the Wald statistic of a shape to the penalty of a mode; with a larger ratio the
/// mode is accepted without a further test.
pub(super) const STRONG_EVIDENCE: f64 = 4.0;

/// Maximum number of additional poles for harmonics, a background or modes outside the band.
pub(super) const NUISANCE_POLES: usize = 4;

/// Minimum number of squared amplitudes in a group of lines whose power is compared with the fitted
/// spectrum. Even with far fewer amplitudes, the cube root of a power has nearly a normal
/// distribution.
pub(super) const MISFIT_GROUP: f64 = 100.0;
