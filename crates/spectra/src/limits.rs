//! Limits of this crate: what counts as noise, rounding or excitation, and when a search ends.

/// Maximum noise-to-signal ratio (RMS) that counts as rounding.
pub(crate) const SCATTER_ROUNDING: f64 = 1e-10;

/// Maximum amplitude of a force channel that may be unexcited, relative to the strongest force;
/// stronger channels always count as forces.
pub(crate) const AVERAGE_IDLE: f64 = 0.1;

/// Maximum mean of −ln p over lines and channels that counts as no coherence; p is the probability
/// of a coherence at least as large as observed if there is no signal. The expected mean is then 1.
pub(crate) const MEAN_EVIDENCE: f64 = 3.0;

/// Maximum difference between the largest of several values −ln p and the logarithm of the number
/// of values; a larger difference shows coherence. Without coherence, the probability of a larger
/// difference is 10⁻³.
pub(crate) const LARGEST_EVIDENCE: f64 = 6.9;

/// Maximum power of a line that may be unexcited, relative to the strongest line of the same force.
pub(crate) const AVERAGE_WEAK: f64 = 0.01;

/// Number of neighbouring lines over which the evidence for coherence is averaged: over this number
/// of lines, without a signal, the mean of −ln p exceeds [`MEAN_EVIDENCE`] in one of 20,000 cases.
pub(crate) const AVERAGE_STRETCH: usize = 8;

/// Half the width, in lines, of the peak into which a window spreads one line.
pub(crate) const AVERAGE_PEAK: usize = 2;

/// Minimum ratio of the eigenvalues of a scaled force cross-spectrum; below it the forces are
/// dependent.
pub(crate) const FORCE_TOLERANCE: f64 = 1e-10;

/// Maximum probability that noise causes the observed coherence between two forces on interleaved
/// lines, at which the coherence counts as crosstalk. Above it the coherence is attributed to noise
/// of the channel.
pub(crate) const INTERLEAVED_CHANCE: f64 = 1e-4;

/// Maximum amplitude of a force that counts as rounding, relative to the force that excites the
/// lines.
pub(crate) const INTERLEAVED_ROUNDING: f64 = 1e-9;

/// Number of iterations that subtract the responses to the other forces: each iteration multiplies
/// what remains of these responses by the ratio of these forces to the force that excites the
/// lines.
pub(crate) const INTERLEAVED_ROUNDS: usize = 8;

/// Minimum of 1 − γ²: rounding of the sums limits the accuracy of a coherence.
pub(crate) const COHERENCE_ROUNDING: f64 = 1e-14;

/// Minimum number of complex deviations for a variance, if neighbouring lines can be pooled. With
/// fewer deviations, the uncertain weights increase the scatter of the estimate by more than a
/// tenth.
pub(crate) const SCATTER_DEVIATIONS: f64 = 20.0;

/// Minimum number of averages, minus the number of forces, for weights from single lines. Below it,
/// the variances of tabulated responses over whole periods are pooled over neighbouring lines, too.
pub(crate) const SCATTER_FEW: f64 = 8.0;

/// Maximum correlation of two lines that count as independent.
pub(crate) const SEGMENT_INDEPENDENT: f64 = 0.01;

/// Maximum distance, in lines, at which correlations are computed; windows do not spread a line
/// farther.
pub(crate) const FARTHEST_LINES: usize = 16;

/// Resolution of the window correction, in fractions of a line: fine enough to resolve responses
/// that last three segments.
pub(crate) const SMOOTHING_STEPS: usize = 4;

/// Number of lines to either side over which a window smooths.
pub(crate) const SMOOTHED_LINES: usize = 6;

/// Maximum amplitude of a line that counts as rounding, relative to the largest sample.
pub(crate) const LINE_ROUNDING: f64 = 1e-12;

/// Maximum number of consecutive periods whose spectrum is taken as the spectrum of one record.
pub(crate) const MAX_PERIODS: usize = 16;

/// Minimum number of consecutive periods whose spectrum is taken as the spectrum of one record. Two
/// periods have only one line between two lines of a period, and it is equally far from both lines.
pub(crate) const MIN_PERIODS: usize = 3;

