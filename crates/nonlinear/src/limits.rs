//! Limits that decide something in this crate, each with what happens on either side.

/// Maximum number of Gauss–Newton steps of a search; more of them mean that the start was not near a minimum.
pub(crate) const SEARCH_STEPS: usize = 60;

/// Blocks of one experiment, at most.
pub(crate) const COVARIANCE_MOST: usize = 32;

/// Blocks of all experiments from which their scatter is trusted.
pub(crate) const FEWEST: usize = 10;

/// Time constants of the free response that a block is long, at least: scores of neighbouring blocks
/// are then nearly independent.
pub(crate) const TIME_CONSTANTS: f64 = 3.0;

/// Part of the largest amplitude of the force from which a line counts as driven: mains hum in the
/// channel of the force does not.
pub(crate) const DISTORTION_DRIVEN: f64 = 0.03;

/// Probability below which a kind is named.
pub(crate) const DISTORTION_SIGNIFICANT: f64 = 1e-3;

/// Degrees of freedom up to which terms between any two of them are looked for.
pub(crate) const DISTORTION_PAIRS: usize = 4;

/// Rounds of weighting, at most.
pub(crate) const WEIGHTING_ROUNDS: usize = 12;

/// Change of the weights, relative, below which another round is useless.
pub(crate) const WEIGHTING_SETTLED: f64 = 1e-3;

/// Lines whose rows are handed to the least squares at a time.
pub(crate) const EQUATIONS_CHUNK: usize = 256;

/// Samples of the grid that nonlinear terms are evaluated on, per sample: products of up to seven
/// lines of the record do not fold back onto it.
pub(crate) const EXPERIMENT_FINER: usize = 4;

/// Time constants of the slowest mode after which the start shows no longer.
pub(crate) const OUTPUT_FORGOTTEN: f64 = 8.0;

/// Newton steps towards a periodic response, at most.
pub(crate) const PREDICTION_SHOTS: usize = 30;

/// Change of the state over a period, relative, that counts as none.
pub(crate) const PREDICTION_CLOSED: f64 = 1e-10;

/// Power above which a term grows faster than data of one amplitude can vouch for.
pub(crate) const HIGHEST_ORDER: f64 = 3.5;

/// Relative standard error of the restoring force above which its extrapolation is poor.
pub(crate) const RESTORING_POOR: f64 = 0.1;

/// Part of the restoring force below which the growth of a term does not matter.
pub(crate) const RESTORING_NEGLIGIBLE: f64 = 0.01;

/// Level of the test on experiments held out.
pub(crate) const SELECTION_LEVEL: f64 = 0.05;

/// Level of the tests on a coefficient, for all candidates together, and on a residual.
pub(crate) const SIGNIFICANT: f64 = 0.01;

/// Step of a derivative with respect to a constant, relative to its size or scale.
pub(crate) const SHAPE_STEP: f64 = 1e-5;

/// Scale of a phase, in rad.
pub(crate) const SHAPE_RADIAN: f64 = 1.0;

/// Angle (rad) that the fastest mode of the linear part may turn in a step.
pub(crate) const SIMULATION_TURN: f64 = 0.3;

/// Steps in a sampling interval, at least: the force may change sign from sample to sample.
pub(crate) const FEWEST_STEPS: usize = 2;

/// Steps in a sampling interval, at most.
pub(crate) const MOST_STEPS: usize = 256;

/// Change of the response, as a part of its peak, by twice as many steps, that shows enough of them:
/// what is left of a rule of fourth order is a fifteenth of it.
pub(crate) const SIMULATION_SETTLED: f64 = 1.5e-4;

/// Relative step of the derivative with respect to a constant of a law.
pub(crate) const SIMULATION_STEP: f64 = 1e-6;

/// Lines to either side that the spectrum of the residual is averaged over, at least.
pub(crate) const HALF_WIDTH: usize = 10;

/// Averages of independent lines that a smooth spectrum has, at most.
pub(crate) const WEIGHTING_GROUPS: usize = 32;

/// Part of the largest residual power of an equation below which none is taken to lie.
pub(crate) const WEIGHTING_FLOOR: f64 = 1e-12;

/// Windows, in all, that open records are cut into for the first search: the response to a wrong start runs out of step
/// with the measured one over many cycles, which many minima follow from.
pub(crate) const OPEN_WINDOWS: usize = 16;

/// Scatter of the periods of a record over its RMS below which it is rounding, and no noise to compare a residual with.
pub(crate) const SCATTER_ROUNDING: f64 = 1e-9;
