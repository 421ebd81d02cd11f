//! Some modes of a sparse system, by Arnoldi's iteration with shift and invert.

pub(crate) mod inverse;
mod shift;
mod space;

use mechid_model::{EIGENVALUE_ROUNDING, Matrix, Mode, SecondOrderSystem, SparseSystem};
use nalgebra::{Complex, DMatrix};

use crate::error::IntegrateError;
use crate::limits;
use crate::modes::inverse::{Inverse, highest_frequency};
use crate::modes::shift::{Reach, merge, next_shift};
use crate::modes::space::{Space, residual_of};

/// Modes of a sparse system that [`sparse_modes`] searches for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ModeSearch {
    /// Modes of the lowest natural frequencies |λ|.
    Lowest,
    /// Modes whose eigenvalues λ are nearest to iω, with a positive ω in rad/s.
    NearOmega(f64),
}

/// A mode of a sparse system, and its residual in the equation of motion.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMode {
    /// The mode.
    pub mode: Mode,
    /// Relative residual ‖(λ²M + λC + K) φ‖ / (|λ|²‖M‖ + |λ|‖C‖ + ‖K‖)‖φ‖ in the maximum norm (pure
    /// number).
    pub residual: f64,
    /// `true` for a motion without restoring force: the eigenvalue is zero to rounding.
    pub is_rigid_body: bool,
}

impl SparseMode {
    fn new(mode: Mode, system: &SparseSystem) -> Self {
        let residual = residual_of(system, mode.eigenvalue(), mode.shape());
        let is_rigid_body =
            mode.eigenvalue().norm() <= EIGENVALUE_ROUNDING * highest_frequency(system);
        Self { mode, residual, is_rigid_body }
    }
}

/// Returns `count` modes of a system in the order of the search; fewer if the system has no more.
///
/// ```
/// use mechid_integrate::{ModeSearch, sparse_modes};
/// use mechid_model::{SparseSystem, band};
///
/// // A chain of 10,000 masses between walls: ω = 2 √(k/m) sin(π / 2(n + 1)).
/// let n = 10_000;
/// let stiffness = band(n, &[(-1, -900.0), (0, 1800.0), (1, -900.0)]);
/// let chain = SparseSystem::new(band(n, &[(0, 1.0)]), band(n, &[]), stiffness)?;
/// let found = sparse_modes(&chain, ModeSearch::Lowest, 2)?;
/// let omega = 60.0 * (std::f64::consts::PI / (2.0 * (n + 1) as f64)).sin();
/// assert!((found[0].mode.natural_frequency() / omega - 1.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The matrix K + σC + σ²M is factored with σ = 0 (a small negative number if K is singular) or σ =
/// iω. A subspace grows until the modes are exact to rounding. Its maximum size is 200 vectors plus
/// 20 for each mode. Modes that are too close together, such as the lowest modes of a large grid
/// with stiff springs to ground, do not converge in this space. σ then moves to the first of these
/// modes, and the search begins again. A search uses at most eight shifts. Multiple eigenvalues are
/// found up to a multiplicity of four. The result is very likely complete, but this is not proved.
///
/// # Errors
/// [`IntegrateError::SearchFrequency`] for an ω that is not positive and finite,
/// [`IntegrateError::SingularShift`] if the matrix is singular,
/// [`IntegrateError::FactorsTooLarge`], [`IntegrateError::ModesNotConverged`].
///
/// # Source
/// Bai, Demmel, Dongarra, Ruhe and van der Vorst, *Templates for the Solution of Algebraic
/// Eigenvalue Problems* (2000), sections 3.3 and 9.2; Parlett and Saad (1987), Linear Algebra Appl.
/// 88/89, 575–595, for complex shifts in real arithmetic; Ruhe (1979), Math. Comp. 33, 680–687, for
/// several start vectors.
pub fn sparse_modes(
    system: &SparseSystem,
    search: ModeSearch,
    count: usize,
) -> Result<Vec<SparseMode>, IntegrateError> {
    let ModeSearch::NearOmega(omega) = search else { return search_modes(system, search, count) };
    if !(omega > 0.0 && omega.is_finite()) {
        return Err(IntegrateError::SearchFrequency { omega });
    }
    // A shift near zero makes the dynamic stiffness of a free structure singular to rounding.
    let slow = omega <= limits::FREE_SHIFT * highest_frequency(system);
    if slow
        && Inverse::is_free(system)
        && let Some(modes) = nearest_of_lowest(system, omega, count)?
    {
        return Ok(modes);
    }
    let mut modes = search_modes(system, search, count)?;
    let distance = |mode: &SparseMode| search.distance(mode.mode.eigenvalue());
    let reaches_zero =
        modes.len() < count || modes.last().is_some_and(|last| distance(last) > omega);
    if reaches_zero && Inverse::is_free(system) {
        // The real part of the inverted operator vanishes at λ = 0, so that another search must
        // find the rigid-body modes.
        modes.retain(|mode| !mode.is_rigid_body);
        let lowest = search_modes(system, ModeSearch::Lowest, count.min(limits::RIGID_BODY_MODES))?;
        modes.extend(lowest.into_iter().filter(|mode| mode.is_rigid_body));
        modes.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        modes.truncate(count);
    }
    Ok(modes)
}

