//! The equations of motion of spectra with the force some time later.

use mechid_model::Matrix;
use nalgebra::{Complex, DMatrix};

use super::FrequencyData;
use super::equation_error::{late_rows, late_weight, motions, real_rows};
use crate::Unknowns;
use crate::equation_of_motion::{Columns, equations_by_columns};

/// How well equations of motion fit the lines of spectra, whatever the delay of the force.
///
/// A delay turns the forces alone: the motions with unknown entries are factored once.
pub(crate) struct LateForce<'a> {
    data: &'a FrequencyData,
    unknowns: &'a Unknowns,
    /// Degrees of freedom on which a force acts.
    driven: &'a [usize],
    /// Weight of each line.
    weight: Vec<f64>,
    /// `None` where the equations are solved together, which leaves no factors to keep.
    groups: Option<Vec<Group>>,
}

/// Driven equations that have the same unknown columns.
struct Group {
    equations: Vec<usize>,
    /// Orthonormal columns that span the motions with unknown entries, and their transpose.
    q: DMatrix<f64>,
    q_transposed: DMatrix<f64>,
    /// Force that the known entries account for, rows × equations.
    known: DMatrix<f64>,
}

impl<'a> LateForce<'a> {
    /// `None` if the data leave an entry open, as they do with any delay.
    pub fn new(
        data: &'a FrequencyData,
        unknowns: &'a Unknowns,
        driven: &'a [usize],
    ) -> Option<Self> {
        let undelayed = late_rows(data, 0.0).ok()?.solve(unknowns).ok()?;
        if !undelayed.undetermined().is_empty() {
            return None;
        }
        let weight = late_weight(data);
        let groups = (!unknowns.is_related()).then(|| {
            let motions = motions(data, &weight);
            let group = |(columns, equations): (Columns, Vec<usize>)| {
                let equations: Vec<usize> =
                    equations.into_iter().filter(|equation| driven.contains(equation)).collect();
                (!equations.is_empty()).then(|| Group::new(&motions, unknowns, &columns, equations))
            };
            equations_by_columns(unknowns, &unknowns.free()).into_iter().filter_map(group).collect()
        });
        Some(Self { data, unknowns, driven, weight, groups })
    }

    /// Residual power of the driven equations, each over the power of its right-hand side, with the force
    /// `delay` (s) later. `None` if there is no solution.
    pub fn residual_power(&self, delay: f64) -> Option<f64> {
        let power = match &self.groups {
            Some(groups) => {
                let late = |row: usize| Complex::cis(-self.data.omega()[row] * delay);
                let force = real_rows(self.data.force(), |row, f| f * late(row) * self.weight[row]);
                groups.iter().map(|group| group.residual_power(&force)).sum()
            }
            None => {
                let estimate = late_rows(self.data, delay).ok()?.solve(self.unknowns).ok()?;
                let powers = self.driven.iter().map(|dof| estimate.residual_nrmse()[*dof].powi(2));
                powers.sum::<f64>()
            }
        };
        power.is_finite().then_some(power)
    }
}

impl Group {
    fn new(
        motions: &DMatrix<f64>,
        unknowns: &Unknowns,
        columns: &Columns,
        equations: Vec<usize>,
    ) -> Self {
        let dof = unknowns.dof();
        let place = |matrix: Matrix, column: usize| matrix as usize * dof + column;
        let free: Vec<usize> = columns.iter().map(|(matrix, at)| place(*matrix, *at)).collect();
        let q = motions.select_columns(&free).qr().q();
        let mut known = DMatrix::zeros(motions.nrows(), equations.len());
        for (mut sum, equation) in known.column_iter_mut().zip(&equations) {
            for (matrix, column) in
                Matrix::ALL.into_iter().flat_map(|matrix| (0..dof).map(move |at| (matrix, at)))
            {
                let value = unknowns.fixed(matrix, *equation, column).unwrap_or(0.0);
                if value != 0.0 {
                    sum.axpy(value, &motions.column(place(matrix, column)), 1.0);
                }
            }
        }
        Self { equations, q_transposed: q.transpose(), q, known }
    }

    fn residual_power(&self, force: &DMatrix<f64>) -> f64 {
        let targets = force.select_columns(&self.equations) - &self.known;
        let residuals = &targets - &self.q * (&self.q_transposed * &targets);
        let both = residuals.column_iter().zip(targets.column_iter());
        both.map(|(e, b)| if e.norm() == 0.0 { 0.0 } else { (e.norm() / b.norm()).powi(2) }).sum()
    }
}
