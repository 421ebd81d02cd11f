//! Limits of the identification, each with the effect of values on either side.

/// Number of lines in a block of the parallel sums: blocks bound the memory of a sum and fix its
/// order, so that a result does not depend on the number of processors.
pub const BLOCK_LINES: usize = 256;
/// Maximum length of the part of a dependent column that the columns before it do not explain,
/// relative to the length of the column; a dependent column gets no coefficient.
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
/// Maximum number of steps of a search before noise and number of modes are known.
pub const ROUGH_STEPS: usize = 10;
/// Minimum curvature that scales a step: a pole outside the band has curvatures of 1e-10, which
/// would block the steps of all other poles.
pub const LEAST_CURVATURE: f64 = 1e-2;
/// Largest step of the logarithm of a decay rate.
pub const MAX_DECAY_STEP: f64 = 1.0;
/// Largest relative step of a natural frequency, in damping ratios.
pub const MAX_FREQUENCY_STEP_DAMPINGS: f64 = 3.0;
/// Relative step of a natural frequency that is always allowed, even for very small damping.
pub const MIN_FREQUENCY_STEP: f64 = 2e-3;
/// Share of the lines over which a noise spectrum is averaged on either side.
pub const NOISE_WINDOW_SHARE: f64 = 1.0 / 16.0;
/// Least number of lines on either side in the average of a noise spectrum.
pub const MIN_NOISE_WINDOW: usize = 15;
/// Largest number of scoring steps for the variances of unmeasured forces.
pub const SCORING_STEPS: usize = 12;
/// Minimum squared response of a mode to a unit force, relative to its maximum, at which a line
/// contributes to the estimate of its unmeasured force.
pub const NEAR_RESONANCE: f64 = 1e-2;
/// Minimum ratio of the power of an unmeasured force to the sensor noise at which a line
/// contributes to the estimate of the force; below it the force counts as sensor noise.
pub const NEAR_PROCESS_POWER: f64 = 0.1;
/// Minimum contribution of an unmeasured force to the noise power of a line; smaller ones are
/// neglected.
pub const NEGLIGIBLE_PROCESS_POWER: f64 = 1e-3;
/// Maximum damping ratio of an initial mode; roots above it are ignored.
pub const MAX_INITIAL_DAMPING: f64 = 0.1;
/// Maximum damping ratio of a mode; a root above it represents the response of modes outside the
/// band.
pub const MAX_DAMPING: f64 = 0.3;
/// Largest number of leading components of the outputs that the first estimate uses.
pub const MAX_COMPONENTS: usize = 8;
/// Number of shifts of the block rows of the first estimate.
pub const SUBSPACE_SHIFTS: usize = 24;
/// Share of the unit circle to which the initial estimate maps the band; the gap separates the two
/// edges of the band.
pub const CIRCLE_SHARE: f64 = 0.9;
/// Minimum share of the orders in which a root must appear to become an initial mode.
pub const MIN_ORDER_SHARE: f64 = 0.4;
/// Maximum relative difference in frequency between roots of one cluster.
pub const CLUSTER_FREQUENCY: f64 = 5e-3;
/// Maximum relative difference in damping between roots of one cluster.
pub const CLUSTER_DAMPING: f64 = 0.3;
/// Maximum number of failed trials before the search for further modes, or for modes that the
/// others can replace, ends.
pub const MAX_TRIES: usize = 3;
/// Number of half-widths on either side of a candidate over which its gain is computed.
pub const SCAN_HALF_WIDTHS: f64 = 12.0;
/// Minimum number of lines on either side of a candidate.
pub const MIN_SCAN_LINES: usize = 12;
/// Minimum ratio of the damping of a mode to its standard error; below it the damping is
/// undetermined.
pub const MIN_DAMPING_ERRORS: f64 = 2.0;
/// Maximum ratio of unmeasured to measured force of a mode; above it unmeasured forces drive the
/// mode.
pub const MAX_UNMEASURED_RATIO: f64 = 0.5;
/// Distance of two poles, in half-widths, below which the modes must differ in shape or
/// participations.
pub const TWIN_HALF_WIDTHS: f64 = 1.0;
/// Distance from an edge of the band, in half-widths, below which a mode is reported as near the
/// edge.
pub const EDGE_HALF_WIDTHS: f64 = 3.0;
/// Significance level of the tests that two modes differ: of the shapes of one record, or of the
/// poles of two parts of it.
pub const DIFFERENCE_PROBABILITY: f64 = 1e-3;
/// Maximum power of a dead channel, relative to the strongest channel.
pub const DEAD_CHANNEL: f64 = 1e-26;
/// Minimum part of an input that the inputs before it do not explain, relative to the input; below
/// it the responses to these inputs cannot be separated.
pub const DEPENDENT_INPUTS: f64 = 1e-6;
/// Distance in half-widths within which two modes may explain the same response: only one of them
/// is removed at a time.
pub const NEIGHBOUR_HALF_WIDTHS: f64 = 5.0;
/// Largest distance in half-widths of two modes whose covariance is kept in a modal model; the
/// errors of modes farther apart count as independent.
pub const GROUP_HALF_WIDTHS: f64 = 10.0;
/// Distance from a mode, in half-widths, within which its unmeasured force may hide another mode:
/// the force acts where the mode resonates.
pub const HIDDEN_HALF_WIDTHS: f64 = 1.0;
/// Largest ratio of the widths of a mode and of another that it hides; the tails of a wider mode
/// are visible beside the other.
pub const HIDDEN_WIDTHS: f64 = 3.0;
/// Minimum share of the residual around a mode that the measured forces explain; below it no hidden
/// mode is tried, above it the likelihood decides. If the residual is only noise, the expected
/// share is the number of forces divided by the number of lines.
pub const LEAST_HIDDEN_SHARE: f64 = 0.5;
/// Minimum noise of a sensor, relative to the root-mean-square of its output: lower noise is
/// rounding, and in data without noise ever more modes would be significant.
pub const LEAST_NOISE: f64 = 1e-6;
/// Maximum distance of a pole from the band, in widths of the band, at which it may represent a
/// mode outside; the likelihood decides whether it is significant.
pub const OUTSIDE_DISTANCE: f64 = 0.5;
/// Number of steps to a constrained estimate: the equations are nearly linear over a standard
/// error, so that the second step is exact to a few digits.
pub const CONSTRAINT_STEPS: usize = 4;
/// Maximum eigenvalue of the covariance of a constraint's equations, relative to the largest, at
/// which an equation depends on the others.
pub const DEPENDENT_EQUATION: f64 = 1e-9;
/// Maximum delay between outputs and forces, in periods at the upper edge of the band; beyond it
/// none is estimated.
pub(crate) const MAX_DELAY_TURNS: f64 = 1.0;
/// Number of outputs that give the initial estimate of the delay.
pub(crate) const DELAY_OUTPUTS: usize = 4;
/// Maximum number of Gauss–Newton steps of the delays at initial poles: an estimate that the final
/// modes refine.
pub(crate) const ROUGH_DELAY_STEPS: usize = 4;
/// Maximum number of Gauss–Newton steps of the delays with the final modes.
pub(crate) const DELAY_STEPS: usize = 10;
/// Minimum share that is not noise in the power of the derivative of an output with respect to its
/// delay. The part of the derivative that modes and residual terms explain is removed first. Below
/// this share the data do not determine the delay.
pub(crate) const LEAST_DELAY_INFORMATION: f64 = 0.5;
/// Maximum step of a delay, relative to the maximum delay.
pub(crate) const MAX_DELAY_STEP: f64 = 0.1;
/// Step of a delay, in standard errors, that ends the steps.
pub(crate) const DELAY_SETTLED: f64 = 0.1;
/// Minimum number of lines, weighted by their information, at a resonance for the scatter of the
/// residual along the shape.
pub const LEAST_SCATTER_LINES: f64 = 3.0;
