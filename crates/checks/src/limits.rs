//! Limits at which a finding becomes a warning. Those without a named source are ours.

/// Probability below which a statistic is not attributed to noise: the error rate of a single test, and of
/// all tests on a fit together once [`adjust_p_values`](super::adjust_p_values) has seen them.
pub const SIGNIFICANCE: f64 = 0.01;

/// Part of the residual power beyond the noise that few lines must hold to be named.
pub const CONCENTRATED: f64 = 0.8;

/// Residual power of all other lines over that of the noise, up to which the model is right but for those.
pub const DISTURBED_ALONE: f64 = 10.0;

/// Part of what a linear model leaves that a nonlinear term has to explain to be named.
pub const DISTORTION_EXPLAINED: f64 = 0.5;

/// Maximum number of lines that a misfit names.
pub const MOST_DISTURBED: usize = 8;

/// Amplitude relative to that of the strongest line of a force, below which a line does not count as
/// excited.
pub const EXCITED_LINE: f64 = 1e-4;

/// Condition number beyond which relative noise of 1 % hides some combination of parameters.
pub const CONDITION_NUMBER: f64 = 1e4;

/// Curvature from the last sample of a period to its first, over the RMS curvature inside, beyond
/// which the record is hardly one period of a steady state.
pub const SEAM_DOUBTFUL: f64 = 5.0;

/// The same, beyond which the record is no period.
pub const SEAM_BAD: f64 = 20.0;

/// RMS deviation of a period from the mean of all, over the RMS of the response, beyond which the
/// response is hardly steady.
pub const PERIOD_SCATTER_DOUBTFUL: f64 = 0.1;

/// The same, beyond which the response does not repeat.
pub const PERIOD_SCATTER_BAD: f64 = 0.5;

/// Fraction of the power of a response that the forces do not explain (1 − coherence, median over the
/// lines), beyond which frequency responses are uncertain.
pub const INCOHERENCE_DOUBTFUL: f64 = 0.1;

/// The same, beyond which they are mostly noise.
pub const INCOHERENCE_BAD: f64 = 0.5;

/// Lines of a segment in the half-power bandwidth of a resonance, below which its intervals do not hold, whatever
/// is known of the window.
pub const RESONANCE_LINES: f64 = 1.0;

/// Samples per period of the highest mode, below which a transition from sample to sample depends on
/// what the force does between them: 2π/1.
pub const SAMPLES_PER_PERIOD_DOUBTFUL: f64 = std::f64::consts::TAU;

/// The same, below which the mode is near the Nyquist frequency: 2π/2.5.
pub const SAMPLES_PER_PERIOD_BAD: f64 = std::f64::consts::TAU / 2.5;

/// Samples per period of the highest mode, below which the equation of motion at the samples is
/// doubtful.
pub const SAMPLES_PER_PERIOD_AT_SAMPLES: f64 = 2.5;

/// Samples per period at the Nyquist frequency.
pub const SAMPLES_PER_PERIOD_NYQUIST: f64 = 2.0;

/// Relative error of the state matrix by Euler's rule, beyond which the estimate is doubtful.
pub const EULER_BIAS_DOUBTFUL: f64 = 0.01;

/// The same, beyond which it is bad.
pub const EULER_BIAS_BAD: f64 = 0.1;

/// Fraction of the residual's power that a delayed model may leave, for the delay to be reported.
pub const DELAY_REMAINING: f64 = 0.25;

/// Factor between the derivative measured and the one that follows from another channel, beyond which
/// units, columns or signs are wrong. Sensors do not err that much, nor does the rule between two
/// samples, which reaches it at four tenths of the sampling rate.
pub const KINEMATIC_GAIN: f64 = 3.0;

/// Power that forces take out of a machine, over the apparent power, beyond which it is neither noise
/// nor leakage.
pub const POWER_TAKEN_OUT: f64 = 0.05;

/// Number of distinct values of a quantised response, beyond which it is not counted as coarse.
pub const QUANTISATION_LEVELS: usize = 16;

/// Second difference of a sample over the largest of the others, beyond which it is a spike: no motion
/// of a band below the Nyquist frequency bends so at one sample alone.
pub const SPIKE: f64 = 20.0;

/// Residual, relative to the signal fitted (RMS), below which it is rounding.
pub const ROUNDING: f64 = 1e-9;

