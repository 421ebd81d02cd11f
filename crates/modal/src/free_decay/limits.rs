//! Limits of the identification of free decays, each with the effect of values on either side.

/// Maximum order of an autoregression.
pub(crate) const MOST_ORDER: usize = 20;

/// Minimum number of samples per order of an autoregression.
pub(crate) const SAMPLES_PER_ORDER: usize = 20;

/// Number of lags in the whiteness test of a residual.
pub(crate) const ESTIMATE_LAGS: usize = 20;

/// Ratio of the length of a record to the length of its onset. The residual of the onset is
/// compared with that of the other samples.
pub(crate) const ONSET_SHARE: usize = 50;

/// Minimum number of samples of the onset, the first part of a record.
pub(crate) const LEAST_ONSET: usize = 10;

/// Number of rows of a block of columns; it limits the memory.
pub(crate) const POLE_CHUNK: usize = 4096;

/// Number of rows of a free decay that one thread reduces; it is fixed, so that the results do not
/// depend on the number of threads.
pub(crate) const POLE_SEGMENT: usize = 4 * POLE_CHUNK;

/// Decay, in nepers, after which a mode has no columns: its amplitude is then 10⁻¹⁵ of its first
/// amplitude, less than the rounding of a fit. A smaller limit would lose information, a larger one
/// would cost time.
pub(crate) const DEAD: f64 = 35.0;

/// Number of operations, for a limit of the work, for each sample and product of two columns.
pub(crate) const PRODUCT_OPERATIONS: f64 = 0.5;

/// Maximum number of steps of a search.
pub(crate) const MAX_STEPS: usize = 50;

/// Minimum decrease of minus twice the log-likelihood in one step of the last search; below it the
/// search ends.
pub(crate) const FINE: f64 = 1e-7;

/// Minimum decrease of minus twice the log-likelihood in one step of a search that compares numbers
/// of modes; below it the search ends.
pub(crate) const COARSE: f64 = 1e-2;

/// Maximum Levenberg–Marquardt damping of a step; above it the search ends, because no step lowers
/// the cost.
pub(crate) const MAX_DAMPING: f64 = 1e8;

/// Maximum residual, relative to the RMS of a channel, that counts as rounding.
pub(crate) const POLE_ROUNDING: f64 = 1e-12;

/// Maximum number of modes of a free decay.
pub(crate) const MOST_MODES: usize = 40;

/// Minimum number of samples of a free decay per mode.
pub(crate) const SAMPLES_PER_MODE: usize = 12;

/// Maximum number of samples of a free decay.
pub(crate) const MOST_SAMPLES: usize = 1 << 18;

/// Minimum ratio of a growth rate to its standard error; below it the growth counts as scatter.
pub(crate) const FREE_DECAY_SURE: f64 = 4.0;

/// Growth over the record, in nepers, above which the amplitude of a mode refers to the last
/// sample. This avoids an overflow.
pub(crate) const FROM_THE_END: f64 = 3.0;

/// Number of samples after which an exponential is computed directly instead of from the preceding
/// sample. This limits rounding errors.
pub(crate) const POLE_AFRESH: usize = 32;

/// Fastest decay of a mode, in nepers per sample.
pub(crate) const FASTEST_DECAY: f64 = 1.5;

/// Largest growth of a mode over a record, in nepers.
pub(crate) const MOST_GROWTH: f64 = 30.0;

/// Largest damping ratio of a mode of a free decay.
pub(crate) const MOST_DAMPING: f64 = 0.9;

/// Highest frequency of a mode, relative to half the sampling rate.
pub(crate) const POLE_HIGHEST: f64 = 0.98;

/// Probability that noise alone reaches the gain that is required for a further decay, or the
/// prediction error that is required for a second excitation.
pub(crate) const FALSE_DECAY: f64 = 1e-3;

/// Number of successive decays without sufficient gain after which the search for further decays
/// ends.
pub(crate) const SELECTION_PATIENCE: usize = 2;

/// Maximum number of rounds that alternate between the noise colour and the poles.
pub(crate) const COLOUR_ROUNDS: usize = 3;

/// Maximum number of rows of the Hankel matrix, for any number of samples.
pub(crate) const HANKEL_ROWS: usize = 160;

/// Maximum fraction of the power of the record that is above half the sampling rate after the
/// decimation for the Hankel matrix.
pub(crate) const INITIAL_ALIASED: f64 = 0.01;

/// Decay of the slowest matched filter over the record, in nepers.
pub(crate) const FIRST_DECAY: f64 = 2.0;

/// Ratio of the decay of a matched filter to that of the preceding filter.
pub(crate) const INITIAL_FASTER: f64 = 3.0;

/// Growth over the record, in nepers, of the matched filter for a growing response.
pub(crate) const INITIAL_GROWTH: f64 = 6.0;

/// Lowest order of the polynomials of a backbone: linear and quadratic damping.
pub(crate) const LOWEST_ORDER: usize = 2;

/// Highest order of the polynomials of a backbone; above it, the amplitude range of one decay does
/// not determine the terms.
pub(crate) const HIGHEST_ORDER: usize = 6;

/// Maximum number of Gauss–Newton steps of a backbone.
pub(crate) const BACKBONE_STEPS: usize = 20;

/// Number of amplitudes at which a backbone is reported.
pub(crate) const BACKBONE_POINTS: usize = 8;

/// Relative distance from the frequency of the strongest mode within which other linear modes may
/// represent the same nonlinear mode; its harmonics are farther away.
pub(crate) const NEIGHBOURHOOD: f64 = 0.5;

/// Minimum amplitude of the data for the initial estimate of a backbone, relative to the first
/// amplitude; below it noise dominates.
pub(crate) const SMALLEST_AMPLITUDE: f64 = 1e-3;

/// Minimum decay over the record, in nepers, of a response that does not oscillate; a slower change
/// counts as drift.
pub(crate) const SLOWEST_RETURN: f64 = 1.0;

/// Number of refinements of the rates of decays without oscillation; the size of each step is the
/// size of the preceding step or half of it.
pub(crate) const RATE_REFINEMENTS: usize = 40;

/// Number of samples at which a second excitation is tested: once over the whole record, and once
/// near the best of these samples.
pub(crate) const RESTART_SAMPLES: usize = 64;

/// Minimum decrease of the Bayesian information criterion at which a backbone replaces linear
/// modes: very strong evidence according to Kass & Raftery (1995), Journal of the American
/// Statistical Association 90, 773–795. Below the limit a backbone may describe close linear modes
/// in one channel equally well.
pub(crate) const STRONG_EVIDENCE: f64 = 10.0;
