//! Limits of this crate: the numbers that decide how long to iterate and when to stop.

/// Maximum number of Newton steps on each mesh, for the journal and for the fronts of a film.
pub(crate) const NEWTON_STEPS: usize = 60;

/// Longest step of the journal, in clearances; with longer steps, Newton's method may diverge.
pub(crate) const JOURNAL_STEP: f64 = 0.1;

/// Smallest ratio of the minimum film thickness after a step of the journal to that before the
/// step.
pub(crate) const STEP_FILM_FRACTION: f64 = 0.3;

/// Limits of the last step on each mesh, from coarse to fine; below them, the solution on this mesh
/// has converged. The step of the journal is relative to the smallest film thickness, the step of
/// the fronts is in rad. Newton's method converges quadratically, so that the remaining error is
/// about the square of the last step.
pub(crate) const MESH_TOLERANCES: [f64; 3] = [1e-2, 1e-3, 1e-6];

/// Maximum eccentricity in the formula that makes the mesh denser where the film is thin; a larger
/// eccentricity does not change the density further.
pub(crate) const GRADED_ECCENTRICITY: f64 = 0.99;

/// Largest change of a front in one step, in rad.
pub(crate) const FRONT_STEP: f64 = 0.3;

/// Smallest fraction of the converging arc that a film covers; a smaller film could vanish.
pub(crate) const FILM_FRACTION: f64 = 0.6;

/// Change of a front (rad) above which the pressure is computed again; after a smaller change, the
/// pressure is corrected to first order.
pub(crate) const PRESSURE_UPDATE: f64 = 0.02;
