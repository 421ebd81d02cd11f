//! Limits that decide something in this crate, each with what happens on either side.

/// Largest order that is tried.
pub(crate) const MOST_ORDER: usize = 20;

/// Samples that each order needs.
pub(crate) const SAMPLES_PER_ORDER: usize = 20;

/// Lags over which a residual is tested for being white.
pub(crate) const ESTIMATE_LAGS: usize = 20;

/// Number of samples over that of the first ones, which are compared with the others.
pub(crate) const ONSET_SHARE: usize = 50;

/// Least number of first samples.
pub(crate) const LEAST_ONSET: usize = 10;

/// Rows made at a time.
pub(crate) const POLE_CHUNK: usize = 4096;

/// Steps of a search.
pub(crate) const MAX_STEPS: usize = 50;

/// Decrease of minus twice the log likelihood that ends the last search …
pub(crate) const FINE: f64 = 1e-7;

/// … and one of those that compare numbers of modes.
pub(crate) const COARSE: f64 = 1e-2;

/// Damping at which no descent is to be had.
pub(crate) const MAX_DAMPING: f64 = 1e8;

/// Residual over the RMS of a channel below which it is rounding.
pub(crate) const POLE_ROUNDING: f64 = 1e-12;

/// Largest number of modes that are fitted.
pub(crate) const MOST_MODES: usize = 40;

/// Samples that each of the poles needs.
pub(crate) const SAMPLES_PER_MODE: usize = 12;

/// Largest number of samples that are fitted.
pub(crate) const MOST_SAMPLES: usize = 1 << 18;

/// Standard errors by which a growth rate above zero is no scatter.
pub(crate) const FREE_DECAY_SURE: f64 = 4.0;

/// Growth over the record from which on a mode is written from its end backwards.
pub(crate) const FROM_THE_END: f64 = 3.0;

/// Samples after which an exponential is computed afresh, not from the sample before.
pub(crate) const POLE_AFRESH: usize = 32;

/// Fastest decay, in nepers per sample.
pub(crate) const FASTEST_DECAY: f64 = 1.5;

/// Largest growth over a record, in nepers.
pub(crate) const MOST_GROWTH: f64 = 30.0;

/// Largest damping ratio.
pub(crate) const MOST_DAMPING: f64 = 0.9;

/// Highest frequency over half the sampling rate.
pub(crate) const POLE_HIGHEST: f64 = 0.98;

/// Probability that noise alone gains as much as a further decay must.
pub(crate) const FALSE_DECAY: f64 = 1e-3;

/// Numbers of decays that may gain nothing before the search for more ends.
pub(crate) const SELECTION_PATIENCE: usize = 2;

/// Rounds in which the colour of the noise and the poles follow one another.
pub(crate) const COLOUR_ROUNDS: usize = 3;

/// Rows of the Hankel matrix, whatever the number of samples.
pub(crate) const HANKEL_ROWS: usize = 160;

/// Share of the power that may lie above half the rate at which the Hankel matrix is read.
pub(crate) const INITIAL_ALIASED: f64 = 0.01;

/// Decays over the record that a peak is looked for with, in nepers; each is that much faster than the
/// last.
pub(crate) const FIRST_DECAY: f64 = 2.0;
pub(crate) const INITIAL_FASTER: f64 = 3.0;

/// Growth over the record that a peak is looked for with, in nepers.
pub(crate) const INITIAL_GROWTH: f64 = 6.0;

/// Lowest and highest order of the polynomials of a backbone: the lowest has linear and quadratic damping; beyond the
/// highest, terms are not told apart over the range of one decay.
pub(crate) const LOWEST_ORDER: usize = 2;
pub(crate) const HIGHEST_ORDER: usize = 6;

/// Gauss–Newton steps of a backbone at most.
pub(crate) const BACKBONE_STEPS: usize = 20;

/// Number of amplitudes at which a backbone is reported.
pub(crate) const BACKBONE_POINTS: usize = 8;

/// Distance from the strongest mode, over its frequency, within which modes may stand for it: harmonics lie beyond.
pub(crate) const NEIGHBOURHOOD: f64 = 0.5;

/// Amplitude over the first below which the first estimate of a backbone takes no value: there the noise decides.
pub(crate) const SMALLEST_AMPLITUDE: f64 = 1e-3;

/// Nepers over the record that a return without oscillation has at least: less is a drift.
pub(crate) const SLOWEST_RETURN: f64 = 1.0;

/// Rounds in which the rates of a return without oscillation are refined, each by as much or half as much as the last.
pub(crate) const RATE_REFINEMENTS: usize = 40;

/// Number of places of the record at which a second excitation is looked for, and again near the best one.
pub(crate) const RESTART_PLACES: usize = 64;

/// Decrease of the Bayesian information criterion from which a backbone takes the place of linear modes: very strong
/// evidence after Kass & Raftery (1995), Journal of the American Statistical Association 90, 773–795. Close modes of one
/// channel can be as well described by either.
pub(crate) const STRONG_EVIDENCE: f64 = 10.0;
