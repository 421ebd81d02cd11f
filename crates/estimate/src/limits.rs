//! Limits that decide something in this crate, each with what happens on either side.

/// Noise of more than this part of a line's power makes it unclear.
pub(crate) const WEIGHTING_CLEAR: f64 = 0.1;

/// Steps of the search from one delay to the next.
pub(crate) const DELAY_STEPS: usize = 30;

/// Steps of the first search.
pub(crate) const SEARCH_STEPS: usize = 200;

/// Steps of the others, which are there to confirm it.
pub(crate) const STEPS_MORE: usize = 60;

/// Steps of a search in resampled data, which need not end at a minimum.
pub(crate) const STEPS_RESAMPLED: usize = 15;

/// Minima whose sums of squares differ by less than this share are one.
pub(crate) const RESTART_SAME: f64 = 1e-6;

/// Sums of squares as small as this, in units of the noise or the response, are rounding.
pub(crate) const RESTART_EXACT: f64 = 1e-16;

/// InitialEstimates whose sums of squares differ by less than this share are searched from last, for they
/// would lead to the same minimum.
pub(crate) const RESTART_ALIKE: f64 = 0.01;

/// Searches at least where the noise explains the best minimum.
pub(crate) const RESTART_CONFIRMED: usize = 2;

/// Searches at least where it does not.
pub(crate) const CONFIRMED_OTHERWISE: usize = 4;

/// Rounds of linear least squares before a search.
pub(crate) const LINEAR_ROUNDS: usize = 6;

/// Restarts in a row that have to find nothing better where one minimum only has been seen.
pub(crate) const RESTART_RESTARTS: usize = 2;

/// The same where there are several that the noise explains.
pub(crate) const RESTARTS_AMONG_MANY: usize = 12;

/// Restarts at most.
pub(crate) const MAX_RESTARTS: u64 = 60;

/// Ends of searches from which restarts are made, by turns.
pub(crate) const RESTART_RESTARTED: usize = 3;

/// A diagonal entry of a triangle below this part of its column: the regressors are dependent.
pub(crate) const GRAM_DEPENDENT: f64 = 1e-14;

/// Part of its length that every regressor of related entries has to itself.
pub(crate) const GRAM_RIDGE: f64 = 1e-7;

/// Lines whose products are held at a time.
pub(crate) const GRAM_LINES: usize = 256;

/// Steps of Lanczos, after which an extreme eigenvalue is known to many digits.
pub(crate) const GRAM_LANCZOS: usize = 80;

/// Standard deviations by which the misfit ratio of a right model may differ from 1.
pub(crate) const FIT_PLAUSIBLE: f64 = 6.0;

/// Maximum number of sensitivities, residuals times parameters; of larger fits the lines are taken to err one by one.
pub(crate) const MAX_SENSITIVITIES: usize = 1 << 22;

/// Relative change of the noise levels below which another round of weighting is useless.
pub(crate) const WEIGHT_TOLERANCE: f64 = 1e-3;

/// A residual this small against the motion is rounding.
pub(crate) const RESIDUAL_ROUNDING: f64 = 1e-12;

/// Rounds of weighting by levels; the second is nearly always the last but one.
pub(crate) const MAX_ROUNDS: usize = 10;

/// Rounds of weighting by a spectrum: the first is efficient already, the others find its form.
pub(crate) const COLOURED_ROUNDS: usize = 3;

/// Maximum number of sensitivities, residuals times parameters, of which leverages are computed.
pub(crate) const MAX_LEVERAGES: usize = 1 << 20;

/// Rounds of sinusoids found in the residual of a fit to what is left without those found before, and the change
/// of what is left, over the residual, below which another one is useless.
pub(crate) const SINUSOID_ROUNDS: usize = 8;
pub(crate) const SINUSOID_TOLERANCE: f64 = 1e-3;

/// Least power of a residual, relative to that of the noise before.
pub(crate) const NOISE_LEAST: f64 = 1e-12;

/// Least part of its noise that a residual is taken to keep.
pub(crate) const NOISE_KEPT: f64 = 0.1;

/// Rounds of weighting by the dynamic stiffness found before.
pub(crate) const INITIAL_ROUNDS: usize = 4;

/// Rounds of sharpening at most; each takes most of what is left of the bias.
pub(crate) const SHARPENING_ROUNDS: usize = 20;

/// Step, in standard errors of the parameters, below which nothing is left.
pub(crate) const SHARPENING_SETTLED: f64 = 0.02;

/// Least modal assurance criterion of real eigenvalues that belong together where there are several pairs.
pub(crate) const SAME_SHAPE: f64 = 0.9;

/// Level of the interval by which a mode is one of a rigid body.
pub(crate) const RIGID_BODY_LEVEL: f64 = 0.99;

/// Relative singular value below which a direction of the start does not show in the motion.
pub(crate) const INITIAL_UNSEEN: f64 = 1e-10;

/// Steps of the search for proportional damping, the only relation that is not linear.
pub(crate) const RELATED_STEPS: usize = 100;

/// Change of the unknowns, in their scale, that ends the search.
pub(crate) const RELATED_SETTLED: f64 = 1e-12;

/// Residual of an equation over its force that is rounding.
pub(crate) const EQUATION_ROUNDING: f64 = 1e-11;

/// Rows per equation from which the residuals show how the equations are correlated.
pub(crate) const ROWS_PER_EQUATION: usize = 10;

/// Pairs reduced at a time.
pub(crate) const TRANSITION_BLOCK: usize = 256;

/// Number of parts into which the band of a fit, or the time of a record, is split to compare what they say: fewer
/// average an error of the model away, more have too few lines each.
pub(crate) const PARTS: usize = 4;

/// Information of a part about a combination of parameters, relative to that of all data, below which it says nothing.
pub(crate) const PART_INFORMS: f64 = 1e-9;
