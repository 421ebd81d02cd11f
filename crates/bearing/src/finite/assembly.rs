//! Reynolds' equation on the mesh of a film, and its derivatives.
//!
//! In dimensionless form, the film thickness is h = H c, the axial coordinate z = ζ R, the pressure
//! p = 6 μ Ω (R/c)² P, the time τ = Ω t, and the journal is at (X, Y) clearances:
//!
//! ```text
//! ∂/∂θ(H³ ∂P/∂θ) + ∂/∂ζ(H³ ∂P/∂ζ) = ∂H/∂θ + 2 ∂H/∂τ ,   H = 1 − X cos θ − Y sin θ
//! ```
//!
//! Galerkin's equations with bilinear pressure P and test functions N, ∫ H³ ∇P·∇N + (∂H/∂θ + 2
//! ∂H/∂τ) N = 0, balance the flow at an inner node. At a node on a front (the start or the end of
//! the film) the equations require that the pressure has no slope; this determines the position of
//! the front.

use nalgebra::{DMatrix, Vector2};

use super::banded::Banded;
use super::film::Film;

/// Right-hand sides: the residual, then its derivatives with respect to the displacement of the
/// journal along the load and across, and to its velocity.
pub(super) const SIDES: usize = 5;

/// The equations of a film, linear in small changes of the pressure, of the fronts (start and end
/// of the film) and of the position and velocity of the journal.
///
/// Nodes are numbered column by column; the first and the last column are on the fronts.
pub(super) struct Assembly {
    /// Derivatives with respect to the pressure.
    pub(super) matrix: Banded,
    /// Right-hand sides, node by node: derivatives with respect to the free fronts, then [`SIDES`]
    /// entries.
    pub(super) right: Vec<f64>,
    /// ∫ P (cos θ, sin θ) dθ dζ over both halves of the bearing.
    pub(super) load: Vector2<f64>,
    /// Derivative of the load with respect to the pressure, by node.
    pub(super) load_pressure: Vec<[f64; 2]>,
    /// Derivatives of the load with respect to the free fronts: two rows (along the load and
    /// across), one column for each free front.
    pub(super) load_fronts: DMatrix<f64>,
}

/// The two points of Gauss' rule on (0, 1); each has the weight ½.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Contributions of an element to the equations. Its four nodes are two of a column of the mesh,
/// then two of the next column.
///
/// Its four fronts are the start and the end of the film in its row, then in the next row.
#[derive(Default)]
struct Element {
    /// Lower triangle of the element matrix.
    matrix: [[f64; 4]; 4],
    sides: [[f64; SIDES]; 4],
    by_front: [[f64; 4]; 4],
    load: [f64; 2],
    load_pressure: [[f64; 4]; 2],
    load_front: [[f64; 4]; 2],
}

impl Assembly {
    /// Assembles the equations for the journal at `position`, and their derivatives with respect to
    /// the fronts in `unknown` (side and row).
    pub(super) fn new(film: &Film, position: Vector2<f64>, unknown: &[(usize, usize)]) -> Self {
        let (rows, columns) = (film.rows(), film.columns.len());
        let mut number = [vec![None; rows], vec![None; rows]];
        for (index, &(side, row)) in unknown.iter().enumerate() {
            number[side][row] = Some(index);
        }
        let nodes = rows * columns;
        let mut equations = Self {
            matrix: Banded::zeros(nodes, rows + 1),
            right: vec![0.0; nodes * (unknown.len() + SIDES)],
            load: Vector2::zeros(),
            load_pressure: vec![[0.0; 2]; nodes],
            load_fronts: DMatrix::zeros(2, unknown.len()),
        };
        let relative = film.pad.relative(position);
        for column in 0..columns - 1 {
            for row in 0..rows {
                let element = Element::new(film, relative, column, row);
                equations.add(&element, &number, column, row);
            }
        }
        equations
    }

    fn add(
        &mut self,
        element: &Element,
        number: &[Vec<Option<usize>>; 2],
        column: usize,
        row: usize,
    ) {
        let rows = number[0].len();
        let next = (row + 1).min(rows - 1);
        let numbers = [number[0][row], number[1][row], number[0][next], number[1][next]];
        let node = column * rows + row;
        let nodes = [node, node + 1, node + rows, node + rows + 1];
        let sides = self.load_fronts.ncols() + SIDES;
        // The last row, at the open end of the bearing, has no pressure.
        let above = row + 1 < rows;
        let inside = || (0..4).filter(move |a| above || a % 2 == 0);
        for a in inside() {
            let (by_front, right) =
                self.right[nodes[a] * sides..][..sides].split_at_mut(sides - SIDES);
            for (&number, value) in numbers.iter().zip(&element.by_front[a]) {
                if let Some(number) = number {
                    by_front[number] += value;
                }
            }
            for (sum, value) in right.iter_mut().zip(&element.sides[a]) {
                *sum += value;
            }
            for b in inside().take_while(|&b| b <= a) {
                *self.matrix.at(nodes[a], nodes[b]) += element.matrix[a][b];
            }
            for axis in 0..2 {
                self.load_pressure[nodes[a]][axis] += element.load_pressure[axis][a];
            }
        }
        for axis in 0..2 {
            self.load[axis] += element.load[axis];
            for (&number, value) in numbers.iter().zip(&element.load_front[axis]) {
                if let Some(number) = number {
                    self.load_fronts[(axis, number)] += value;
                }
            }
        }
    }
}

