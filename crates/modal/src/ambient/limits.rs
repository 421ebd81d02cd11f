//! Numbers that decide in the identification of ambient records.

/// Smallest ζωT for an interval: with fewer decay times in the record the distribution of the
/// estimates is far from normal, and intervals cover less than they state.
pub const MIN_DECAY_TIMES: f64 = 15.0;

/// Highest frequency of the default band, as part of half the sampling rate: filters fold above it.
pub(super) const DEFAULT_BAND_TOP: f64 = 0.8;

/// Lowest line of the default band: below it the mean and slow drifts dominate.
pub(super) const DEFAULT_FIRST_LINE: f64 = 4.0;

/// Number of modes that is not exceeded unless the settings say so.
pub(super) const DEFAULT_MAX_MODES: usize = 12;

/// Smallest number of lines in the band per unknown of one mode; fewer do not determine it.
pub(super) const MIN_LINES_PER_UNKNOWN: usize = 3;

/// RMS value of a channel over that of the strongest, below which the channel is dead: twelve bits
/// of a converter and some margin.
pub(super) const DEAD_CHANNEL: f64 = 1e-7;

/// Orders of the subspace models above twice the number of modes wanted, and their step.
pub(super) const EXTRA_ORDERS: usize = 16;

/// Smallest number of block rows of the Hankel matrix of covariances.
pub(super) const MIN_BLOCK_ROWS: usize = 20;

/// Rate at which a band is resampled for the subspace method, over its upper end.
pub(super) const RESAMPLING: f64 = 2.5;

/// Largest damping ratio of a pole that may be a mode.
pub(super) const MAX_DAMPING: f64 = 0.2;

/// Smallest share of the orders in which an initial mode has a pole.
pub(super) const MIN_SHARE: f64 = 0.3;

/// Lines are pooled over this part of the distance to the nearest pole, over which the mean of the
/// spectrum is that of its middle to 0.25 %.
pub(super) const POOLING: f64 = 0.1;

/// The same where starts are compared.
pub(super) const COARSE_POOLING: f64 = 0.3;

/// Largest mean part of the power of a line that is leakage of the open record, for an interval. Leakage at all
/// lines comes from the states at the two ends: the likelihood takes it for independent, and intervals cover
/// less than they state. Displacements reach it, whose tails fall faster than leakage.
pub const MAX_LEAKAGE: f64 = 0.07;

/// Number of Chebyshev polynomials of the logarithm of a sensor's noise over the band.
pub(super) const NOISE_TERMS: usize = 3;

/// Number of neighbours on either side with whose force that of a mode may be correlated.
pub(super) const CORRELATED_NEIGHBOURS: usize = 4;

/// Gain of the logarithm of the likelihood by a step at which a search ends: it moves the
/// parameters by less than a twentieth of their standard errors.
pub(super) const ENOUGH: f64 = 1e-3;

/// Largest step of the logarithm of a damping ratio or of another unknown of unit scale.
pub(super) const LARGEST_STEP: f64 = 0.7;

/// Refused candidates after which the search for further modes ends.
pub(super) const REFUSALS: usize = 2;

/// Smallest damping ratio over its standard error of a mode.
pub(super) const DAMPING_SIGNIFICANCE: f64 = 2.0;

/// Probability of a false harmonic in a record.
pub(super) const HARMONIC_LEVEL: f64 = 1e-3;

/// Number of sine tapers of the test of harmonics: they resolve as many half lines.
pub(super) const TAPERS: usize = 7;

/// Lines on either side of an excluded harmonic that are left out: what the subtraction of the sine
/// leaves.
pub(super) const EXCLUDED_LINES: f64 = 2.0;

/// Part of a channel that another does not explain, below which the two are copies.
pub(super) const COPIED_CHANNEL: f64 = 1e-10;

/// Wald statistic of a shape over the price of a mode above which the mode needs no further test.
pub(super) const STRONG_EVIDENCE: f64 = 4.0;

/// Number of poles beside the modes that may explain harmonics, a background or modes outside the
/// band.
pub(super) const NUISANCE_POLES: usize = 4;
