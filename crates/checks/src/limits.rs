//! Limits at which a finding becomes a warning. Limits without a named source are ours.

/// Significance level: the error rate of a single test, and of all tests of a fit together after
/// [`adjust_p_values`](super::adjust_p_values).
pub const SIGNIFICANCE: f64 = 0.01;

/// Minimum share of the excess power (residual power minus noise power) that a few lines must have
/// for these lines to be reported.
pub const CONCENTRATED: f64 = 0.8;

/// Maximum ratio of residual power to noise power on the lines that remain without the few lines
/// with most of the misfit; up to this ratio, the model counts as correct on the remaining lines.
pub const DISTURBED_ALONE: f64 = 10.0;

/// Minimum share of the residual power of a linear model that a reported nonlinear term explains.
pub const DISTORTION_EXPLAINED: f64 = 0.5;

/// Maximum number of lines that a misfit reports.
pub const MOST_DISTURBED: usize = 8;

/// Minimum amplitude of an excited line, relative to the strongest line of the force.
pub const EXCITED_LINE: f64 = 1e-4;

/// Condition number above which relative noise of 1 % may hide a combination of parameters.
pub const CONDITION_NUMBER: f64 = 1e4;

/// Curvature from the last sample of a period to its first, relative to the RMS curvature inside
/// the period, above which the record is hardly one period of a steady state.
pub const SEAM_DOUBTFUL: f64 = 5.0;

/// Curvature from the last sample of a period to its first, relative to the RMS curvature inside
/// the period, above which the record is not a period of a steady state.
pub const SEAM_BAD: f64 = 20.0;

/// RMS deviation of a period from the mean of all periods, relative to the RMS of the response,
/// above which the response is hardly steady.
pub const PERIOD_SCATTER_DOUBTFUL: f64 = 0.1;

/// RMS deviation of a period from the mean of all periods, relative to the RMS of the response,
/// above which the response does not repeat.
pub const PERIOD_SCATTER_BAD: f64 = 0.5;

/// Fraction of the power of a response that the forces do not explain (1 − coherence, median over
/// the lines), above which frequency responses are uncertain.
pub const INCOHERENCE_DOUBTFUL: f64 = 0.1;

/// Fraction of the power of a response that the forces do not explain, above which frequency
/// responses are mostly noise.
pub const INCOHERENCE_BAD: f64 = 0.5;

/// Minimum number of lines of a segment in the half-power bandwidth of a resonance; below it the
/// intervals are unreliable, even with a known window.
pub const RESONANCE_LINES: f64 = 1.0;

/// Minimum number of samples per period of the highest mode, for a fit of the transition from
/// sample to sample; at fewer samples (a natural frequency above 1 rad per sample), the change of
/// the force between the samples matters.
pub const SAMPLES_PER_PERIOD_DOUBTFUL: f64 = std::f64::consts::TAU;

/// Minimum number of samples per period of the highest mode, for a fit of the transition from
/// sample to sample; at fewer samples (a natural frequency above 2.5 rad per sample), the mode may
/// be the alias of a mode above the Nyquist frequency.
pub const SAMPLES_PER_PERIOD_BAD: f64 = std::f64::consts::TAU / 2.5;

/// Minimum number of samples per period of the highest mode, for a fit of the equation of motion at
/// each sample; at fewer samples, the mode may be the alias of a mode above the Nyquist frequency.
pub const SAMPLES_PER_PERIOD_AT_SAMPLES: f64 = 2.5;

/// Samples per period at the Nyquist frequency.
pub const SAMPLES_PER_PERIOD_NYQUIST: f64 = 2.0;

/// Relative error of the state matrix by Euler's rule, above which the estimate is doubtful.
pub const EULER_BIAS_DOUBTFUL: f64 = 0.01;

/// Relative error of the state matrix by Euler's rule, above which the estimate is bad.
pub const EULER_BIAS_BAD: f64 = 0.1;

/// Maximum fraction of the residual power that remains with a delay, for the delay to be reported.
pub const DELAY_REMAINING: f64 = 0.25;