/// Number of lags, to either side for a force, at which a residual is correlated.
pub const LAGS: usize = 25;

/// Minimum number of samples per lag.
pub const SAMPLES_PER_LAG: usize = 4;

/// Difference of two masses that are equal in a symmetric M, over the geometric mean of those on the diagonal, below
/// which it is rounding.
pub const ASYMMETRY: f64 = 1e-6;

/// Part of the motion from which it is doubtful that forces which were not measured account for it: few tests are as
/// disturbed, and nonlinear machines leave more.
pub const UNMEASURED_FORCE: f64 = 0.1;

/// Minimum number of standard errors by which the ratio of two mirrored entries differs from 1, in damping and in
/// stiffness, for a gain to be named; below it noise may make the ratio.
pub const GAIN_SHOWS: f64 = 5.0;

/// Maximum number of standard errors between the ratios in damping and in stiffness that count as the same gain.
pub const GAIN_AGREES: f64 = 2.5;

/// Maximum difference of the logarithms of both ratios, relative to that in stiffness, that counts as the same gain
/// too, whatever the standard errors.
pub const GAIN_NEAR: f64 = 0.05;

/// Fraction of samples that a coarsely quantised channel leaves at the level of the one before.
pub const REPEATED_SAMPLES: f64 = 0.2;

/// Minimum number of samples per level of a quantised channel.
pub const SAMPLES_PER_LEVEL: usize = 16;

/// Difference of the neighbours of a spike, over the spike.
pub const RETURN: f64 = 0.1;

/// Deviation of a level from a multiple of the step, over the step, that is rounding.
pub const LEVEL_ROUNDING: f64 = 1e-6;

/// Amplitude of a line over that of the strongest of its force, above which the response to it shows.
pub const STRONG_LINE: f64 = 0.01;

/// Lines beside each one named, of which at most one is.
pub(crate) const LINES_PER_DISTURBED: usize = 8;

/// Relative difference of frequencies that are the same line of several records.
pub(crate) const SAME_LINE: f64 = 1e-9;

/// Residual power of the equations, over that of their right-hand sides, beyond which it hardly does.
pub(crate) const HARDLY_FOLLOWS: f64 = 0.25;

/// Reductions of the interval around the best step, each to two thirds.
pub(crate) const DELAY_REDUCTIONS: usize = 24;

/// Samples from that delay of the equations of motion within which the one of maximum likelihood begins in the data
/// without a delay.
pub(crate) const DELAY_NEAR: f64 = 0.5;

/// Samples to either side of a delay through whose sums of squares a first parabola is laid.
pub(crate) const DELAY_REACH: f64 = 0.25;

/// Parabolas at most, part of the reach of one that the next has at least, and reach, in samples, below which there
/// is none.
pub(crate) const DELAY_PARABOLAS: usize = 8;
pub(crate) const LEAST_PART: f64 = 0.1;
pub(crate) const DELAY_RESOLVED: f64 = 0.005;

/// Part of the residual power that a first parabola leaves at most where nothing else speaks for a delay.
pub(crate) const DELAY_PROMISING: f64 = 0.5;

/// Factor below which a longer delay must bring the residual power, to be preferred to a shorter one.
pub(crate) const DELAY_PREFERRED: f64 = 0.99;

/// Distance of a gain from 1, or of a fault of the acquisition from none, in its standard errors, that noise does not
/// reach.
pub(crate) const STANDARD_ERRORS: f64 = 4.0;

/// Maximum number of sensitivities, residuals times parameters; of larger fits the errors of the estimate are left in
/// the residual.
pub(crate) const LINEARITY_SENSITIVITIES: usize = 1 << 22;

/// Lines to either side over which the spectrum of a residual is averaged.
pub(crate) const LINEARITY_NEIGHBOURS: usize = 10;

/// Mismatch, over the RMS of the force, beyond which it does not repeat.
pub(crate) const PERIOD_WORST: f64 = 0.1;

/// Factor between squared mismatches of lags after which the force repeats equally well.
pub(crate) const PERIOD_ALIKE: f64 = 2.0;

/// Squared mismatch that the rounding of Fourier transforms leaves.
pub(crate) const PERIOD_ROUNDING: f64 = 1e-12;

