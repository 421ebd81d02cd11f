//! Limits of this crate: the numbers that decide how long to iterate, when to stop and which
//! algorithm to use.

// Matrices.

/// Maximum number of degrees of freedom of a system whose dense matrices are always used as they
/// are.
pub(crate) const DENSE_DOF: usize = 64;

/// Maximum fraction of non-zero entries for which the dense matrices of a system with more than
/// [`DENSE_DOF`] degrees of freedom are converted to sparse matrices.
pub(crate) const SPARSE_FRACTION: f64 = 0.1;

/// Maximum number of diagonals of a matrix that is factored in band form. At this width, solutions
/// for a two-dimensional grid take about as long with a band as with other factors, and the band of
/// 100,000 degrees of freedom takes 0.4 GB.
pub(crate) const BAND_DIAGONALS: usize = 256;

/// Maximum number of diagonals of a matrix that is always factored in band form; no other form is
/// faster.
pub(crate) const NARROW_BAND_DIAGONALS: usize = 32;

/// Smallest ratio of a diagonal entry to the largest entry of its column for which the diagonal
/// entry is the pivot. Below this ratio rows are exchanged, which keeps rounding small but widens
/// the band.
pub(crate) const PIVOT_FRACTION: f64 = 0.1;

/// Maximum number of operations of an LU factorisation that works column by column; above it, the
/// factorisation of `faer`, which works in blocks of columns, is faster.
pub(crate) const COLUMN_OPERATIONS: f64 = 4e9;

/// Largest backward error, relative to the terms of the rows, of an LU factorisation without
/// exchanges of rows. Above it the matrix is factored again with exchanges.
pub(crate) const BACKWARD_ERROR: f64 = 1e-13;

/// Number of inverse iterations that estimate the reciprocal condition of a sparse matrix.
pub(crate) const CONDITION_STEPS: usize = 4;

// Stepping.

/// Maximum number of degrees of freedom of a system whose time steps are computed as products of
/// matrices of fixed size.
pub(crate) const FIXED_SIZE_DOF: usize = 2;

/// Maximum number of secant steps for a nonlinear force in a time step that is computed with
/// matrices of fixed size. If they do not suffice, Newton's method, which has safeguards, computes
/// the time step.
pub(crate) const SECANT_STEPS: usize = 12;

/// Residual, in multiples of the tolerance, above which a secant step updates the slope; below it
/// the residual is mostly rounding.
pub(crate) const SECANT_UPDATE: f64 = 1e3;

/// Number of time steps that the general stepper takes after the method with matrices of fixed size
/// did not solve the equation of a time step; then that method is tried again.
pub(crate) const GENERAL_STEPS: usize = 16;

/// Number of computed values between two log messages about the progress.
pub(crate) const NUMBERS_PER_MESSAGE: usize = 1 << 20;

// Nonlinear equation of a step.

/// Residual of the accelerations, relative to the largest acceleration, at which Newton's method
/// ends.
pub(crate) const STEP_RESIDUAL: f64 = 1e-12;

/// Largest residual, relative to the largest acceleration, that is accepted if no Newton step
/// reduces it. It allows for the rounding error of a small difference of large displacements.
pub(crate) const STEP_RESIDUAL_ROUNDING: f64 = 1e-9;

/// Maximum number of Newton steps.
pub(crate) const STEP_NEWTON_STEPS: usize = 50;

/// Smallest fraction of a Newton step that is tried before the search ends.
pub(crate) const STEP_NEWTON_FRACTION: f64 = 1e-4;

/// Relative change of a displacement or velocity in the forward differences of a tangent, about √ε.
pub(crate) const TANGENT_DIFFERENCE: f64 = 1e-7;

// Periodic responses.

/// Maximum number of degrees of freedom for which the map over a period is formed as a matrix;
/// above it the response is found in a Krylov space.
pub(crate) const PERIOD_MAP_DOF: usize = 300;

/// Correction of the periodic state, relative to the state, at which a linear periodic response is
/// accepted: a tenth of the documented accuracy.
pub(crate) const PERIODIC_GAP: f64 = 1e-13;

/// Relative residual at which a Krylov search for a linear periodic state ends.
pub(crate) const PERIODIC_GMRES_RESIDUAL: f64 = 1e-9;

/// Maximum number of Krylov searches; each one reduces the residual of the previous one.
pub(crate) const PERIODIC_SEARCHES: usize = 8;

/// Maximum number of passes over the period after a linear periodic state is computed from the
/// matrix of the period map. The first pass gives the response; each further pass follows a
/// correction of the state.
pub(crate) const PERIODIC_PASSES: usize = 4;

