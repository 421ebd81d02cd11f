//! Limits that decide something in this crate, each with what happens on either side.

/// Noise relative to the signal (RMS), below which it is rounding.
pub(crate) const SCATTER_ROUNDING: f64 = 1e-10;

/// Amplitude of a force over that of the strongest, below which its channel may be idle.
pub(crate) const AVERAGE_IDLE: f64 = 0.1;

/// Mean of −ln p over lines and channels up to which nothing shows; of no signal it is 1.
pub(crate) const MEAN_EVIDENCE: f64 = 3.0;

/// Largest −ln p, beyond the logarithm of their number, up to which nothing shows: a probability of 10⁻³.
pub(crate) const LARGEST_EVIDENCE: f64 = 6.9;

/// Power of a force over that of its strongest line, below which a line may be undriven.
pub(crate) const AVERAGE_WEAK: f64 = 0.01;

/// Number of neighbouring lines by which it is told whether anything shows: of so many the mean of −ln p stays
/// below [`MEAN_EVIDENCE`] in all but one of 10⁵ cases where nothing does.
pub(crate) const AVERAGE_STRETCH: usize = 8;

/// Half the width, in lines, of the peak that a window makes of one line.
pub(crate) const AVERAGE_PEAK: usize = 2;

/// Scaled force cross-spectra with eigenvalues further apart than this determine nothing.
pub(crate) const FORCE_TOLERANCE: f64 = 1e-10;

/// Probability that noise of a channel has so much in common with the force of the lines.
pub(crate) const INTERLEAVED_CHANCE: f64 = 1e-4;

/// Amplitude of a force over that of the one that drives the lines, below which it is rounding.
pub(crate) const INTERLEAVED_ROUNDING: f64 = 1e-9;

/// Rounds in which the parts of the others are taken off: each leaves of them as much as they are of the whole.
pub(crate) const INTERLEAVED_ROUNDS: usize = 8;

/// No coherence is known closer to 1 than this: the rounding of the sums behind it.
pub(crate) const COHERENCE_ROUNDING: f64 = 1e-14;

/// Complex deviations that a variance is made of at least where neighbouring lines can lend theirs: weights of
/// fewer cost more than a tenth of the scatter.
pub(crate) const SCATTER_DEVIATIONS: f64 = 20.0;

/// Deviations of a line of periods below which it is not weighted by itself: of a table nothing else would tell.
pub(crate) const SCATTER_FEW: f64 = 8.0;

/// Lines less correlated than this count as independent.
pub(crate) const SEGMENT_INDEPENDENT: f64 = 0.01;

/// Lines further apart than this are not looked at: no window ties them together.
pub(crate) const FARTHEST_LINES: usize = 16;

/// Steps of a line by which a response is smoothed: that to a force three segments ago is still told from others.
pub(crate) const SMOOTHING_STEPS: usize = 4;

/// Lines to either side over which a window smooths.
pub(crate) const SMOOTHED_LINES: usize = 6;

/// Lines below this part of the largest sample are rounding.
pub(crate) const LINE_ROUNDING: f64 = 1e-12;

/// Maximum number of periods in a row that are taken as one.
pub(crate) const MAX_PERIODS: usize = 16;

/// Minimum number: of two the only line between is as near to the next line of a period.
pub(crate) const MIN_PERIODS: usize = 3;

/// Maximum number of samples, of all channels, that are held: 8 MB.
pub(crate) const MAX_HELD: usize = 1 << 20;

/// Rounds of scoring; it converges in a few.
pub(crate) const LEVEL_ROUNDS: usize = 60;

/// Relative change of the variance at which the search ends.
pub(crate) const LEVEL_SETTLED: f64 = 1e-6;

/// Least variance, relative to the mean power of the residual: a channel without any noise of its own must not
/// take all the weight.
pub(crate) const LEVEL_LEAST: f64 = 1e-12;

/// Complex deviations, beyond the channels, that a covariance is made of at least where the choice is free.
pub(crate) const POOLING_SPARE: f64 = 6.0;

/// Advantage in the log likelihood of new data, per complex deviation of all, by which a mean over lines has
/// to predict better than a smooth spectrum.
pub(crate) const POOLING_MARGIN: f64 = 4.0;

/// Highest order of log power in log frequency.
pub(crate) const MAX_ORDER: usize = 6;

/// Lines among which a form is searched; of more, neighbours are taken together, for the search tries hundreds of forms.
pub(crate) const SMOOTH_SEARCHED: usize = 4096;