/// Maximum number of samples by which a neighbouring period is longer or shorter.
pub(crate) const PERIOD_NEIGHBOURS: usize = 2;

/// Mismatch, over the RMS of the force, beyond which it does not repeat even with noise on it.
pub(crate) const PERIOD_REPEATS: f64 = 0.5;

/// Reduction of the squared mismatch, in its own scatter, from which a neighbouring period is better.
pub(crate) const PERIOD_CLEARLY: f64 = 4.0;

/// Minimum factor between the squared mismatch across an interruption and elsewhere.
pub(crate) const PERIOD_INTERRUPTED: f64 = 10.0;

/// Number of lines, those with the most power, of which [`STRONGEST_FRACTION`] must take power out.
pub(crate) const STRONGEST_LINES: usize = 32;

/// Fraction of the strongest lines that must take power out: not even seven lines do by chance.
pub(crate) const STRONGEST_FRACTION: f64 = 0.9;

/// Amplitude relative to that of the strongest line of a force, below which a line carries no force.
pub(crate) const FORCE_FLOOR: f64 = 1e-3;

/// Minimum number of samples per unknown.
pub(crate) const SAMPLES_PER_UNKNOWN: usize = 4;

/// 1 − coherence (median over the lines), below which it is rounding.
pub(crate) const RESPONSE_ROUNDING: f64 = 1e-10;

/// Distance of the lines, in lines, that Hann's window correlates, the custom of analysers.
pub(crate) const WINDOW_REACH: usize = 2;

/// Maximum number of distances between lines at which residuals are correlated.
pub(crate) const MAX_DISTANCES: usize = 12;

/// Number of lines over the largest of those distances: beyond, few pairs are left, and their products
/// are not normally distributed.
pub(crate) const LINES_PER_DISTANCE: usize = 8;

/// Minimum number of pairs of lines at a distance.
pub(crate) const RESPONSE_PAIRS: usize = 8;

/// Minimum number of lines per such distance, and per lag of the correlation with a force: more would
/// leave no direction in which noise and an error of the model differ.
pub(crate) const LINES_PER_CORRELATION: usize = 8;

/// Minimum number of residuals, real and imaginary parts, that the parameters leave free.
pub(crate) const FREE_RESIDUALS: f64 = 8.0;

/// Least part of the power that is stated of the response to an unmeasured force that the mean of periods has.
pub(crate) const SPECTRAL_LEAKED: f64 = 0.5;

/// Singular value of the sensitivity (columns of unit length) relative to the largest, below which a
/// combination of parameters has no effect.
pub(crate) const FIT_RANK: f64 = 1e-12;

/// Variance that the noise of the forces makes of a response over that of its own noise, above which it decides.
pub(crate) const FIT_DECIDES: f64 = 10.0;

/// Loads of the ends of a record that a channel is fitted with.
pub(crate) const FIT_LOADS: f64 = 6.0;

/// Maximum number of Gauss–Newton steps from the estimate to the most likely parameters.
pub(crate) const FIT_STEPS: usize = 8;

/// Residual power that another such step removes, over the variance of a residual, below which there is
/// none.
pub(crate) const FIT_SETTLED: f64 = 0.01;

/// Maximum number of sensitivities, residuals times parameters; of larger fits the residual is tested as
/// the estimate leaves it.
pub(crate) const MAX_SENSITIVITIES: usize = 1 << 24;

/// Likewise, maximum number of products, sensitivities times parameters: some seconds.
pub(crate) const FIT_PRODUCTS: usize = 1 << 32;

/// Number of samples on either side of a run of equal ones by which a drop-out is judged.
pub const DROP_OUT_NEIGHBOURS: usize = 64;

/// Standard deviation of these samples, in steps of the converter, from which a channel moves: a structure that comes to
/// rest goes through a few steps.
pub const DROP_OUT_MOTION: f64 = 10.0;

/// Probability at which a run of equal samples is a drop-out: those that are have far smaller ones.
pub const DROP_OUT_LEVEL: f64 = 1e-4;

/// Maximum number of rounds in which the corner frequency of a coupled channel is refined.
pub(crate) const ACQUISITION_ROUNDS: usize = 4;

/// Difference of corner frequencies over the lowest line by which the effect of a high-pass is differentiated.
pub(crate) const HIGH_PASS_STEP: f64 = 1e-3;