/// Ratio of a correction of a linear periodic state to the previous correction; above it the
/// remaining error is rounding, and the iteration ends.
pub(crate) const PERIODIC_PROGRESS: f64 = 0.1;

/// Change of the state, relative to the largest displacement, velocity or acceleration, for a
/// derivative by central differences. The error of the derivative is the square of this number.
pub(crate) const SHOOTING_DIFFERENCE: f64 = 1e-5;

/// Maximum memory of the vectors of a Krylov space, in bytes.
pub(crate) const SEARCH_BYTES: usize = 1 << 30;

/// Maximum number of vectors of a Krylov space; each costs a pass over the period.
pub(crate) const SEARCH_VECTORS: usize = 1000;

/// Maximum number of degrees of freedom for which the derivative of the map over a period is formed
/// as a matrix; above it Newton steps are found in a Krylov space.
pub(crate) const MONODROMY_DOF: usize = 64;

/// Relative residual of a Newton step in a Krylov space: each step then reduces the change of the
/// state over a period by about this factor.
pub(crate) const ORBIT_GMRES_RESIDUAL: f64 = 1e-4;

/// Change of the state over a period, relative to the largest displacement, velocity or
/// acceleration, at which Newton's method ends.
pub(crate) const ORBIT_GAP: f64 = 1e-11;

/// Largest change of the state over a period, relative as for [`ORBIT_GAP`], that is accepted if no
/// Newton step reduces this change.
pub(crate) const ORBIT_GAP_ROUNDING: f64 = 1e-8;

/// Maximum number of Newton steps to a periodic orbit.
pub(crate) const ORBIT_NEWTON_STEPS: usize = 40;

/// Smallest fraction of a Newton step that is tried before the search ends.
pub(crate) const ORBIT_NEWTON_FRACTION: f64 = 1.0 / 64.0;

/// Error of the Floquet multipliers, relative to the largest multiplier, if they are the
/// eigenvalues of a derivative that is formed as a matrix.
pub(crate) const MONODROMY_ERROR: f64 = 1e-9;

/// Residual of the largest Floquet multiplier at which Arnoldi's iteration ends: relative to the
/// multiplier, or absolute if its modulus is below 1.
pub(crate) const MULTIPLIER_RESIDUAL: f64 = 1e-6;

/// Maximum number of vectors of the search for the largest Floquet multiplier.
pub(crate) const MULTIPLIER_VECTORS: usize = 200;

/// Number of vectors added to the Krylov space between two evaluations of the largest Floquet
/// multiplier.
pub(crate) const MULTIPLIER_CHECK_INTERVAL: usize = 10;

// Stability.

/// Maximum number of degrees of freedom for which the largest stable step comes from the whole
/// amplification matrix; above it, only the fastest motions of the system are examined.
pub(crate) const AMPLIFICATION_DOF: usize = 20;

/// Maximum number of degrees of freedom for which all eigenvalues of a dense matrix are computed;
/// above it only the largest eigenvalues are computed, in Krylov spaces.
pub(crate) const DENSE_EIGENVALUE_DOF: usize = 200;

/// Largest growth per step that is accepted. Rounding moves the double eigenvalue 1 of a free body
/// by √ε times a condition number, which is not an instability. At the accepted rate a motion needs
/// a million steps to grow by a factor e.
pub(crate) const TOLERATED_GROWTH: f64 = 1e-6;

/// Growth per step above which a step counts as larger than the critical step. The rounding error
/// of two eigenvalues that almost coincide at the critical step is far smaller than this growth.
/// For a system with a free body, [`TOLERATED_GROWTH`] is used instead.
pub(crate) const CRITICAL_GROWTH: f64 = 1e-9;

/// Factor on the stability limit of a scheme for the eigenvalues of M⁻¹K or M⁻¹C. An eigenvalue
/// that is not proved to be below the limit is assumed to be the limit times this factor. The
/// motion of this eigenvalue then grows by more than [`TOLERATED_GROWTH`] per step.
pub(crate) const EXCEEDED_LIMIT: f64 = 1.0 + 1e-8;

/// Largest relative difference of two mirrored entries of a matrix that counts as symmetric.
pub(crate) const ASYMMETRY: f64 = 1e-12;

/// Largest modulus of a negative eigenvalue of C or K, relative to the size of the rows of the
/// matrix, that counts as rounding. For K, the slowest motion may then grow at a rate of 3·10⁻⁷ of
/// the highest natural frequency.
pub(crate) const SEMIDEFINITE_SHIFT: f64 = 1e-13;

/// Maximum number of Lanczos steps to the highest frequency.
pub(crate) const LANCZOS_STEPS: usize = 100;

