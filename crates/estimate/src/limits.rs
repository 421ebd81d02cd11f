//! Limits of this crate, each with what happens on either side.

/// Maximum ratio of the noise power of the motion to the power of the motion on a line that the
/// weighted linear estimate uses; a line with a larger ratio has zero weight.
pub(crate) const WEIGHTING_CLEAR: f64 = 0.1;

/// Maximum number of Gauss–Newton steps after each change of the delay in a search for the delay of
/// the force.
pub(crate) const DELAY_STEPS: usize = 30;

/// Significance level of the test whether the noise of the forces is less than stated.
pub(crate) const FORCE_NOISE_LEVEL: f64 = 0.01;

/// Maximum number of Gauss–Newton steps of the first search by maximum likelihood.
pub(crate) const SEARCH_STEPS: usize = 200;

/// Maximum number of continuations of the best search if no search has converged.
pub(crate) const SEARCHES_CONTINUED: usize = 2;

/// Number of operations of a pass over one line, in addition to those of its matrices; it counts
/// for a limit of the work.
pub(crate) const PASS_OPERATIONS: f64 = 200.0;

/// Maximum number of Gauss–Newton steps of each search after the first one; these searches confirm
/// the minimum of the first.
pub(crate) const STEPS_MORE: usize = 60;

/// Maximum number of Gauss–Newton steps in resampled data, where the search may stop before it
/// converges.
pub(crate) const STEPS_RESAMPLED: usize = 15;

/// Minimum number of values per parameter in the reduced set of lines on which searches begin; a
/// line has one value for each response.
pub(crate) const THIN_LINES: usize = 20;

/// Largest ratio of the number of all lines to the number of lines on which searches begin.
pub(crate) const THIN_STEP: usize = 10;

/// Largest ratio of the sum of squares at the end of a search on fewer lines to the sum of squares
/// of the best minimum on these lines; above it the search does not continue on all lines. The
/// limit is above 1 because the minima change a little with the number of lines.
pub(crate) const THIN_NEAR: f64 = 2.0;

/// Largest relative difference of the sums of squares of two searches that count as one minimum.
pub(crate) const RESTART_SAME: f64 = 1e-6;

/// Largest sum of squares of a fit, in units of the noise or the response, that counts as rounding.
pub(crate) const RESTART_EXACT: f64 = 1e-16;

/// Relative difference of the sums of squares of two initial estimates below which the search from
/// the second one comes last, because it probably ends at the same minimum as the search from the
/// first one.
pub(crate) const RESTART_ALIKE: f64 = 0.01;

/// Minimum number of searches if the noise explains the sum of squares at the best minimum.
pub(crate) const RESTART_CONFIRMED: usize = 2;

/// Minimum number of searches if the noise does not explain the sum of squares at the best minimum.
pub(crate) const CONFIRMED_OTHERWISE: usize = 4;

/// Maximum number of rounds of linear least squares before a search.
pub(crate) const LINEAR_ROUNDS: usize = 6;

/// Number of successive restarts without a better minimum that end the search, if the best search
/// has converged and the noise does not explain the difference between the two smallest sums of
/// squares.
pub(crate) const RESTART_RESTARTS: usize = 2;

/// Number of successive restarts without a better minimum that end the search, if the best search
/// has not converged or the noise explains the difference between the two smallest sums of squares.
pub(crate) const RESTARTS_AMONG_MANY: usize = 12;

/// Maximum number of restarts of a search from its best minima.
pub(crate) const MAX_RESTARTS: u64 = 60;

/// Maximum number of best minima at which restarts begin in turn, if the best search has not
/// converged or the noise explains the difference between the two smallest sums of squares;
/// otherwise all restarts begin at the best minimum.
pub(crate) const RESTART_RESTARTED: usize = 3;

/// Ratio of a diagonal entry of a triangular factor to the length of its column below which the
/// regressors count as linearly dependent.
pub(crate) const GRAM_DEPENDENT: f64 = 1e-14;

/// Ridge added to every regressor of related entries, relative to the length of the regressor, so
/// that linearly dependent regressors still have a triangular factor.
pub(crate) const GRAM_RIDGE: f64 = 1e-7;

/// Number of lines whose products are in memory at a time, on each thread.
pub(crate) const GRAM_LINES: usize = 256;

/// Number of lines that one thread computes at a time. With fewer lines the division among threads
/// costs more time than it saves. The number also fixes the order of sums over the lines.
pub(crate) const LINES_AT_ONCE: usize = 64;

/// Maximum number of Lanczos steps; after this number, an extreme eigenvalue is accurate to many
/// digits.
pub(crate) const GRAM_LANCZOS: usize = 80;

/// Largest excess of the sum of squares of a correct model over its expected value that noise
/// explains, in standard deviations.
pub(crate) const FIT_PLAUSIBLE: f64 = 6.0;

/// Maximum number of sensitivities (residuals times parameters times parts) for a comparison of the
/// parts of the data and for a test of omitted terms: 128 MiB of numbers. Larger fits have neither
/// the comparison nor the test.
pub(crate) const MAX_PARTS: usize = 1 << 24;

/// Maximum number of sensitivities (residuals times parameters) for the correction of the window
/// bias of averaged responses, and for a covariance with correlated lines: 128 MiB of numbers.
/// Larger fits are not corrected and assume independent errors of the lines; they count as not
/// settled if the window smooths the responses.
pub(crate) const MAX_SENSITIVITIES: usize = 1 << 24;