/// Factor between a measured derivative and the derivative computed from another channel, above
/// which units, columns or signs are wrong. Sensor errors give a smaller factor. At frequencies
/// below four tenths of the sampling rate, the trapezoidal rule and the second difference also give
/// a smaller factor.
pub const KINEMATIC_GAIN: f64 = 3.0;

/// Power that forces extract from a machine, relative to the apparent power, above which neither
/// noise nor leakage explains this power.
pub const POWER_TAKEN_OUT: f64 = 0.05;

/// Maximum number of distinct values of a coarsely quantised response.
pub const QUANTISATION_LEVELS: usize = 16;

/// Ratio of the second difference at a sample to the largest second difference at other samples,
/// above which the sample is a spike: a motion below the Nyquist frequency cannot have such a
/// curvature at a single sample.
pub const SPIKE: f64 = 20.0;

/// Maximum residual, relative to the fitted signal (RMS), that counts as rounding.
pub const ROUNDING: f64 = 1e-9;

/// Number of lags of the autocorrelation of a residual. The correlation of a residual with a force
/// has this number of lags on each side of lag 0.
pub const LAGS: usize = 25;

/// Minimum number of samples per lag of the correlation; a short residual is tested at fewer lags.
pub const SAMPLES_PER_LAG: usize = 4;

/// Maximum difference of two mirrored entries of M, relative to the geometric mean of the diagonal
/// entries, that counts as rounding.
pub const ASYMMETRY: f64 = 1e-6;

/// Share of the response attributed to unmeasured forces, at or above which this explanation is
/// doubtful: few tests have a disturbance of this size, and nonlinear systems give a larger share.
pub const UNMEASURED_FORCE: f64 = 0.1;

/// Minimum deviation of the ratio of two mirrored entries from 1, in standard errors, for a gain to
/// be reported. Both ratios, in damping and in stiffness, must have this deviation; a smaller
/// deviation may be due to noise.
pub const GAIN_SIGNIFICANT: f64 = 5.0;

/// Maximum difference, in standard errors, between the ratio of mirrored entries in damping and the
/// ratio in stiffness, for the two ratios to count as the same gain.
pub const GAIN_AGREES: f64 = 2.5;

/// Maximum difference between the logarithms of the ratios of mirrored entries in damping and in
/// stiffness, relative to the logarithm in stiffness. Up to this difference, the ratios count as
/// the same gain even if they differ by more than [`GAIN_AGREES`].
pub const GAIN_NEAR: f64 = 0.05;

/// Minimum fraction of samples of a coarsely quantised channel that equal the sample before.
pub const REPEATED_SAMPLES: f64 = 0.2;

/// Minimum number of samples per level of a quantised channel.
pub const SAMPLES_PER_LEVEL: usize = 16;

/// Maximum difference between the two neighbours of a spike, relative to the distance of the spike
/// from their mean.
pub const RETURN: f64 = 0.1;

/// Maximum deviation of a level from a multiple of the step, relative to the step, that counts as
/// rounding.
pub const LEVEL_ROUNDING: f64 = 1e-6;

/// Minimum amplitude of a strong line, relative to the strongest line of the same force; the
/// response to a strong line exceeds the noise.
pub const STRONG_LINE: f64 = 0.01;

/// Minimum number of lines for each line that is reported as disturbed: at most an eighth of all
/// lines are reported.
pub(crate) const LINES_PER_DISTURBED: usize = 8;

/// Maximum relative difference of frequencies that count as the same line of several records.
pub(crate) const SAME_LINE: f64 = 1e-9;

/// Residual power of the equations, relative to their right-hand sides, above which the response
/// hardly follows the force.
pub(crate) const HARDLY_FOLLOWS: f64 = 0.25;

/// Number of reductions of the interval around the best delay, each to two thirds.
pub(crate) const DELAY_REDUCTIONS: usize = 24;

/// Maximum delay, in samples, as estimated from the equations of motion, for which the search by
/// maximum likelihood starts from the fit without a delay.
pub(crate) const DELAY_NEAR: f64 = 0.5;

/// Half width of the first parabola through the sums of squares around a delay, in samples.
pub(crate) const DELAY_REACH: f64 = 0.25;

