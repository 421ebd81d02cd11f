//! Some modes of a sparse system, by Arnoldi's iteration with shift and invert.

mod inverse;
mod shift;
mod space;

use mechid_model::{EIGENVALUE_ROUNDING, Matrix, Mode, SecondOrderSystem, SparseSystem};
use nalgebra::{Complex, DMatrix};

pub(crate) use self::inverse::dynamic_stiffness;
use self::inverse::{FREE_SHIFT, Inverse, fastest};
use self::shift::{Reach, joined, next_shift};
use self::space::{Space, residual_of};
use crate::IntegrateError;

/// The modes of a sparse system that [`sparse_modes`] looks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ModeSearch {
    /// Modes of the lowest natural frequencies |λ|.
    Lowest,
    /// Modes whose eigenvalues λ lie nearest to iω, with a positive ω in rad/s.
    NearOmega(f64),
}

/// A mode of a sparse system, and how well it meets the equation.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMode {
    /// The mode.
    pub mode: Mode,
    /// ‖(λ²M + λC + K) φ‖ / (|λ|²‖M‖ + |λ|‖C‖ + ‖K‖)‖φ‖ in the norm of the largest entry (pure number).
    pub residual: f64,
    /// `true` for a motion without restoring force: the eigenvalue is zero to rounding.
    pub is_rigid_body: bool,
}

impl SparseMode {
    fn of(mode: Mode, system: &SparseSystem) -> Self {
        let residual = residual_of(system, mode.eigenvalue(), mode.shape());
        let is_rigid_body = mode.eigenvalue().norm() <= EIGENVALUE_ROUNDING * fastest(system);
        Self { mode, residual, is_rigid_body }
    }
}

/// Largest number of shifts: modes that lie close together and far from the shift of one are found from
/// another among them.
const SHIFTS: usize = 8;

/// Number of degrees of freedom up to which all modes are computed where a space of all vectors has not found them.
const MOST_DENSE: usize = 200;

/// Number of motions without restoring force that a free machine has, as a body in three dimensions.
const RIGID_BODY_MODES: usize = 6;

/// Returns `count` modes of a system, those searched for that come first; fewer if it has no more.
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
/// The matrix K + σC + σ²M is factored with σ = 0 or a small negative number where K is singular, or σ = iω;
/// a subspace grows until the modes are exact to rounding, to 20 vectors for each and 200 more at most. Where they
/// lie too close together for that, such as above the floor that springs to ground give a spectrum, σ moves
/// to the first of them and the search begins again, from eight shifts at most.
/// Modes of one eigenvalue are found up to four. That no mode between those returned was missed is likely, not
/// proved.
///
/// # Errors
/// [`IntegrateError::SearchFrequency`] for an ω that is not positive and finite, [`IntegrateError::SingularShift`]
/// if the matrix is singular, [`IntegrateError::FactorsTooLarge`], [`IntegrateError::ModesNotConverged`].
///
/// # Source
/// Bai, Demmel, Dongarra, Ruhe and van der Vorst, *Templates for the Solution of Algebraic Eigenvalue
/// Problems* (2000), sections 3.3 and 9.2; Parlett and Saad (1987), Linear Algebra Appl. 88/89, 575–595, for
/// complex shifts in real arithmetic; Ruhe (1979), Math. Comp. 33, 680–687, for several start vectors.
pub fn sparse_modes(
    system: &SparseSystem,
    search: ModeSearch,
    count: usize,
) -> Result<Vec<SparseMode>, IntegrateError> {
    let ModeSearch::NearOmega(omega) = search else { return searched(system, search, count) };
    if !(omega > 0.0 && omega.is_finite()) {
        return Err(IntegrateError::SearchFrequency { omega });
    }
    // There the dynamic stiffness of a free machine is singular to rounding.
    let slow = omega <= FREE_SHIFT * fastest(system);
    if slow
        && Inverse::is_free(system)
        && let Some(found) = nearest_of_lowest(system, omega, count)?
    {
        return Ok(found);
    }
    let mut found = searched(system, search, count)?;
    let distance = |found: &SparseMode| search.distance(found.mode.eigenvalue());
    let reaches_zero =
        found.len() < count || found.last().is_some_and(|last| distance(last) > omega);
    if reaches_zero && Inverse::is_free(system) {
        // The real part of the inverted operator vanishes at λ = 0.
        found.retain(|found| !found.is_rigid_body);
        let lowest = searched(system, ModeSearch::Lowest, count.min(RIGID_BODY_MODES))?;
        found.extend(lowest.into_iter().filter(|found| found.is_rigid_body));
        found.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        found.truncate(count);
    }
    Ok(found)
}

