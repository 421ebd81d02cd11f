//! Equilibrium of the journal: Newton's method on pressure, fronts and journal together.

use std::f64::consts::FRAC_PI_3;

use nalgebra::{Matrix2x4, Vector2};

use super::film::Film;
use super::pad::Pad;
use super::step::{Step, settle};
use super::{FiniteBearing, Mesh};
use crate::error::BearingError;
use crate::limits;

/// The journal and its films during the search for the equilibrium.
pub(super) struct Search<'a> {
    bearing: &'a FiniteBearing,
    /// Load divided by 6 μ Ω R² (R/c)².
    load: f64,
    pub(super) position: Vector2<f64>,
    films: Vec<Option<Film>>,
}

impl<'a> Search<'a> {
    pub(super) fn new(bearing: &'a FiniteBearing, load: f64) -> Self {
        let (sin, cos) = FRAC_PI_3.sin_cos();
        let start = 0.3 * bearing.bore.thinnest(Vector2::zeros());
        Self { bearing, load, position: start * Vector2::new(cos, sin), films: Vec::new() }
    }

    /// Moves the journal to its equilibrium; returns the derivatives of the load there with respect
    /// to displacement and velocity.
    ///
    /// The search starts on a coarse mesh, where Newton's method converges from far away, and ends
    /// on the mesh of the bearing: the finer the mesh, the better the initial fronts must be.
    pub(super) fn equilibrium(&mut self) -> Result<Matrix2x4<f64>, BearingError> {
        let Mesh { along, across } = self.bearing.mesh;
        let [coarse, middle] = [4, 2].map(|by| Mesh { along: along / by, across: across / by });
        self.approach(coarse, limits::MESH_TOLERANCES[0])?;
        self.converge(middle, limits::MESH_TOLERANCES[1])?;
        self.converge(self.bearing.mesh, limits::MESH_TOLERANCES[2])
    }

    /// Approaches the equilibrium, with new films at every position.
    fn approach(&mut self, mesh: Mesh, tolerance: f64) -> Result<(), BearingError> {
        let mut wanted = f64::NAN;
        for _ in 0..limits::NEWTON_STEPS {
            let (mut load, mut tangent) = (Vector2::zeros(), Matrix2x4::zeros());
            self.films.clear();
            for &pad in self.bearing.bore.pads() {
                let mut film = self.initial_film(pad, mesh)?;
                if let Some(film) = &mut film {
                    let step = self.converge_fronts(film, tolerance)?;
                    load += step.load;
                    tangent += step.tangent;
                }
                self.films.push(film);
            }
            let moved;
            (moved, wanted) = self.journal_step(load, &tangent)?;
            self.position += moved;
            if wanted < tolerance * self.bearing.bore.thinnest(self.position) {
                return Ok(());
            }
        }
        Err(self.lost(wanted))
    }

    /// Converges on a mesh, starting from the films of another mesh.
    fn converge(&mut self, mesh: Mesh, tolerance: f64) -> Result<Matrix2x4<f64>, BearingError> {
        for film in self.films.iter_mut().flatten() {
            *film = film.on(self.position, self.bearing.length_over_diameter, mesh);
            settle(film, self.position)?;
        }
        let mut wanted = f64::NAN;
        for _ in 0..limits::NEWTON_STEPS {
            for (index, &pad) in self.bearing.bore.pads().iter().enumerate() {
                if pad.converging(self.position).is_none() {
                    self.films[index] = None;
                } else if self.films[index].is_none() {
                    self.films[index] = self.initial_film(pad, mesh)?;
                }
            }
            let (mut load, mut tangent) = (Vector2::zeros(), Matrix2x4::zeros());
            let mut steps = Vec::with_capacity(self.films.len());
            for film in self.films.iter().flatten() {
                let step = Step::new(film, self.position)?;
                load += step.load;
                tangent += step.tangent;
                steps.push(step);
            }
            let moved;
            (moved, wanted) = self.journal_step(load, &tangent)?;
            self.position += moved;
            let mut front: f64 = 0.0;
            for (film, step) in self.films.iter_mut().flatten().zip(&steps) {
                front = front.max(step.apply(film, moved, self.position)?);
            }
            let thinnest = self.bearing.bore.thinnest(self.position);
            if wanted < tolerance * thinnest && front < tolerance {
                return Ok(tangent);
            }
        }
        Err(self.lost(wanted))
    }

    /// Returns a film over the converging part of a pad, with its pressure.
    fn initial_film(&self, pad: Pad, mesh: Mesh) -> Result<Option<Film>, BearingError> {
        let mut film = Film::new(pad, self.position, self.bearing.length_over_diameter, mesh);
        if let Some(film) = &mut film {
            settle(film, self.position)?;
        }
        Ok(film)
    }

    /// Moves the fronts of a film to convergence with the journal fixed; returns the Newton step at
    /// the converged film.
    fn converge_fronts(&self, film: &mut Film, tolerance: f64) -> Result<Step, BearingError> {
        let mut change = f64::NAN;
        for _ in 0..limits::NEWTON_STEPS {
            let step = Step::new(film, self.position)?;
            change = step.apply(film, Vector2::zeros(), self.position)?;
            if change < tolerance {
                return Ok(step);
            }
        }
        let (iterations, position) = (limits::NEWTON_STEPS, self.position.into());
        Err(BearingError::FilmNotConverged { iterations, change, position })
    }