/// Half width, in samples, of the first parabola in the search on all lines, if a search on some of
/// the lines has already found the delay.
pub(crate) const DELAY_REFINED: f64 = 0.02;

/// Maximum number of parabolic steps in the search for a delay or a corner frequency.
pub(crate) const PARABOLAS: usize = 8;

/// Maximum step of the search for a delay or a corner frequency, in half widths of the parabola.
pub(crate) const LONGEST_STEP: f64 = 2.0;

/// Minimum ratio of successive parabola widths in the search for a delay or a corner frequency.
pub(crate) const LEAST_WIDTH_RATIO: f64 = 0.1;

/// Parabola width, in samples, that ends the search for a delay.
pub(crate) const DELAY_RESOLVED: f64 = 0.005;

/// Maximum ratio of the residual power of a longer delay to that of a shorter one, for the longer
/// delay to be preferred.
pub(crate) const DELAY_PREFERRED: f64 = 0.99;

/// Minimum deviation of a gain from 1, or of a fault of the acquisition from 0, in standard errors,
/// that counts as significant.
pub(crate) const STANDARD_ERRORS: f64 = 4.0;

/// Maximum number of sensitivities (residuals times parameters); in larger fits the residual is not
/// corrected for the errors of the estimate.
pub(crate) const LINEARITY_SENSITIVITIES: usize = 1 << 22;

/// Number of lines on either side in the averages of a residual spectrum.
pub(crate) const LINEARITY_NEIGHBOURS: usize = 10;

/// Maximum mismatch, relative to √2 times the RMS of the force, at which the force counts as
/// repeating.
pub(crate) const PERIOD_WORST: f64 = 0.1;

/// Maximum ratio of the squared mismatch at a lag to the smallest squared mismatch, at which the
/// force counts as repeating equally well at this lag.
pub(crate) const PERIOD_ALIKE: f64 = 2.0;

/// Maximum squared mismatch that rounding of Fourier transforms causes.
pub(crate) const PERIOD_ROUNDING: f64 = 1e-12;

/// Maximum difference in length between a claimed and a neighbouring period, in samples.
pub(crate) const PERIOD_NEIGHBOURS: usize = 2;

/// Maximum mismatch, relative to √2 times the RMS of the force, at which a force with noise counts
/// as repeating.
pub(crate) const PERIOD_REPEATS: f64 = 0.5;

/// Minimum reduction of the squared mismatch, relative to its scatter, for a neighbouring period to
/// count as better.
pub(crate) const PERIOD_CLEARLY: f64 = 4.0;

/// Minimum ratio of the squared mismatch across an interruption to the squared mismatch at the
/// other samples.
pub(crate) const PERIOD_INTERRUPTED: f64 = 10.0;

/// Number of strongest lines in the test of the power flow: for a finding, at least the fraction
/// [`STRONGEST_FRACTION`] of these lines must extract power.
pub(crate) const STRONGEST_LINES: usize = 32;

/// Minimum fraction of the strongest lines that must extract power for a finding; chance does not
/// reach this fraction, even for seven lines.
pub(crate) const STRONGEST_FRACTION: f64 = 0.9;

/// Minimum amplitude of a line with force, relative to the strongest line.
pub(crate) const FORCE_FLOOR: f64 = 1e-3;

/// Minimum number of samples per unknown of an equation of motion; with fewer samples, the equation
/// is not tested for noise on the response.
pub(crate) const SAMPLES_PER_UNKNOWN: usize = 4;

/// Maximum of 1 − coherence (median over the lines) that counts as rounding.
pub(crate) const RESPONSE_ROUNDING: f64 = 1e-10;

/// Largest distance, in lines, over which Hann's window (the usual window of analysers) correlates
/// lines.
pub(crate) const WINDOW_REACH: usize = 2;

/// Maximum number of distances between lines at which residuals are correlated.
pub(crate) const MAX_DISTANCES: usize = 12;

/// Minimum ratio of the number of lines to the largest distance at which residuals are correlated:
/// with fewer pairs of lines, the sum of their products is not normally distributed.
pub(crate) const LINES_PER_DISTANCE: usize = 8;

/// Minimum number of pairs of lines with a given distance; with fewer pairs, the correlation at
/// this distance is not tested.
pub(crate) const RESPONSE_PAIRS: usize = 8;

