//! Numbers that decide something, each with what happens on either side of it.

/// Number of lines in a block of the parallel sums: blocks bound the memory of a sum and fix its
/// order, so that a result does not depend on the number of processors.
pub const BLOCK_LINES: usize = 256;
/// Largest ratio of a column's rest to its length, after the columns before it, that counts as
/// dependent: a dependent column gets no coefficient.
pub const DEPENDENT_COLUMN: f64 = 1e-11;
/// Largest number of damped steps of one search.
pub const MAX_STEPS: usize = 40;
/// Largest number of damping increases within a step before the search ends.
pub const MAX_DAMPING_INCREASES: usize = 14;
/// Decrease of −2 log L in a step below which the last search has converged: the estimates are then
/// within a few hundredths of their standard errors of the optimum.
pub const COST_TOLERANCE: f64 = 1e-3;
/// Decrease of −2 log L in a step below which a search between two changes of the model ends.
pub const ROUGH_COST_TOLERANCE: f64 = 0.5;
/// Number of steps before noise and number of modes are known.
pub const ROUGH_STEPS: usize = 10;
/// Least curvature that scales a step: a pole outside the band has curvatures of 1e-10, which would
/// block the steps of all others.
pub const LEAST_CURVATURE: f64 = 1e-2;
/// Largest step of the logarithm of a decay rate.
pub const MAX_DECAY_STEP: f64 = 1.0;
/// Largest relative step of a natural frequency, in damping ratios.
pub const MAX_FREQUENCY_STEP_DAMPINGS: f64 = 3.0;
/// Relative step of a natural frequency that is allowed however small the damping is.
pub const MIN_FREQUENCY_STEP: f64 = 2e-3;
/// Share of the lines over which a noise spectrum is averaged on either side.
pub const NOISE_WINDOW_SHARE: f64 = 1.0 / 16.0;
/// Least number of lines on either side in the average of a noise spectrum.
pub const MIN_NOISE_WINDOW: usize = 15;
/// Largest number of scoring steps for the variances of unmeasured forces.
pub const SCORING_STEPS: usize = 12;
/// Response of a mode to a unit force over its largest, squared, above which a line bears on its
/// unmeasured force.
pub const NEAR_RESONANCE: f64 = 1e-2;
/// Power of an unmeasured force beside the sensors' noise on a line below which the line leaves it
/// to the latter.
pub const NEAR_PROCESS_POWER: f64 = 0.1;
/// Contribution of an unmeasured force to the noise power of a line below which the line says
/// nothing of it.
pub const NEGLIGIBLE_PROCESS_POWER: f64 = 1e-3;
/// Damping ratio above which a root of the first estimate counts as no mode.
pub const MAX_INITIAL_DAMPING: f64 = 0.1;
/// Damping ratio above which a root counts as no mode but as the response of what lies outside the
/// band.
pub const MAX_DAMPING: f64 = 0.3;
/// Largest number of leading components of the outputs that the first estimate uses.
pub const MAX_COMPONENTS: usize = 8;
/// Number of shifts of the block rows of the first estimate.
pub const SUBSPACE_SHIFTS: usize = 24;
/// Share of the unit circle that the band is mapped to in the first estimate; the gap joins the
/// band's two edges.
pub const CIRCLE_SHARE: f64 = 0.9;
/// Share of the orders in which a root must appear to start a mode.
pub const MIN_ORDER_SHARE: f64 = 0.4;
/// Relative difference of frequency within which roots of several orders are one.
pub const CLUSTER_FREQUENCY: f64 = 5e-3;
/// Relative difference of damping within which roots of several orders are one.
pub const CLUSTER_DAMPING: f64 = 0.3;
/// Number of candidates that are tried in one step of the search for further modes.
pub const MAX_TRIES: usize = 3;
/// Half-widths on either side of a candidate over which its gain is measured.
pub const SCAN_HALF_WIDTHS: f64 = 12.0;
/// Least lines on either side of a candidate.
pub const MIN_SCAN_LINES: usize = 12;
/// Number of standard errors by which the damping of a mode must exceed zero.
pub const MIN_DAMPING_ERRORS: f64 = 2.0;
/// Ratio of unmeasured to measured force above which a mode is one of the unmeasured forces alone.
pub const MAX_UNMEASURED_RATIO: f64 = 0.5;
/// Half-widths between two poles below which they must differ in their shapes or participations.
pub const TWIN_HALF_WIDTHS: f64 = 1.0;
/// Half-widths from an edge of the band within which a mode is reported as near the edge.
pub const EDGE_HALF_WIDTHS: f64 = 3.0;
/// Probability of a larger statistic by chance below which two shapes differ.
pub const DIFFERENCE_PROBABILITY: f64 = 1e-3;
/// Ratio of the power of a channel to that of the strongest below which the channel is dead.
pub const DEAD_CHANNEL: f64 = 1e-26;
/// Part of an input that the inputs before it cannot follow, relative to the input, at or below which
/// their responses cannot be separated.
pub const DEPENDENT_INPUTS: f64 = 1e-6;
/// Half-widths within which two modes may share what they explain: only one of them is taken out at
/// a time.
pub const NEIGHBOUR_HALF_WIDTHS: f64 = 5.0;
/// Least noise of a sensor, relative to the root-mean-square of its output: what is below it is
/// rounding, and data without noise would otherwise hold modes without end.
pub const LEAST_NOISE: f64 = 1e-6;
/// Largest distance of a pole from the band, in widths of the band, at which it may stand for a mode
/// outside; the likelihood decides whether it is worth its parameters.
pub const OUTSIDE_REACH: f64 = 0.5;
/// Number of steps to the estimate that meets a constraint: its equations are nearly linear over a
/// standard error, so that the second step is exact to a few digits.
pub const CONSTRAINT_STEPS: usize = 4;
/// Eigenvalue of the covariance of a constraint's equations, over the largest, at or below which an
/// equation follows from the others.
pub const DEPENDENT_EQUATION: f64 = 1e-9;
