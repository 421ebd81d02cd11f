//! Numbers that decide something in the likelihood, with their reasons.

/// Order of the polynomial in s that the transient of an open record adds to every output. What the
/// samples fold back from above half their rate is smooth over the band; with the loads of the
/// states, order 3 is the load polynomial of order 5 that a machine with all degrees of freedom
/// measured has.
pub(super) const TRANSIENT_ORDER: usize = 3;

/// Smallest part that a column of a transient may have beside the others; below it the column is
/// dependent on them, and rounding would decide its coefficient.
pub(super) const TRANSIENT_RANK: f64 = 1e-12;

/// Ratio of singular values of the scaled Jacobian below which a combination of parameters is not
/// determined: rounding of the responses, with a reserve.
pub(super) const RANK: f64 = 1e-9;

/// Relative standard error beyond which a parameter counts as weakly determined: its interval comes
/// from the profile of the likelihood, for the likelihood is no parabola over such a distance.
pub(super) const WEAK: f64 = 0.3;

/// Relative noise with which the first steps of every search are weighted: the response counts by
/// its relative deviation, so that a resonance in the wrong place does not outweigh all other
/// lines.
pub(super) const FIRST_RELATIVE_NOISE: f64 = 0.3;

/// Maximum number of steps with relative weights.
pub(super) const FIRST_STEPS: usize = 40;

/// Maximum number of steps of a search.
pub(super) const STEPS: usize = 200;

/// Relative difference of two sums of squares below which two searches ended at one minimum.
pub(super) const SAME_MINIMUM: f64 = 1e-6;

/// Standard deviations by which the misfit of a right model exceeds its expectation at most.
pub(super) const PLAUSIBLE: f64 = 6.0;

/// Relative change of the noise levels below which another round of weighting is useless.
pub(super) const NOISE_LEVEL_CHANGE: f64 = 1e-6;

/// Maximum number of rounds in which levels of white noise and parameters are found in turn.
pub(super) const NOISE_ROUNDS: usize = 30;

/// Number of rounds of weighting by a noise spectrum: the first is efficient, the others find its
/// form.
pub(super) const COLOURED_ROUNDS: usize = 3;

/// Smallest power of a residual relative to that of the noise of the round before; a line without
/// any residual would take all the weight.
pub(super) const LEAST_POWER: f64 = 1e-12;

/// Smallest part of its noise that a residual keeps beside the parameters.
pub(super) const LEAST_KEPT: f64 = 0.1;

/// Maximum number of degrees of freedom of a machine with open records, whose transient acts on
/// each of them: the cost of a line grows with their cube.
pub(super) const OPEN_DOFS: usize = 60;

/// Number of searches that have to end at the lowest minimum where the known noise explains it;
/// otherwise every first value is searched from.
pub(super) const CONFIRMED: usize = 2;

/// The same where the noise is unknown, so that no misfit says whether a minimum is a right one.
pub(super) const CONFIRMED_WITHOUT_NOISE: usize = 4;

/// Level of significance of the misfit of known noise below which standard errors and intervals are
/// those of the misfit: a right model gets wider intervals than it needs in one of a thousand fits.
pub(super) const MISFIT_SIGNIFICANCE: f64 = 1e-3;

/// Part of a gradient outside the determined combinations above which the quantity is not
/// determined; less is rounding of the singular vectors.
pub(super) const UNDETERMINED_PART: f64 = 1e-5;

/// Part of its terms that a combination of parameters has at most if it depends on their ratios
/// alone; a combination of another kind has most of them.
pub(super) const COMMON_FACTOR: f64 = 1e-4;
