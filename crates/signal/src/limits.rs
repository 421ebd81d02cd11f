//! Limits of this crate: the numbers that decide what is noise, when to stop and what to accept.

// Clipping

/// Minimum number of equal samples of a clipped run: the peak of a smooth signal has fewer.
pub(crate) const CLIPPED_RUN: usize = 3;

/// Smallest jump, in steps of the converter, at the end of a clipped run. After three equal samples
/// at a smooth peak, the next sample is lower by less than four steps; a clipped signal leaves its
/// limit as fast as it changes.
pub(crate) const CLIPPED_JUMP: f64 = 6.0;

/// Fraction of all samples at an extreme value above which a channel is at rest at this value.
pub(crate) const REST_FRACTION: f64 = 0.5;

/// Fraction of all samples at the two extremes, not counting samples at rest, above which a channel
/// is a two-level signal.
pub(crate) const TWO_LEVEL_FRACTION: f64 = 0.9;

// Excited lines

/// Smallest amplitude of an excited line, relative to the strongest: far above rounding and
/// quantisation, far below any line that is driven on purpose.
pub(crate) const EXCITED_AMPLITUDE: f64 = 1e-3;

/// Ratio of the strongest line to the peak value below which a signal counts as constant and its
/// spectrum as rounding.
pub(crate) const CONSTANT_SIGNAL: f64 = 1e-12;

/// Probability that any undriven line of a record counts as excited.
pub(crate) const EXCITED_LEVEL: f64 = 1e-3;

/// Number of lines on each side of a line; their scatter determines the noise level of this line.
pub(crate) const NOISE_NEIGHBOURS: usize = 16;

/// Minimum number of weak lines that count as the noise of a single period.
pub(crate) const NOISE_LINES: usize = 16;

/// Smallest ratio in amplitude of the excited lines to the noise of a single period: amplitudes of
/// noise have no gap of this size.
pub(crate) const NOISE_GAP: f64 = 3.0;

// Noise above the driven band

/// Number of lines over which the power is averaged for one level of the noise floor.
pub(crate) const FLOOR_LINES: usize = 16;

/// Minimum number of equal levels of a noise floor, counted downwards from half the sampling rate.
pub(crate) const FLOOR_LEVELS: usize = 3;

/// Largest ratio of two levels that count as equal. Its logarithm is four standard
/// deviations of the logarithm of such a ratio in noise.
pub(crate) const FLOOR_RATIO: f64 = 7.0;

/// Standard deviation of the logarithm of a level averaged over 16 lines; under Hann's window,
/// neighbouring lines are correlated.
pub(crate) const FLOOR_SCATTER: f64 = 0.34;

/// Maximum difference between the mean levels of the upper and the lower half of a noise floor, in
/// standard deviations; above it the floor is not flat, and the signal is not only noise.
pub(crate) const FLOOR_DEVIATION: f64 = 4.0;

/// Level, relative to the largest, above which a group of lines counts as driven.
pub(crate) const DRIVEN_LEVEL: f64 = 0.01;

/// Standard deviation of noise, relative to the RMS of the signal, that is too small to affect a
/// parameter and counts as zero.
pub(crate) const NEGLIGIBLE_NOISE: f64 = 1e-5;

// Hits

/// Fraction of the peak of a hit above which the force belongs to the pulse of this hit.
pub(crate) const PULSE_FRACTION: f64 = 0.1;

/// Number of instants per sampling step at which the lobes of a ringing filter are evaluated. With
/// eight, the extreme of a lobe at half the sampling rate is missed by at most 2 %.
pub(crate) const RINGING_STEPS: usize = 8;

/// Number of samples on either side that are used to interpolate a value between samples.
pub(crate) const INTERPOLATION_REACH: usize = 16;

/// Smallest peak of a hit, in standard deviations of the noise: the range of 10⁵ samples of
/// Gaussian noise is 9 standard deviations.
pub(crate) const HIT_OVER_NOISE: f64 = 12.0;

/// Minimum peak of a hit, in steps of the converter; at rest, the force signal changes at random
/// between two levels of the converter.
pub(crate) const HIT_OVER_STEP: f64 = 4.0;

