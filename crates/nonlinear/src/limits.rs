//! Limits of this crate. They decide when a search ends, and which effects are significant, are
//! negligible or are due to rounding.

/// Number of operations, for a limit of the work, of the simulation of one sample of a degree of
/// freedom, for each pair of a degree of freedom and a direction.
pub(crate) const SAMPLE_OPERATIONS: f64 = 40.0;

/// Maximum number of Gauss–Newton steps of a search; a search that needs more did not start near a
/// minimum.
pub(crate) const SEARCH_STEPS: usize = 60;

/// Maximum number of blocks of time into which one experiment is divided for standard errors.
pub(crate) const COVARIANCE_MOST: usize = 32;

/// Minimum number of blocks, summed over all experiments, for standard errors from the scatter of
/// the blocks.
pub(crate) const FEWEST: usize = 10;

/// Minimum length of a block, in time constants of the free response: for blocks of at least this
/// length, the scores of neighbouring blocks are nearly independent.
pub(crate) const TIME_CONSTANTS: f64 = 3.0;

/// Minimum amplitude of the force on a driven line, relative to the largest amplitude; mains hum in
/// the force channel is below this limit.
pub(crate) const DISTORTION_DRIVEN: f64 = 0.03;

/// Significance level of the test for a kind of nonlinearity.
pub(crate) const DISTORTION_SIGNIFICANT: f64 = 1e-3;

/// Maximum number of degrees of freedom for which terms between any two of them are tested.
pub(crate) const DISTORTION_PAIRS: usize = 4;

/// Velocity b of the friction that is tried as a missing term, relative to the largest velocity; at
/// velocities below b the friction force is nearly proportional to the velocity. A smaller b needs
/// more harmonics than a record has.
pub(crate) const FRICTION_WIDTH: f64 = 0.05;

/// Maximum number of weighting rounds.
pub(crate) const WEIGHTING_ROUNDS: usize = 12;

/// Relative change of the weights below which the weighting rounds end.
pub(crate) const WEIGHTING_SETTLED: f64 = 1e-3;

/// Number of lines per block of rows of the least squares, which limits the memory.
pub(crate) const EQUATIONS_CHUNK: usize = 256;

/// Oversampling of the grid on which nonlinear terms are evaluated: products of up to seven lines
/// of the record do not alias into its band.
pub(crate) const EXPERIMENT_FINER: usize = 4;

/// Number of time constants of the slowest mode after which the effect of the initial state is
/// negligible.
pub(crate) const OUTPUT_FORGOTTEN: f64 = 8.0;

/// Maximum number of Newton steps towards a periodic response.
pub(crate) const PREDICTION_SHOTS: usize = 30;

/// Maximum change of the state over one period, relative to the state, for a steady state.
pub(crate) const PREDICTION_CLOSED: f64 = 1e-10;

/// Growth exponent of a term above which the extrapolation of this term is unreliable.
pub(crate) const HIGHEST_ORDER: f64 = 3.5;

/// Standard error of the restoring force, relative to the restoring force, above which the
/// extrapolation of this force is poor.
pub(crate) const RESTORING_POOR: f64 = 0.1;

/// Ratio of the force of a term to the restoring force below which the growth of the term is
/// negligible.
pub(crate) const RESTORING_NEGLIGIBLE: f64 = 0.01;

/// Significance level of the test on experiments that are excluded from the fit.
pub(crate) const SELECTION_LEVEL: f64 = 0.05;

/// Significance level of the tests of a coefficient, for all candidates together, and of a
/// residual.
pub(crate) const SIGNIFICANT: f64 = 0.01;

/// Step of a derivative with respect to a shape constant, relative to the constant or its scale.
pub(crate) const SHAPE_STEP: f64 = 1e-5;

/// Scale of a phase of the channels, in rad.
pub(crate) const SHAPE_RADIAN: f64 = 1.0;

/// Maximum phase angle (rad) of the fastest mode of the linear part in one step.
pub(crate) const SIMULATION_TURN: f64 = 0.3;

/// Minimum number of steps in a sampling interval: the force may change sign from sample to sample.
pub(crate) const FEWEST_STEPS: usize = 2;

/// Maximum number of steps in a sampling interval.
pub(crate) const MOST_STEPS: usize = 256;

/// Change of the response due to a doubled number of steps, relative to the peak of the response,
/// below which the refinement ends: the remaining error of a fourth-order method is a fifteenth of
/// this change.
pub(crate) const SIMULATION_SETTLED: f64 = 1.5e-4;

/// Relative step of the derivative with respect to a constant of a law.
pub(crate) const SIMULATION_STEP: f64 = 1e-6;

/// Minimum half-width, in lines, of the averages of the residual spectrum.
pub(crate) const HALF_WIDTH: usize = 10;

/// Maximum number of independent averages of a smooth spectrum: each average is over neighbouring
/// lines.
pub(crate) const WEIGHTING_GROUPS: usize = 32;

/// Minimum average of the residual power around a line, relative to the largest residual power of
/// the same equation; a lower average is raised to this limit.
pub(crate) const WEIGHTING_FLOOR: f64 = 1e-12;

/// Total number of windows for the first search on open records: over many cycles, the response of
/// a wrong model loses its phase relation to the measured response, and the cost has many minima.
pub(crate) const OPEN_WINDOWS: usize = 16;

/// Maximum scatter of the periods of a record, relative to its RMS, that counts as rounding instead
/// of noise.
pub(crate) const SCATTER_ROUNDING: f64 = 1e-9;

/// Largest logarithm of the ratio of a noise variance to its initial value; with a larger ratio one
/// of the kinds of noise is negligible.
pub(crate) const NOISE_SPAN: f64 = 14.0;

/// First step of the search for the noise variances: a change of the logarithm of a variance ratio.
pub(crate) const NOISE_STEP: f64 = 2.0;

/// Change of twice the logarithm of the likelihood below which the search for the noise variances
/// ends: a hundredth of the change due to the uncertainty of the variances.
pub(crate) const NOISE_SETTLED: f64 = 0.01;

/// Maximum number of rounds of the search for the noise variances.
pub(crate) const NOISE_ROUNDS: usize = 200;

/// Maximum number of lags of the test for a white residual.
pub(crate) const WHITE_LAGS: usize = 25;