/// Number of partial sums of the products of the effects of pulses. It limits the memory of the
/// sums. The number is fixed, so that the result does not depend on the number of threads.
pub(crate) const PULSE_SUMS: usize = 8;

/// Maximum number of effects of the errors of pulses on the residuals, and maximum number of
/// sensitivities of a fit with pulse errors: 128 MiB of numbers each; some copies are in memory at
/// the same time. In a larger fit the errors of the lines are assumed to be independent.
pub(crate) const MAX_PULSE_EFFECTS: usize = 1 << 24;

/// Maximum number of rounds that alternate between an estimate of the errors of pulses and a fit to
/// the data without these errors; about three rounds suffice.
pub(crate) const PULSE_ROUNDS: usize = 8;

/// Change of the amplitudes of pulse errors, in standard deviations of the stated noise, below
/// which the alternating rounds ([`PULSE_ROUNDS`]) end.
pub(crate) const PULSE_SETTLED: f64 = 0.02;

/// Relative change of the noise levels that ends the rounds of weighting.
pub(crate) const WEIGHT_TOLERANCE: f64 = 1e-3;

/// Largest ratio of residual to motion that counts as rounding.
pub(crate) const RESIDUAL_ROUNDING: f64 = 1e-12;

/// Maximum number of rounds of weighting by noise levels; three nearly always suffice.
pub(crate) const MAX_ROUNDS: usize = 10;

/// Maximum number of rounds of weighting by a noise spectrum: the first one gives an efficient
/// estimate, the others refine the shape of the spectrum.
pub(crate) const COLOURED_ROUNDS: usize = 3;

/// Maximum number of sensitivities (residuals times parameters) for the computation of leverages;
/// larger fits neglect the leverages.
pub(crate) const MAX_LEVERAGES: usize = 1 << 20;

/// Maximum number of rounds that alternate between a search for sinusoids in the residual and a fit
/// to the data without these sinusoids.
pub(crate) const SINUSOID_ROUNDS: usize = 8;

/// Change of the data without sinusoids in one round, relative to the residual. Below this change
/// the rounds of fit and subtraction end.
pub(crate) const SINUSOID_TOLERANCE: f64 = 1e-3;

/// Minimum power of the residual at a line, relative to the noise power of the previous round. A
/// smaller power is replaced by this minimum; otherwise the weight of the line would be unbounded.
pub(crate) const NOISE_LEAST: f64 = 1e-12;

/// Minimum assumed fraction of the noise that remains in a residual after the fit (1 − leverage).
pub(crate) const NOISE_KEPT: f64 = 0.1;

/// Number of rounds of the initial estimates, each weighted by the dynamic stiffness of the round
/// before.
pub(crate) const INITIAL_ROUNDS: usize = 4;

/// Maximum number of corrections of the window bias; each removes most of the remaining bias.
pub(crate) const SHARPENING_ROUNDS: usize = 20;

/// Step, in standard errors of the parameters, below which the corrections of the window bias end.
pub(crate) const SHARPENING_SETTLED: f64 = 0.02;

/// Minimum modal assurance criterion of the shapes of two real eigenvalues that form an overdamped
/// pair, if there are several pairs.
pub(crate) const SAME_SHAPE: f64 = 0.9;

/// Level of the confidence interval of the squared natural frequency: a mode is a rigid-body mode
/// if this interval contains zero.
pub(crate) const RIGID_BODY_LEVEL: f64 = 0.99;

/// Singular value, relative to the largest one, below which a direction of the initial state is
/// unobservable.
pub(crate) const INITIAL_UNSEEN: f64 = 1e-10;

/// Maximum number of steps of the search for proportional damping, the only nonlinear relation.
pub(crate) const RELATED_STEPS: usize = 100;

/// Relative change of the unknowns that ends the search for proportional damping.
pub(crate) const RELATED_SETTLED: f64 = 1e-12;

/// Largest ratio of residual to force of an equation that counts as rounding.
pub(crate) const EQUATION_ROUNDING: f64 = 1e-11;

/// Minimum number of rows per equation for an estimate of the correlation between equations; with
/// fewer rows the residuals of the equations are assumed to be uncorrelated.
pub(crate) const ROWS_PER_EQUATION: usize = 10;

/// Number of pairs of samples that are reduced to triangular form at a time.
pub(crate) const TRANSITION_BLOCK: usize = 256;

/// Number of parts that the band of a fit, or the time of a record, is split into for a comparison:
/// with fewer parts an error of the model averages out within a part, with more parts each part has
/// too few lines.
pub(crate) const PARTS: usize = 4;

/// Minimum information of a part of the data about a combination of parameters, relative to the
/// information of all data; with less information the part does not determine the combination.
pub(crate) const PART_INFORMS: f64 = 1e-9;

/// Number of omitted terms that are tested at once: enough for products at the speed of the
/// processor, few enough for their memory.
pub(crate) const TERMS_AT_ONCE: usize = 8;

/// Largest distance, in lines, between lines whose errors are correlated by Hann's window, the
/// usual window of analysers.
pub(crate) const CORRELATED_DISTANCES: usize = 2;

/// p-value below which the errors of neighbouring lines of a table are treated as correlated.
pub(crate) const CORRELATED_LINES: f64 = 0.01;

/// Largest deviation of the distance between two lines from a multiple of the smallest distance, in
/// units of the smallest distance. It allows for the rounding of numbers in a file.
pub(crate) const LINE_STEP: f64 = 0.01;
