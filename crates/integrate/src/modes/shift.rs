//! Shifts at which the search for modes begins again, and the radius within which all modes have
//! converged.

use nalgebra::Complex;

use crate::limits;
use crate::modes::{Candidate, ModeSearch};

impl ModeSearch {
    /// Returns the distance of an eigenvalue from the target of the search; modes are sorted by it.
    pub(super) fn distance(self, value: Complex<f64>) -> f64 {
        match self {
            Self::Lowest => value.norm(),
            Self::NearOmega(omega) => (value - Complex::new(0.0, omega)).norm(),
        }
    }
}

/// Radius about a shift within which all modes have converged.
pub(super) struct Reach {
    shift: Complex<f64>,
    /// Distance from the shift (rad/s).
    radius: f64,
}

impl Reach {
    pub(super) fn new(modes: &[Candidate], shift: Complex<f64>) -> Self {
        let mut distances: Vec<(f64, bool)> =
            modes.iter().map(|f| ((f.value() - shift).norm(), f.converged)).collect();
        distances.sort_by(|a, b| a.0.total_cmp(&b.0));
        let converged = distances.iter().take_while(|(_, converged)| *converged);
        Self { shift, radius: converged.last().map_or(0.0, |(distance, _)| *distance) }
    }

    /// Returns the eigenvalue of the first mode within the radius; `modes` also contains modes that
    /// were found from other shifts.
    fn first(&self, modes: &[Candidate]) -> Option<Complex<f64>> {
        let within = |value: &Complex<f64>| (value - self.shift).norm() <= self.radius;
        modes.iter().map(Candidate::value).find(within)
    }

    /// Returns whether the first mode in the order of the search is well inside the radius. If it
    /// is not, an unknown mode outside the radius may precede this first mode.
    pub(super) fn covers(&self, modes: &[Candidate], search: ModeSearch) -> bool {
        let (Some(first), Some(last)) = (self.first(modes), modes.last()) else { return true };
        let last = last.value();
        let gap = (first - self.shift).norm();
        match search {
            ModeSearch::Lowest => {
                search.distance(first) >= search.distance(self.shift) || gap <= 0.5 * self.radius
            }
            // An unknown mode may lie on the other side of the first mode, at the distance of the
            // last mode from the first. The radius must include this distance.
            ModeSearch::NearOmega(_) => {
                gap + (last - first).norm()
                    <= self.radius * (1.0 + limits::SAME_EIGENVALUE) + gap * limits::SAME_EIGENVALUE
            }
        }
    }
}

/// Returns the modes found from this shift and those known from other shifts, without duplicates,
/// in the order of the search.
pub(super) fn merge(
    new: Vec<Candidate>,
    known: &[Candidate],
    search: ModeSearch,
) -> Vec<Candidate> {
    let same = |one: &Candidate, other: &Candidate| {
        let gap = (one.value() - other.value()).norm();
        gap <= limits::SAME_EIGENVALUE * other.value().norm()
            || (one.mode.is_rigid_body && other.mode.is_rigid_body)
    };
    let again = |other: &&Candidate| new.iter().any(|one| one.converged && same(one, other));
    let unknown_here: Vec<Candidate> =
        known.iter().filter(|other| !again(other)).cloned().collect();
    let mut modes = new;
    modes.extend(unknown_here);
    modes.sort_by(|a, b| search.distance(a.value()).total_cmp(&search.distance(b.value())));
    modes
}

/// Returns the next shift. If not all wanted modes have converged, the shift is near a mode that
/// has not converged. If all have converged (`all_converged`) but the radius is too small, the
/// shift follows from the first mode.
pub(super) fn next_shift(
    found: &[Candidate],
    reach: &Reach,
    search: ModeSearch,
    all_converged: bool,
) -> Option<Complex<f64>> {
    if !all_converged {
        let open = || found.iter().filter(|found| !found.converged && !found.mode.is_rigid_body);
        let rough = open().find(|found| found.mode.residual <= limits::SHIFT_RESIDUAL);
        return rough
            .or_else(|| open().next())
            .map(|found| found.value() * (1.0 - limits::SHIFT_OFFSET));
    }
    let first = reach.first(found)?;
    match search {
        // Modes may exist far below the first mode found, so the shift moves far below this mode.
        ModeSearch::Lowest => Some(first + (first - reach.shift) * 3.0),
        ModeSearch::NearOmega(_) => Some(first * (1.0 - limits::SHIFT_OFFSET)),
    }
}