/// Relative width to which the highest eigenvalue is enclosed by factorisations.
pub(crate) const ENCLOSURE_WIDTH: f64 = 1e-4;

/// First relative increase of the upper bound of the highest eigenvalue; each later increase is
/// twice the previous one.
pub(crate) const ENCLOSURE_STEP: f64 = 0.01;

/// Maximum number of factorisations that raise the upper bound of the highest eigenvalue, and of
/// factorisations that then narrow its enclosure.
pub(crate) const ENCLOSURE_FACTORISATIONS: usize = 64;

/// Number of Arnoldi steps that estimate the eigenvalue of largest modulus.
pub(crate) const ARNOLDI_STEPS: usize = 32;

/// Maximum number of vectors of the search for the fastest growing free motion.
pub(crate) const GROWTH_VECTORS: usize = 40;

/// Number of vectors added to the Krylov space between two evaluations of the growth of the fastest
/// growing free motion.
pub(crate) const GROWTH_CHECK_INTERVAL: usize = 5;

/// Largest excess of a growth factor over 1 that counts as rounding, for example of the double
/// eigenvalue 1 of a free body.
pub(crate) const GROWTH_ROUNDING: f64 = 1e-4;

/// Norm after one period below which a motion counts as vanished; the square of this norm is still
/// a normal floating-point number.
pub(crate) const VANISHED_MOTION: f64 = 1e-150;

/// Number of periods over which a motion is simulated if the Krylov search could not decide whether
/// the motion grows.
pub(crate) const FOLLOWED_PERIODS: usize = 20;

/// Ratio of the energy of a motion in the second half of the [`FOLLOWED_PERIODS`] to its energy in
/// the first half; above this ratio the motion counts as growing.
pub(crate) const FOLLOWED_GROWTH: f64 = 2.0;

// Modes of sparse systems.

/// Maximum number of shifts in a search for modes. Modes that are close together and far from one
/// shift converge from another shift among them.
pub(crate) const SHIFTS: usize = 8;

/// Number of rigid-body modes of a free structure in three dimensions.
pub(crate) const RIGID_BODY_MODES: usize = 6;

/// Shift for a free structure, relative to the highest natural frequency.
pub(crate) const FREE_SHIFT: f64 = 1e-3;

/// Maximum ratio of the frequency of the modes searched for to the scale of the velocities (both in
/// rad/s); the search divides velocities by this scale. Above this ratio, the scale is changed.
pub(crate) const VELOCITY_SCALE_RATIO: f64 = 10.0;

/// Number of inverse iterations that estimate the lowest natural frequency.
pub(crate) const LOWEST_FREQUENCY_STEPS: usize = 3;

/// Largest ratio of the imaginary part of a shift to its modulus for which real factors are used.
pub(crate) const REAL_SHIFT: f64 = 1e-6;

/// Distance between a shift and the eigenvalue near it, relative to the eigenvalue; at a distance
/// of zero the matrix would be singular.
pub(crate) const SHIFT_OFFSET: f64 = 1e-6;

/// Largest relative difference of converged eigenvalues from two shifts that count as the same
/// eigenvalue.
pub(crate) const SAME_EIGENVALUE: f64 = 3e-8;

/// Largest residual of a mode that is preferred for the next shift; a vector with a larger residual
/// may not be a mode.
pub(crate) const SHIFT_RESIDUAL: f64 = 1e-2;

/// Number of start vectors: multiple eigenvalues, such as those of a symmetric rotor in its two
/// planes, are found up to this multiplicity.
pub(crate) const START_VECTORS: usize = 4;

/// Largest relative residual at which an eigenvalue of the inverted operator counts as converged.
pub(crate) const RITZ_RESIDUAL: f64 = 1e-8;

/// Modulus, relative to the largest, below which an eigenvalue of the inverted operator counts as
/// zero.
pub(crate) const NEGLIGIBLE_EIGENVALUE: f64 = 1e-14;

/// Largest relative difference of eigenvalues of the inverted operator that count as one multiple
/// eigenvalue.
pub(crate) const MULTIPLE_EIGENVALUE: f64 = 1e-9;

/// Minimum norm of the part of a unit eigenvector that is orthogonal to the other eigenvectors of
/// the same eigenvalue; above it the eigenvector is independent of these other eigenvectors.
pub(crate) const INDEPENDENT_EIGENVECTOR: f64 = 1e-6;

/// Number of eigenvalues that are examined in addition to the requested modes, because the order of
/// the eigenvalues of the operator differs slightly from the order of the search.
pub(crate) const SPARE_MODES: usize = 8;

/// Largest relative residual of a mode that is returned.
pub(crate) const MODE_RESIDUAL: f64 = 1e-12;