/// Fraction of the largest peak above which a peak counts for the median: there may be many light
/// hits between the good ones.
pub(crate) const MEDIAN_PEAK_FRACTION: f64 = 0.1;

/// Minimum length of a window that ends where the next window begins, relative to the median length
/// of all windows.
pub(crate) const SHORTEST_WINDOW: f64 = 0.25;

/// Smallest force that counts as ringing of a filter, relative to the smallest peak of a hit: four
/// standard deviations of the noise. Weaker ringing counts as noise and is set to zero.
pub(crate) const RINGING_OVER_FLOOR: f64 = 1.0 / 3.0;

/// Maximum distance, in samples, from a pulse or its ringing to the next sample above the noise, if
/// this sample also counts as ringing. Near the zero crossings ringing is weaker than the noise,
/// and every second lobe is negative. A larger number would count slow forces of a swinging hammer
/// as ringing.
pub(crate) const RINGING_GAP: usize = 8;

/// Default number of samples before a pulse, as a multiple of the number of samples in the pulse.
pub(crate) const PRE_TRIGGER: usize = 2;

// Repetition and quantisation

/// Largest mismatch of a periodic signal; the mismatch of a signal with noise of a tenth of its
/// RMS value is smaller.
pub(crate) const PERIODIC_MISMATCH: f64 = 0.125;

/// Largest ratio of the squared mismatches of equally good lags.
pub(crate) const EQUAL_LAGS: f64 = 2.0;

/// Squared mismatch above which a slow signal no longer resembles itself, as a multiple of the
/// square of [`PERIODIC_MISMATCH`]. This multiple is larger than the ratio of the squared
/// mismatches of any two equally good lags.
pub(crate) const SLOW_SIGNAL: f64 = 2.0 * EQUAL_LAGS;

/// Maximum squared mismatch that rounding in the Fourier transforms can cause; smaller differences
/// of squared mismatches count as zero.
pub(crate) const MISMATCH_ROUNDING: f64 = 1e-12;

/// Minimum number of pairs of samples in a fit of growth: with fewer, the two terms of the fit
/// would explain any difference.
pub(crate) const GROWTH_PAIRS: usize = 20;

/// Minimum fraction of the difference between samples one period apart that counts as growth; a
/// smaller fraction may be rounding.
pub(crate) const GROWTH_FRACTION: f64 = 0.01;

/// Number of samples examined for the step of a converter.
pub(crate) const QUANTISATION_SAMPLES: usize = 8192;

/// Minimum number of different values in a channel for which the step of a converter is
/// determined; a signal may have fewer values for other reasons.
pub(crate) const QUANTISATION_LEVELS: usize = 16;

/// Largest deviation of the distance of two values from a whole number of steps, in steps: the
/// rounding of printed digits.
pub(crate) const QUANTISATION_DEVIATION: f64 = 0.05;

// Excitation

/// Largest exponent of a power law; above it a single line has all the power.
pub(crate) const NOISE_EXPONENT: f64 = 10.0;

/// Largest random change of the given phases at the first starting point, as a fraction of 2π.
pub(crate) const PHASE_CHANGE: f64 = 1e-2;

/// Damping of the first step, as a multiple of the mean curvature.
pub(crate) const FIRST_DAMPING: f64 = 1e-2;

/// Maximum number of Newton steps for each exponent of the norm, far more than needed.
pub(crate) const CREST_STEPS: usize = 400;

/// Relative reduction of the norm by two successive steps below which the search at one exponent
/// ends.
pub(crate) const CREST_GAIN: f64 = 1e-5;

/// Maximum damping of a Newton step, as a multiple of the mean curvature. If a step needs more
/// damping, the norm is stationary up to rounding and the search ends.
pub(crate) const LARGEST_DAMPING: f64 = 1e6;

/// Maximum number of lines for which the Hessian is formed and factored. With more lines, only
/// products of the Hessian with vectors are computed. At this number of lines, both methods take
/// the same time.
pub(crate) const DENSE_HESSIAN: usize = 400;

/// Residual, relative to the gradient, below which conjugate gradients stop.
pub(crate) const CG_RESIDUAL: f64 = 0.05;

/// Maximum number of steps of conjugate gradients.
pub(crate) const CG_STEPS: usize = 60;