    /// Returns the limited step of the journal towards the equilibrium, and the length of this step
    /// before the limitation.
    fn journal_step(
        &self,
        load: Vector2<f64>,
        tangent: &Matrix2x4<f64>,
    ) -> Result<(Vector2<f64>, f64), BearingError> {
        let stiffness = tangent.fixed_view::<2, 2>(0, 0).into_owned();
        let missing = Vector2::new(self.load, 0.0) - load;
        let mut step = (stiffness.lu().solve(&missing))
            .filter(|step| step.iter().all(|value| value.is_finite()))
            .ok_or(BearingError::SingularFilm { position: self.position.into() })?;
        let wanted = step.norm();
        step *= (limits::JOURNAL_STEP / wanted).min(1.0);
        let least = limits::STEP_FILM_FRACTION * self.bearing.bore.thinnest(self.position);
        while self.bearing.bore.thinnest(self.position + step) < least {
            step *= 0.5;
        }
        Ok((step, wanted))
    }

    fn lost(&self, step: f64) -> BearingError {
        let sommerfeld = self.bearing.sommerfeld_number(self.load);
        BearingError::EquilibriumNotConverged { sommerfeld, iterations: limits::NEWTON_STEPS, step }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::finite::pad::Bore;

    fn found(bearing: &FiniteBearing, sommerfeld: f64) -> (Search<'_>, Matrix2x4<f64>) {
        let mut search = Search::new(bearing, bearing.sommerfeld_number(sommerfeld));
        let tangent = search.equilibrium().unwrap();
        (search, tangent)
    }

    fn bearings() -> [(FiniteBearing, f64); 3] {
        let groove = 20_f64.to_radians();
        let mesh = Mesh { along: 32, across: 8 };
        [
            (Bore::plain(), 0.2),
            (Bore::two_axial_grooves(groove).unwrap(), 0.235),
            (Bore::elliptical(0.5, groove).unwrap(), 0.12),
        ]
        .map(|(bore, s)| (FiniteBearing::new(bore, 1.0).unwrap().with_mesh(mesh).unwrap(), s))
    }

    /// The derivatives agree with finite differences of the load. For each difference, the films
    /// are solved again after a small displacement of the journal.
    #[test]
    fn tangents_are_the_derivatives_of_the_discrete_load() {
        for (bearing, sommerfeld) in bearings() {
            let (search, tangent) = found(&bearing, sommerfeld);
            let load = |position: Vector2<f64>| {
                let mut load = Vector2::zeros();
                for film in search.films.iter().flatten() {
                    let mut film = film.clone();
                    for _ in 0..6 {
                        let step = Step::new(&film, position).unwrap();
                        step.apply(&mut film, Vector2::zeros(), position).unwrap();
                    }
                    load += Step::new(&film, position).unwrap().load;
                }
                load
            };
            assert!((load(search.position) - Vector2::new(search.load, 0.0)).norm() < 1e-9);
            for axis in 0..2 {
                let mut step = Vector2::zeros();
                step[axis] = 1e-5;
                let slope = (load(search.position + step) - load(search.position - step)) / 2e-5;
                let error = (slope - tangent.column(axis)).norm();
                assert!(error < 1e-5 * tangent.norm(), "{bearing:?}: {slope} {tangent}");
            }
        }
    }

    /// The films satisfy the conditions of Swift and Stieber: no pressure below zero, no slope of
    /// the pressure at the free ends of the film, and each end at or outside the limits of the
    /// converging arc.
    #[test]
    fn films_meet_the_conditions_of_their_ends() {
        for (bearing, sommerfeld) in bearings() {
            let (search, _) = found(&bearing, sommerfeld);
            let mut free = 0;
            for film in search.films.iter().flatten() {
                let largest = film.pressure.max();
                assert!(film.pressure.min() > -1e-3 * largest, "{bearing:?}");
                let arc = film.pad.converging(search.position).unwrap();
                for row in 0..film.rows() {
                    let [start, end] = [0, 1].map(|side| film.fronts[side][row]);
                    assert!(start <= arc[0] + 0.01 && end >= arc[1] - 0.01, "{bearing:?}");
                    let last = film.columns.len() - 1;
                    for (side, [near, next]) in [[1, 2], [last - 1, last - 2]].iter().enumerate() {
                        if film.free[side][row] {
                            free += 1;
                            // The ratio of the pressures at the two nodes next to a front is ¼ if
                            // the pressure rises from the front without a slope (parabola), and ½
                            // if it rises linearly.
                            let ratio = film.pressure[(row, *near)] / film.pressure[(row, *next)];
                            assert!(ratio < 0.35, "{bearing:?}: {ratio}");
                        }
                    }
                }
            }
            assert!(free > 0, "{bearing:?}");
        }
    }
}