/// Minimum number of lines per order.
pub(crate) const LINES_PER_ORDER: usize = 8;

/// Maximum number of bumps.
pub(crate) const MAX_BUMPS: usize = 24;

/// Complex deviations that a level below those beside it is made of at least: few lines may be quiet by
/// chance, and would then have all the weight.
pub(crate) const QUIET_DEVIATIONS: f64 = 12.0;

/// Largest leverage of a line, over the complex deviations of its sample and without that of bumps, with which a
/// polynomial is trusted to be lower there than one of a lower order: at the ends of the band few lines decide.
pub(crate) const END_LEVERAGE: f64 = 0.25;

/// Steps of the search for the log power.
pub(crate) const SMOOTH_STEPS: usize = 200;

/// Change of the log power (RMS) below which it is found, and while forms are compared: what that misses of the
/// likelihood is its square.
pub(crate) const SMOOTH_TOLERANCE: f64 = 1e-9;
pub(crate) const SMOOTH_COMPARED: f64 = 1e-4;

/// Smallest power, relative to the mean over the lines, at which the search starts.
pub(crate) const SMOOTH_FLOOR: f64 = 1e-9;

/// Power of a peak over the floor that is tried first.
pub(crate) const BUMP_PEAK: f64 = 100.0;

/// Factor by which the width of a peak is varied.
pub(crate) const BUMP_WIDER: f64 = 1.3;

/// Factor by which the power of a peak over the floor is varied, its flanks being kept.
pub(crate) const BUMP_HIGHER: f64 = 3.0;

/// Distance at which a peak ends, over that at which it is as high as the floor.
pub(crate) const PEAK_REACH: f64 = 10.0;

/// Number of flat bands, of different widths, about which others are tried.
pub(crate) const BEST_WIDTHS: usize = 6;

/// Rounds of variations of a bump.
pub(crate) const BUMP_VARIATIONS: usize = 12;

/// Steps of the search for the height of a bump, and the change of the height that ends it.
pub(crate) const HEIGHT_STEPS: usize = 10;
pub(crate) const HEIGHT_TOLERANCE: f64 = 1e-4;

/// Largest height, in the logarithm of the power.
pub(crate) const BUMP_HIGHEST: f64 = 30.0;

/// A force whose periods differ from their mean by this part of it, in the RMS, repeats to rounding.
pub(crate) const PERIODS_REPEATS: f64 = 1e-12;

/// Terms of the series of a sawtooth that count.
pub(crate) const PERIODS_TERMS: i32 = 64;

/// Halvings by which noise is found.
pub(crate) const PERIODS_HALVINGS: usize = 50;

/// Power of a line under Hann's window over the level around it from which it is looked at: noise passes it on one
/// of 10⁷ lines, with a level of 20 independent lines.
pub(crate) const SINUSOID_CONSPICUOUS: f64 = 30.0;

/// Lines to either side whose median is the level around a line, and those next to it that do not count.
pub(crate) const SINUSOID_AROUND: usize = 24;
pub(crate) const SINUSOID_NEXT: usize = 3;

/// Fewest lines that make a level.
pub(crate) const SINUSOID_FEWEST: usize = 16;

/// Lines to either side that a sinusoid is fitted to; under Hann's window it has next to nothing beyond.
pub(crate) const SINUSOID_FITTED: usize = 4;

/// Lines to either side of which a sinusoid has to explain the power above the level, and the part it may leave: a
/// band of noise, or a frequency that changes, leaves more.
pub(crate) const SINUSOID_EXPLAINED: usize = 8;
pub(crate) const SINUSOID_LEFT: f64 = 0.25;

/// Part of the power of the strongest new one that others found with it have at least: what a fit beside a strong one
/// leaves near a resonance may look like a weak one.
pub(crate) const SINUSOID_BESIDE: f64 = 0.1;

/// Sinusoids of a record at most, and lines that are looked at.
pub(crate) const SINUSOID_MOST: usize = 16;
pub(crate) const LOOKED_AT: usize = 96;

/// Receptances from one line to the next, of which a mean is taken.
pub(crate) const GAINS_PER_LINE: usize = 16;

/// Rounds in which each sinusoid is fitted again beside all others.
pub(crate) const SINUSOID_ROUNDS: usize = 2;

/// Frequencies tried between the line before and the line after, and the golden sections that follow.
pub(crate) const SINUSOID_FREQUENCIES: usize = 20;
pub(crate) const SINUSOID_SECTIONS: usize = 40;
