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