/// Returns the modes nearest to iω if the modes of the lowest frequencies certainly contain them:
/// |λ − iω| < R − ω implies |λ| < R, where R is the largest of these lowest frequencies.
fn nearest_of_lowest(
    system: &SparseSystem,
    omega: f64,
    count: usize,
) -> Result<Option<Vec<SparseMode>>, IntegrateError> {
    let wanted = count.saturating_mul(2).saturating_add(limits::RIGID_BODY_MODES);
    let mut modes = match search_modes(system, ModeSearch::Lowest, wanted) {
        Err(IntegrateError::ModesNotConverged { .. }) => return Ok(None),
        modes => modes?,
    };
    let is_all = modes.len() < wanted;
    let radius = modes.last().map_or(0.0, |last| last.mode.natural_frequency());
    let distance =
        |mode: &SparseMode| ModeSearch::NearOmega(omega).distance(mode.mode.eigenvalue());
    modes.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    modes.truncate(count);
    let is_sure = is_all || modes.last().is_none_or(|last| distance(last) < radius - omega);
    Ok(is_sure.then_some(modes))
}

fn search_modes(
    system: &SparseSystem,
    search: ModeSearch,
    count: usize,
) -> Result<Vec<SparseMode>, IntegrateError> {
    let len = 2 * system.dof();
    if count == 0 {
        return Ok(Vec::new());
    }
    let mut inverse = Inverse::new(system, search)?;
    let most = len.min(count.saturating_mul(20).saturating_add(200));
    let (mut known, mut best) = (Vec::new(), 0);
    for shift in 0..limits::SHIFTS {
        let mut space = Space::new(len);
        let mut target = len.min(count.saturating_mul(2).saturating_add(20));
        let (modes, reach, usable) = loop {
            while space.products < target {
                space.grow(&mut inverse);
            }
            let candidates = space.modes(system, &mut inverse, count)?;
            let reach = Reach::new(&candidates, inverse.shift);
            let exhausted = shift > 0 && candidates.iter().all(|mode| mode.converged);
            let modes = merge(candidates, &known, search);
            // A complete space contains all modes of the system.
            let complete = space.products == len;
            let usable = modes.iter().take(count).filter(|mode| mode.converged).count();
            let enough = usable == count
                && (shift == 0 || complete || reach.covers(&modes[..count], search));
            if enough || (complete && usable == modes.len()) {
                let modes = modes.into_iter().take(count);
                return Ok(modes.map(|mode| mode.mode).collect());
            }
            if complete && system.dof() <= limits::DENSE_EIGENVALUE_DOF {
                return all_modes(system, search, count);
            }
            best = best.max(usable);
            if let Some(last) = modes.get(count - 1)
                && inverse.rescale_if_far(last.mode.mode.natural_frequency())
            {
                space = Space::new(len);
                continue;
            }
            // The search continues from another shift in two cases: fewer than a quarter of the
            // requested modes have converged when the space has half of its largest size, or all
            // modes of the space have converged, but requested modes may be missing.
            let stalled = most < len && 2 * target >= most && 4 * usable < count;
            if target == most || stalled || exhausted {
                break (modes, reach, usable);
            }
            target = most.min(target + (target / 4).max(10));
        };
        let Some(next) = next_shift(&modes, &reach, search, usable == count) else { break };
        // Complex factors need twice the memory; if there is not enough, the search ends here.
        let Ok(moved) = Inverse::near(system, next) else { break };
        inverse = moved;
        known = modes.into_iter().filter(|mode| mode.converged).collect();
    }
    Err(IntegrateError::ModesNotConverged { wanted: count, found: best, vectors: most })
}

/// Returns the first `count` of all modes of a small system, in the order of the search.
fn all_modes(
    system: &SparseSystem,
    search: ModeSearch,
    count: usize,
) -> Result<Vec<SparseMode>, IntegrateError> {
    let [mass, damping, stiffness] = Matrix::ALL.map(|which| DMatrix::from(system.matrix(which)));
    let mut modes = SecondOrderSystem::new(mass, damping, stiffness)?.modes()?;
    modes.sort_by(|a, b| {
        search.distance(a.eigenvalue()).total_cmp(&search.distance(b.eigenvalue()))
    });
    modes.truncate(count);
    Ok(modes.into_iter().map(|mode| SparseMode::new(mode, system)).collect())
}

/// Approximation of a mode, and whether it has converged.
#[derive(Clone)]
struct Candidate {
    mode: SparseMode,
    converged: bool,
}

impl Candidate {
    fn value(&self) -> Complex<f64> {
        self.mode.mode.eigenvalue()
    }
}