/// Minimum number of lines per distance of the correlation from line to line, and per lag of the
/// correlation with a force: with fewer lines, noise and model error could not be distinguished.
pub(crate) const LINES_PER_CORRELATION: usize = 8;

/// Minimum number of residuals (real and imaginary parts) in excess of the number of parameters;
/// with fewer, the residuals are not tested.
pub(crate) const FREE_RESIDUALS: f64 = 8.0;

/// Minimum ratio of the residual power to the stated power of the response to an unmeasured force;
/// below it the residual is too small for this stated power. The mean of the periods may contain
/// only this fraction of the power of the response.
pub(crate) const SPECTRAL_LEAKED: f64 = 0.5;

/// Minimum singular value of the sensitivity (columns of unit length), relative to the largest; a
/// combination of parameters below it has no effect.
pub(crate) const FIT_RANK: f64 = 1e-12;

/// Ratio of the variance that force noise causes in the response to the variance of the noise of
/// the response, above which the force noise dominates.
pub(crate) const FIT_DECIDES: f64 = 10.0;

/// Number of transient terms of each channel of a record.
pub(crate) const TRANSIENT_TERMS: f64 = 6.0;

/// Maximum number of Gauss–Newton steps from the estimate to the most likely parameters.
pub(crate) const FIT_STEPS: usize = 8;

/// Decrease of the residual power by a further step, relative to the variance of a residual, below
/// which the steps end.
pub(crate) const FIT_SETTLED: f64 = 0.01;

/// Maximum number of sensitivities (residuals times parameters); in larger fits the residual of the
/// estimate is tested without Gauss–Newton steps.
pub(crate) const MAX_SENSITIVITIES: usize = 1 << 24;

/// Maximum number of products (sensitivities times parameters) for which Gauss–Newton steps are
/// made; this number of products takes some seconds.
pub(crate) const FIT_PRODUCTS: usize = 1 << 32;

/// Number of samples on either side of a run of equal samples that decide whether the run is a
/// drop-out.
pub const DROP_OUT_NEIGHBOURS: usize = 64;

/// Minimum standard deviation, in steps of the converter, of the samples on either side of a run of
/// equal samples, for the channel to count as moving; a structure that comes to rest moves by a few
/// steps only.
pub const DROP_OUT_MOTION: f64 = 10.0;

/// Maximum probability of a run of equal samples that counts as a drop-out; real drop-outs have far
/// smaller probabilities.
pub const DROP_OUT_LEVEL: f64 = 1e-4;

/// Maximum number of rounds in which the corner frequency of an AC-coupled channel is refined.
pub(crate) const ACQUISITION_ROUNDS: usize = 4;

/// Half width of the first and of the last parabola through the sums of squares around a corner
/// frequency of hits, relative to the first estimate of this frequency.
pub(crate) const CORNER_WIDTHS: [f64; 2] = [0.5, 0.01];

/// Step of the corner frequency in the numerical derivative of the effect of a high-pass, relative
/// to the frequency of the lowest line.
pub(crate) const HIGH_PASS_STEP: f64 = 1e-3;

/// Maximum number of changes in the sentence about an omitted term; the finding itself has all
/// changes.
pub(crate) const LISTED_CHANGES: usize = 3;

/// Maximum length of a drop-out of a force, as a fraction of the record; a longer run of equal
/// samples is a pause of the excitation.
pub const DROP_OUT_FORCE_PAUSE: f64 = 0.05;

/// Minimum fraction of the samples outside a drop-out at which the force acts. Hammers and bursts
/// act at a smaller fraction of the samples.
pub const DROP_OUT_FORCE_ACTING: f64 = 0.75;

/// Minimum jump of a force at the beginning or the end of a drop-out near the mean of the force, in
/// standard deviations of the force; a sweep that comes to rest has a smaller jump.
pub const DROP_OUT_FORCE_JUMP: f64 = 0.2;

/// Minimum number of samples of a drop-out of a force; at a smooth peak a converter gives fewer
/// equal samples.
pub const DROP_OUT_FORCE_SAMPLES: usize = 8;
