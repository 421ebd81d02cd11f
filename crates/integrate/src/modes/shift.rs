//! Shifts at which the search for modes begins again: near those that have not converged, and how far about
//! one all have.

use nalgebra::Complex;

use super::{Found, ModeSearch};

/// Part of an eigenvalue by which a shift misses the one it was moved to: the matrix is not to be singular.
const OFFSET: f64 = 1e-6;

/// Difference of two converged eigenvalues, relative to their modulus, that makes one of those found from two
/// shifts.
const SAME: f64 = 3e-8;

/// Largest residual of a mode that a shift is moved to: others need not be near any.
const ROUGH: f64 = 1e-2;

impl ModeSearch {
    /// What the search puts eigenvalues in order by.
    pub(super) fn distance(self, value: Complex<f64>) -> f64 {
        match self {
            Self::Lowest => value.norm(),
            Self::NearOmega(omega) => (value - Complex::new(0.0, omega)).norm(),
        }
    }
}

/// How far about a shift all modes have converged.
pub(super) struct Reach {
    shift: Complex<f64>,
    /// Distance from the shift (rad/s).
    radius: f64,
}

impl Reach {
    pub(super) fn of(found: &[Found], shift: Complex<f64>) -> Self {
        let mut distances: Vec<(f64, bool)> =
            found.iter().map(|f| ((f.value() - shift).norm(), f.converged)).collect();
        distances.sort_by(|a, b| a.0.total_cmp(&b.0));
        let converged = distances.iter().take_while(|(_, converged)| *converged);
        Self { shift, radius: converged.last().map_or(0.0, |(distance, _)| *distance) }
    }

    /// The first of the modes within it: those beyond were found from another shift.
    fn first(&self, modes: &[Found]) -> Option<Complex<f64>> {
        let within = |value: &Complex<f64>| (value - self.shift).norm() <= self.radius;
        modes.iter().map(Found::value).find(within)
    }

    /// Returns whether the first of the modes in the order of the search can be told from the edge of what
    /// has converged, beyond which others may come before them.
    pub(super) fn covers(&self, modes: &[Found], search: ModeSearch) -> bool {
        let (Some(first), Some(last)) = (self.first(modes), modes.last()) else { return true };
        let last = last.value();
        let gap = (first - self.shift).norm();
        match search {
            ModeSearch::Lowest => {
                search.distance(first) >= search.distance(self.shift) || gap <= 0.5 * self.radius
            }
            // On the other side of the first there may be as many as on that of the last.
            ModeSearch::NearOmega(_) => {
                gap + (last - first).norm() <= self.radius * (1.0 + SAME) + gap * SAME
            }
        }
    }
}

/// The modes found from this shift and, of those known from others, which it has not found again, in the order
/// of the search.
pub(super) fn joined(own: Vec<Found>, known: &[Found], search: ModeSearch) -> Vec<Found> {
    let same = |one: &Found, other: &Found| {
        let gap = (one.value() - other.value()).norm();
        gap <= SAME * other.value().norm() || (one.mode.is_rigid_body && other.mode.is_rigid_body)
    };
    let again = |other: &&Found| own.iter().any(|one| one.converged && same(one, other));
    let others: Vec<Found> = known.iter().filter(|other| !again(other)).cloned().collect();
    let mut found = own;
    found.extend(others);
    found.sort_by(|a, b| search.distance(a.value()).total_cmp(&search.distance(b.value())));
    found
}

/// The next shift after one from which the modes wanted have not all converged, or `all_converged` do not
/// reach far enough.
pub(super) fn next_shift(
    found: &[Found],
    reach: &Reach,
    search: ModeSearch,
    all_converged: bool,
) -> Option<Complex<f64>> {
    if !all_converged {
        let open = || found.iter().filter(|found| !found.converged && !found.mode.is_rigid_body);
        let rough = open().find(|found| found.mode.residual <= ROUGH);
        return rough.or_else(|| open().next()).map(|found| found.value() * (1.0 - OFFSET));
    }
    let first = reach.first(found)?;
    match search {
        // The floor may lie well beyond it.
        ModeSearch::Lowest => Some(first + (first - reach.shift) * 3.0),
        ModeSearch::NearOmega(_) => Some(first * (1.0 - OFFSET)),
    }
}
