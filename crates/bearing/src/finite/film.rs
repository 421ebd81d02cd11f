//! The film on a pad: its start and end, and its pressure.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, Vector2};

use super::Mesh;
use super::pad::Pad;
use crate::limits;

/// The film on a pad, on a mesh that moves with its start and its end.
///
/// Row j of the mesh runs from the start to the end of the film at one axial coordinate; the film
/// starts and ends where its pressure falls to zero without a slope (Swift and Stieber), or at an
/// edge of the pad.
#[derive(Debug, Clone)]
pub(super) struct Film {
    pub(super) pad: Pad,
    /// Axial coordinate of the rows, in radii from the middle; the last is the open end.
    pub(super) axial: Vec<f64>,
    /// Positions of the columns, as fractions of the way from start to end.
    pub(super) columns: Vec<f64>,
    /// Start and end of the film in each row but the last, in rad.
    pub(super) fronts: [Vec<f64>; 2],
    /// True if the film starts or ends within the pad, not at its edge.
    pub(super) free: [Vec<bool>; 2],
    /// Pressure divided by 6 μ Ω (R/c)²: one row for each row of the mesh except the last, one
    /// column for each column of the mesh.
    pub(super) pressure: DMatrix<f64>,
}

impl Film {
    /// Creates the film over the converging part, without pressure; `None` if no part of the pad
    /// converges.
    pub(super) fn new(
        pad: Pad,
        position: Vector2<f64>,
        half_length: f64,
        mesh: Mesh,
    ) -> Option<Self> {
        let arc = pad.converging(position)?;
        let axial = axial_nodes(half_length, mesh.across);
        Some(Self::with_fronts(
            pad,
            position,
            axial,
            arc.map(|angle| vec![angle; mesh.across]),
            mesh,
        ))
    }

    fn with_fronts(
        pad: Pad,
        position: Vector2<f64>,
        axial: Vec<f64>,
        fronts: [Vec<f64>; 2],
        mesh: Mesh,
    ) -> Self {
        let free = [0, 1].map(|side| {
            fronts[side].iter().map(|&angle| angle != pad.edges[side]).collect::<Vec<_>>()
        });
        let columns =
            column_nodes(pad.relative(position), [fronts[0][0], fronts[1][0]], mesh.along);
        let pressure = DMatrix::zeros(mesh.across, mesh.along + 1);
        Self { pad, axial, columns, fronts, free, pressure }
    }

    /// Number of rows with pressure.
    pub(super) fn rows(&self) -> usize {
        self.pressure.nrows()
    }

    /// Returns the film with the same fronts on another mesh, without pressure.
    pub(super) fn on(&self, position: Vector2<f64>, half_length: f64, mesh: Mesh) -> Self {
        let axial = axial_nodes(half_length, mesh.across);
        let last = self.rows() - 1;
        let fronts = [0, 1].map(|side| {
            let known = &self.fronts[side];
            let at = |&z: &f64| {
                let below = self.axial[1..last].iter().take_while(|&&node| node <= z).count();
                let part = (z - self.axial[below]) / (self.axial[below + 1] - self.axial[below]);
                let front = known[below] + part * (known[below + 1] - known[below]);
                front.clamp(self.pad.edges[0], self.pad.edges[1])
            };
            axial[..mesh.across].iter().map(at).collect::<Vec<_>>()
        });
        Self::with_fronts(self.pad, position, axial, fronts, mesh)
    }
}

/// Returns the axial coordinates of the rows of the mesh, from the middle of the bearing to its
/// end. In a long bearing the rows are denser near the end, where the pressure falls to zero within
/// a length of about one radius.
fn axial_nodes(half_length: f64, rows: usize) -> Vec<f64> {
    let grading = half_length / (half_length + 2.0);
    (0..=rows)
        .map(|row| {
            let part = row as f64 / rows as f64;
            half_length * part * (1.0 + grading * (1.0 - part))
        })
        .collect()
}

/// Returns the positions of the columns of the mesh, as fractions of the distance between two
/// fronts. The columns are equidistant in the angle of Sommerfeld's substitution and therefore
/// dense where the film is thin.
fn column_nodes(relative: Vector2<f64>, fronts: [f64; 2], along: usize) -> Vec<f64> {
    let thinnest = relative[1].atan2(relative[0]);
    let eccentricity = relative.norm().min(limits::GRADED_ECCENTRICITY);
    let root = ((1.0 + eccentricity) / (1.0 - eccentricity)).sqrt();
    // Sommerfeld's substitution is tan(γ/2) = `root` · tan(θ/2); whole turns of 2π are kept.
    let turned = |angle: f64, root: f64| {
        let turns = (angle / TAU).round();
        let half = (angle - turns * TAU) / 2.0;
        2.0 * (root * half.sin()).atan2(half.cos()) + turns * TAU
    };
    let [first, last] = fronts.map(|angle| turned(angle - thinnest, root));
    (0..=along)
        .map(|column| {
            let even = first + (last - first) * column as f64 / along as f64;
            let angle = thinnest + turned(even, 1.0 / root);
            match column {
                0 => 0.0,
                _ if column == along => 1.0,
                _ => (angle - fronts[0]) / (fronts[1] - fronts[0]),
            }
        })
        .collect()
}