/// The modes nearest to iω if those of the lowest frequencies are sure to have all of them: |λ − iω| < R − ω
/// makes |λ| < R.
fn nearest_of_lowest(
    system: &SparseSystem,
    omega: f64,
    count: usize,
) -> Result<Option<Vec<SparseMode>>, IntegrateError> {
    let wanted = count.saturating_mul(2).saturating_add(RIGID_BODY_MODES);
    let mut found = match searched(system, ModeSearch::Lowest, wanted) {
        Err(IntegrateError::ModesNotConverged { .. }) => return Ok(None),
        found => found?,
    };
    let is_all = found.len() < wanted;
    let radius = found.last().map_or(0.0, |last| last.mode.natural_frequency());
    let distance =
        |found: &SparseMode| ModeSearch::NearOmega(omega).distance(found.mode.eigenvalue());
    found.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    found.truncate(count);
    let is_sure = is_all || found.last().is_none_or(|last| distance(last) < radius - omega);
    Ok(is_sure.then_some(found))
}

fn searched(
    system: &SparseSystem,
    search: ModeSearch,
    count: usize,
) -> Result<Vec<SparseMode>, IntegrateError> {
    let len = 2 * system.dof();
    if count == 0 {
        return Ok(Vec::new());
    }
    let mut inverse = Inverse::of(system, search)?;
    let most = len.min(count.saturating_mul(20).saturating_add(200));
    let (mut known, mut best) = (Vec::new(), 0);
    for shift in 0..SHIFTS {
        let mut space = Space::of(len);
        let mut target = len.min(count.saturating_mul(2).saturating_add(20));
        let (found, reach, usable) = loop {
            while space.products < target {
                space.grow(&mut inverse);
            }
            let own = space.modes(system, &mut inverse, count)?;
            let reach = Reach::of(&own, inverse.shift);
            let exhausted = shift > 0 && own.iter().all(|found| found.converged);
            let found = joined(own, &known, search);
            // All modes of a system that has no more.
            let complete = space.products == len;
            let usable = found.iter().take(count).filter(|found| found.converged).count();
            let enough = usable == count
                && (shift == 0 || complete || reach.covers(&found[..count], search));
            if enough || (complete && usable == found.len()) {
                let found = found.into_iter().take(count);
                return Ok(found.map(|found| found.mode).collect());
            }
            if complete && system.dof() <= MOST_DENSE {
                return all_modes(system, search, count);
            }
            best = best.max(usable);
            if let Some(last) = found.get(count - 1)
                && inverse.suits(last.mode.mode.natural_frequency())
            {
                space = Space::of(len);
                continue;
            }
            // A space that has found next to nothing halfway is better begun again elsewhere, and so is one
            // that has found all it looks at, too far away.
            let stalled = most < len && 2 * target >= most && 4 * usable < count;
            if target == most || stalled || exhausted {
                break (found, reach, usable);
            }
            target = most.min(target + (target / 4).max(10));
        };
        let Some(next) = next_shift(&found, &reach, search, usable == count) else { break };
        // Complex factors need twice the memory: without them the search ends here.
        let Ok(moved) = Inverse::near(system, next) else { break };
        inverse = moved;
        known = found.into_iter().filter(|found| found.converged).collect();
    }
    Err(IntegrateError::ModesNotConverged { wanted: count, found: best, vectors: most })
}

/// The first `count` of all modes of a small system.
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
    Ok(modes.into_iter().map(|mode| SparseMode::of(mode, system)).collect())
}

/// A mode, and whether it has converged.
#[derive(Clone)]
struct Found {
    mode: SparseMode,
    converged: bool,
}

impl Found {
    fn value(&self) -> Complex<f64> {
        self.mode.mode.eigenvalue()
    }
}
