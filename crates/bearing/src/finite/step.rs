//! One step of Newton's method on a film, and the change of its load.

use nalgebra::{DMatrix, Matrix2x4, SMatrix, Vector2};

use super::assembly::{Assembly, SIDES};
use super::film::Film;
use crate::error::BearingError;
use crate::limits;

/// Linearisation of a film: its load, and the derivatives of the pressure and of the film
/// boundaries (fronts) with respect to displacement and velocity of the journal.
pub(super) struct Step {
    /// Load of the film after the Newton step, to first order.
    pub(super) load: Vector2<f64>,
    /// Derivatives of the load with respect to displacement and velocity, along the static load
    /// and across.
    pub(super) tangent: Matrix2x4<f64>,
    /// Changes of the pressure, one entry per node.
    pressure: Vec<[f64; SIDES]>,
    /// Changes of the fronts: one row for each free front, [`SIDES`] columns.
    fronts: DMatrix<f64>,
    unknown: Vec<(usize, usize)>,
    /// Flow out of the film at its start and its end, by row.
    outflow: [Vec<f64>; 2],
}

impl Step {
    /// Returns the step from the present film, with the journal at `position`.
    ///
    /// # Errors
    /// [`BearingError::SingularFilm`] if the equations cannot be solved.
    pub(super) fn new(film: &Film, position: Vector2<f64>) -> Result<Self, BearingError> {
        let free = |side: usize| {
            let rows = film.free[side].iter().enumerate();
            rows.filter(|(_, free)| **free).map(move |(row, _)| (side, row))
        };
        let unknown = free(0).chain(free(1)).collect();
        Self::with_unknown(film, position, unknown)
            .ok_or(BearingError::SingularFilm { position: position.into() })
    }

    fn with_unknown(
        film: &Film,
        position: Vector2<f64>,
        unknown: Vec<(usize, usize)>,
    ) -> Option<Self> {
        let Assembly { mut matrix, mut right, load, load_pressure, load_fronts } =
            Assembly::new(film, position, &unknown);
        let (rows, nodes) = (film.rows(), load_pressure.len());
        let (free, sides) = (unknown.len(), unknown.len() + SIDES);
        // The pressure at the fronts is known to be zero, so that the equations of these nodes
        // determine the positions of the fronts.
        let inner = rows..nodes - rows;
        matrix.solve(inner.clone(), &mut right, sides)?;

        let reduced = DMatrix::from_fn(free, sides, |equation, column| {
            let (side, row) = unknown[equation];
            let node = if side == 0 { row } else { inner.end + row };
            let near =
                inner.start.max(node.saturating_sub(rows + 1))..inner.end.min(node + rows + 2);
            let by_pressure =
                near.map(|other| matrix.get(node, other) * right[other * sides + column]);
            right[node * sides + column] - by_pressure.sum::<f64>()
        });
        if !reduced.iter().all(|value| value.is_finite()) {
            return None;
        }
        let fronts = match free {
            0 => DMatrix::zeros(0, SIDES),
            _ => {
                -reduced.columns(0, free).into_owned().lu().solve(&reduced.columns(free, SIDES))?
            }
        };
        let mut change: SMatrix<f64, 2, SIDES> = SMatrix::zeros();
        change.gemm(1.0, &load_fronts, &fronts, 0.0);
        let mut pressure = vec![[0.0; SIDES]; nodes];
        for node in inner.clone() {
            let solved = &right[node * sides..][..sides];
            for side in 0..SIDES {
                let by_front = (0..free).map(|front| solved[front] * fronts[(front, side)]);
                let value = -solved[free + side] - by_front.sum::<f64>();
                pressure[node][side] = value;
                change[(0, side)] += load_pressure[node][0] * value;
                change[(1, side)] += load_pressure[node][1] * value;
            }
        }
        let outflow = [0, inner.end]
            .map(|first| (first..first + rows).map(|node| right[node * sides + free]).collect());
        let load = load + change.fixed_view::<2, 1>(0, 0);
        let tangent = change.fixed_view::<2, 4>(0, 1).into_owned();
        let finite = tangent.iter().chain(&load).all(|value| value.is_finite());
        finite.then_some(Self { load, tangent, pressure, fronts, unknown, outflow })
    }

    /// Changes the film such that it satisfies its linearised equations after the journal has moved
    /// by `moved` to `position`; returns the largest change of a front (rad).
    ///
    /// # Errors
    /// [`BearingError::SingularFilm`] as for [`Step::new`].
    pub(super) fn apply(
        &self,
        film: &mut Film,
        moved: Vector2<f64>,
        position: Vector2<f64>,
    ) -> Result<f64, BearingError> {
        let Some(arc) = film.pad.converging(position) else { return Ok(0.0) };
        let by = |steps: [f64; 3]| steps[0] + steps[1] * moved[0] + steps[2] * moved[1];
        let mut largest: f64 = 0.0;
        // The film ends before the edge of the pad if its pressure would otherwise fall below zero.
        for (side, converging) in arc.iter().enumerate() {
            let edge = film.pad.edges[side];
            for (free, outflow) in film.free[side].iter_mut().zip(&self.outflow[side]) {
                if !*free && *outflow > 0.0 && *converging != edge {
                    *free = true;
                    largest = limits::FRONT_STEP;
                }
            }
        }
        let slack = (1.0 - limits::FILM_FRACTION) / 2.0 * (arc[1] - arc[0]);
        for (index, &(side, row)) in self.unknown.iter().enumerate() {
            let change = by([0, 1, 2].map(|side| self.fronts[(index, side)]));
            largest = largest.max(change.abs().min(limits::FRONT_STEP));
            let front = &mut film.fronts[side][row];
            *front += change.clamp(-limits::FRONT_STEP, limits::FRONT_STEP);
            let edge = film.pad.edges[side];
            let beyond = match side {
                0 => {
                    *front = front.min(arc[0] + slack);
                    *front <= edge
                }
                _ => {
                    *front = front.max(arc[1] - slack);
                    *front >= edge
                }
            };
            if beyond {
                *front = edge;
                film.free[side][row] = false;
            }
        }
        if largest > limits::PRESSURE_UPDATE {
            settle(film, position)?;
        } else {
            for (pressure, steps) in film.pressure.iter_mut().zip(&self.pressure) {
                *pressure += by([steps[0], steps[1], steps[2]]);
            }
        }
        Ok(largest)
    }
}

/// Computes the pressure of a film for its present fronts.
///
/// # Errors
/// [`BearingError::SingularFilm`] if the equations cannot be solved.
pub(super) fn settle(film: &mut Film, position: Vector2<f64>) -> Result<(), BearingError> {
    film.pressure.fill(0.0);
    let step = Step::with_unknown(film, position, Vec::new())
        .ok_or(BearingError::SingularFilm { position: position.into() })?;
    for (pressure, steps) in film.pressure.iter_mut().zip(&step.pressure) {
        *pressure = steps[0];
    }
    Ok(())
}