/// Maximum number of buffered samples over all channels: 8 MB.
pub(crate) const MAX_BUFFERED: usize = 1 << 20;

/// Maximum number of Fisher scoring steps for the level of white noise; a few are usually enough.
pub(crate) const LEVEL_ROUNDS: usize = 60;

/// Relative change of the variance of white noise below which the search for its level ends.
pub(crate) const LEVEL_SETTLED: f64 = 1e-6;

/// Minimum variance of white noise relative to the mean power of the residual: a channel without
/// noise must not have all the weight.
pub(crate) const LEVEL_LEAST: f64 = 1e-12;

/// Minimum difference between the number of complex deviations of a covariance and the number of
/// channels, if the pooling is chosen automatically.
pub(crate) const POOLING_SPARE: f64 = 6.0;

/// Minimum advantage of a mean over lines relative to a smooth spectrum: difference in the
/// log-likelihood of new data of the same size. Below it the smooth spectrum is chosen.
pub(crate) const POOLING_MARGIN: f64 = 4.0;

/// Maximum order of the polynomial of a smooth noise spectrum: log power over log frequency.
pub(crate) const MAX_ORDER: usize = 6;

/// Maximum number of lines on which the form of a spectrum is searched; with more lines, neighbours
/// are averaged, because the search tries hundreds of forms.
pub(crate) const SMOOTH_SEARCHED: usize = 4096;

/// Minimum number of lines per order of the polynomial of a smooth noise spectrum.
pub(crate) const LINES_PER_ORDER: usize = 8;

/// Maximum number of bumps on a smooth spectrum.
pub(crate) const MAX_BUMPS: usize = 24;

/// Minimum norm of the component of a bump that is orthogonal to the polynomial and the other
/// bumps, relative to the norm of the bump; a smaller component is rounding.
pub(crate) const BUMP_REMAINDER: f64 = 1e-8;

/// Minimum number of complex deviations for a noise level that is lower than on the neighbouring
/// lines. With fewer deviations, some lines may have a low level by chance, and these lines would
/// have all the weight.
pub(crate) const QUIET_DEVIATIONS: f64 = 12.0;

/// Maximum leverage of a line (per complex deviation of its sample, without the leverage of bumps)
/// at which the polynomial of a noise spectrum is used unchanged. Above it, the level of the line
/// is at least that of the polynomial of the next lower order, because only a few lines determine
/// the polynomial at the ends of a band.
pub(crate) const END_LEVERAGE: f64 = 0.25;

/// Number of operations for each line and channel of the choice of a smooth noise spectrum; it
/// counts for a limit of the work.
pub(crate) const SMOOTH_OPERATIONS: f64 = 40_000.0;

/// Maximum number of steps of the search for the log power of a smooth noise spectrum.
pub(crate) const SMOOTH_STEPS: usize = 200;

/// Maximum length of a step that uses the Hessian of an earlier step, relative to the preceding
/// step, in the search for the log power of a smooth noise spectrum. A longer step is computed
/// again with a new Hessian.
pub(crate) const HESSIAN_REUSED: f64 = 0.25;

/// Change of the log power (RMS) below which the search for the final fit ends.
pub(crate) const SMOOTH_TOLERANCE: f64 = 1e-9;

/// Change of the log power (RMS) below which the search ends while forms are compared; the error of
/// the log-likelihood is the square of this change.
pub(crate) const SMOOTH_COMPARED: f64 = 1e-4;

/// Smallest initial power of a smooth noise spectrum, relative to the mean over the lines.
pub(crate) const SMOOTH_FLOOR: f64 = 1e-9;

/// Initial power of a resonance peak on a noise spectrum, relative to the floor.
pub(crate) const BUMP_PEAK: f64 = 100.0;

/// Ratio of successive widths of a peak that are tried.
pub(crate) const BUMP_WIDER: f64 = 1.3;

/// Ratio of successive powers of a peak, relative to the floor, that are tried with unchanged
/// flanks.
pub(crate) const BUMP_HIGHER: f64 = 3.0;

/// Distance from the middle of a resonance peak at which the peak is truncated, relative to the
/// distance at which the power of the peak equals the power of the floor.
pub(crate) const PEAK_REACH: f64 = 10.0;

