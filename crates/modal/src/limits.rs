//! Limits of the identification, each with the effect of values on either side.

/// Operations that count for a limit of the work, for each product in the sums over lines; these
/// sums do many products at once.
pub(crate) const VECTOR_OPERATIONS: f64 = 0.1;

/// Number of lines in a block of the parallel sums. Blocks limit the memory of a sum and fix the
/// order of its terms, so that the result does not depend on the number of processors.
pub const BLOCK_LINES: usize = 256;
/// Maximum ratio of two norms for a linearly dependent column: the norm of the part of the column
/// that the preceding columns do not explain, and the norm of the column. A dependent column has no
/// coefficient.
pub const DEPENDENT_COLUMN: f64 = 1e-11;
/// Largest number of damped steps of one search.
pub const MAX_STEPS: usize = 40;
/// Largest number of damping increases within a step before the search ends.
pub const MAX_DAMPING_INCREASES: usize = 14;
/// Decrease of −2 log L in one step, below which the last search has converged; the estimates then
/// differ from the optimum by a few hundredths of their standard errors.
pub const COST_TOLERANCE: f64 = 1e-3;
/// Decrease of −2 log L in one step, below which a search between two changes of the model ends.
pub const ROUGH_COST_TOLERANCE: f64 = 0.5;
/// Maximum number of steps of a search while noise and number of modes are still unknown.
pub const ROUGH_STEPS: usize = 10;
/// Minimum curvature that scales a step: a pole outside the band has curvatures of 1e-10, which
/// would block the steps of all other poles.
pub const LEAST_CURVATURE: f64 = 1e-2;
/// Maximum change of the logarithm of a decay rate in one step of the search.
pub const MAX_DECAY_STEP: f64 = 1.0;
/// Largest relative step of a natural frequency, as a multiple of the damping ratio of the mode.
pub const MAX_FREQUENCY_STEP_DAMPINGS: f64 = 3.0;
/// Relative step of a natural frequency that is always allowed, even for very small damping.
pub const MIN_FREQUENCY_STEP: f64 = 2e-3;
/// Half-width of the averaging window of a noise spectrum, as a fraction of the number of lines.
pub const NOISE_WINDOW_SHARE: f64 = 1.0 / 16.0;
/// Minimum half-width of the averaging window of a noise spectrum, in lines.
pub const MIN_NOISE_WINDOW: usize = 15;
/// Largest number of scoring steps for the variances of unmeasured forces.
pub const SCORING_STEPS: usize = 12;
/// Minimum squared response of a mode to a unit force on a line, relative to its maximum, at which
/// the line contributes to the estimate of the unmeasured force on the mode.
pub const NEAR_RESONANCE: f64 = 1e-2;
/// Minimum ratio of the power of an unmeasured force to the sensor noise at which a line
/// contributes to the estimate of the force; below it the force counts as sensor noise.
pub const NEAR_PROCESS_POWER: f64 = 0.1;
/// Minimum contribution of an unmeasured force to the noise power of a line, relative to the noise
/// power of the weights; smaller contributions are neglected.
pub const NEGLIGIBLE_PROCESS_POWER: f64 = 1e-3;
/// Maximum damping ratio of an initial mode; roots above it are ignored.
pub const MAX_INITIAL_DAMPING: f64 = 0.1;
/// Maximum damping ratio of a mode; a root above it represents the response of modes outside the
/// band.
pub const MAX_DAMPING: f64 = 0.3;
/// Largest number of leading components of the outputs that the first estimate uses.
pub const MAX_COMPONENTS: usize = 8;
/// Minimum number of block rows of the initial estimate if the data have enough lines for this
/// number.
pub const SUBSPACE_SHIFTS: usize = 24;
/// Fraction of the unit circle to which the initial estimate maps the band; the remaining gap
/// separates the two edges of the band.
pub const CIRCLE_SHARE: f64 = 0.9;
/// Minimum share of the orders in which a root must appear to become an initial mode.
pub const MIN_ORDER_SHARE: f64 = 0.4;
/// Maximum relative difference in frequency between roots of one cluster.
pub const CLUSTER_FREQUENCY: f64 = 5e-3;
/// Maximum relative difference in damping between roots of one cluster.
pub const CLUSTER_DAMPING: f64 = 0.3;
/// Maximum number of failed trials in the search for further modes, and in the search for modes
/// that other modes can replace.
pub const MAX_TRIES: usize = 3;
/// Distance from a candidate mode, in half-widths, within which the lines are used to compute the
/// gain of this mode.
pub const SCAN_HALF_WIDTHS: f64 = 12.0;
/// Minimum number of lines on either side of a candidate mode that are used to compute the gain of
/// this mode.
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
/// Significance level of the tests of a difference between two modes: between the shapes of one
/// record, or between the poles from two parts of a record.
pub const DIFFERENCE_PROBABILITY: f64 = 1e-3;
/// Maximum power of a dead channel, relative to the strongest channel.
pub const DEAD_CHANNEL: f64 = 1e-26;
/// Minimum part of an input that the preceding inputs do not explain, relative to the input; below
/// this limit the responses to these inputs cannot be separated.
pub const DEPENDENT_INPUTS: f64 = 1e-6;
/// Distance in half-widths within which two modes may explain the same response: only one of them
/// is removed at a time.
pub const NEIGHBOUR_HALF_WIDTHS: f64 = 5.0;
/// Largest distance, in half-widths, between two modes whose joint covariance is part of a modal
/// model; the errors of modes farther apart count as independent.
pub const GROUP_HALF_WIDTHS: f64 = 10.0;
/// Distance from a mode, in half-widths, within which the unmeasured force on this mode may hide
/// another mode: the response to this force is large only near the resonance.
pub const HIDDEN_HALF_WIDTHS: f64 = 1.0;
/// Largest ratio of the widths of two modes at which one mode may hide the other mode; if the ratio
/// is larger, the tails of the wider mode are visible next to the narrower one.
pub const HIDDEN_WIDTHS: f64 = 3.0;
/// Minimum fraction of the residual around a mode that the measured forces must explain before a
/// hidden mode is tried; above it the likelihood decides. If the residual is only noise, the
/// expected fraction is the number of forces divided by the number of lines.
pub const LEAST_HIDDEN_SHARE: f64 = 0.5;
/// Minimum noise of a sensor, relative to the root-mean-square of its output: lower noise counts as
/// rounding. Without this limit, more and more modes would be significant in data without noise.
pub const LEAST_NOISE: f64 = 1e-6;
/// Maximum distance of a pole from the band, in widths of the band, at which the pole may represent
/// a mode outside the band; the likelihood decides whether this mode is significant.
pub const OUTSIDE_DISTANCE: f64 = 0.5;
/// Number of steps to a constrained estimate: the equations are nearly linear within a standard
/// error, so the second step is already accurate to a few digits.
pub const CONSTRAINT_STEPS: usize = 4;
/// Eigenvalue of the covariance of a constraint's equations, relative to the largest eigenvalue,
/// below which an equation counts as dependent on the other equations.
pub const DEPENDENT_EQUATION: f64 = 1e-9;
/// Maximum delay between outputs and forces, in periods of the highest frequency of the band; a
/// larger delay is not estimated.
pub(crate) const MAX_DELAY_TURNS: f64 = 1.0;
/// Number of outputs that give the initial estimate of the delay.
pub(crate) const DELAY_OUTPUTS: usize = 4;
/// Maximum number of Gauss–Newton steps of the delays with the initial poles. These steps give
/// rough delays, which are refined with the final modes.
pub(crate) const ROUGH_DELAY_STEPS: usize = 4;
/// Maximum number of Gauss–Newton steps of the delays with the final modes.
pub(crate) const DELAY_STEPS: usize = 10;
/// Minimum fraction of signal in the power of the derivative of an output with respect to its
/// delay; the rest of the power is noise. The part of the derivative that modes and residual terms
/// explain is removed first. Below this share the data do not determine the delay.
pub(crate) const LEAST_DELAY_INFORMATION: f64 = 0.5;
/// Maximum step of a delay, relative to the maximum delay.
pub(crate) const MAX_DELAY_STEP: f64 = 0.1;
/// Step of a delay, in standard errors of the delay, below which the steps end.
pub(crate) const DELAY_SETTLED: f64 = 0.1;
/// Minimum effective number of lines at a resonance for an estimate of the scatter of the residual
/// along the mode shape; each line is weighted by its information about the pole.
pub const LEAST_SCATTER_LINES: f64 = 3.0;