impl Element {
    fn new(film: &Film, relative: Vector2<f64>, column: usize, row: usize) -> Self {
        let rows = film.rows();
        // The last row has no pressure, so it has no equation for its front. It uses the front of
        // the row before.
        let next = (row + 1).min(rows - 1);
        let [start, end] = &film.fronts;
        let fronts = [start[row], end[row], start[next], end[next]];
        let height = film.axial[row + 1] - film.axial[row];
        let step = film.columns[column + 1] - film.columns[column];
        let above = |column| if row + 1 < rows { film.pressure[(row + 1, column)] } else { 0.0 };
        let pressure = [
            film.pressure[(row, column)],
            above(column),
            film.pressure[(row, column + 1)],
            above(column + 1),
        ];
        let mut element = Self::default();
        for v in GAUSS {
            for u in GAUSS {
                let t = film.columns[column] + u * step;
                element.add_point([u, v, t], [step, height], &fronts, &pressure, relative);
            }
        }
        element
    }

    /// Adds the contribution of a Gauss point at (u, v) of the element, at the fraction t of the
    /// way from the start to the end of the film.
    #[inline]
    fn add_point(
        &mut self,
        [u, v, t]: [f64; 3],
        [step, height]: [f64; 2],
        fronts: &[f64; 4],
        pressure: &[f64; 4],
        relative: Vector2<f64>,
    ) {
        const WEIGHT: f64 = 0.25;
        let shape = [(1.0 - u) * (1.0 - v), (1.0 - u) * v, u * (1.0 - v), u * v];
        let shape_u = [v - 1.0, -v, 1.0 - v, v];
        let shape_v = [u - 1.0, 1.0 - u, -u, u];
        // θ, ∂θ/∂u and ∂θ/∂v are linear in the four fronts.
        let angle_by = [(1.0 - v) * (1.0 - t), (1.0 - v) * t, v * (1.0 - t), v * t];
        let along_by = [step * (v - 1.0), step * (1.0 - v), -step * v, step * v];
        let skew_by = [t - 1.0, -t, 1.0 - t, t];
        let (sin, cos) = dot(&angle_by, fronts).sin_cos();
        let (along, skew) = (dot(&along_by, fronts), dot(&skew_by, fronts));

        let thickness = 1.0 - relative[0] * cos - relative[1] * sin;
        let slope = relative[0] * sin - relative[1] * cos;
        let curvature = 1.0 - thickness;
        let square = WEIGHT * thickness * thickness;
        let (cube, square) = (square * thickness, 3.0 * square);

        let p_u = dot(&shape_u, pressure);
        let p_v = dot(&shape_v, pressure);
        // `p_w` is ∂P/∂ζ times the area of the element in (θ, ζ).
        let p_w = p_v * along - p_u * skew;
        let area = WEIGHT * along * height;
        let [per_along, per_area] = [1.0 / along, 1.0 / (along * height)];
        let across = shape_u.map(|n_u| height * n_u * per_along);
        let n_w: [f64; 4] = std::array::from_fn(|a| shape_v[a] * along - shape_u[a] * skew);

        for a in 0..4 {
            let flow = p_u * across[a] + p_w * n_w[a] * per_area;
            let thin = square * flow;
            let load = shape[a] * area;
            self.sides[a][0] += cube * flow + slope * load;
            self.sides[a][1] += sin * load - cos * thin;
            self.sides[a][2] -= cos * load + sin * thin;
            self.sides[a][3] -= 2.0 * cos * load;
            self.sides[a][4] -= 2.0 * sin * load;
            let by_angle = thin * slope + curvature * load;
            let by_along = cube
                * (per_area * (p_v * n_w[a] + p_w * shape_v[a])
                    - per_along * (p_u * across[a] + p_w * n_w[a] * per_area))
                + slope * load * per_along;
            let by_skew = -cube * per_area * (p_u * n_w[a] + p_w * shape_u[a]);
            for k in 0..4 {
                self.by_front[a][k] +=
                    by_angle * angle_by[k] + by_along * along_by[k] + by_skew * skew_by[k];
            }
            for b in 0..=a {
                self.matrix[a][b] += cube * (shape_u[b] * across[a] + n_w[b] * n_w[a] * per_area);
            }
            self.load_pressure[0][a] += 2.0 * cos * load;
            self.load_pressure[1][a] += 2.0 * sin * load;
        }
        let here = 2.0 * area * dot(&shape, pressure);
        self.load[0] += here * cos;
        self.load[1] += here * sin;
        for k in 0..4 {
            let wider = along_by[k] * per_along;
            self.load_front[0][k] += here * (cos * wider - sin * angle_by[k]);
            self.load_front[1][k] += here * (sin * wider + cos * angle_by[k]);
        }
    }
}

fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}