/// Width of the groups of lines that the search for a bump represents by their mean level, relative
/// to the larger of two lengths: the distance of the group from the middle of the bump, and the
/// half-width of the bump.
pub(crate) const BUMP_GROUP: f64 = 0.03125;

/// Number of flat bumps with the largest gains, each of a different width, around which other
/// shapes are tried.
pub(crate) const BEST_WIDTHS: usize = 6;

/// Maximum number of rounds in which a bump is varied.
pub(crate) const BUMP_VARIATIONS: usize = 12;

/// Maximum number of steps of the search for the height of a bump.
pub(crate) const HEIGHT_STEPS: usize = 10;

/// Change of the height of a bump below which the search ends; the error of the gain is of the
/// order of the cube of this change.
pub(crate) const HEIGHT_TOLERANCE: f64 = 1e-2;

/// Maximum height of a bump, as the logarithm of the power.
pub(crate) const BUMP_HIGHEST: f64 = 30.0;

/// Maximum RMS difference between the periods of a force and their mean, relative to the mean, at
/// which the force counts as exactly repeated.
pub(crate) const PERIODS_REPEATS: f64 = 1e-12;

/// Number of terms of the Fourier series of the rounding error, which is a sawtooth.
pub(crate) const PERIODS_TERMS: i32 = 64;

/// Number of bisections in the search for the noise level of quantised samples.
pub(crate) const PERIODS_HALVINGS: usize = 50;

/// Minimum power of a line under Hann's window, relative to the level around it, at which a
/// sinusoid is searched for. Noise exceeds this ratio on one of 10⁷ lines if the level comes from
/// 20 independent lines.
pub(crate) const SINUSOID_CONSPICUOUS: f64 = 30.0;

/// Number of lines on either side of a line whose median power determines the level around this
/// line.
pub(crate) const SINUSOID_AROUND: usize = 24;

/// Number of nearest lines on either side of a line that are excluded from the median around this
/// line.
pub(crate) const SINUSOID_NEXT: usize = 3;

/// Minimum number of lines that determine the level around a line.
pub(crate) const SINUSOID_FEWEST: usize = 16;

/// Number of lines on either side to which a sinusoid is fitted; under Hann's window the sinusoid
/// is negligible on other lines.
pub(crate) const SINUSOID_FITTED: usize = 4;

/// Number of lines on either side of a peak over which a sinusoid must explain the power above the
/// level.
pub(crate) const SINUSOID_CHECKED_LINES: usize = 8;

/// Maximum fraction of the power above the level that a sinusoid may leave unexplained. A band of
/// noise, or a sinusoid of changing frequency, exceeds this fraction.
pub(crate) const SINUSOID_LEFT: f64 = 0.25;

/// Minimum power of further sinusoids of one search relative to the strongest one: the residual of
/// a strong sinusoid near a resonance may look like a weak sinusoid.
pub(crate) const SINUSOID_BESIDE: f64 = 0.1;

/// Maximum number of sinusoids in a record.
pub(crate) const SINUSOID_MOST: usize = 16;

/// Maximum number of candidate lines in the search for sinusoids.
pub(crate) const MAX_CANDIDATES: usize = 96;

/// Number of frequencies per line at which receptances are averaged for the level around a line.
pub(crate) const GAINS_PER_LINE: usize = 16;

/// Number of rounds in which each sinusoid is fitted again after all other sinusoids have been
/// subtracted.
pub(crate) const SINUSOID_ROUNDS: usize = 2;

/// Number of frequencies of a sinusoid that are tried between the two lines next to its peak.
pub(crate) const SINUSOID_FREQUENCIES: usize = 20;

/// Number of golden-section steps in the search for the frequency of a sinusoid.
pub(crate) const SINUSOID_SECTIONS: usize = 40;

/// Maximum number of samples of a pulse whose noise is decomposed into patterns together; a longer
/// pulse is divided.
pub(crate) const PULSE_SAMPLES: usize = 256;

/// Minimum power of a pattern of the noise of a pulse on the lines, relative to the strongest
/// pattern; weaker patterns have their power outside the band.
pub(crate) const PULSE_PATTERN: f64 = 1e-4;
